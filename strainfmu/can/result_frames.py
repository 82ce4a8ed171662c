"""The frames of the results: their signals in each form, and what results and the bridge's state put into them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from math import ceil, isfinite, isnan, nan
from operator import itemgetter

from strainfmu.can.encoder import frame_of
from strainfmu.can.frame import FD_LENGTHS, Frame, Protection
from strainfmu.can.frame_layout import FLOAT, LITTLE, SIGNED, FrameLayout, SignalLayout
from strainfmu.can.machine import Result
from strainfmu.can.profiles import (
    BRIDGE,
    E2E_COUNTER,
    E2E_CRC,
    Identifiers,
    placed_signal,
    shared_signal,
    stated_file,
)
from strainfmu.can.quality import BusState, FrameAccount, FrameClass, Quality, low_causes
from strainfmu.can.signals import SignalPlan
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.other_loads import FAMILIES, SIGMA, LoadFamily, LoadGroup, LoadKind

_RESULT_DATA_ID = 0x5380
STATUS_PERIOD = 0.1
"""Period of the status frames [s]."""
DETAIL = "EstimateDetail"
"""Frame that is sent with the status and with every result that has causes above bit 15."""
SIGMA_NAMES = tuple(f"sigma_{name}" for name in COEFFICIENT_NAMES)
LAST_NAMES = tuple(f"last_{name}" for name in COEFFICIENT_NAMES)
_ENUMERATIONS = {"quality": Quality, "health": HealthState, "bus": BusState}

_NAN = "NaN: not available"
_LARGEST_WHOLE = 65534.0
"""Largest standard deviation of a classic frame, in steps."""


# --- layouts -----------------------------------------------------------------------------------------------------


def result_layouts(
    form: str, identifiers: Identifiers, cycle_time: float, groups: Sequence[LoadGroup] = ()
) -> tuple[FrameLayout, ...]:
    """Return the frames that the bridge sends.

    Parameters
    ----------
    form : "fd" or "classic-le".
    cycle_time : nominal period of the results [s]. Status frames have none: they are sent every STATUS_PERIOD.
    groups : of the loads behind the five, which are sent too.
    """
    is_fd = form == "fd"
    protected = (shared_signal("crc_5", 0), shared_signal("counter_5", 16))
    if not is_fd:
        protected = (shared_signal("crc_1", 0), shared_signal("counter_1", 8))
    frames = [
        (
            name,
            stated.get("length", 8),
            [signal for field, place in stated["fields"].items() for signal in _signals(field, place)],
            stated.get("comment", ""),
            cycle_time if "every_cycle" in stated else None,
        )
        for name, stated in stated_file("results")[form].items()
    ]
    frames += [(*frame, cycle_time) for frame in (_fd_frames if is_fd else _classic_frames)(groups)]
    return tuple(
        FrameLayout(
            name=name,
            identifier=identifiers.result_base + number,
            length=length,
            signals=(*protected, *signals),
            is_extended=identifiers.is_extended,
            is_fd=is_fd,
            protection=Protection(5 if is_fd else 1, _RESULT_DATA_ID + number),
            cycle_time=period,
            sender=BRIDGE,
            comment=comment,
        )
        for number, (name, length, signals, comment, period) in enumerate(frames)
    )


def _signals(field: str, position: int | Sequence[int]) -> list[SignalLayout]:
    """Return the signals of a field of results.toml at their places."""
    stated = {**stated_file("results")["signal"][field]}
    first, names = (
        (position, ("",))
        if isinstance(position, int)
        else (position[0], COEFFICIENT_NAMES[position[1] : position[2]])
    )
    if "choices" in stated:
        stated["choices"] = [(int(choice), choice.name.title()) for choice in _ENUMERATIONS[stated["choices"]]]
        if "not_available" in stated:
            stated["choices"].append((stated["not_available"], "NotAvailable"))
    name = stated.pop("name")
    return [
        placed_signal(stated, first + stated["length"] * place, LITTLE, name=name.format(coefficient))
        for place, coefficient in enumerate(names)
    ]


_Frame = tuple[str, int, list[SignalLayout], str]
"""Name, bytes, signals behind the protection, and comment."""


def _fd_frames(groups: Sequence[LoadGroup]) -> Iterator[_Frame]:
    """Yield one frame of each place of ``groups``: all that is sent of it, then the standard deviations."""
    head = [*_signals("quality", 24), *_signals("sample_time", 32)]
    for family, name, text, sent in _places(groups):
        outputs = [(f"{prefix}{output}", _unit(family, load)) for prefix in ("", SIGMA) for load, output in sent]
        floats = [_float(output, unit, _NAN, 64 + 32 * k) for k, (output, unit) in enumerate(outputs)]
        end = 8 + 4 * len(floats)
        length = next(length for length in FD_LENGTHS if length > end)
        yield name, length, [*head, *floats, *_signals("answered", 8 * end)], text


def _classic_frames(groups: Sequence[LoadGroup]) -> Iterator[_Frame]:
    """Yield one frame of each load of each place of ``groups``; loads take all bytes, coefficients do not."""
    head = _signals("quality", 12)
    for family, name, text, sent in _places(groups):
        for load, output in sent:
            if family.sends_coefficients:
                value = replace(_number(output, 5e-4, "", -32768, "-32768 (0x8000): not available"), kind=SIGNED)
                std = _number(f"{SIGMA}{output}", 1e-4, "", 65535, "65535: not available")
                signals = [value, replace(std, start=32), *_signals("answered", 48)]
            else:
                value = _float(output, load.unit, f"{load.text}; {_NAN}", 16)
                comment = "Rounded up; 65535: not available, above"
                std = _number(f"{SIGMA}{output}", load.step, load.unit, 65535, comment)
                signals = [value, replace(std, start=48)]
            yield f"{name}_{load.key}" if family.is_listed else name, 8, [*head, *signals], text


def _float(output: str, unit: str, comment: str, start: int) -> SignalLayout:
    name = signal_name(output)
    return SignalLayout(name=name, start=start, length=32, kind=FLOAT, unit=unit, comment=comment)


def _number(output: str, scale: float, unit: str, not_available: int, comment: str) -> SignalLayout:
    return SignalLayout(
        name=signal_name(output),
        start=16,
        length=16,
        scale=scale,
        unit=unit,
        not_available=not_available,
        comment=comment,
    )


def _places(groups: Sequence[LoadGroup]) -> Iterator[tuple[LoadFamily, str, str, list[tuple[LoadKind, str]]]]:
    """Return the places of ``groups`` in the order of their frames: family, frame, its text, loads and outputs."""
    for family in FAMILIES:
        of_family = [group for group in groups if group.family is family]
        for index, place in enumerate(of_family[0].places if of_family else ()):
            name = f"{family.frame}{index + 1}" if family.is_listed else family.frame
            sent = [(group.load, group.numbered(_sent_name(family, group.load))[index]) for group in of_family]
            yield family, name, family.frame_text.format(place), sent


def _unit(family: LoadFamily, load: LoadKind) -> str:
    return "" if family.sends_coefficients else load.unit


def _sent_name(family: LoadFamily, load: LoadKind) -> str:
    return load.coefficient if family.sends_coefficients else load.output


def _sent_among(signals: Mapping[str, SignalLayout], family: LoadFamily, load: LoadKind) -> Iterator[str]:
    """Return the outputs of ``load`` at all places that have signals."""
    stem = _sent_name(family, load)
    names = (f"{stem}[{number}]" for number in count(1)) if family.is_listed else iter((stem,))
    for name in names:
        if signal_name(name) not in signals:
            return
        yield name


def signal_name(output: str) -> str:
    """Return the name of the signal for an output of the estimator: section_axial_1 for ``section.axial[1]``."""
    return output.replace(".", "_").replace("[", "_").rstrip("]")


class OtherLoadSignals:
    """The signals of these loads among result frames, and their values.

    Parameters
    ----------
    layouts : of all result frames.
    """

    def __init__(self, layouts: Sequence[FrameLayout]) -> None:
        signals = {signal.name: signal for layout in layouts for signal in layout.signals}
        loads = [(family, load) for family in FAMILIES for load in family.loads]
        sent = {name: load for load in loads for name in _sent_among(signals, *load)}
        self._outputs = {
            signal_name(f"{prefix}{name}"): f"{prefix}{name}" for name in sent for prefix in ("", SIGMA)
        }
        # Standard deviations in whole steps are never stated smaller than they are.
        steps = {
            signal_name(f"{SIGMA}{name}"): load.step
            for name, (family, load) in sent.items()
            if not family.sends_coefficients
        }
        self._steps = {name: step for name, step in steps.items() if signals[name].length == 16}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the signals, in the order of their values."""
        return tuple(self._outputs)

    @property
    def outputs(self) -> dict[str, float]:
        """The outputs of the estimator, in order, and the step in which each is rounded up, 0 for none."""
        return {output: self._steps.get(name, 0.0) for name, output in self._outputs.items()}

    def __bool__(self) -> bool:
        return bool(self._outputs)

    def values(self, outputs: Mapping[str, float]) -> dict[str, float]:
        """Return the value of every signal from the ``outputs`` of the estimator, NaN where they have none."""
        values = {name: outputs.get(output, nan) for name, output in self._outputs.items()}
        for name, step in self._steps.items():
            value = values[name] / step
            # 0 of a load that is known; above the range there is none.
            values[name] = step * ceil(value) if isfinite(value) and 0.0 <= value <= _LARGEST_WHOLE else nan
        return values


# --- contents ----------------------------------------------------------------------------------------------------

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
            [
                _ResultFrame(layout, places, 0 if kind else first)
                for layout, frame_kind, places in frames
                if frame_kind == kind
            ]
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
    other_loads = OtherLoadSignals(layouts)
    names = ((*_RESULT_NAMES, *other_loads.names), _STATUS_NAMES, _DETAIL_NAMES)
    composed = []
    for layout in layouts:
        kind = 0 if layout.cycle_time is not None else 2 if layout.name == DETAIL else 1
        composed.append((layout, kind, [names[kind].index(signal.name) for signal in layout.signals]))
    return composed, other_loads


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
