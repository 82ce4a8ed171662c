"""Summary of a campaign, in the lines that a user reads."""

from __future__ import annotations

import numpy as np

from builder.campaign.campaign_run import CampaignResult
from builder.campaign.failures import failed_conditions, failure_lines


def campaign_notes(result: CampaignResult) -> list[str]:
    """Return in a few lines what a campaign did and how accurate its flows are."""
    snapshots, tally = result.snapshots, result.tally
    conditions, flows = len(snapshots.condition), int(snapshots.solved.sum())
    notes = [
        f"{conditions} conditions: {flows} flows, {conditions - flows} rolled from them; "
        f"{tally.solved} solved now, {tally.reused} reused"
    ]
    if np.isfinite(snapshots.momentum_error).any():
        balance = f"force and momentum agree within {100.0 * np.nanmax(snapshots.momentum_error):.2g} %"
        if snapshots.mass_error is not None:
            balance += f", mass is conserved within {100.0 * np.nanmax(snapshots.mass_error):.2g} %"
        notes.append(balance)
    repaired = int(np.sum(snapshots.solved & (snapshots.repairs > 0)))
    if repaired:
        notes.append(f"{repaired} flows needed states repaired, {snapshots.repairs.max()} at most in one")
    if tally.solved:
        notes.append(f"{tally.seconds:.1f} s for the flows, {tally.seconds_per_flow:.2g} s for one on one worker")
    failed = failed_conditions(snapshots)
    if failed:
        notes.append(f"warning: {len(failed)} of {conditions + len(failed)} conditions are not in the result")
    return notes + failure_lines(failed)
