"""Which modes are states of a map of Case 1, which are not, and why: as numbers, and in words."""

from collections.abc import Mapping, Sequence
from typing import Any

MIN_STRAIN_OVER_NOISE, MIN_STRAIN_OVER_ERRORS = 10.0, 3.0
"""Strain of a mode over the gauges' noise, and over all errors together, from which it is a free state [1].

Without hardware errors a limit of 3 costs a factor 1.65 in sigma of C_A, one of 1 a factor 2.5. With them, modes
between the two limits carry more error than knowledge.
"""

MOST_NAMED, FAINT = 12, 1e-3
"""Modes that are no states and are named, at most, and the fraction of the variance from which those behind the
last state are; the others are counted."""


def choice_record(wanted: int, states: Sequence[int], left_out: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the choice for a map's provenance.

    Parameters
    ----------
    wanted : number of states that the vehicle file requests.
    states : modes that are states, by falling energy, from 1.
    left_out : the modes that were tried and are no states, likewise: ``mode``, ``fraction_of_variance`` of the
        snapshots' pressure, weighted with area [1], ``strain_over_noise`` and ``strain_over_errors`` [1], see
        :func:`builder.inverse.solution.mode_choice`.
    """
    named = [mode for mode in left_out if mode["mode"] < states[-1] or mode["fraction_of_variance"] >= FAINT]
    return {
        "wanted": wanted,
        "kept": list(states),
        "left_out": named[:MOST_NAMED],
        "further_left_out": len(left_out) - len(named[:MOST_NAMED]),
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
    states, wanted, further = choice["kept"], choice["wanted"], choice["further_left_out"]
    of_wanted = f" of the {wanted} modes that map.modes requests" if len(states) < wanted else ""
    needed = " and ".join(f"{choice['needed'][name]:g} times {what}" for name, what in MEASURES)
    return [
        f"{len(states)}{of_wanted or ' modes'} are states of the linear map: {_listed(states)}; a state needs "
        f"strain that those before it do not explain, {needed}; the modes left out count as noise",
        *(_left_out(mode) for mode in choice["left_out"]),
        *((f"left out: {further} weaker mode{'s' if further > 1 else ''}",) if further else ()),
    ]


MEASURES = (("strain_over_noise", "the gauges' noise"), ("strain_over_errors", "all errors together"))


def _left_out(mode: Mapping[str, Any]) -> str:
    strain = ", ".join(f"{mode[name]:.2g} times {what}" for name, what in MEASURES)
    percent = f"{100.0 * mode['fraction_of_variance']:.2g} % of the variance"
    return f"left out: mode {mode['mode']}, {percent}, strain {strain}"


def _listed(numbers: Sequence[int]) -> str:
    """Return numbers as a list in words."""
    words = [str(number) for number in numbers]
    return " and ".join(part for part in (", ".join(words[:-1]), words[-1]) if part)
