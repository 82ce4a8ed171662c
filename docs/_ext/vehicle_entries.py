"""The reference of files in TOML, made from the models that check them: directives ``vehicle-entries``,
``load-test-entries`` and, of the kinds of error of a vehicle as built, ``as-built-kinds``, and ``map-errors``."""

from __future__ import annotations

import inspect
import re
import types
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from generated_text import GeneratedText
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from sphinx.application import Sphinx

from builder.calibration.ground_test.load_test_file import LoadTestFile
from builder.inverse.noise.error_list import ERRORS
from builder.structure.as_built_kinds import AS_BUILT, IN_FLIGHT
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import ENGINE_NAMES, NeededBy
from strainfmu.linear.regularisation import RULES

UNITS = {
    "um_per_m_per_K": "um/m/K",
    "percent_per_100K": "%/(100 K)",
    "degC": "deg C",
    "N_per_m3": "N/m3",
    "m_per_s2": "m/s2",
    "rad_per_s2": "rad/s2",
    "kg_m2": "kg m2",
    "N_m": "N m",
    "kg_per_m3": "kg/m3",
    "um_per_m": "um/m",
    "N_per_m": "N/m",
    "percent": "%",
    "GPa": "GPa",
    "Pa": "Pa",
    "deg": "deg",
    "kg": "kg",
    "N": "N",
    "mm": "mm",
    "km": "km",
    "m2": "m2",
    "m": "m",
    "s": "s",
    "K": "K",
}
"""Units by the end of an entry's name; the file says so of itself."""

NAMED = {
    "engine": ENGINE_NAMES,
    "gamma": RULES,
}
"""Values that a check of the code allows, where the type is text."""

KINDS = {float: "number", int: "whole number", str: "text", bool: "true or false"}


def entries_page(model: type[BaseModel] = Vehicle) -> str:
    """Return every section of a file with its entries, in MyST Markdown."""
    blocks: list[str] = []
    _section(model, "", blocks)
    return "\n".join(blocks)


def _section(model: type[BaseModel], path: str, blocks: list[str], kind: str = "") -> None:
    """Append the table of ``model``, then those of the sections in it."""
    blocks += [f"## `{path}`{kind}" if path else "## Top level", "", _doc(model), ""]
    rows, below = [], []
    for name, field in model.model_fields.items():
        sections, listed, named = _sections(field.annotation)
        if not sections:
            rows.append(_row(name, field))
            continue
        kind = "sections by name" if named else "list of sections" if listed else "section"
        rows.append(f"| `{name}` | {kind} | | {_default(field)} | below |")
        where = ".".join([part for part in (path, name) if part]) + (".NAME" if named else "")
        below += [(section, where, section.__name__) for section in sections]
    blocks += ["| entry | type | unit | default | allowed |", "|---|---|---|---|---|", *rows, ""]
    for section, where, name in below:
        several = sum(other[1] == where for other in below) > 1
        _section(section, where, blocks, f" of kind {name.lower()}" if several else "")


def _sections(annotation: Any) -> tuple[list[type[BaseModel]], bool, bool]:
    """Return the models inside an annotation, whether they stand in a list, and whether by name."""
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        return [annotation], False, False
    found: list[type[BaseModel]] = []
    listed, named = get_origin(annotation) is list, get_origin(annotation) is dict
    for inner in get_args(annotation):
        models, inner_listed, inner_named = _sections(inner)
        found, listed, named = [*found, *models], listed or inner_listed, named or inner_named
    return found, listed, named


def _row(name: str, field: FieldInfo) -> str:
    return f"| `{name}` | {_kind(field.annotation)} | {_unit(name)} | {_default(field)} | {_limits(field, name)} |"


def _unit(name: str) -> str:
    return next(
        (unit for end, unit in UNITS.items() if name.endswith(f"_{end}") or name.startswith(f"{end}_")), ""
    )


def _kind(annotation: Any) -> str:
    origin, inner = get_origin(annotation), [a for a in get_args(annotation) if a is not types.NoneType]
    if origin is Literal:
        return " or ".join(f"`{value!r}`".replace("'", '"') for value in inner)
    if origin is Annotated:
        return _kind(inner[0])
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(map(_kind, inner)))
    if origin is list:
        return f"list of: {_kind(inner[0])}"
    if origin is tuple:
        return f"list of: {_kind(inner[0])}" if Ellipsis in inner else f"list of {len(inner)}: {_kind(inner[0])}"
    return KINDS.get(annotation, str(annotation))


