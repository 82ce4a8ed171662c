"""The frames of the results: their signals in each form, and what results and the bridge's state put into them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count

import numpy as np

from strainfmu.can.encoder import frame_of
from strainfmu.can.frame import FD_LENGTHS, Frame, Protection
from strainfmu.can.frame_layout import FLOAT, LITTLE, SIGNED, FrameLayout, SignalLayout
from strainfmu.can.profiles import (
    BRIDGE,
    E2E_COUNTER,
    E2E_CRC,
    Identifiers,
    placed_signal,
    shared_signal,
    stated_file,
)
from strainfmu.can.quality import BusState, Quality
from strainfmu.can.signals import frame_table, signal_table
from strainfmu.cosim.estimators.exchange import Record
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE
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


def other_loads(layouts: Sequence[FrameLayout]) -> dict[str, float]:
    """Return the estimator's outputs in addition to the five loads that frames state, in order.

    The number of each is the step in which it is rounded up, 0 for none: standard deviations in whole steps are
    never stated smaller than they are.
    """
    signals, outputs = {signal.name: signal for layout in layouts for signal in layout.signals}, dict[str, float]()
    for load_family, load in [(family, load) for family in FAMILIES for load in family.loads]:
        for name in _sent_among(signals, load_family, load):
            sigma = f"{SIGMA}{name}"
            is_rounded = not load_family.sends_coefficients and signals[signal_name(sigma)].length == 16
            outputs |= {name: 0.0, sigma: load.step if is_rounded else 0.0}
    return outputs


# --- contents ----------------------------------------------------------------------------------------------------

_HEADER = (E2E_CRC, E2E_COUNTER)
"""Signals that are written when all others are."""

OF_RESULT, OF_STATUS, OF_DETAIL = range(3)
"""Kinds of a frame."""

FIRST_OTHER = 11
"""Place of the first of the estimator's other outputs, behind loads, their standard deviations and chi-square."""


def output_names(layouts: Sequence[FrameLayout]) -> tuple[str, ...]:
    """Return the names of the estimator's other outputs that the frames state."""
    return ENVELOPE_SCORE, *other_loads(layouts)


class ResultFrames:
    """The frames that ``bridge`` composes of its results and its status, each with its own counter.

    Parameters
    ----------
    layouts : of :func:`result_layouts`.
    configuration : number of the gauge assignment, as in the input's frames; 0 for none.
    first : counter of the first result.
    outputs : names of what the estimator gives behind its loads and chi-square.

    Attributes
    ----------
    of_kind : frames of each kind without data, and where compiled code puts the data of each.
    """

    def __init__(
        self,
        bridge: Record,
        layouts: Sequence[FrameLayout],
        configuration: int,
        first: int,
        outputs: Sequence[str],
    ) -> None:
        frames, kinds, sources = zip(*_composition(layouts), strict=True)
        others = other_loads(layouts)
        places = {name: FIRST_OTHER + place for place, name in enumerate(outputs)}
        data = np.zeros((len(frames), FD_LENGTHS[-1]), dtype=np.uint8)
        bridge.set(
            frame=frame_table(list(zip(frames, kinds, strict=True))),
            signal=np.concatenate([signal_table(layout) for layout in frames]),
            source=np.concatenate(sources).astype(np.int32),
            counter=np.array([0 if kind else first for kind in kinds], dtype=np.uint8),
            data=data,
            other=np.array([*(places.get(name, -1) for name in others), -1], dtype=np.int32),
            step=np.array([*others.values(), 0.0]),
            value=np.zeros(len(_RESULT_NAMES) + len(_STATUS_NAMES) + len(others)),
        )
        record = bridge.record
        record["n_frames"], record["n_others"] = len(frames), len(others)
        record["score"], record["configuration"] = places.get(ENVELOPE_SCORE, -1), configuration
        self.of_kind: list[list[tuple[Frame, memoryview]]] = [[], [], []]
        for layout, kind, row in zip(frames, kinds, data, strict=True):
            self.of_kind[kind].append((frame_of(layout, b""), row[: layout.length].data))


def _composition(
    layouts: Sequence[FrameLayout],
) -> list[tuple[FrameLayout, int, list[int]]]:
    """Return how each frame is composed.

    A kind, 0 of a result, 1 of the status and 2 of details, and the place of each signal's value among the values
    of that kind, as ``fmus/native/bridge/bridge.h`` lists them.
    """
    others = [signal_name(output) for output in other_loads(layouts)]
    names = ((*_RESULT_NAMES, *others), _STATUS_NAMES, _DETAIL_NAMES)
    composed = []
    for layout in layouts:
        kind = 0 if layout.cycle_time is not None else 2 if layout.name == DETAIL else 1
        composed.append((layout, kind, [names[kind].index(signal.name) for signal in layout.signals]))
    return composed


_RESULT_NAMES = (
    *_HEADER,
    *COEFFICIENT_NAMES,
    *SIGMA_NAMES,
    *("Quality", "Health", "Usable", "SampleTime", "ChiSquare", "Age", "Causes", "GaugesUsed", "AnsweredCounter"),
    *("Configuration", "UsedPressure", "EnvelopeScore8"),
)


_DETAIL_NAMES = (*_HEADER, "Quality", "AllCauses", "Usable", "AgeUncertainty", "AnsweredCounter")


_COUNTS = ("Received", "Used", "Rejected", "Cycles", "Overrun")
_STATUS_NAMES = (
    *_HEADER,
    *LAST_NAMES,
    *_COUNTS,
    *(f"{name}16" for name in _COUNTS),
    *("LastAge", "LastAge16", "Quality", "BusState", "SendFailures", "Reconnects", "Drift", "EnvelopeScore"),
    "Configuration",
)
