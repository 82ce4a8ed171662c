"""The channel that each gauge most likely has, by the words and numbers of the names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import SequenceMatcher
from functools import lru_cache

MIN_SIMILARITY = 0.6
"""Similarity below which two names are no match."""

_WORDS_OR_NUMBERS = re.compile(r"[^\W\d_]+|[0-9]+")


def similarity(one: str, other: str) -> float:
    """Return how similar two names are, from 0 to 1.

    Numbers count as numbers, from the last to the first, and as much as all letters: 'axial_180deg_2' is more like
    'AX-180-2' than like 'axial_180deg_3'.

    >>> similarity("axial_180deg_2", "AX-180-2") > similarity("axial_180deg_2", "axial_180deg_3")
    True
    """
    words, numbers = _parts(one)
    other_words, other_numbers = _parts(other)
    alike = _ratio(words, other_words)
    if not numbers and not other_numbers:
        return alike
    pairs = zip(reversed(numbers), reversed(other_numbers), strict=False)
    equal = sum(first == second for first, second in pairs) / max(len(numbers), len(other_numbers))
    return 0.5 * alike + 0.5 * equal


@lru_cache(maxsize=4096)  # gauges of one kind have the same words
def _ratio(one: str, other: str) -> float:
    return SequenceMatcher(None, one, other, autojunk=False).ratio()


def _parts(name: str) -> tuple[str, list[int]]:
    """Return the letters of a name in one text, and its numbers."""
    found = _WORDS_OR_NUMBERS.findall(name.casefold())
    return "".join(one for one in found if not one.isdecimal()), [int(one) for one in found if one.isdecimal()]


def likely_pairs(wanted: Sequence[str], channels: Sequence[str]) -> dict[str, str]:
    """Return the most similar of ``channels`` for each name of ``wanted``, the most similar pairs first.

    A channel belongs to one name at most. Names without a channel of :data:`MIN_SIMILARITY` are left out, and so
    are names that fit two channels equally well.
    """
    scores = {name: {one: similarity(name, one) for one in channels} for name in wanted}
    ranked = sorted(
        (
            (score, name, one)
            for name, row in scores.items()
            for one, score in row.items()
            if score >= MIN_SIMILARITY
        ),
        key=lambda item: -item[0],
    )
    found: dict[str, str] = {}
    for score, name, one in ranked:
        taken = found.values()
        if name in found or one in taken:
            continue
        if sum(other == score and free not in taken for free, other in scores[name].items()) == 1:
            found[name] = one
    return found
