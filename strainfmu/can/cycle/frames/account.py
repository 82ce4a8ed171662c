"""The account of received frames: every frame in exactly one class, so that the classes add up to all of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from strainfmu.can.wire.frame import EXTENDED_FLAG

LISTED_IDENTIFIERS = 64
"""Maximum number of unknown identifiers counted one by one: a babbling bus must not fill the memory."""


class FrameClass(Enum):
    """Fate of a frame."""

    # By identity, as the equality of members is. Enum's own hash is a Python function, called many times a cycle.
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


_UNKNOWN = FrameClass.UNKNOWN_IDENTIFIER


@dataclass(kw_only=True)
class FrameAccount:
    """Counts of frames by class.

    Attributes
    ----------
    received : number of all frames.
    classes : number of frames in each class.
    pending : number of frames in the open cycle.
    unknown : count per unknown key, of the first LISTED_IDENTIFIERS keys.
    first_time, last_time : of the first and the last frame of a class, local monotonic clock [s].
    """

    received: int = 0
    pending: int = 0
    classes: dict[FrameClass, int] = field(default_factory=lambda: dict.fromkeys(FrameClass, 0))
    unknown: dict[int, int] = field(default_factory=dict)
    first_time: dict[FrameClass, float] = field(default_factory=dict)
    last_time: dict[FrameClass, float] = field(default_factory=dict)

    def settle(self, kind: FrameClass, time: float, count: int = 1, last: float | None = None) -> None:
        """Put ``count`` received frames into their class, from ``time`` to ``last`` [s], or all at ``time``."""
        self.classes[kind] += count
        if kind not in self.first_time:
            self.first_time[kind] = time
        self.last_time[kind] = time if last is None else last

    def refuse(self, kind: FrameClass, key: int, time: float) -> None:
        """Put a refused frame into its class; count its key if that is unknown."""
        self.settle(kind, time)
        if kind is not _UNKNOWN:
            return
        if key in self.unknown or len(self.unknown) < LISTED_IDENTIFIERS:
            self.unknown[key] = self.unknown.get(key, 0) + 1

    @property
    def rejected(self) -> int:
        """Number of frames in any class but USED."""
        return sum(self.classes.values()) - self.classes[FrameClass.USED]

    @property
    def unaccounted(self) -> int:
        """Number of received frames less those in a class or pending: 0, or the bridge has a defect."""
        return self.received - self.pending - sum(self.classes.values())

    def plus(self, other: FrameAccount) -> FrameAccount:
        """Return the sum of two accounts of different frames."""
        others = other.classes
        total = FrameAccount(
            received=self.received + other.received,
            pending=self.pending + other.pending,
            classes={kind: count + others[kind] for kind, count in self.classes.items()},
            unknown=self.unknown.copy(),
            first_time=self.first_time.copy(),
            last_time=self.last_time.copy(),
        )
        for key, count in other.unknown.items():
            total.unknown[key] = total.unknown.get(key, 0) + count
        for kind, time in other.first_time.items():
            total.first_time[kind] = min(time, total.first_time.get(kind, time))
        for kind, time in other.last_time.items():
            total.last_time[kind] = max(time, total.last_time.get(kind, time))
        return total

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
