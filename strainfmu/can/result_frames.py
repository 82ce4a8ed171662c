"""The composition of result and status frames from results and the state of the bridge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan, nan
from operator import itemgetter

from strainfmu.can.encoder import frame_of
from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import FrameLayout
from strainfmu.can.machine import Result
from strainfmu.can.profiles import E2E_COUNTER, E2E_CRC
from strainfmu.can.quality import BusState, FrameAccount, FrameClass, Quality, low_causes
from strainfmu.can.result_layouts import DETAIL, LAST_NAMES, SIGMA_NAMES, OtherLoadSignals
from strainfmu.can.signals import SignalPlan
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

_NOTHING = [nan] * 5
_HEADER, _NO_HEADER = (E2E_CRC, E2E_COUNTER), (0, 0)
"""Signals that are written when all others are, and their values until then: whole numbers are encoded fastest."""
_LARGEST_UNCERTAINTY = 6553.4
"""Largest uncertainty of an age in a frame [ms]; it stands for all above."""
_LARGEST_SCORE = 25.4
"""Largest envelope score of a classic frame; it stands for all above."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BridgeStatus:
    """Contents of the status frames, which are sent every STATUS_PERIOD.

    Attributes
    ----------
    last, last_valid : the last result, and the last of quality VALID or UNPROTECTED; or None.
    account : of all frames so far.
    cycles : number of results so far.
    """

    time: float
    bus_state: BusState
    last: Result | None
    last_valid: Result | None
    account: FrameAccount
    cycles: int
    send_failures: int
    reconnects: int


class ResultFrames:
    """Composes result and status frames, each with its own counter.

    Parameters
    ----------
    layouts : of :func:`result_layouts`.
    configuration : number of the gauge assignment, as in the input's frames; 0 for none.
    first : counter of the first result.
    """

    def __init__(self, layouts: tuple[FrameLayout, ...], configuration: int, first: int = 0) -> None:
        self._configuration = configuration
        frames, self._others = composition(layouts)
        self._of_result, self._of_status, self._details = (
            [_ResultFrame(layout, places, 0 if kind else first) for layout, of, places in frames if of == kind]
            for kind in range(3)
        )

    def of_result(self, result: Result) -> list[Frame]:
        """Return the frames of one result; frames of a result with further causes hold their details too."""
        values = _result_values(result, self._configuration)
        if self._others:
            outputs = result.other_outputs if result.quality.has_coefficients else {}
            values = (*values, *self._others.values(outputs).values())
        frames = [frame.compose(values) for frame in self._of_result]
        if int(result.causes) >> 16:
            frames += [frame.compose(_detail_values(result)) for frame in self._details]
        return frames

    def of_status(self, status: BridgeStatus) -> list[Frame]:
        """Return the frames of the bridge's status, and the details of the last result."""
        values = _status_values(status, self._configuration)
        details = _detail_values(status.last)
        frames = [frame.compose(values) for frame in self._of_status]
        return frames + [frame.compose(details) for frame in self._details]


def composition(
    layouts: tuple[FrameLayout, ...],
) -> tuple[list[tuple[FrameLayout, int, list[int]]], OtherLoadSignals]:
    """Return how each frame is composed, and the loads behind the five in them.

    A kind, 0 of a result, 1 of the status and 2 of details, and the place of each signal's value among the values
    of that kind, as ``fmus/native/ecu/ecu.c`` lists them.
    """
    others = OtherLoadSignals(layouts)
    names = ((*_RESULT_NAMES, *others.names), _STATUS_NAMES, _DETAIL_NAMES)
    found = []
    for layout in layouts:
        kind = 0 if layout.cycle_time is not None else 2 if layout.name == DETAIL else 1
        found.append((layout, kind, [names[kind].index(signal.name) for signal in layout.signals]))
    return found, others


