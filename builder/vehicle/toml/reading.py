"""A TOML file of sections: read, checked by pydantic, every fault in one line of its own."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from builder.vehicle.toml.faults import all_faults
from builder.vehicle.toml.sections import Section
from strainfmu.errors import FaultsError, InputError

_MOST_FAULTS = 40
"""Lines of faults that are shown."""

AnySection = TypeVar("AnySection", bound=Section)


def read_sections(
    path: Path, model: type[AnySection], further_faults: Callable[[AnySection], list[str]] = lambda _: []
) -> AnySection:
    """Read and check a file.

    Parameters
    ----------
    model : of the whole file.
    further_faults : returns faults of sizes that follow from entries that are right on their own.

    Raises
    ------
    FaultsError
        Entries are unknown, missing or outside their limits: one line each.
    InputError
        The file is missing or no TOML.
    """
    try:
        entries = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:  # of TOML, of UTF-8, of a number with thousands of digits
        raise InputError(f"{path}: not a TOML file: {error}") from error
    try:
        found = model.model_validate(entries)
        faults = further_faults(found)
    except ValidationError as error:
        faults = all_faults(error, model)
    if faults:
        raise FaultsError("\n".join(f"{path}: {line}" for line in _limited(faults)))
    return found


def _limited(faults: list[str]) -> list[str]:
    """Return ``faults``, or the first of them and how many more there are."""
    more = len(faults) - _MOST_FAULTS
    return faults if more <= 0 else [*faults[:_MOST_FAULTS], f"{more} more entries are wrong"]
