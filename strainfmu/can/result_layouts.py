"""The frames of the results: their signals in each form, and the signals of loads behind the five."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from math import ceil, isfinite, nan

from strainfmu.can.frame import FD_LENGTHS, Protection
from strainfmu.can.frame_layout import FLOAT, LITTLE, SIGNED, FrameLayout, SignalLayout
from strainfmu.can.profiles import BRIDGE, Identifiers, placed_signal, shared_signal, stated_file
from strainfmu.can.quality import BusState, Quality
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.other_loads import FAMILIES, SIGMA, LoadFamily, LoadGroup, LoadKind

_NAN = "NaN: not available"
_LARGEST_WHOLE = 65534.0
"""Largest standard deviation of a classic frame, in steps."""


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
        sent = {name: one for one in loads for name in _sent_among(signals, *one)}
        self._outputs = {signal_name(f"{of}{name}"): f"{of}{name}" for name in sent for of in ("", SIGMA)}
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


def fd_layouts(
    head: Sequence[SignalLayout], answered: SignalLayout, groups: Sequence[LoadGroup], cycle_time: float
) -> list[FrameLayout]:
    """Return one frame of each place of ``groups``: all that is sent of it, then the standard deviations.

    ``head`` is the first 8 bytes, ``answered`` the counter of the strains answered, which is placed at the end.
    """
    layouts = []
    for family, name, text, sent in _places(groups):
        outputs = [(f"{of}{output}", _unit(family, load)) for of in ("", SIGMA) for load, output in sent]
        floats = [_float(output, unit, _NAN, 64 + 32 * k) for k, (output, unit) in enumerate(outputs)]
        end = 8 + 4 * len(floats)
        layouts.append(
            FrameLayout(
                name=name,
                identifier=0,
                length=next(length for length in FD_LENGTHS if length > end),
                signals=(*head, *floats, replace(answered, start=8 * end)),
                is_fd=True,
                cycle_time=cycle_time,
                comment=text,
            )
        )
    return layouts


def classic_layouts(
    head: Sequence[SignalLayout], answered: SignalLayout, groups: Sequence[LoadGroup], cycle_time: float
) -> list[FrameLayout]:
    """Return one frame of each load of each place of ``groups``.

    ``head`` is the first 2 bytes; ``answered`` is placed behind coefficients, and nowhere behind loads, which take
    all bytes.
    """
    layouts = []
    for family, name, text, sent in _places(groups):
        for load, output in sent:
            if family.sends_coefficients:
                value = replace(_number(output, 5e-4, "", -32768, "-32768 (0x8000): not available"), kind=SIGNED)
                std = _number(f"{SIGMA}{output}", 1e-4, "", 65535, "65535: not available")
                signals = [value, replace(std, start=32), replace(answered, start=48)]
            else:
                value = _float(output, load.unit, f"{load.text}; {_NAN}", 16)
                comment = "Rounded up; 65535: not available, above"
                std = _number(f"{SIGMA}{output}", load.step, load.unit, 65535, comment)
                signals = [value, replace(std, start=48)]
            layouts.append(
                FrameLayout(
                    name=f"{name}_{load.key}" if family.is_listed else name,
                    identifier=0,
                    length=8,
                    signals=(*head, *signals),
                    cycle_time=cycle_time,
                    comment=text,
                )
            )
    return layouts


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
        for index, at in enumerate(of_family[0].places if of_family else ()):
            name = f"{family.frame}{index + 1}" if family.is_listed else family.frame
            sent = [(one.load, one.numbered(_sent_name(family, one.load))[index]) for one in of_family]
            yield family, name, family.frame_text.format(at), sent


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


_RESULT_DATA_ID = 0x5380
STATUS_PERIOD = 0.1
"""Period of the status frames [s]."""
DETAIL = "EstimateDetail"
"""Frame that is sent with the status and with every result that has causes above bit 15."""
SIGMA_NAMES = tuple(f"sigma_{name}" for name in COEFFICIENT_NAMES)
LAST_NAMES = tuple(f"last_{name}" for name in COEFFICIENT_NAMES)
_ENUMERATIONS = {"quality": Quality, "health": HealthState, "bus": BusState}


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
    is_fd, stated = form == "fd", stated_file("results")
    protected = (shared_signal("crc_5", 0), shared_signal("counter_5", 16))
    if not is_fd:
        protected = (shared_signal("crc_1", 0), shared_signal("counter_1", 8))
    layouts = [
        FrameLayout(
            name=name,
            identifier=0,
            length=frame.get("length", 8),
            signals=(*protected, *(one for field, at in frame["fields"].items() for one in _signals(field, at))),
            is_fd=is_fd,
            cycle_time=cycle_time if "every_cycle" in frame else None,
            comment=frame.get("comment", ""),
        )
        for name, frame in stated[form].items()
    ]
    (answered,), (quality,) = _signals("answered", 0), _signals("quality", 24 if is_fd else 12)
    head = (*protected, quality, *(_signals("sample_time", 32) if is_fd else ()))
    layouts += (fd_layouts if is_fd else classic_layouts)(head, answered, groups, cycle_time)
    return tuple(
        replace(
            layout,
            identifier=identifiers.result_base + number,
            is_extended=identifiers.is_extended,
            protection=Protection(5 if is_fd else 1, _RESULT_DATA_ID + number),
            sender=BRIDGE,
        )
        for number, layout in enumerate(layouts)
    )


def _signals(field: str, at: int | Sequence[int]) -> list[SignalLayout]:
    """Return the signals of a field of results.toml at their places."""
    stated = {**stated_file("results")["signal"][field]}
    first, names = (at, ("",)) if isinstance(at, int) else (at[0], COEFFICIENT_NAMES[at[1] : at[2]])
    if "choices" in stated:
        stated["choices"] = [(int(one), one.name.title()) for one in _ENUMERATIONS[stated["choices"]]]
        if "not_available" in stated:
            stated["choices"].append((stated["not_available"], "NotAvailable"))
    name = stated.pop("name")
    return [
        placed_signal(stated, first + stated["length"] * place, LITTLE, name=name.format(of))
        for place, of in enumerate(names)
    ]
