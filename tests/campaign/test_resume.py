"""A campaign that is ended at any moment goes on where it was, and its result does not show it."""

import os
import random
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from campaign_case import Undisturbed, start, stored_hash, wait_for_journal
from ogive import OGIVE

from builder.campaign.journal import journal_path

pytestmark = pytest.mark.skipif(os.name != "posix", reason="process groups and SIGKILL are POSIX")

Run = Callable[..., tuple[int, str, str]]

KILLS = 5


@pytest.mark.slow
def test_five_kills_leave_no_trace(undisturbed: Undisturbed, tmp_path: Path) -> None:
    """SIGKILL to the whole group, the k-th at a random moment of the k-th sixth; in processes and in threads."""
    moments = random.Random(4)
    output = tmp_path / "snapshots.h5"
    for kill in range(KILLS):
        share = (kill + moments.random()) / (KILLS + 1)
        process = start("snapshots", OGIVE, "-o", output, "--workers", 2 if kill % 2 else 0)
        wait_for_journal(output, int(share * undisturbed.journal_size), process)
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        assert process.returncode == -signal.SIGKILL
        assert not output.exists()
    printed, message = start("snapshots", OGIVE, "-o", output).communicate()
    assert message == ""
    assert "15 flows" in printed
    assert "15 solved now" not in printed
    assert stored_hash(output) == undisturbed.content_hash
    assert list(tmp_path.iterdir()) == [output]


@pytest.mark.parametrize("workers", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_ctrl_c_keeps_what_is_finished(workers: int, undisturbed: Undisturbed, tmp_path: Path, run: Run) -> None:
    """SIGINT to the whole group, as a terminal sends it: one line, exit code 130, and no word of the workers.

    Before that, a second campaign on the same file is refused.
    """
    output = tmp_path / "snapshots.h5"
    process = start("snapshots", OGIVE, "-o", output, "--workers", workers)
    wait_for_journal(output, undisturbed.journal_size // 8, process)
    os.killpg(process.pid, signal.SIGSTOP)
    try:
        code, _, message = run("snapshots", OGIVE, "-o", output)
    finally:
        os.killpg(process.pid, signal.SIGINT)
        os.killpg(process.pid, signal.SIGCONT)
    assert (code, message) == (1, f"strainfmu: {output}: another campaign is writing it\n")
    _, message = process.communicate()
    assert process.returncode == 130, message
    assert message.count("\n") == 1
    assert message.startswith("strainfmu: interrupted; ")
    assert f" of 15 flows are kept in {journal_path(output)}" in message
    kept = int(message.split("; ")[1].split(" of ")[0])
    assert kept >= 1
    _, printed, _ = run("snapshots", OGIVE, "-o", output)
    assert f"{15 - kept} solved now, {kept} reused" in " ".join(printed.split())
    assert stored_hash(output) == undisturbed.content_hash
