"""How long work tells what it is doing, without knowing who listens."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from builder.campaign.run import CampaignResult

Progress = Callable[[int, int], None]


class Reporter(Protocol):
    """Listens to a chain of stages."""

    @contextmanager
    def stage(self, title: str) -> Iterator[Progress]:
        """Begin a stage; the callback given takes (done, of)."""
        ...

    def note(self, text: str) -> None:
        """Take one line of information."""
        ...


class Silent:
    """Listens and says nothing."""

    @contextmanager
    def stage(self, title: str) -> Iterator[Progress]:
        yield lambda done, of: None

    def note(self, text: str) -> None:
        return None


def campaign_notes(result: CampaignResult) -> list[str]:
    """Say in a few lines what a campaign did and how sound its flows are."""
    snapshots, tally = result.snapshots, result.tally
    conditions, flows = len(snapshots.condition), int(snapshots.solved.sum())
    notes = [
        f"{conditions} conditions: {flows} flows, {conditions - flows} rolled from them; "
        f"{tally.solved} solved now, {tally.reused} reused"
    ]
    if np.isfinite(snapshots.momentum_error).any():
        notes.append(f"force and momentum agree within {100.0 * np.nanmax(snapshots.momentum_error):.2g} %")
    repaired = int(np.sum(snapshots.solved & (snapshots.repairs > 0)))
    if repaired:
        notes.append(f"{repaired} flows needed states repaired, {snapshots.repairs.max()} at most in one")
    if tally.solved:
        notes.append(f"{tally.seconds:.1f} s for the flows, {tally.seconds_per_flow:.2g} s for one on one worker")
    return notes
