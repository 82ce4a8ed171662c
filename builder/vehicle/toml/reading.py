"""A TOML file of sections: read, checked by pydantic, every fault in one line of its own.

Checks of a vehicle's parts know entries, not files: :func:`naming` adds the file to the line of what they refuse.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from builder.vehicle.toml.entry_faults import all_faults
from builder.vehicle.toml.toml_sections import Section
from strainfmu.errors import FaultsError, InputError
from strainfmu.text_files import read_toml

_FILES = (".toml", ".h5", ".csv", ".json", ".stl", ".tri", ".triq", ".obj", ".vtk", ".vtp", ".vtu", ".msh")
"""Suffixes by which a file that is missing is known as one."""


@contextmanager
def naming(vehicle: Path) -> Iterator[None]:
    """Put ``vehicle`` before every line that is refused and names neither a file nor an option.

    Raises
    ------
    InputError
        As refused inside, with the file; :class:`FaultsError` where that was one.
    """
    try:
        yield
    except InputError as error:
        lines = named(error.lines, vehicle)
        if lines == error.lines:
            raise
        kind = FaultsError if isinstance(error, FaultsError) else InputError
        raise kind("\n".join(lines)) from error


def named(lines: list[str], vehicle: Path) -> list[str]:
    """Return ``lines`` with ``vehicle`` before those that name neither a file nor an option."""
    return [line if _has_name(line) else f"{vehicle}: {line}" for line in lines]


def _has_name(line: str) -> bool:
    head = line.partition(": ")[0]
    return head.startswith("--") or Path(head).suffix.lower() in _FILES or Path(head).exists()


_MOST_FAULTS = 40
"""Lines of faults that are shown."""
SECTIONS_NAMED = 6

AnySection = TypeVar("AnySection", bound=Section)


def read_sections(
    path: Path,
    model: type[AnySection],
    kind: str,
    other_faults: Callable[[AnySection], list[str]] = lambda _: [],
    changes: Mapping[str, Any] | None = None,
) -> AnySection:
    """Read and check a file.

    Parameters
    ----------
    model : of the whole file.
    kind : what the file is, for messages, such as ``"vehicle file"``.
    other_faults : returns faults of sizes that follow from entries that are right on their own.
    changes : values of entries by their names, as in messages, instead of the file's.

    Raises
    ------
    FaultsError
        Entries are unknown, missing or outside their limits: one line each.
    InputError
        The file is missing or no TOML, or most of its entries are not of ``model``.
    """
    entries = read_toml(path)
    for name, value in (changes or {}).items():
        _set_entry(entries, name, value)
    known = len(entries.keys() & model.model_fields.keys())
    if known < len(entries) - known:  # a file named by mistake: a list of its entries helps nobody
        sections = ", ".join(list(model.model_fields)[:SECTIONS_NAMED])
        raise InputError(
            f"{path}: not a {kind}: expected entries such as {sections}, got {len(entries) - known} others"
        )
    try:
        content = model.model_validate(entries)
        faults = other_faults(content)
    except ValidationError as error:
        faults = all_faults(error, model)
    if faults:
        raise FaultsError("\n".join(f"{path}: {line}" for line in _limited(faults)))
    return content


def _set_entry(entries: dict[str, Any], name: str, value: Any) -> None:
    """Set the entry ``name``, such as ``map.modes`` or ``profile.1.end_x_m``; a section that is missing is added.

    Raises
    ------
    InputError
        A part of the name is no section, or no number of a list.
    """
    *parents, last = name.split(".")
    place: Any = entries
    for part in parents:
        if isinstance(place, list):
            place = place[_item(name, part, place)]
        elif isinstance(place, dict):
            place = place.setdefault(part, {})
    if isinstance(place, list):
        place[_item(name, last, place)] = value
    elif isinstance(place, dict):
        place[last] = value
    else:
        raise InputError(f"{name}: expected an entry of a section, got a part of another entry")


def _item(name: str, part: str, items: list[Any]) -> int:
    if not part.isdigit() or not 1 <= int(part) <= len(items):
        raise InputError(f"{name}: expected a number from 1 to {len(items)} for '{part}'")
    return int(part) - 1


def _limited(faults: list[str]) -> list[str]:
    """Return ``faults``, or the first of them and how many more there are."""
    more = len(faults) - _MOST_FAULTS
    return faults if more <= 0 else [*faults[:_MOST_FAULTS], f"{more} more entries are wrong"]
