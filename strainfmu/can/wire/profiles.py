"""The four frame layouts that need no DBC file: fd64, classic-le, classic-be and float2.

fd64: 27 gauges per CAN FD frame of 64 bytes, each frame under E2E profile 5. The others: plain frames of 8 bytes,
as strain amplifiers send them (4 x 16 bit, 2 x float32), closed by a trailer whose CRC covers the whole cycle.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass

from strainfmu.can.wire.crc import Protection
from strainfmu.can.wire.frame import EXTENDED_FLAG
from strainfmu.can.wire.frame_layout import (
    BIG,
    FLOAT,
    LITTLE,
    SIGNED,
    FrameLayout,
    InputFrame,
    InputLayout,
    SignalLayout,
)
from strainfmu.errors import InputError

PROFILES = ("fd64", "classic-le", "classic-be", "float2")

GAUGES_PER_FD_FRAME = 27
STRAIN_SCALE = 0.25
"""um/m per bit of a 16 bit strain: +-8191.5 um/m, a quarter of a good gauge's noise."""

LARGEST_FLOAT_STRAIN = 50_000.0
"""um/m that foil gauges stand, 5 %: what a float says beyond is no strain."""

LARGEST_DYNAMIC_PRESSURE = 1e7
"""Pa; Mach 10 at sea level has 7.1 MPa."""

SENDER = "StrainSender"
BRIDGE = "StrainBridge"

_PRESSURE_DATA_ID = 0x5300
_STRAIN_DATA_ID = 0x5301
_MICRO = 1e-6


@dataclass(frozen=True)
class Identifiers:
    """Where the frames of a profile lie.

    Attributes
    ----------
    base : identifier of the frame of q_inf; strain frames and the trailer follow.
    result_base : identifier of the first result frame.
    is_extended : 29 bit identifiers.
    """

    base: int = 0x300
    result_base: int = 0x380
    is_extended: bool = False

    def checked(self, n_input: int, n_result: int) -> Identifiers:
        """Return self if ``n_input`` input and ``n_result`` result frames have identifiers of their own.

        Raises
        ------
        InputError
            They overlap or do not exist.
        """
        limit = EXTENDED_FLAG >> 2 if self.is_extended else 0x800
        for name, first, count in (("input", self.base, n_input), ("result", self.result_base, n_result)):
            if first < 0 or first + count > limit:
                raise InputError(
                    f"{name} identifiers: 0x{first:X} and {count - 1} more found, 0 to 0x{limit - 1:X} allowed"
                )
        if self.base < self.result_base + n_result and self.result_base < self.base + n_input:
            raise InputError(
                f"result identifiers: 0x{self.result_base:X} and {n_result - 1} more found, others than the "
                f"input's, 0x{self.base:X} to 0x{self.base + n_input - 1:X}, wanted"
            )
        return self


def configuration_of(profile: str, gauge_names: Sequence[str]) -> int:
    """Return the 16 bit number that tells one assignment of gauges to frames from another.

    The first two bytes of the SHA-256 of profile and gauge names in their order; 0 and 65535 are not used.
    """
    digest = hashlib.sha256("\n".join((profile, *gauge_names)).encode()).digest()
    return 1 + int.from_bytes(digest[:2], "big") % 65534


def profile_layout(
    profile: str, gauge_names: Sequence[str], cycle_time: float, identifiers: Identifiers | None = None
) -> InputLayout:
    """Return the frames of ``profile`` for gauges in the order of ``gauge_names``, sent every ``cycle_time`` [s].

    Raises
    ------
    InputError
        There is no such profile, or its frames do not fit onto the identifiers.
    """
    if profile not in PROFILES:
        raise InputError(f"profile: '{profile}' found, one of {', '.join(PROFILES)} wanted")
    identifiers = identifiers or Identifiers()
    configuration = configuration_of(profile, gauge_names)
    names = signal_names(gauge_names)
    if profile == "fd64":
        layout = _fd64(names, cycle_time, identifiers, configuration)
    else:
        layout = _classic(profile, names, cycle_time, identifiers, configuration)
    identifiers.checked(len(layout.frames), 1)
    return layout


