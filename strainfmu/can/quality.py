"""What goes over the bus about a result, and its words; the account of received frames."""

import tomllib
from dataclasses import dataclass, field
from enum import Enum, IntEnum, IntFlag
from functools import cache
from math import isnan
from pathlib import Path
from typing import Any

from strainfmu.can.frame import EXTENDED_FLAG, Frame

LISTED_IDENTIFIERS = 64
"""Maximum number of unknown identifiers counted one by one: a babbling bus must not fill the memory."""


class FrameClass(Enum):
    """Fate of a frame, in the order of bus.h."""

    __hash__ = object.__hash__

    USED = "used"
    OWN = "own frame"
    SECOND_BRIDGE = "result of another bridge"
    UNKNOWN_IDENTIFIER = "unknown identifier"
    ERROR_FRAME = "error frame"
    REMOTE_FRAME = "remote frame"
    WRONG_FORMAT = "wrong length or format"
    SHED = "shed: sender babbles"
    CORRUPT = "CRC does not fit"
    NOT_AUTHENTIC = "authenticator does not fit"
    NOT_FRESH = "freshness value not new"
    WRONG_CONFIGURATION = "other configuration"
    OLD_SESSION = "of an earlier run of the sender"
    REPEATED = "repeated counter"
    WRONG_SEQUENCE = "counter out of sequence"
    LATE = "older than its cycle"
    NOT_TRUSTED = "E2E state not VALID"
    UNVERIFIED = "in a cycle whose CRC does not fit or is missing"
    TOO_OLD = "in a cycle that is too old, frozen or of a clock that jumped"
    NOT_USABLE = "right, but holds no usable value"
    OVERRUN = "dropped: queue full"
    SKIPPED = "skipped: newer cycles waited"
    UNFINISHED = "in a cycle that was open at the end"


NUMBER_OF = {kind: number for number, kind in enumerate(FrameClass)}
"""Number of a class in compiled code. An iteration of the Enum itself takes many times as long as of these."""


@dataclass(kw_only=True)
class FrameAccount:
    """Counts of frames by class at one time.

    Attributes
    ----------
    received : number of all frames.
    pending : number of frames in the open cycle.
    classes : number of frames in each class.
    unknown : count per unknown key, of the first LISTED_IDENTIFIERS keys.
    first_time, last_time : of the first and the last frame of a class, local monotonic clock [s].
    """

    received: int = 0
    pending: int = 0
    classes: dict[FrameClass, int] = field(default_factory=lambda: dict.fromkeys(NUMBER_OF, 0))
    unknown: dict[int, int] = field(default_factory=dict)
    first_time: dict[FrameClass, float] = field(default_factory=dict)
    last_time: dict[FrameClass, float] = field(default_factory=dict)

    @property
    def unaccounted(self) -> int:
        """Number of received frames less those in a class or pending: 0, or the bridge has a defect."""
        return self.received - self.pending - sum(self.classes.values())

    def rows(self) -> list[tuple[str, int]]:
        """Return the rows to show: received, then every class that is not empty."""
        rows = [("received", self.received)]
        rows += [(kind.value, count) for kind, count in self.classes.items() if count]
        if self.pending:
            rows.append(("in an open cycle", self.pending))
        return rows

    def unknown_text(self) -> str:
        """Return the unknown identifiers with their counts, most frequent first."""
        ranked = sorted(self.unknown.items(), key=lambda item: -item[1])
        return ", ".join(f"0x{key & ~EXTENDED_FLAG:X}: {count}" for key, count in ranked[:8])


def account_of(record: Any, unknown: dict[int, int]) -> FrameAccount:
    """Return the account that compiled code keeps in ``record``."""
    times = [
        {kind: time for kind, time in zip(NUMBER_OF, record[name].tolist(), strict=True) if not isnan(time)}
        for name in ("first", "last")
    ]
    return FrameAccount(
        received=int(record["received"]),
        pending=int(record["pending"]),
        classes=dict(zip(NUMBER_OF, record["count"].tolist(), strict=True)),
        unknown=dict(unknown),
        first_time=times[0],
        last_time=times[1],
    )


