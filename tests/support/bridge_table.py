"""The summary that a bridge prints at its end, and what it says of cycles without an answer."""

import re
from dataclasses import dataclass

from strainfmu.can.quality import FrameClass

OF_LATE_FRAMES = (FrameClass.LATE, FrameClass.WRONG_SEQUENCE, FrameClass.OVERRUN, FrameClass.SKIPPED)
"""Classes of the frames of cycles without an answer. A cycle ends half a period behind its first frame, which is
the sender's state; strains that come later are older than their cycle."""

LATENCY = "last frame in to results out"


@dataclass(frozen=True)
class BridgeTable:
    """What a bridge has ``printed``."""

    printed: str

    def row(self, name: str) -> str:
        """Return the text beside a name, "" if there is no such row."""
        match = re.search(rf"{re.escape(name)}\s*│\s*([^│]*?)\s*│", self.printed)
        return match[1] if match else ""

    def number(self, name: str) -> int:
        """Return the number beside a name, 0 if there is no such row."""
        match = re.match(r"\d+", self.row(name))
        return int(match[0]) if match else 0

    @property
    def frames_lost(self) -> int:
        """Number of frames that the bridge refused, or did not get, since a process was late."""
        late = sum(self.number(f"frames: {kind.value}") for kind in OF_LATE_FRAMES)
        return late + self.number("dropped by the system")

    @property
    def results_lost(self) -> int:
        """Number of frames that the bridge could not send."""
        match = re.search(r"(\d+) failed", self.row("frames sent"))
        assert match
        return int(match[1])

    def percentile(self, name: str) -> float:
        """Return the time beside a name that all but one in a hundred keep [s], 0 if there is none."""
        match = re.search(r"p99 ([\d.]+)", self.row(name))
        return 1e-3 * float(match[1]) if match else 0.0


def is_late(bridge: str, sender: str, cycle_time: float) -> bool:
    """Return whether the host held one of both processes up, by what they have printed."""
    late = BridgeTable(bridge).percentile(LATENCY), BridgeTable(sender).percentile("behind their time")
    return max(late) > 0.2 * cycle_time
