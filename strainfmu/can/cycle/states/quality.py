"""Quality of a published result: how far to trust it, and the causes that limit it."""

from __future__ import annotations

from enum import IntEnum, IntFlag

from strainfmu.estimator.health import USABLE_STATES


class Quality(IntEnum):
    """Verdict on one result. The numbers go over the bus and never change; 15 is kept for "not available"."""

    __hash__ = int.__hash__  # in C; Enum's own is a Python function

    NO_DATA = 0
    """Nothing trustworthy has been received since the start. No coefficients."""
    VALID = 1
    """Every gauge valid, fresh and end-to-end protected; the estimate is healthy."""
    UNPROTECTED = 2
    """As VALID, but without end-to-end protection of the input: complete, fresh and plausible, not proven."""
    DEGRADED = 3
    """Some gauges are left out, or the bridge is at its limits; sigma has grown accordingly."""
    SUSPECT = 4
    """The strains fit no known pressure, one gauge does not fit the others, or the flight is outside what the map
    covers, where its sigma need not hold. Coefficients for information."""
    STALE = 5
    """The input is too old, or does not change. No coefficients."""
    INVALID = 6
    """Nothing can be computed. No coefficients."""
    UNCONFIRMED = 7
    """Not proven to be the newest strains of the one sender: delay may hide, a restart may be a recording, or a
    second sender or bridge is on the bus, or its period is another. Coefficients for information."""

    has_coefficients: bool
    """Coefficients are published with this quality."""


_WITH_COEFFICIENTS = {Quality.VALID, Quality.UNPROTECTED, Quality.DEGRADED, Quality.SUSPECT, Quality.UNCONFIRMED}
for _quality in Quality:  # once, as it is asked for several times a cycle
    _quality.has_coefficients = _quality in _WITH_COEFFICIENTS

_USABLE_QUALITIES = frozenset({Quality.VALID, Quality.UNPROTECTED, Quality.DEGRADED})
_USABLE_HEALTHS = frozenset(int(state) for state in USABLE_STATES)


def is_usable(quality: Quality, health: int | None) -> bool:
    """Return whether loads may be used with their standard deviations; ``health`` is None without an estimate."""
    return quality in _USABLE_QUALITIES and health in _USABLE_HEALTHS


class Cause(IntFlag):
    """Why a result is not VALID, or less proven than before; 32 bits that go over the bus and never change.

    Bit 15 is none: in frames with room for 16 bits it says that there are causes above it.
    """

    __bool__ = int.__bool__  # in C, too

    NONE = 0
    PARTIAL_CYCLE = 1 << 0
    """Frames of the cycle are missing."""
    GAUGE_INVALID = 1 << 1
    """A gauge reports no value, is out of range, frozen, exactly zero or jumps."""
    NOT_TRUSTED = 1 << 2
    """The E2E state machine of a frame is not VALID."""
    CYCLE_CRC = 1 << 3
    """The CRC or counter over the cycle does not fit."""
    OLD = 1 << 4
    """The strains are older than allowed."""
    FROZEN = 1 << 5
    """No gauge of the cycle has changed for longer than allowed."""
    SILENT = 1 << 6
    """No cycle was received in time."""
    DYNAMIC_PRESSURE = 1 << 7
    """q_inf is missing, too old or not plausible."""
    CLOCK_JUMP = 1 << 8
    """The sender's clock or counter jumped: a restart."""
    SENDER_STATUS = 1 << 9
    """The sender itself reports that its values are degraded or not to be used."""
    HEALTH = 1 << 10
    """The estimator reports it in health.state."""
    STEP_FAILED = 1 << 11
    """The FMU refused the step, or an output is not finite."""
    OVERLOAD = 1 << 12
    """Frames were dropped or shed because time was short."""
    BUS = 1 << 13
    """The bus is passive, off, or was reopened."""
    NAVIGATION = 1 << 14
    """Mach number, altitude or a flow parameter was known and is not any more: fewer tests of the
    envelope, the quality is as before."""
    HIDDEN_DELAY = 1 << 16
    """As much delay as is allowed was taken for a slow clock of the sender; more of it may hide."""
    UNPROVEN_RESTART = 1 << 17
    """The sender's time has jumped, and nothing proves that it is not a recording."""
    SECOND_SENDER = 1 << 18
    """Frames with correct CRC whose counter belongs to other strains, or again and again out of sequence."""
    SECOND_BRIDGE = 1 << 19
    """Result frames on our identifiers that are not ours."""
    TARE_RUNNING = 1 << 20
    """Strains are collected for the zeros of the gauges; the quality is as before, as with the next two."""
    TARE_REFUSED = 1 << 21
    """A tare was asked for, and loads are not known or the strains are no zeros: zeros are as before."""
    ZEROS_TAKEN = 1 << 22
    """The zeros of the gauges are new: strains of a tare are taken off from now on."""
    TEMPERATURE = 1 << 23
    """A temperature was known and is not any more: sigma is larger, the quality is as before."""
    NOT_AUTHENTIC = 1 << 24
    """Frames were refused whose authenticator does not fit, or whose freshness value is not new; the quality is as
    before, for what is used is authentic."""
    SENSOR = 1 << 25
    """The reading of an auxiliary sensor, or thrust, was known and is not any more: the sensor is
    left out, as health says."""
    PERIOD = 1 << 26
    """The sender's period is not the stated one, so limits counted in cycles are wrong."""
    REPEATS = 1 << 27
    """The strains are an earlier cycle's, bit by bit, which noise does not allow: not used."""


MORE_CAUSES = 1 << 15
"""In frames with room for 16 bits: the result has causes above bit 15, which another frame holds."""


def low_causes(causes: Cause) -> int:
    """Return the causes in 16 bits."""
    return (int(causes) & (MORE_CAUSES - 1)) | (MORE_CAUSES if int(causes) >> 16 else 0)
