"""The arrays of a map, made from the schema of its records: directive ``map-arrays``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

from generated_text import GeneratedText
from sphinx.application import Sphinx

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.schema import Entry, entries


def records_of(record: Any, group: str = "") -> dict[str, type[Any]]:
    """Return the types of records inside a type of records, by the path of their group; equal ones once."""
    inside = dict[str, type[Any]]()
    for item in fields(record):
        kind = item.metadata.get("record")
        if kind is not None and kind not in inside.values():
            inside[group + item.name] = kind
            inside |= records_of(kind, f"{group}{item.name}/")
    return inside


def _rows(name: str, one: Entry) -> Iterator[str]:
    shape = one.shape.replace(" ", " x ").replace("+", " + ")
    meaning = one.meaning.replace("|", "\\|")
    yield f"| `{name}` | {shape} | {one.unit} | {meaning} | {f'`{one.place}`' if one.place else ''} |"


def array_table(record: type) -> str:
    """Return the arrays of a type of records, in MyST Markdown."""
    lines = ["| data set | shape | unit | | in `map.bin` |", "|---|---|---|---|---|"]
    for name, one in entries(record).items():
        lines += _rows(name, one)
    return "\n".join(lines)


class MapArrays(GeneratedText):
    """The tables of all records of a map, each under the name of its group."""

    source = "strainfmu.estimator"

    def text(self) -> str:
        """Return the tables."""
        parts = [array_table(InverseMap)]
        for group, record in records_of(InverseMap).items():
            parts += [f"**Group `{group}`**", array_table(record)]
        return "\n\n".join(parts)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("map-arrays", MapArrays)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
