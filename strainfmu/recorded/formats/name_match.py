"""Names compared without regard to case and blanks, and the names that come nearest."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from strainfmu.errors import InputError

_GROUPS = re.compile(r"[/\\.]")


def plain_name(name: str) -> str:
    """Return a name in small letters without blanks."""
    return "".join(name.split()).casefold()


def matched(path: Path, what: str, name: str, names: Sequence[str]) -> str | None:
    """Return the one of ``names`` that is ``name``, None if none is.

    The same text comes first, then the same but for case and blanks, then that behind the name of a group and a
    slash or dot.

    Raises
    ------
    InputError
        Several names fit equally well.
    """
    small = plain_name(name)
    for candidates in (
        [one for one in names if one == name],
        [one for one in names if plain_name(one) == small],
        [one for one in names if small in _without_groups(one)],
    ):
        if len(candidates) > 1:
            shown = " and ".join(f"'{one}'" for one in candidates[:3])
            raise InputError(f"{path}: {what} '{name}': expected one of that name, got {len(candidates)}: {shown}")
        if candidates:
            return candidates[0]
    return None


def _without_groups(name: str) -> set[str]:
    """Return the plain ends of a name, one without each of its groups."""
    return {plain_name(name[match.end() :]) for match in _GROUPS.finditer(name)}


def suggestion(name: str, names: Sequence[str]) -> str:
    """Return what to say of the nearest of ``names``: '; did you mean ..', or some of them."""
    by_small = {plain_name(one): one for one in reversed(names)}
    found = get_close_matches(plain_name(name), by_small, n=1, cutoff=0.6)
    if found:
        return f"did you mean '{by_small[found[0]]}'"
    return f"there are {', '.join(names[:6]) or 'none'}{' ..' if len(names) > 6 else ''}"
