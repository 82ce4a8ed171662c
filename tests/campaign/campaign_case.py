"""Common parts of the tests of campaigns: a small vehicle, and the command in a process of its own."""

import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py

from builder.aero.engines.registry import make_engine
from builder.campaign.campaign_run import Campaign, CampaignResult, run_campaign, vehicle_campaign
from builder.campaign.journal import encode_record, journal_path
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import load_flows
from builder.reporting import Silent
from builder.vehicle.file import Vehicle
from builder.vehicle.flight_conditions import ConditionSet
from strainfmu.flight_condition import FlightCondition

THREADS = Scheduling(workers=0)

# Shells that start a command in the background let it ignore SIGINT: taken back here.
COMMAND = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
if __name__ == "__main__":
    from strainfmu.cli.main import main
    main()
"""


@dataclass(frozen=True)
class Undisturbed:
    """A finished campaign: its file, content hash, and the bytes its journal had at the end."""

    path: Path
    content_hash: str
    journal_size: int


def campaign_of(vehicle: Vehicle, conditions: Sequence[FlightCondition] = ()) -> Campaign:
    """Return the campaign over ``conditions``, or over those of the vehicle file."""
    sets = [ConditionSet("test", tuple(conditions))] if conditions else []
    return vehicle_campaign(vehicle, make_engine(vehicle, None, vehicle.resolution.map), sets)


def run(campaign: Campaign, path: Path) -> CampaignResult:
    """Run ``campaign`` in threads of this process."""
    return run_campaign(campaign, path, THREADS, Silent())


def undisturbed_campaign(vehicle: Vehicle, path: Path) -> Undisturbed:
    """Run the campaign of ``vehicle`` to its end, in one go."""
    run(campaign_of(vehicle), path)
    kept = load_flows(path)
    size = sum(len(encode_record(kept.fingerprint, flow)) for flow in kept.flows)
    return Undisturbed(path, stored_hash(path), size)


def stored_hash(path: Path) -> str:
    """Return the content hash that a file states."""
    with h5py.File(path, "r") as file:
        return str(file.attrs["content_hash"])


def start(*arguments: object) -> subprocess.Popen[str]:
    """Start ``strainfmu`` with arguments in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-c", COMMAND, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for_journal(output: Path, size: int, process: subprocess.Popen[str]) -> None:
    """Return as soon as the journal of ``output`` holds more than ``size`` bytes, or the process has ended."""
    journal = journal_path(output)
    wait_until(lambda: process.poll() is not None or (journal.exists() and journal.stat().st_size > size))


def wait_until(holds: Callable[[], bool]) -> None:
    """Look often; give up after a minute."""
    give_up = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < give_up
        time.sleep(0.002)