class Quality(IntEnum):
    """Verdict on one result, in words.toml. Numbers never change; 15 is kept for "not available"."""

    __hash__ = int.__hash__  # in C; Enum's own is a Python function

    NO_DATA = 0
    VALID = 1
    UNPROTECTED = 2
    DEGRADED = 3
    SUSPECT = 4
    STALE = 5
    INVALID = 6
    UNCONFIRMED = 7

    has_coefficients: bool
    """Coefficients are published with this quality."""


_WITH_COEFFICIENTS = {Quality.VALID, Quality.UNPROTECTED, Quality.DEGRADED, Quality.SUSPECT, Quality.UNCONFIRMED}
for _quality in Quality:  # once, as it is asked for several times a cycle
    _quality.has_coefficients = _quality in _WITH_COEFFICIENTS


class Cause(IntFlag):
    """Why a result is not VALID, or less proven than before, in words.toml; 32 bits that never change.

    Bit 15 is none: in frames with room for 16 bits it says that there are causes above it.
    """

    __bool__ = int.__bool__  # in C, too

    NONE = 0
    PARTIAL_CYCLE = 1 << 0
    GAUGE_INVALID = 1 << 1
    NOT_TRUSTED = 1 << 2
    CYCLE_CRC = 1 << 3
    OLD = 1 << 4
    FROZEN = 1 << 5
    SILENT = 1 << 6
    DYNAMIC_PRESSURE = 1 << 7
    CLOCK_JUMP = 1 << 8
    SENDER_STATUS = 1 << 9
    HEALTH = 1 << 10
    STEP_FAILED = 1 << 11
    OVERLOAD = 1 << 12
    BUS = 1 << 13
    NAVIGATION = 1 << 14
    HIDDEN_DELAY = 1 << 16
    UNPROVEN_RESTART = 1 << 17
    SECOND_SENDER = 1 << 18
    SECOND_BRIDGE = 1 << 19
    TARE_RUNNING = 1 << 20
    TARE_REFUSED = 1 << 21
    ZEROS_TAKEN = 1 << 22
    TEMPERATURE = 1 << 23
    NOT_AUTHENTIC = 1 << 24
    SENSOR = 1 << 25
    PERIOD = 1 << 26


# --- the bus --------------------------------------------------------------------------------------------------

_CONTROLLER, _BUS_OFF, _RESTARTED = 0x04, 0x40, 0x100
_WARNING, _PASSIVE, _ACTIVE = 0x0C, 0x30, 0x40
"""Bits of an error frame's identifier, and of its second byte if the controller reports its state."""


class BusState(IntEnum):
    """State of the controller; the numbers go over the bus and never change."""

    ERROR_ACTIVE = 0
    ERROR_WARNING = 1
    ERROR_PASSIVE = 2
    BUS_OFF = 3
    DISCONNECTED = 4


def state_after(state: BusState, frame: Frame) -> BusState:
    """Return the state that the error frame ``frame`` leaves the controller in."""
    if frame.identifier & _BUS_OFF:
        return BusState.BUS_OFF
    if frame.identifier & _RESTARTED:
        return BusState.ERROR_ACTIVE
    if frame.identifier & _CONTROLLER and len(frame.data) > 1:
        flags = frame.data[1]
        if flags & _PASSIVE:
            return BusState.ERROR_PASSIVE
        if flags & _WARNING:
            return BusState.ERROR_WARNING
        if flags & _ACTIVE:
            return BusState.ERROR_ACTIVE
    return state


# --- words ----------------------------------------------------------------------------------------------------

HEALING = "healing: good again, not long enough"
REASONS = (
    "",
    "no frame",
    "frame not trusted",
    "no value or out of signal range",
    "beyond sensor range",
    "jumps",
    "frozen",
    "exactly zero",
    HEALING,
    FrameClass.UNVERIFIED.value,
    FrameClass.REPEATED.value,
    FrameClass.WRONG_SEQUENCE.value,
    FrameClass.TOO_OLD.value,
)
"""Why a gauge is not used, in the order of bus.h; "" of one that is."""


@cache
def all_words() -> dict[str, dict[str, str]]:
    """Return the words by kind (quality, cause, bus, health) and name."""
    return tomllib.loads(Path(__file__).with_name("words.toml").read_text("utf-8"))