def _default(field: FieldInfo) -> str:
    needed = [one.what for one in field.metadata if isinstance(one, NeededBy)]
    if field.is_required() or needed:
        return f"required with {needed[0]}" if needed else "required"
    default = field.get_default(call_default_factory=True)
    if default is None or default in ({}, []) or isinstance(default, BaseModel):
        return ""
    if isinstance(default, bool):
        return f"`{str(default).lower()}`"
    return f"`{default!r}`".replace("'", '"')


def _limits(field: FieldInfo, name: str) -> str:
    limits = [*_bounds(field.metadata), *_length(field.metadata), *_inner_limits(field.annotation, False)]
    limits += [f"`{value}`" for value in NAMED.get(name, ())]
    return ", ".join(dict.fromkeys(limits))


def _inner_limits(annotation: Any, in_list: bool) -> list[str]:
    """Return the limits that stand inside an annotation, those of a list's elements with "each"."""
    inner = get_args(annotation)
    if get_origin(annotation) is Annotated:
        held = [m for item in inner[1:] for m in (item.metadata if isinstance(item, FieldInfo) else [item])]
        bounds = _bounds(held)
        return [f"each {bounds[0]}", *bounds[1:]] if bounds and in_list else bounds
    in_list = in_list or get_origin(annotation) is list
    return [limit for a in inner for limit in _inner_limits(a, in_list)]


def _bounds(metadata: list[Any]) -> list[str]:
    words = ((Gt, "gt", "above"), (Ge, "ge", "at least"), (Lt, "lt", "below"), (Le, "le", "at most"))
    return [f"{word} {getattr(m, key):g}" for m in metadata for kind, key, word in words if isinstance(m, kind)]


def _length(metadata: list[Any]) -> list[str]:
    texts = []
    for limit in metadata:
        if isinstance(limit, MinLen) and limit.min_length > 0:
            texts.append("not empty" if limit.min_length == 1 else f"at least {limit.min_length} values")
        if isinstance(limit, MaxLen):
            texts.append(f"at most {limit.max_length} values")
    return texts


def _doc(model: type[BaseModel]) -> str:
    return re.sub(r"``([^`]*)``", r"`\1`", " ".join((inspect.getdoc(model) or "").split()))


class VehicleEntries(GeneratedText):
    """Every entry of the vehicle file."""

    source = "builder.vehicle.file"

    def text(self) -> str:
        """Return the page."""
        return entries_page()


class LoadTestEntries(GeneratedText):
    """Every entry of the file of a ground test."""

    source = "builder.calibration.ground_test.load_test_file"

    def text(self) -> str:
        """Return the page."""
        return entries_page(LoadTestFile)


class AsBuiltKinds(GeneratedText):
    """Every kind of error of a vehicle as built, with its entries in the vehicle file."""

    source = "builder.structure.as_built_kinds"

    def text(self) -> str:
        """Return the table."""
        rows = [
            f"| {kind.in_words} | {kind.acts_on} | {OF[kind.extent]} | {kind.unit} | "
            + " | ".join(_entry(kind.entry if name in kind.sections else "") for name in ("calibration", "noise"))
            + " |"
            for kind in (*AS_BUILT, *IN_FLIGHT)
        ]
        head = "| kind | acts on | of | unit | `[calibration]` | `[noise]` |"
        return "\n".join([head, "|---|---|---|---|---|---|", *rows])


class MapErrors(GeneratedText):
    """Every error that a map includes, with its role."""

    source = "builder.inverse.noise.error_list"

    def text(self) -> str:
        """Return the table."""
        rows = [
            f"| {error.name} | {error.acts_on} | {error.role} | {_entry(error.entry)} | {error.unit} |"
            for error in ERRORS.values()
        ]
        return "\n".join(["| error | where | role | entry | unit |", "|---|---|---|---|---|", *rows])


OF = {
    "gauge": "each gauge",
    "vehicle": "the vehicle",
    "region": "each region of the wall",
    "row": "each row of gauges",
    "joint": "each joint",
}


def _entry(name: str) -> str:
    return f"`{name}`" if name else ""


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("vehicle-entries", VehicleEntries)
    app.add_directive("load-test-entries", LoadTestEntries)
    app.add_directive("as-built-kinds", AsBuiltKinds)
    app.add_directive("map-errors", MapErrors)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
