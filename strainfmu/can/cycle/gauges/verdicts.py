"""The verdict on each gauge of a cycle: used, or why not, in words made on demand from the judgement's arrays.

The judgement hands over references, so that the deadline path pays nothing for what only a display reads.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from strainfmu.arrays import BoolArray

NO_FRAME = "no frame"
NOT_TRUSTED = "frame not trusted"
NO_VALUE = "no value or out of signal range"
OUT_OF_RANGE = "beyond sensor range"
JUMPS = "jumps"
FROZEN = "frozen"
ZERO = "exactly zero"
HEALING = "healing: good again, not long enough"
NOT_FINITE = "not a finite number"


class GaugeVerdicts(NamedTuple):
    """What a cycle's judgement found of its n_d gauges; all arrays (n_d,).

    Attributes
    ----------
    present : gauges whose frame has arrived.
    trusted : gauges whose frame is trusted end to end.
    refused : gauges that report no value, or are outside their signal's limits.
    plausible : gauges that passed the checks of their values.
    faults : gauges that failed a check, by the check's words; the first that holds is named.
    cycle : why the whole cycle is not used, "" if it is.
    """

    present: BoolArray
    trusted: BoolArray
    refused: BoolArray
    plausible: BoolArray
    faults: Mapping[str, BoolArray]
    cycle: str = ""


def gauge_reasons(verdicts: GaugeVerdicts | None, valid: BoolArray) -> list[str]:
    """Return why each gauge is not used, in words; "" for those in ``valid`` (n_d,).

    ``verdicts`` is None where all are used, and for a result without a cycle: no frame has come.
    """
    if verdicts is None:
        return ["" if used else NO_FRAME for used in valid.tolist()]
    return ["" if used else _reason(verdicts, gauge) for gauge, used in enumerate(valid.tolist())]


def _reason(verdicts: GaugeVerdicts, gauge: int) -> str:
    """Return the first reason against one gauge that no result uses."""
    if not verdicts.present[gauge]:
        return NO_FRAME
    if verdicts.cycle:
        return verdicts.cycle
    if not verdicts.trusted[gauge]:
        return NOT_TRUSTED
    if verdicts.refused[gauge]:
        return NO_VALUE
    for words, failed in verdicts.faults.items():
        if failed[gauge]:
            return words
    return HEALING if not verdicts.plausible[gauge] else NOT_FINITE
