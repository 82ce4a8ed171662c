"""Which modes are states of a map of Case 1, which are not, and why: as numbers, and in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

MIN_STRAIN_OVER_NOISE, MIN_STRAIN_OVER_ERRORS = 10.0, 3.0
"""Strain of a mode over the gauges' noise, and over all errors together, from which it is a free state [1].

Without hardware errors a limit of 3 costs a factor 1.65 in sigma of C_A, one of 1 a factor 2.5. With them, modes
between the two limits carry more error than knowledge.
"""

MOST_NAMED, FAINT = 12, 1e-3
"""Modes that are no states and are named, at most, and the fraction of the variance from which those behind the
last state are; the others are counted."""


@dataclass(frozen=True, kw_only=True)
class LeftOutMode:
    """A mode that is no state.

    Attributes
    ----------
    mode : its index by falling energy, from 0.
    fraction : of the variance of the snapshots' pressure, weighted with area [1].
    over_noise, over_errors : its strain at one standard deviation, without the part that the states before it
        explain, over the gauges' own noise, and over all errors together [1]. A state needs both limits.
    """

    mode: int
    fraction: float
    over_noise: float
    over_errors: float


@dataclass(frozen=True, kw_only=True)
class ModeChoice:
    """The choice of states among the POD modes.

    Attributes
    ----------
    wanted : number of states that the vehicle file requests.
    kept : indices of the modes that are states, by falling energy, from 0.
    left_out : the modes that were tried and are no states, by falling energy.
    """

    wanted: int
    kept: tuple[int, ...]
    left_out: tuple[LeftOutMode, ...]

    @property
    def skipped(self) -> tuple[int, ...]:
        """The modes ahead of the last state that are no states."""
        return tuple(one.mode for one in self.left_out if one.mode < self.kept[-1])

    def record(self) -> dict[str, Any]:
        """Return the choice for a map's provenance, modes counted from 1."""
        named = [one for one in self.left_out if one.mode < self.kept[-1] or one.fraction >= FAINT][:MOST_NAMED]
        return {
            "wanted": self.wanted,
            "kept": [mode + 1 for mode in self.kept],
            "left_out": [
                {
                    "mode": one.mode + 1,
                    "fraction_of_variance": one.fraction,
                    "strain_over_noise": one.over_noise,
                    "strain_over_errors": one.over_errors,
                }
                for one in named
            ],
            "further_left_out": len(self.left_out) - len(named),
            "needed": {"strain_over_noise": MIN_STRAIN_OVER_NOISE, "strain_over_errors": MIN_STRAIN_OVER_ERRORS},
        }


def mode_choice_lines(provenance: Mapping[str, Any]) -> list[str]:
    """Return, a sentence each, how many modes of a map are states, and which modes are not and why.

    ``provenance`` comes from the map. The list is empty where every mode that was tried is a state, and for maps
    of Case 2, whose states all modes of the prior are.
    """
    choice = provenance.get("mode_choice")
    if not choice or not (choice["left_out"] or choice["further_left_out"]):
        return []
    kept, wanted, further = choice["kept"], choice["wanted"], choice["further_left_out"]
    of = f" of the {wanted} modes that map.modes requests" if len(kept) < wanted else ""
    needed = " and ".join(f"{choice['needed'][name]:g} times {what}" for name, what in MEASURES)
    return [
        f"{len(kept)}{of or ' modes'} are states of the linear map: {_listed(kept)}; a state needs strain that "
        f"those before it do not explain, {needed}; the modes left out count as noise",
        *(_left_out(one) for one in choice["left_out"]),
        *((f"left out: {further} weaker mode{'s' if further > 1 else ''}",) if further else ()),
    ]


MEASURES = (("strain_over_noise", "the gauges' noise"), ("strain_over_errors", "all errors together"))


def _left_out(one: Mapping[str, Any]) -> str:
    found = ", ".join(f"{one[name]:.2g} times {what}" for name, what in MEASURES)
    percent = f"{100.0 * one['fraction_of_variance']:.2g} % of the variance"
    return f"left out: mode {one['mode']}, {percent}, strain {found}"


def _listed(numbers: Sequence[int]) -> str:
    """Return numbers as a list in words."""
    words = [str(number) for number in numbers]
    return " and ".join(part for part in (", ".join(words[:-1]), words[-1]) if part)
