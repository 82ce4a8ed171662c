"""Result frames of the loads beside the five: the rolling moment, and the loads of sections along the body.

They come behind the other result frames, and only of an estimator that has such loads. CAN FD: one frame of the
rolling moment, and one of each section. Classic: one of the rolling moment, and one of each load of a section.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import ceil, isfinite, nan

from strainfmu.can.wire.frame_layout import BIG, FLOAT, LITTLE, SIGNED, FrameLayout, SignalLayout
from strainfmu.estimator.other_loads import SECTION_LOADS
from strainfmu.interface.other_load_variables import other_load_outputs

_COEFFICIENT = "M_R"
_NAN = "NaN: not available"
_LARGEST_WHOLE = 65534.0
"""Largest standard deviation [N, N m] of a classic frame."""


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
        n_sections = sum(1 for name in signals if name.startswith("section_axial_"))
        outputs = ((signal_name(output), output) for output in other_load_outputs(n_sections))
        self._outputs = {name: output for name, output in outputs if name in signals}
        # Standard deviations in whole numbers of their unit are never stated smaller than they are.
        self._whole = frozenset(
            n for n in self._outputs if n.startswith("sigma_section") and signals[n].length == 16
        )

    def __bool__(self) -> bool:
        return bool(self._outputs)

    def values(self, outputs: Mapping[str, float]) -> dict[str, float]:
        """Return the value of every signal from the ``outputs`` of the estimator, NaN where they have none."""
        values = {name: outputs.get(output, nan) for name, output in self._outputs.items()}
        for name in self._whole:
            value = values[name]
            # 0 of a load that is known; above the range there is none.
            values[name] = float(ceil(value)) if isfinite(value) and 0.0 <= value <= _LARGEST_WHOLE else nan
        return values


def fd_layouts(
    head: Sequence[SignalLayout], answered: SignalLayout, stations: Sequence[float], cycle_time: float
) -> list[FrameLayout]:
    """Return one frame of the rolling moment, and one of each section at x = ``stations`` [m].

    ``head`` is the first 8 bytes, ``answered`` the counter of the strains answered, which is placed at the end.
    """

    def frame(name: str, length: int, outputs: Sequence[tuple[str, str]], comment: str) -> FrameLayout:
        floats = [
            SignalLayout(
                name=signal_name(output),
                start=64 + 32 * index,
                length=32,
                byte_order=LITTLE,
                kind=FLOAT,
                unit=unit,
                comment=_NAN,
            )
            for index, (output, unit) in enumerate(outputs)
        ]
        last = replace(answered, start=64 + 32 * len(floats))
        return FrameLayout(
            name=name,
            identifier=0,
            length=length,
            signals=(*head, *floats, last),
            is_fd=True,
            cycle_time=cycle_time,
            comment=comment,
        )

    rolling = frame("RollingMoment", 20, [(_COEFFICIENT, ""), (f"sigma.{_COEFFICIENT}", "")], _rolling_text())
    sections = []
    for number, station in enumerate(stations, start=1):
        loads = [(f"section.{name}[{number}]", unit) for name, (_, unit) in SECTION_LOADS.items()]
        deviations = [(f"sigma.{name}", unit) for name, unit in loads]
        sections.append(frame(f"Section{number}", 64, [*loads, *deviations], _section_text(station)))
    return [rolling, *sections]


def classic_layouts(
    head: Sequence[SignalLayout], answered: SignalLayout, order: str, stations: Sequence[float], cycle_time: float
) -> list[FrameLayout]:
    """Return one frame of the rolling moment, and one of each load of each section at x = ``stations`` [m].

    ``head`` is the first 2 bytes; ``answered`` is placed behind the numbers of the frame of the rolling moment.
    """

    def at(signal: SignalLayout, byte: int) -> SignalLayout:
        is_big = order == BIG and signal.length > 8
        return replace(signal, start=8 * byte + (7 if is_big else 0), byte_order=order if is_big else LITTLE)

    def frame(name: str, signals: Sequence[SignalLayout], comment: str) -> FrameLayout:
        return FrameLayout(
            name=name,
            identifier=0,
            length=8,
            signals=(*head, *signals),
            cycle_time=cycle_time,
            comment=comment,
        )

    def number(name: str, scale: float, unit: str = "", comment: str = "65535: not available") -> SignalLayout:
        return SignalLayout(
            name=name, start=0, length=16, scale=scale, unit=unit, not_available=65535, comment=comment
        )

    coefficient = SignalLayout(
        name=_COEFFICIENT,
        start=0,
        length=16,
        kind=SIGNED,
        scale=5e-4,
        not_available=-32768,
        comment="-32768 (0x8000): not available",
    )
    deviation = number(f"sigma_{_COEFFICIENT}", 1e-4)
    layouts = [frame("RollingMoment", [at(coefficient, 2), at(deviation, 4), at(answered, 6)], _rolling_text())]
    for index, station in enumerate(stations, start=1):
        for name, (text, unit) in SECTION_LOADS.items():
            output = signal_name(f"section.{name}[{index}]")
            load = SignalLayout(name=output, start=0, length=32, kind=FLOAT, unit=unit, comment=f"{text}; {_NAN}")
            rounded = number(f"sigma_{output}", 1.0, unit=unit, comment="Rounded up; 65535: not available, above")
            layouts.append(frame(f"Section{index}_{name}", [at(load, 2), at(rounded, 6)], _section_text(station)))
    return layouts


def _rolling_text() -> str:
    return "Rolling moment coefficient C_l, positive with starboard down"


def _section_text(station: float) -> str:
    return f"Loads of the air on the part ahead of x = {station:g} m"
