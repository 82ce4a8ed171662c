"""The flow that is marched."""

from __future__ import annotations

from dataclasses import dataclass

from builder.aero.euler.scheme.reconstruction import Stream
from strainfmu.errors import FlowReachError


@dataclass(frozen=True)
class Flow:
    """The flow to march: its free stream, and its name in messages."""

    mach_number: float
    stream: Stream
    name: str

    def refusal(self, reason: str) -> FlowReachError:
        return FlowReachError(f"euler: {reason} for {self.name}: outside the solver's reach")
