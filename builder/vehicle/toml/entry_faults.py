"""Faults of a vehicle file, in one line each: which entry, what is allowed, what was found."""

import difflib
from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

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
    "N",
    "kN",
    "K",
}

_KINDS = {
    "bool": "true or false",
    "dict": "a section",
    "float": "a number",
    "int": "a whole number",
    "list": "a list",
    "tuple": "a list",
    "model": "a section",
    "string": "text",
}
"""What a value must be, by the first word of pydantic's type of the fault."""

_SHOWN = 60
"""Characters shown of a value that was found."""


class Faults(ValueError):
    """Several faults that one check found."""

    def __init__(self, faults: list[str]) -> None:
        super().__init__("; ".join(faults))
        self.faults = faults


def all_faults(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """Return every fault of a file, one line each, unknown entries first; ``model`` is the file's."""
    # A misspelt key also leaves its right name missing: the unknown one is more useful, and enough.
    faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    meant = {
        (*fault["loc"][:-1], _meant(fault["loc"], model)) for fault in faults if fault["type"] == "extra_forbidden"
    }
    lines = [
        line
        for fault in faults
        if not (fault["type"] == "missing" and fault["loc"] in meant)
        for line in _lines(fault, model)
    ]
    return list(dict.fromkeys(lines))


def _lines(fault: ErrorDetails, model: type[BaseModel]) -> Iterator[str]:
    """Yield the lines of one fault; a check over several entries may find several."""
    location, tags = fault["loc"], _tags(model)
    where = ".".join(
        str(part + 1) if isinstance(part, int) else part
        for part, before in zip(location, (None, *location), strict=False)
        if not _is_member(part) and not (part in tags and isinstance(before, int))
    )
    if fault["type"] == "value_error":
        error = fault["ctx"]["error"]
        for message in error.faults if isinstance(error, Faults) else [str(error)]:
            text = " ".join(message.split())
            yield f"{where}: {text}" if where else text
        return
    if fault["type"] == "extra_forbidden":
        yield f"{where}: unknown entry{_hint(fault['loc'], model)}"
    elif fault["type"] == "missing":
        yield f"{where}: entry is missing"
    elif fault["type"] == "union_tag_not_found":
        yield f"{where}.kind: entry is missing, expected {_kinds_at(location, model)}"
    elif fault["type"] == "union_tag_invalid":
        yield f"{where}.kind: expected {_kinds_at(location, model)}, got {fault['ctx']['tag']!r}"
    else:
        yield f"{where}: expected {_expected(fault, model)}, got {_shown(fault['input'])}"


@cache
def _tags(model: type[BaseModel]) -> frozenset[str]:
    """Return the kinds that distinguish the members of unions, of all sections of a file."""
    kinds = get_args(model.model_fields["kind"].annotation) if "kind" in model.model_fields else ()
    below = [_tags(submodel) for field in model.model_fields.values() for submodel in _models_in(field.annotation)]
    return frozenset(kinds).union(*below)


def _kinds_at(location: tuple[int | str, ...], model: type[BaseModel]) -> str:
    """Return the kinds of section allowed at ``location``."""
    kinds = [repr(tag) for submodel in _models_at((*location, "kind"), model) for tag in _tags(submodel)]
    return " or ".join(part for part in (", ".join(kinds[:-1]), kinds[-1]) if part)


def _is_member(part: int | str) -> bool:
    """Return whether a part of a location names the member of a union, as pydantic adds it, and no entry."""
    return isinstance(part, str) and (part in ("float", "int", "str") or "[" in part)


def _expected(fault: ErrorDetails, model: type[BaseModel]) -> str:
    """Return what is allowed: the range where there is one, else the kind of value."""
    kind, context = fault["type"], fault.get("ctx", {})
    if kind in ("too_short", "string_too_short"):
        return f"at least {context['min_length']} {'value' if context['min_length'] == 1 else 'values'}"
    if kind in ("too_long", "string_too_long"):
        return f"at most {context['max_length']} values"
    word, _, what = kind.partition("_")
    limits = _range_at(fault["loc"], model)
    if what in ("type", "parsing", "from_float") and word in _KINDS:
        return _KINDS[word] + (f", {limits}" if limits else "")
    if kind in ("finite_number", "greater_than", "greater_than_equal", "less_than", "less_than_equal"):
        return limits or fault["msg"].removeprefix("Input should be ")
    return fault["msg"].removeprefix("Input should be ")


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]} .."