def signal_names(gauge_names: Sequence[str]) -> list[str]:
    """Return a distinct C name for every gauge, as DBC files want them."""
    names: list[str] = []
    for place, gauge in enumerate(gauge_names, start=1):
        name = re.sub(r"\W+", "_", gauge, flags=re.ASCII)[:28]
        if not re.match(r"[A-Za-z_]", name) or name in names:
            name = f"gauge_{place}_{name}"[:32]
        names.append(name)
    return names


def _strain(name: str, start: int, byte_order: str) -> SignalLayout:
    """Return a strain of 16 bits."""
    return SignalLayout(
        name,
        start,
        16,
        byte_order,
        SIGNED,
        STRAIN_SCALE,
        unit="um/m",
        minimum=-32766 * STRAIN_SCALE,
        maximum=32766 * STRAIN_SCALE,
        not_available=-32768,
        comment="Strain; -32768 (0x8000) not available, -32767 and 32767 are the ends of the converter: not valid",
    )


def _float_strain(name: str, start: int) -> SignalLayout:
    """Return a strain of 32 bits."""
    limit = LARGEST_FLOAT_STRAIN
    return SignalLayout(
        name,
        start,
        32,
        LITTLE,
        FLOAT,
        unit="um/m",
        minimum=-limit,
        maximum=limit,
        comment="Strain; NaN not available",
    )


def _sample_time(start: int, byte_order: str = LITTLE) -> SignalLayout:
    return SignalLayout(
        "SampleTime",
        start,
        32,
        byte_order,
        unit="us",
        comment="When the strains were sampled, sender's clock; wraps after 71.6 min",
    )


def _status(start: int, length: int) -> SignalLayout:
    return SignalLayout(
        "Status",
        start,
        length,
        choices=((0, "Good"), (1, "Degraded"), (2, "DoNotUse")),
        comment="The sender's own verdict; above 1: not used",
    )


def _configuration(start: int, configuration: int) -> SignalLayout:
    return SignalLayout(
        "Configuration",
        start,
        16,
        initial=configuration,
        comment="Which gauge lies where; frames with another number are refused",
    )


def header_5() -> tuple[SignalLayout, SignalLayout]:
    """Return CRC and counter of E2E profile 5."""
    return (
        SignalLayout("E2E_CRC", 0, 16, comment="E2E profile 5: CRC-16/CCITT-FALSE over bytes 2.. and the DataID"),
        SignalLayout("E2E_Counter", 16, 8, comment="E2E profile 5: 0 to 255, one more each time"),
    )


def header_1() -> tuple[SignalLayout, SignalLayout]:
    """Return CRC and counter of E2E profile 1."""
    return (
        SignalLayout("E2E_CRC", 0, 8, comment="E2E profile 1: CRC-8 over the DataID and bytes 1 to 7"),
        SignalLayout("E2E_Counter", 8, 4, maximum=14, comment="E2E profile 1: 0 to 14, one more each time"),
    )


def _pressure(start: int, byte_order: str) -> SignalLayout:
    return SignalLayout(
        "DynamicPressure",
        start,
        32,
        byte_order,
        FLOAT,
        unit="Pa",
        minimum=1e-6,
        maximum=LARGEST_DYNAMIC_PRESSURE,
        comment="Free-stream dynamic pressure; NaN not available",
    )


