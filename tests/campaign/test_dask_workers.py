"""Campaigns on Dask workers: some die, some schedulers go or are not there, local ones listen on loopback."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import pytest
from campaign_case import Undisturbed, start, stored_hash, wait_for_journal, wait_until
from ogive import OGIVE

Run = Callable[..., tuple[int, str, str]]


class Cluster(NamedTuple):
    address: str
    workers: list[subprocess.Popen[bytes]]


def dask(folder: Path, role: str, *arguments: str) -> subprocess.Popen[bytes]:
    """Start a scheduler or a worker as a user does, listening on loopback."""
    command = [sys.executable, "-m", f"distributed.cli.dask_{role}", "--scheduler-file", str(folder / "scheduler")]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([*command, "--host", "127.0.0.1", "--no-dashboard", *arguments], cwd=folder, **quiet)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler with two worker processes, none of which knows the vehicle file."""
    folder = tmp_path / "cluster"
    folder.mkdir()
    described = folder / "scheduler"
    scheduler = dask(folder, "scheduler", "--port", "0")
    workers = []
    try:
        wait_until(lambda: described.exists() and described.stat().st_size > 0)
        workers = [dask(folder, "worker", "--nthreads", "1", "--no-nanny") for _ in range(2)]
        yield Cluster(json.loads(described.read_text())["address"], workers)
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_worker_that_is_killed_does_not_matter(
    cluster: Cluster, undisturbed: Undisturbed, tmp_path: Path
) -> None:
    """Two workers, one killed in mid-work: the file is the same as that of threads in one process."""
    output = tmp_path / "snapshots.h5"
    process = start("snapshots", OGIVE, "-o", output, "--scheduler", cluster.address)
    wait_for_journal(output, undisturbed.journal_size // 3, process)
    assert process.poll() is None
    cluster.workers[0].send_signal(signal.SIGKILL)
    printed, message = process.communicate()
    assert message == ""
    assert process.returncode == 0
    assert cluster.address in printed
    assert stored_hash(output) == undisturbed.content_hash


@pytest.mark.slow
def test_a_scheduler_that_goes_keeps_what_is_finished(undisturbed: Undisturbed, tmp_path: Path) -> None:
    output = tmp_path / "snapshots.h5"
    scheduler = dask(tmp_path, "scheduler", "--port", "0")
    described = tmp_path / "scheduler"
    worker = None
    try:
        wait_until(lambda: described.exists() and described.stat().st_size > 0)
        worker = dask(tmp_path, "worker", "--nthreads", "1", "--no-nanny")
        address = json.loads(described.read_text())["address"]
        process = start("snapshots", OGIVE, "-o", output, "--scheduler", address)
        wait_for_journal(output, undisturbed.journal_size // 3, process)
        scheduler.kill()
        _, message = process.communicate()
    finally:
        for one in (scheduler, worker):
            if one is not None:
                one.kill()
                one.wait()
    assert process.returncode == 1
    assert message == f"strainfmu: {address}: the scheduler was lost; start again to go on\n"
    assert not output.exists()
    printed, _ = start("snapshots", OGIVE, "-o", output).communicate()
    assert "15 solved now" not in printed
    assert stored_hash(output) == undisturbed.content_hash


def test_no_scheduler_is_one_line(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Port 9 of loopback, where nothing listens, asked for a second; nothing is left behind."""
    monkeypatch.setattr("builder.campaign.dask_workers.CONNECT_TIMEOUT", 1.0)
    code, _, message = run("snapshots", OGIVE, "-o", tmp_path / "snapshots.h5", "--scheduler", "tcp://127.0.0.1:9")
    assert code == 1
    assert message == "strainfmu: tcp://127.0.0.1:9: no Dask scheduler answers there\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("address", ["here", "udp://127.0.0.1:8786", "tcp://127.0.0.1:port"])
def test_no_address_is_one_line(address: str, tmp_path: Path, run: Run) -> None:
    code, _, message = run("snapshots", OGIVE, "-o", tmp_path / "snapshots.h5", "--scheduler", address)
    assert code == 2
    assert message.startswith(f"strainfmu: --scheduler: '{address}' found, must be like tcp://host:8786;")


@pytest.mark.slow
def test_local_processes_listen_on_loopback_alone_and_give_the_same(
    undisturbed: Undisturbed, tmp_path: Path
) -> None:
    """Every listening TCP socket of the campaign's processes: 127.0.0.1 (0100007F in /proc/net/tcp).

    Two processes start, and each imports what it needs.
    """
    table = Path("/proc/net/tcp")
    if not table.exists():
        pytest.skip("no /proc/net/tcp here")

    def listening(group: int) -> set[str]:
        """Return the addresses that processes of a group listen at."""
        own = set()
        for folder in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                if os.getpgid(int(folder.name)) == group:
                    own |= {os.readlink(link) for link in (folder / "fd").iterdir()}
        lines = (line.split() for line in table.read_text().splitlines()[1:])
        # Fields: number, local address, remote address, state (0A: listening) .. 9: inode.
        return {fields[1] for fields in lines if fields[3] == "0A" and f"socket:[{fields[9]}]" in own}

    output = tmp_path / "snapshots.h5"
    process = start("snapshots", OGIVE, "-o", output, "--workers", 2)
    wait_for_journal(output, 0, process)
    new = listening(process.pid)
    process.communicate()
    assert process.returncode == 0
    assert new
    assert {address.split(":")[0] for address in new} == {"0100007F"}
    assert stored_hash(output) == undisturbed.content_hash
