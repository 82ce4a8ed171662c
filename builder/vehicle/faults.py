"""Faults of a vehicle file, in one line each: which entry, what was found, what is allowed."""

from __future__ import annotations

import difflib
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

_UNITS = {
    "m",
    "mm",
    "cm",
    "km",
    "in",
    "ft",
    "deg",
    "rad",
    "Pa",
    "kPa",
    "MPa",
    "GPa",
    "psi",
    "bar",
    "s",
    "m2",
    "um",
}


def first_fault(error: ValidationError, model: type[BaseModel]) -> str:
    """Return the first fault of a file in one line, and how many more there are; ``model`` is the file's."""
    # A misspelt key also leaves its right name missing: the unknown one is more useful.
    faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    fault = faults[0]
    where = ".".join(
        str(part + 1) if isinstance(part, int) else part for part in fault["loc"] if part not in ("cone", "arc")
    )
    if fault["type"] == "extra_forbidden":
        text = f"{where}: unknown entry{_hint(fault['loc'], model)}"
    elif fault["type"] == "missing":
        text = f"{where}: entry is missing"
    elif fault["type"] == "value_error":
        text = f"{where}: {fault['ctx']['error']}" if where else str(fault["ctx"]["error"])
    elif fault["type"] == "union_tag_not_found":
        text = f"{where}.kind: entry is missing, must be 'cone' or 'arc'"
    elif fault["type"] == "union_tag_invalid":
        text = f"{where}.kind: {fault['ctx']['tag']!r} found, must be 'cone' or 'arc'"
    elif fault["type"] in ("too_short", "string_too_short"):
        text = f"{where}: {fault['input']!r} found, must hold at least {fault['ctx']['min_length']}"
    else:
        what = fault["msg"].removeprefix("Input should be ")
        text = f"{where}: {fault['input']!r} found, must be {what}"
    more = len(faults) - 1
    return text + (f" (and {more} more)" if more else "")


def _hint(location: tuple[int | str, ...], model: type[BaseModel]) -> str:
    """Return what was probably meant by an unknown key: the same quantity in the unit that is allowed."""
    key = str(location[-1])
    allowed = _keys_beside(location, model)
    stem = _without_unit(key)
    for candidate in allowed:
        if _without_unit(candidate) == stem and candidate != key:
            return f" (wrong unit?), allowed is {candidate}"
    close = difflib.get_close_matches(key, allowed, n=1)
    return f", did you mean {close[0]}?" if close else f"; allowed: {', '.join(allowed)}"


def _without_unit(key: str) -> str:
    stem, _, unit = key.rpartition("_")
    return stem if stem and unit in _UNITS else key


def _keys_beside(location: tuple[int | str, ...], model: type[BaseModel]) -> list[str]:
    """Return the keys allowed in the section that ``location`` points into."""
    here = [model]
    for part in location[:-1]:
        if isinstance(part, int):
            continue
        inside = [one.model_fields[part].annotation for one in here if part in one.model_fields]
        if inside:
            here = [one for annotation in inside for one in _models_in(annotation)]
            continue
        # Otherwise it is a name of the user's, or the kind that distinguishes the members of a union.
        tagged = [one for one in here if "kind" in one.model_fields]
        here = [one for one in tagged if part in get_args(one.model_fields["kind"].annotation)] or here
    return [key for one in here for key in one.model_fields]


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the sections that a field may hold, through lists, dictionaries and unions."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [one for part in get_args(annotation) for one in _models_in(part)]
