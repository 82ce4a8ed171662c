"""The frame by which the sender of the strains asks the bridge for a tare."""

from __future__ import annotations

from strainfmu.can.wire.crc import Protection
from strainfmu.can.wire.frame_layout import BIG, LITTLE, FrameLayout, InputFrame, SignalLayout
from strainfmu.can.wire.profile_signals import (
    configuration_signal,
    header_1,
    header_5,
    sample_time_signal,
    status_signal,
)

_TARE_DATA_ID = 0x5201
_TEXT = "Asks for a tare: mean of the strains from now on as zeros of the gauges; the bridge needs tare.map"


def tare_frame(
    identifier: int,
    *,
    is_extended: bool,
    cycle_time: float,
    sender: str,
    configuration: int | None,
    byte_order: str = LITTLE,
) -> InputFrame:
    """Return the frame, of 16 bytes CAN FD, or of 8 bytes where ``configuration`` is None.

    Parameters
    ----------
    cycle_time : period of the strain frames, and of this one while it is sent [s].
    configuration : number of the gauge assignment.
    byte_order : of the sample time in 8 bytes.
    """
    is_fd = configuration is not None
    signals: tuple[SignalLayout, ...]
    if configuration is not None:
        head = (*header_5(), status_signal(24, 8), sample_time_signal(32))
        signals = (*head, _request(64), configuration_signal(72, configuration))
    else:
        start = 55 if byte_order == BIG else 48
        clock = SignalLayout(
            name="SampleTime", start=start, length=16, byte_order=byte_order, scale=0.1, unit="ms"
        )
        signals = (*header_1(), status_signal(12, 4), _request(16), clock)
    layout = FrameLayout(
        name="TareCommand",
        identifier=identifier,
        length=16 if is_fd else 8,
        signals=signals,
        is_extended=is_extended,
        is_fd=is_fd,
        protection=Protection(5 if is_fd else 1, _TARE_DATA_ID),
        cycle_time=cycle_time,
        sender=sender,
        comment=_TEXT,
    )
    names = [signal.name for signal in signals]
    return InputFrame(
        layout=layout,
        request=names.index("Request"),
        sample_time=names.index("SampleTime"),
        tick=1e-6 if is_fd else 1e-4,
        status=names.index("Status"),
        configuration=names.index("Configuration") if is_fd else None,
    )


def _request(start: int) -> SignalLayout:
    return SignalLayout(
        name="Request",
        start=start,
        length=8,
        initial=0,
        comment="A change to another number than 0 begins a tare; 0: none is asked for",
    )
