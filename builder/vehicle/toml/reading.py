"""A TOML file of sections: read, checked by pydantic, every fault in one line of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from builder.vehicle.toml.faults import all_faults
from builder.vehicle.toml.sections import Section
from strainfmu.errors import FaultsError, InputError
from strainfmu.text_files import read_toml

_MOST_FAULTS = 40
"""Lines of faults that are shown."""
SECTIONS_NAMED = 6

AnySection = TypeVar("AnySection", bound=Section)


def read_sections(
    path: Path,
    model: type[AnySection],
    kind: str,
    other_faults: Callable[[AnySection], list[str]] = lambda _: [],
) -> AnySection:
    """Read and check a file.

    Parameters
    ----------
    model : of the whole file.
    kind : what the file is, for messages, such as ``"vehicle file"``.
    other_faults : returns faults of sizes that follow from entries that are right on their own.

    Raises
    ------
    FaultsError
        Entries are unknown, missing or outside their limits: one line each.
    InputError
        The file is missing or no TOML, or most of its entries are not of ``model``.
    """
    entries = read_toml(path)
    known = len(entries.keys() & model.model_fields.keys())
    if known < len(entries) - known:  # a file named by mistake: a list of its entries helps nobody
        sections = ", ".join(list(model.model_fields)[:SECTIONS_NAMED])
        raise InputError(
            f"{path}: not a {kind}: expected entries such as {sections}, got {len(entries) - known} others"
        )
    try:
        found = model.model_validate(entries)
        faults = other_faults(found)
    except ValidationError as error:
        faults = all_faults(error, model)
    if faults:
        raise FaultsError("\n".join(f"{path}: {line}" for line in _limited(faults)))
    return found


def _limited(faults: list[str]) -> list[str]:
    """Return ``faults``, or the first of them and how many more there are."""
    more = len(faults) - _MOST_FAULTS
    return faults if more <= 0 else [*faults[:_MOST_FAULTS], f"{more} more entries are wrong"]
