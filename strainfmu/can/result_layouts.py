"""The frames of the results: their signals in each form, and the signals of loads behind the five."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from math import ceil, isfinite, nan

from strainfmu.can.frame import FD_LENGTHS, Protection
from strainfmu.can.frame_layout import FLOAT, SIGNED, FrameLayout, SignalLayout
from strainfmu.can.profiles import BRIDGE, Identifiers, header_1, header_5
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
    for place in _places(groups):
        outputs = [f"{of}{one.output}" for of in ("", SIGMA) for one in place.sent]
        units = [one.unit for one in place.sent] * 2
        floats = [
            SignalLayout(
                name=signal_name(output),
                start=64 + 32 * index,
                length=32,
                kind=FLOAT,
                unit=unit,
                comment=_NAN,
            )
            for index, (output, unit) in enumerate(zip(outputs, units, strict=True))
        ]
        end = 8 + 4 * len(floats)
        layouts.append(
            FrameLayout(
                name=place.frame,
                identifier=0,
                length=next(length for length in FD_LENGTHS if length > end),
                signals=(*head, *floats, replace(answered, start=8 * end)),
                is_fd=True,
                cycle_time=cycle_time,
                comment=place.text,
            )
        )
    return layouts


def classic_layouts(
    head: Sequence[SignalLayout],
    answered: SignalLayout,
    groups: Sequence[LoadGroup],
    cycle_time: float,
) -> list[FrameLayout]:
    """Return one frame of each load of each place of ``groups``.

    ``head`` is the first 2 bytes; ``answered`` is placed behind coefficients, and nowhere behind loads, which take
    all bytes.
    """

    def at(signal: SignalLayout, byte: int) -> SignalLayout:
        return replace(signal, start=8 * byte)

    layouts = []
    for place in _places(groups):
        for one in place.sent:
            value, deviation = one.signals()
            behind = [at(answered, 6)] if one.is_coefficient else []
            byte = 4 if one.is_coefficient else 6
            layouts.append(
                FrameLayout(
                    name=f"{place.frame}_{one.key}" if place.is_listed else place.frame,
                    identifier=0,
                    length=8,
                    signals=(*head, at(value, 2), at(deviation, byte), *behind),
                    cycle_time=cycle_time,
                    comment=place.text,
                )
            )
    return layouts


@dataclass(frozen=True)
class _Sent:
    """An output that is sent."""

    key: str
    output: str
    unit: str
    text: str
    step: float
    is_coefficient: bool

    def signals(self) -> tuple[SignalLayout, SignalLayout]:
        """Return the signals of value and standard deviation in a classic frame, not placed yet."""
        of_value, of_deviation = signal_name(self.output), signal_name(f"{SIGMA}{self.output}")
        if self.is_coefficient:
            value = SignalLayout(
                name=of_value,
                start=0,
                length=16,
                kind=SIGNED,
                scale=5e-4,
                not_available=-32768,
                comment="-32768 (0x8000): not available",
            )
            return value, _number(of_deviation, 1e-4, "", "65535: not available")
        comment = f"{self.text}; {_NAN}"
        value = SignalLayout(name=of_value, start=0, length=32, kind=FLOAT, unit=self.unit, comment=comment)
        return value, _number(of_deviation, self.step, self.unit, "Rounded up; 65535: not available, above")


@dataclass(frozen=True)
class _Place:
    """A place, its frame, and what is sent of it."""

    frame: str
    text: str
    sent: tuple[_Sent, ...]
    is_listed: bool


def _number(name: str, scale: float, unit: str, comment: str) -> SignalLayout:
    return SignalLayout(
        name=name, start=0, length=16, scale=scale, unit=unit, not_available=65535, comment=comment
    )


def _places(groups: Sequence[LoadGroup]) -> Iterator[_Place]:
    """Return the places of ``groups`` in the order of their frames."""
    for family in FAMILIES:
        of_family = [group for group in groups if group.family is family]
        for index, at in enumerate(of_family[0].places if of_family else ()):
            yield _Place(
                frame=f"{family.frame}{index + 1}" if family.is_listed else family.frame,
                text=family.frame_text.format(at),
                sent=tuple(_sent(group, index) for group in of_family),
                is_listed=family.is_listed,
            )


def _sent(group: LoadGroup, index: int) -> _Sent:
    family, load = group.family, group.load
    unit = "" if family.sends_coefficients else load.unit
    output = group.numbered(_sent_name(family, load))[index]
    return _Sent(load.key, output, unit, load.text, load.step, family.sends_coefficients)


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

_QUALITY_CHOICES = tuple((int(quality), quality.name.title()) for quality in Quality)
_HEALTH_CHOICES = tuple((int(state), state.name.title()) for state in HealthState)
_BUS_CHOICES = tuple((int(state), state.name.title()) for state in BusState)
SIGMA_NAMES = tuple(f"sigma_{name}" for name in COEFFICIENT_NAMES)
LAST_NAMES = tuple(f"last_{name}" for name in COEFFICIENT_NAMES)
_AGE_TICK = 1e-4
_CAUSES_TEXT = f"Why it is not Valid, one bit each; bit 15: further ones in {DETAIL}"
_DETAIL_TEXT = "Of the last result: every 100 ms, and with every result that has causes above bit 15"


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
    layouts = _fd_layouts(cycle_time) if form == "fd" else _classic_layouts(cycle_time)
    if form == "fd":
        first = (*header_5(), _quality(24), _sample_time())
        layouts += fd_layouts(first, _answered(0), groups, cycle_time)
    else:
        head = (*header_1(), _quality(12))
        layouts += classic_layouts(head, _answered(0), groups, cycle_time)
    return tuple(
        replace(
            layout,
            identifier=identifiers.result_base + number,
            is_extended=identifiers.is_extended,
            protection=Protection(5 if form == "fd" else 1, _RESULT_DATA_ID + number),
            sender=BRIDGE,
        )
        for number, layout in enumerate(layouts)
    )


def _quality(start: int) -> SignalLayout:
    return SignalLayout(
        name="Quality", start=start, length=4, choices=_QUALITY_CHOICES, comment="How far to trust it"
    )


def _sample_time() -> SignalLayout:
    return SignalLayout(
        name="SampleTime",
        start=32,
        length=32,
        unit="us",
        not_available=2**32 - 1,
        comment="Of the strains answered",
    )


def _health(start: int, length: int) -> SignalLayout:
    largest = (1 << length) - 1
    return SignalLayout(
        name="Health",
        start=start,
        length=length,
        not_available=largest,
        choices=(*_HEALTH_CHOICES, (largest, "NotAvailable")),
        comment="health.state of the estimator",
    )


def _usable(start: int) -> SignalLayout:
    return SignalLayout(
        name="Usable",
        start=start,
        length=1,
        comment="1: Health Ok or Degraded and Quality Valid, Unprotected or Degraded: loads and sigma may be used",
    )


def _fd_layouts(cycle_time: float) -> list[FrameLayout]:
    """Return LoadEstimate and BridgeStatus in CAN FD frames of 64 bytes."""
    floats = [
        SignalLayout(name=name, start=64 + 32 * i, length=32, kind=FLOAT, comment="NaN: not available")
        for i, name in enumerate((*COEFFICIENT_NAMES, *SIGMA_NAMES, "ChiSquare"))
    ]
    estimate = (
        *header_5(),
        _quality(24),
        _health(28, 4),
        _sample_time(),
        *floats,
        _age(416),
        SignalLayout(name="Causes", start=432, length=16, comment=_CAUSES_TEXT),
        SignalLayout(name="GaugesUsed", start=448, length=8),
        _answered(456),
        SignalLayout(name="Configuration", start=464, length=16),
        SignalLayout(
            name="UsedPressure",
            start=480,
            length=32,
            kind=FLOAT,
            unit="Pa",
            comment="q_inf used; NaN: none",
        ),
    )
    lasts = [
        SignalLayout(name=name, start=64 + 32 * i, length=32, kind=FLOAT) for i, name in enumerate(LAST_NAMES)
    ]
    counts = [
        SignalLayout(name=name, start=256 + 32 * i, length=32, comment="Wraps")
        for i, name in enumerate(("Received", "Used", "Rejected", "Cycles", "Overrun"))
    ]
    status = (
        *header_5(),
        _quality(24),
        SignalLayout(name="BusState", start=28, length=4, choices=_BUS_CHOICES),
        *lasts,
        SignalLayout(
            name="LastAge",
            start=224,
            length=32,
            unit="ms",
            not_available=2**32 - 1,
            comment="Age of the last valid coefficients",
        ),
        *counts,
        SignalLayout(name="SendFailures", start=416, length=16, comment="Wraps"),
        SignalLayout(name="Reconnects", start=432, length=8),
        SignalLayout(name="Configuration", start=448, length=16),
        _drift(464),
        SignalLayout(
            name="EnvelopeScore",
            start=480,
            length=32,
            kind=FLOAT,
            comment="Deviations by which the last result leaves what the map covers, 0 inside; NaN: none",
        ),
    )
    return [
        FrameLayout(
            name="LoadEstimate", identifier=0, length=64, signals=estimate, is_fd=True, cycle_time=cycle_time
        ),
        FrameLayout(
            name="BridgeStatus", identifier=0, length=64, signals=status, is_fd=True, comment="Every 100 ms"
        ),
        FrameLayout(
            name=DETAIL,
            identifier=0,
            length=12,
            signals=(*header_5(), _quality(24), *_details(32), _answered(80), _usable(88)),
            is_fd=True,
            comment=_DETAIL_TEXT,
        ),
    ]


def _classic_layouts(cycle_time: float) -> list[FrameLayout]:
    """Return five result and three status frames of 8 bytes: 3 x 16 bit behind the header of E2E profile 1."""
    head = (*header_1(), _quality(12))

    def words(name: str, *signals: SignalLayout, period: float | None = cycle_time) -> FrameLayout:
        placed = []
        bit = 16
        for signal in signals:
            placed.append(replace(signal, start=bit))
            bit += signal.length
        comment = "" if period else "Every 100 ms"
        return FrameLayout(
            name=name, identifier=0, length=8, signals=(*head, *placed), cycle_time=period, comment=comment
        )

    coefficients = [_coefficient(name) for name in COEFFICIENT_NAMES]
    deviations = [
        SignalLayout(
            name=name, start=0, length=16, scale=1e-4, not_available=65535, comment="65535: not available"
        )
        for name in SIGMA_NAMES
    ]
    lasts = [_coefficient(name) for name in LAST_NAMES]
    chi_square = SignalLayout(
        name="ChiSquare", start=0, length=16, scale=0.1, not_available=65535, comment="65535: not available"
    )
    verdict = (
        SignalLayout(name="Causes", start=0, length=16, comment=_CAUSES_TEXT),
        _answered(0),
        SignalLayout(name="GaugesUsed", start=0, length=8),
        _health(0, 7),
        _usable(0),
        SignalLayout(
            name="EnvelopeScore8",
            start=0,
            length=8,
            scale=0.1,
            not_available=255,
            comment="Deviations by which it leaves what the map covers, 0 inside; 254: 25.4 and above",
        ),
    )
    last_age = SignalLayout(name="LastAge16", start=0, length=16, scale=10.0, unit="ms", not_available=65535)
    return [
        words("Coefficients1", *coefficients[:3]),
        words("Coefficients2", *coefficients[3:], chi_square),
        words("Deviations1", *deviations[:3]),
        words("Deviations2", *deviations[3:], _age(0)),
        words("Verdict", *verdict),
        words("LastValid1", *lasts[:3], period=None),
        words("LastValid2", *lasts[3:], last_age, period=None),
        words(
            "BridgeStatus",
            SignalLayout(name="Received16", start=0, length=16, comment="Wraps"),
            SignalLayout(name="Rejected16", start=0, length=16, comment="Wraps"),
            SignalLayout(name="Reconnects", start=0, length=8),
            SignalLayout(name="BusState", start=0, length=8, choices=_BUS_CHOICES),
            period=None,
        ),
        FrameLayout(
            name=DETAIL,
            identifier=0,
            length=8,
            signals=(*head, *_details(16)),
            comment=_DETAIL_TEXT,
        ),
    ]


def _coefficient(name: str) -> SignalLayout:
    """Return a coefficient of 16 bits: +-16.38 in steps of 0.0005."""
    return SignalLayout(
        name=name,
        start=0,
        length=16,
        kind=SIGNED,
        scale=5e-4,
        not_available=-32768,
        comment="-32768 (0x8000): not available",
    )


def _age(start: int) -> SignalLayout:
    return SignalLayout(
        name="Age",
        start=start,
        length=16,
        scale=1e3 * _AGE_TICK,
        unit="ms",
        not_available=65535,
        comment="Of the strains when the result was sent; 65535: not available",
    )


def _details(start: int) -> tuple[SignalLayout, SignalLayout]:
    """Return all causes in 32 bits from bit ``start`` on, and the uncertainty of the age in 16 behind them."""
    return (
        SignalLayout(
            name="AllCauses",
            start=start,
            length=32,
            comment="Why the result is not Valid, one bit each, bits 16 and above too",
        ),
        SignalLayout(
            name="AgeUncertainty",
            start=start + 32,
            length=16,
            scale=1e3 * _AGE_TICK,
            unit="ms",
            not_available=65535,
            comment="By how much the strains may be older than Age; 65534: 6553.4 and above; 65535: not available",
        ),
    )


def _answered(start: int) -> SignalLayout:
    return SignalLayout(
        name="AnsweredCounter", start=start, length=8, comment="E2E counter of the strains answered"
    )


def _drift(start: int) -> SignalLayout:
    return SignalLayout(
        name="Drift",
        start=start,
        length=16,
        kind=SIGNED,
        scale=0.1,
        unit="ppm",
        not_available=-32768,
        comment="How much slower than the bridge's the sender's clock runs",
    )
