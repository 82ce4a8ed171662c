"""The signals in the frames of the profiles."""

from __future__ import annotations

from strainfmu.can.wire.frame_layout import (
    BIG,
    FLOAT,
    LITTLE,
    SIGNED,
    SignalLayout,
)

STRAIN_SCALE = 0.25
"""Scale of a 16 bit strain [um/m per bit]: range +-8191.5 um/m, a bit is a quarter of a good gauge's noise."""

LARGEST_FLOAT_STRAIN = 50_000.0
"""Maximum strain of a foil gauge [um/m], 5 %; a float beyond is no strain."""

LEAST_DYNAMIC_PRESSURE, LARGEST_DYNAMIC_PRESSURE = 1e-6, 1e7
"""Dynamic pressures [Pa] below and above which there are no coefficients; Mach 10 at sea level has 7.1 MPa."""

MACH_SCALE = 1e-3
ALTITUDE_SCALE, LOWEST_ALTITUDE = 2.0, -2000.0
"""Scale of Mach number [1 per bit] and altitude [m per bit], and the altitude of the number 0 [m]."""

_NO_NAVIGATION = 65535

E2E_CRC, E2E_COUNTER = "E2E_CRC", "E2E_Counter"
"""Signals of the end-to-end protection, which are written when all others are."""


def strain_signal(name: str, start: int, byte_order: str) -> SignalLayout:
    """Return a strain of 16 bits."""
    return SignalLayout(
        name=name,
        start=start,
        length=16,
        byte_order=byte_order,
        kind=SIGNED,
        scale=STRAIN_SCALE,
        unit="um/m",
        minimum=-32766 * STRAIN_SCALE,
        maximum=32766 * STRAIN_SCALE,
        not_available=-32768,
        comment="Strain; -32768 (0x8000) not available, -32767 and 32767 are the ends of the converter: not valid",
    )


def float_strain_signal(name: str, start: int) -> SignalLayout:
    """Return a strain of 32 bits."""
    limit = LARGEST_FLOAT_STRAIN
    return SignalLayout(
        name=name,
        start=start,
        length=32,
        byte_order=LITTLE,
        kind=FLOAT,
        unit="um/m",
        minimum=-limit,
        maximum=limit,
        comment="Strain; NaN not available",
    )


def sample_time_signal(start: int, byte_order: str = LITTLE) -> SignalLayout:
    """Return the sender's clock of 32 bits."""
    return SignalLayout(
        name="SampleTime",
        start=start,
        length=32,
        byte_order=byte_order,
        unit="us",
        comment="When the strains were sampled, sender's clock; wraps after 71.6 min",
    )


def short_sample_time(byte_order: str) -> SignalLayout:
    """Return the sender's clock of 16 bits at the end of a frame of 8 bytes."""
    start = 55 if byte_order == BIG else 48
    return SignalLayout(name="SampleTime", start=start, length=16, byte_order=byte_order, scale=0.1, unit="ms")


def status_signal(start: int, length: int) -> SignalLayout:
    """Return the sender's own status."""
    return SignalLayout(
        name="Status",
        start=start,
        length=length,
        choices=((0, "Good"), (1, "Degraded"), (2, "DoNotUse")),
        comment="The sender's own verdict; above 1: not used",
    )


def configuration_signal(start: int, configuration: int) -> SignalLayout:
    """Return the number of the gauge assignment."""
    return SignalLayout(
        name="Configuration",
        start=start,
        length=16,
        initial=configuration,
        comment="Which gauge lies where; frames with another number are refused",
    )


def header_5() -> tuple[SignalLayout, SignalLayout]:
    """Return CRC and counter of E2E profile 5."""
    return (
        SignalLayout(
            name=E2E_CRC,
            start=0,
            length=16,
            comment="E2E profile 5: CRC-16/CCITT-FALSE over bytes 2.. and the DataID",
        ),
        SignalLayout(name=E2E_COUNTER, start=16, length=8, comment="E2E profile 5: 0 to 255, one more each time"),
    )


def header_1() -> tuple[SignalLayout, SignalLayout]:
    """Return CRC and counter of E2E profile 1."""
    return (
        SignalLayout(
            name=E2E_CRC, start=0, length=8, comment="E2E profile 1: CRC-8 over the DataID and bytes 1 to 7"
        ),
        SignalLayout(
            name=E2E_COUNTER, start=8, length=4, maximum=14, comment="E2E profile 1: 0 to 14, one more each time"
        ),
    )


def freshness_signals(start: int) -> tuple[SignalLayout, SignalLayout, SignalLayout]:
    """Return freshness value and authenticator behind the authentic bytes."""
    return (
        SignalLayout(
            name="MessageCounter",
            start=start,
            length=32,
            comment="Freshness value, low part: one more each cycle, the same in all frames of a cycle",
        ),
        SignalLayout(
            name="TripCounter",
            start=start + 32,
            length=16,
            comment="Freshness value, low bits of its high part: one more each start of the sender",
        ),
        SignalLayout(
            name="Authenticator",
            start=start + 48,
            length=64,
            comment="First 8 bytes of CMAC (AES-128) over data ID, bytes ahead of MessageCounter, freshness value",
        ),
    )


def pressure_signal(start: int, byte_order: str) -> SignalLayout:
    """Return the dynamic pressure, a float of 32 bits."""
    return SignalLayout(
        name="DynamicPressure",
        start=start,
        length=32,
        byte_order=byte_order,
        kind=FLOAT,
        unit="Pa",
        minimum=0.0,
        maximum=LARGEST_DYNAMIC_PRESSURE,
        comment="Free-stream dynamic pressure; NaN not available; 0 at rest: no coefficients, a tare is possible",
    )


def mach_signal(start: int, byte_order: str) -> SignalLayout:
    """Return the Mach number, 16 bits."""
    return SignalLayout(
        name="MachNumber",
        start=start,
        length=16,
        byte_order=byte_order,
        scale=MACH_SCALE,
        minimum=MACH_SCALE,
        maximum=65534 * MACH_SCALE,
        not_available=_NO_NAVIGATION,
        initial=_NO_NAVIGATION,
        comment="Mach number by navigation; 65535 not available",
    )


def altitude_signal(start: int, byte_order: str) -> SignalLayout:
    """Return the altitude, 16 bits."""
    return SignalLayout(
        name="Altitude",
        start=start,
        length=16,
        byte_order=byte_order,
        scale=ALTITUDE_SCALE,
        offset=LOWEST_ALTITUDE,
        unit="m",
        minimum=LOWEST_ALTITUDE + ALTITUDE_SCALE,
        maximum=LOWEST_ALTITUDE + 65534 * ALTITUDE_SCALE,
        not_available=_NO_NAVIGATION,
        initial=_NO_NAVIGATION,
        comment="Geopotential altitude by navigation; 65535 not available",
    )
