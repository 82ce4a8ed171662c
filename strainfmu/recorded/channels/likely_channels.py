"""The channel that each gauge most likely has, by the words and numbers of the names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import SequenceMatcher
from functools import lru_cache
from itertools import product

MIN_SIMILARITY = 0.6
"""Similarity below which two names are no match."""

MIN_LIKENESS, ABBREVIATED = 0.5, 0.8
"""Likeness of words below which names are not similar, whatever their numbers; of a word and its abbreviation."""

_WORDS_OR_NUMBERS = re.compile(r"[^\W\d_]+|[0-9]+")


def similarity(one: str, other: str) -> float:
    """Return how similar two names are, from 0 to 1; 0 for names whose words have nothing in common.

    Numbers count as numbers, from the last to the first, and as much as all letters: 'axial_180deg_2' is more like
    'AX-180-2' than like 'axial_180deg_3'. Equal numbers alone make no two names similar.

    >>> similarity("axial_180deg_2", "AX-180-2") > similarity("axial_180deg_2", "axial_180deg_3")
    True
    >>> similarity("axial_0deg_1", "AI0/ch1")
    0.0
    """
    words, numbers = _parts(one)
    other_words, other_numbers = _parts(other)
    alike = _likeness(words, other_words)
    if alike < MIN_LIKENESS:
        return 0.0
    if not numbers and not other_numbers:
        return alike
    pairs = zip(reversed(numbers), reversed(other_numbers), strict=False)
    equal = sum(first == second for first, second in pairs) / max(len(numbers), len(other_numbers))
    return 0.5 * alike + 0.5 * equal


@lru_cache(maxsize=4096)  # gauges of one kind have the same words
def _likeness(words: tuple[str, ...], others: tuple[str, ...]) -> float:
    """Return how similar the words of two names are, from 0 to 1; an abbreviation counts much."""
    alike = SequenceMatcher(None, "".join(words), "".join(others), autojunk=False).ratio()
    pairs = [sorted(pair, key=len) for pair in product(words, others)]
    is_short = any(len(short) > 1 and long.startswith(short) for short, long in pairs)
    return max(alike, ABBREVIATED) if is_short else alike


def _parts(name: str) -> tuple[tuple[str, ...], list[int]]:
    """Return the words and the numbers of a name."""
    found = _WORDS_OR_NUMBERS.findall(name.casefold())
    return tuple(one for one in found if not one.isdecimal()), [int(one) for one in found if one.isdecimal()]


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
