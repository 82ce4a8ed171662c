"""The frames of a profile for auxiliary sensors and thrust: floats in SI units, each frame with a CRC."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from strainfmu.can.wire.crc import Protection
from strainfmu.can.wire.frame_layout import BIG, FLOAT, LITTLE, FlowSignal, FrameLayout, InputFrame, SignalLayout
from strainfmu.can.wire.profile_signals import (
    configuration_signal,
    header_1,
    header_5,
    sample_time_signal,
    short_sample_time,
    status_signal,
)

READINGS_PER_FD_FRAME, READINGS_PER_SECURED_FRAME = 13, 10

_DATA_ID = 0x5400
_TEXT = "Auxiliary sensors and thrust; optional; send them ahead of the strains of the same time"
_UNITS = {"1": "m/m"}
"""Units of FMI that a DBC file writes otherwise."""


def reading_frames(
    identifier: int,
    readings: Mapping[str, str],
    names: Sequence[str],
    *,
    per_frame: int,
    is_extended: bool,
    cycle_time: float,
    sender: str,
    configuration: int | None,
    byte_order: str = LITTLE,
) -> tuple[InputFrame, ...]:
    """Return the frames, of 64 bytes CAN FD, or of 8 bytes with one reading where ``configuration`` is None.

    Parameters
    ----------
    identifier : of the first frame.
    readings : unit of each reading by name of the estimator's input.
    names : of their signals.
    per_frame : largest number of readings of a frame.
    cycle_time : period of the strain frames, and of these [s].
    configuration : number of the assignment of gauges and sensors.
    byte_order : of readings and sample time in 8 bytes.
    """
    is_fd = configuration is not None
    head: tuple[SignalLayout, ...] = (*header_1(), status_signal(12, 4))
    tail: tuple[SignalLayout, ...] = (short_sample_time(byte_order),)
    start = 23 if byte_order == BIG else 16
    if configuration is not None:
        head = (*header_5(), status_signal(24, 8), sample_time_signal(32))
        start, tail = 64, (configuration_signal(64 + 32 * per_frame, configuration),)
    quantities, frames = list(readings.items()), []
    for number, first in enumerate(range(0, len(quantities), per_frame)):
        chosen = quantities[first : first + per_frame]
        of_readings = tuple(
            SignalLayout(
                name=names[first + place],
                start=start + 32 * place,
                length=32,
                byte_order=byte_order,
                kind=FLOAT,
                unit=_UNITS.get(unit, unit),
                comment=f"Input {quantity} of the estimator; NaN not available: left out",
            )
            for place, (quantity, unit) in enumerate(chosen)
        )
        signals = (*head, *of_readings, *tail)
        layout = FrameLayout(
            name=f"Sensors{number + 1}",
            identifier=identifier + number,
            length=64 if is_fd else 8,
            signals=signals,
            is_extended=is_extended,
            is_fd=is_fd,
            protection=Protection(5 if is_fd else 1, _DATA_ID + number),
            cycle_time=cycle_time,
            sender=sender,
            comment=_TEXT,
        )
        index = {signal.name: place for place, signal in enumerate(signals)}
        frames.append(
            InputFrame(
                layout=layout,
                flow=tuple(FlowSignal(quantity=one, index=len(head) + k) for k, (one, _) in enumerate(chosen)),
                sample_time=index["SampleTime"],
                tick=1e-6 if is_fd else 1e-4,
                status=index["Status"],
                configuration=index["Configuration"] if is_fd else None,
            )
        )
    return tuple(frames)