class _ResultFrame:
    """One frame, with its counter, and the places of its signals' values."""

    def __init__(self, layout: FrameLayout, places: Sequence[int], first: int) -> None:
        assert layout.protection is not None
        self._plan, self._pick = SignalPlan(layout), itemgetter(*places)
        self._counter, self._modulus = first, layout.protection.counter_modulus
        self._frame = frame_of(layout, b"")

    def compose(self, values: Sequence[float]) -> Frame:
        """Return the next frame with its signals among ``values``."""
        counter = self._counter
        self._counter = (counter + 1) % self._modulus
        return self._frame.with_data(self._plan.protected(self._pick(values), counter))


_RESULT_NAMES = (
    *_HEADER,
    *COEFFICIENT_NAMES,
    *SIGMA_NAMES,
    *("Quality", "Health", "Usable", "SampleTime", "ChiSquare", "Age", "Causes", "GaugesUsed", "AnsweredCounter"),
    *("Configuration", "UsedPressure", "EnvelopeScore8"),
)


def _result_values(result: Result, configuration: int) -> tuple[float, ...]:
    """Return the values of _RESULT_NAMES, NaN where a result has none."""
    quality, health, score = result.quality, result.health, result.envelope_score
    published = quality.has_coefficients
    coefficients = result.coefficients.tolist() if published else _NOTHING
    deviations = result.coefficients_std.tolist() if published else _NOTHING
    return (
        *_NO_HEADER,
        *coefficients,
        *deviations,
        int(quality),
        nan if health is None else health,
        int(result.usable),
        nan if result.sample_time is None else result.sample_time,
        result.chi_square,
        1e3 * result.age,
        low_causes(result.causes),
        min(result.valid.tobytes().count(1), 255),
        result.counter or 0,
        configuration,
        result.dynamic_pressure,
        nan if isnan(score) else min(score, _LARGEST_SCORE),
    )


_DETAIL_NAMES = (*_HEADER, "Quality", "AllCauses", "Usable", "AgeUncertainty", "AnsweredCounter")


def _detail_values(last: Result | None) -> tuple[float, ...]:
    """Return the values of _DETAIL_NAMES."""
    if last is None:
        return *_NO_HEADER, int(Quality.NO_DATA), 0, 0, nan, 0
    uncertainty = 1e3 * last.age_uncertainty
    stated = nan if isnan(uncertainty) else min(uncertainty, _LARGEST_UNCERTAINTY)
    return *_NO_HEADER, int(last.quality), int(last.causes), int(last.usable), stated, last.counter or 0


_COUNTS = ("Received", "Used", "Rejected", "Cycles", "Overrun")
_STATUS_NAMES = (
    *_HEADER,
    *LAST_NAMES,
    *_COUNTS,
    *(f"{name}16" for name in _COUNTS),
    *("LastAge", "LastAge16", "Quality", "BusState", "SendFailures", "Reconnects", "Drift", "EnvelopeScore"),
    "Configuration",
)


def _status_values(status: BridgeStatus, configuration: int) -> tuple[float, ...]:
    """Return the values of _STATUS_NAMES."""
    last, account = status.last_valid, status.account
    age = nan if last is None else 1e3 * (status.time - last.time + last.age)
    classes = account.classes
    counts = (
        account.received,
        classes[FrameClass.USED],
        account.rejected,
        status.cycles,
        classes[FrameClass.OVERRUN],
    )
    return (
        *_NO_HEADER,
        *(_NOTHING if last is None else last.coefficients.tolist()),
        # Counts wrap: every layout takes as many of the low bits as its signal has.
        *[count % 2**32 for count in counts],
        *[count % 2**16 for count in counts],
        min(age, 2**32 - 2.0) if not isnan(age) else nan,
        min(age, 655_340.0) if not isnan(age) else nan,
        int(Quality.NO_DATA if status.last is None else status.last.quality),
        int(status.bus_state),
        status.send_failures % 2**16,
        min(status.reconnects, 255),
        nan,  # the drift, which earlier versions have measured
        nan if status.last is None else status.last.envelope_score,
        configuration,
    )