def _range_at(location: tuple[int | str, ...], model: type[BaseModel]) -> str:
    """Return the range allowed for the number that ``location`` points at, "" where it has none."""
    keys = [part for part in location if not isinstance(part, int) and not _is_member(part)]
    low = high = ""
    least = "at least"
    for submodel in _models_at(location, model):
        field = submodel.model_fields.get(str(keys[-1]))
        for limit in _constraints(field) if field is not None else ():
            if isinstance(limit, Ge | Gt):
                low = f"{limit.ge if isinstance(limit, Ge) else limit.gt:g}"
                least = "at least" if isinstance(limit, Ge) else "above"
            if isinstance(limit, Le | Lt):
                high = f"{limit.le if isinstance(limit, Le) else limit.lt:g}"
    if low and high:
        return f"{low} .. {high}" if least == "at least" else f"{least} {low}, at most {high}"
    return f"{least} {low}" if low else f"at most {high}" if high else ""


def _constraints(field: FieldInfo) -> Iterator[Any]:
    """Yield the constraints of a field and of what its lists and unions hold."""
    yield from field.metadata
    yield from _inside(field.annotation)


def _inside(annotation: Any) -> Iterator[Any]:
    parts = get_args(annotation)
    if get_origin(annotation) is Annotated:
        for part in parts[1:]:
            yield from part.metadata if isinstance(part, FieldInfo) else [part]
    for part in parts:
        yield from _inside(part)


def _hint(location: tuple[int | str, ...], model: type[BaseModel]) -> str:
    """Return what was probably meant by an unknown key: the same quantity in the unit that is allowed."""
    key, candidate = str(location[-1]), _meant(location, model)
    if candidate is None:
        return f"; allowed: {', '.join(_keys_beside(location, model))}"
    if _without_unit(candidate) == _without_unit(key):
        return f" (wrong unit?), allowed is {candidate}"
    return f", did you mean {candidate}?"


def _meant(location: tuple[int | str, ...], model: type[BaseModel]) -> str | None:
    """Return the entry that was probably meant by an unknown key."""
    key = str(location[-1])
    allowed = _keys_beside(location, model)
    stem = _without_unit(key)
    alike = [candidate for candidate in allowed if _without_unit(candidate) == stem and candidate != key]
    return next(iter(alike or difflib.get_close_matches(key, allowed, n=1)), None)


def _without_unit(key: str) -> str:
    stem, _, unit = key.rpartition("_")
    return stem if stem and unit in _UNITS else key


def _keys_beside(location: tuple[int | str, ...], model: type[BaseModel]) -> list[str]:
    """Return the keys allowed in the section that ``location`` points into."""
    return [key for submodel in _models_at(location, model) for key in submodel.model_fields]


def _models_at(location: tuple[int | str, ...], model: type[BaseModel]) -> list[type[BaseModel]]:
    """Return the sections, one or several members of a union, that ``location`` points into."""
    models = [model]
    for part in location[:-1]:
        if isinstance(part, int):
            continue
        inside = [submodel.model_fields[part].annotation for submodel in models if part in submodel.model_fields]
        if inside:
            models = [submodel for annotation in inside for submodel in _models_in(annotation)] or models
            continue
        # Otherwise it is a name of the user's, or the kind that distinguishes the members of a union.
        tagged = [submodel for submodel in models if "kind" in submodel.model_fields]
        models = [
            submodel for submodel in tagged if part in get_args(submodel.model_fields["kind"].annotation)
        ] or models
    return models


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the sections that a field may hold, through lists, dictionaries and unions."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [submodel for part in get_args(annotation) for submodel in _models_in(part)]