def _fd64(names: list[str], cycle_time: float, identifiers: Identifiers, configuration: int) -> InputLayout:
    """Return the layout of profile fd64."""
    head = (*header_5(), _status(24, 8), _sample_time(32))
    frames = []
    for number, first in enumerate(range(0, len(names), GAUGES_PER_FD_FRAME)):
        chosen = names[first : first + GAUGES_PER_FD_FRAME]
        strains = tuple(_strain(name, 64 + 16 * place, LITTLE) for place, name in enumerate(chosen))
        layout = FrameLayout(
            f"Strain{number + 1}",
            identifiers.base + 1 + number,
            64,
            (*head, *strains, _configuration(496, configuration)),
            identifiers.is_extended,
            True,
            Protection(5, _STRAIN_DATA_ID + number),
            cycle_time,
            SENDER,
            "Strains; all frames of a cycle have the same counter and sample time",
        )
        places = tuple(range(len(head), len(head) + len(chosen)))
        frames.append(
            InputFrame(
                layout,
                places,
                tuple(range(first, first + len(chosen))),
                (_MICRO,) * len(chosen),
                sample_time=3,
                status=2,
                configuration=len(head) + len(chosen),
            )
        )
    pressure = FrameLayout(
        "DynamicPressure",
        identifiers.base,
        16,
        (*head, _pressure(64, LITTLE), _configuration(96, configuration)),
        identifiers.is_extended,
        True,
        Protection(5, _PRESSURE_DATA_ID),
        cycle_time,
        SENDER,
        "Dynamic pressure; send it ahead of the strains of the same time",
    )
    pressure_frame = InputFrame(pressure, dynamic_pressure=4, sample_time=3, status=2, configuration=5)
    return InputLayout("fd64", len(names), tuple(frames), pressure_frame, cycle_time=cycle_time)


def _classic(
    profile: str, names: list[str], cycle_time: float, identifiers: Identifiers, configuration: int
) -> InputLayout:
    """Return the layout of a profile of 8 byte frames."""
    order = BIG if profile == "classic-be" else LITTLE
    per_frame = 2 if profile == "float2" else 4
    frames = []
    for number, first in enumerate(range(0, len(names), per_frame)):
        chosen = names[first : first + per_frame]
        if profile == "float2":
            strains = tuple(_float_strain(name, 32 * place) for place, name in enumerate(chosen))
        else:
            strains = tuple(
                _strain(name, 16 * place + (7 if order == BIG else 0), order) for place, name in enumerate(chosen)
            )
        layout = FrameLayout(
            f"Strain{number + 1}",
            identifiers.base + 1 + number,
            8,
            strains,
            identifiers.is_extended,
            cycle_time=cycle_time,
            sender=SENDER,
            comment="Strains, covered by the CRC of the cycle's trailer",
        )
        gauges = tuple(range(first, first + len(chosen)))
        frames.append(InputFrame(layout, tuple(range(len(chosen))), gauges, (_MICRO,) * len(chosen)))
    trailer = FrameLayout(
        "StrainTrailer",
        identifiers.base + 1 + len(frames),
        8,
        (*header_5(), _status(24, 8), _sample_time(39 if order == BIG else 32, order)),
        identifiers.is_extended,
        # The configuration as DataID: a cycle with other gauges never passes the CRC.
        protection=Protection(5, configuration),
        cycle_time=cycle_time,
        sender=SENDER,
        comment="Ends a cycle; its CRC covers bytes 2 to 7, then the data of Strain1, Strain2 .. and the DataID",
    )
    pressure = FrameLayout(
        "DynamicPressure",
        identifiers.base,
        8,
        (
            *header_1(),
            _status(12, 4),
            _pressure(23 if order == BIG else 16, order),
            SignalLayout("SampleTime", 55 if order == BIG else 48, 16, order, scale=0.1, unit="ms"),
        ),
        identifiers.is_extended,
        protection=Protection(1, _PRESSURE_DATA_ID),
        cycle_time=cycle_time,
        sender=SENDER,
        comment="Dynamic pressure; send it ahead of the strains of the same time",
    )
    return InputLayout(
        profile,
        len(names),
        tuple(frames),
        InputFrame(pressure, dynamic_pressure=3, sample_time=4, tick=1e-4, status=2),
        InputFrame(trailer, sample_time=3, status=2, is_trailer=True),
        cycle_time,
    )
