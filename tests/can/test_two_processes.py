"""Sender and bridge as two processes over udp_multicast, the bridge by its command."""

import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from bridge_table import LATENCY, BridgeTable
from multicast import free_port
from sender_process import FOREIGN
from state_estimates import state_gain
from synthetic_vehicle import synthetic_inverse_map

from strainfmu.can.profiles import Identifiers
from strainfmu.can.quality import Cause, Quality
from strainfmu.can.result_frames import result_layouts
from strainfmu.can.signals import SignalPlan
from strainfmu.cosim.estimators.description import gauge_names_of
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, save_inverse_map
from strainfmu.fmu.export import export_estimator

GROUP = "239.74.163.77"
N_GAUGES = 54
OF_LATENESS = (
    Cause.NOT_TRUSTED | Cause.PARTIAL_CYCLE | Cause.OLD | Cause.SILENT | Cause.OVERLOAD | Cause.DYNAMIC_PRESSURE
)
"""Why a result of a sender without faults may be other than VALID: at its start, and where the host is late."""
STRAIN_FRAMES = 2
SENDER = Path(__file__).with_name("sender_process.py")
STRAINFMU = [sys.executable, "-c", "from strainfmu.cli.main import main; main()"]


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory: pytest.TempPathFactory) -> tuple[InverseMap, Path]:
    """Return a synthetic map of 54 gauges and its FMU."""
    folder = tmp_path_factory.mktemp("can")
    inverse_map = synthetic_inverse_map(1, N_GAUGES)
    save_inverse_map(inverse_map, folder / "map.h5")
    export_estimator(folder / "map.h5", folder / "estimator.fmu")
    return inverse_map, folder / "estimator.fmu"


@dataclass(frozen=True)
class Run:
    """What a run printed, and what the sender received.

    Attributes
    ----------
    bridge : its summary.
    names, values : signals of the results, and their (n, k) values.
    results_dropped : datagrams that the system dropped ahead of the sender.
    is_late : sender or bridge was held up by the host in more than one cycle of a hundred.
    """

    bridge: BridgeTable
    names: list[str]
    values: np.ndarray
    results_dropped: int
    is_late: bool

    def column(self, name: str) -> np.ndarray:
        return self.values[:, self.names.index(name)]


def flight(inverse_map: InverseMap, n_cycles: int) -> tuple[np.ndarray, np.ndarray]:
    """Return strains (n, n_d) [m/m] of pressure states that move, and q_inf (n,) [Pa]."""
    cycle = np.arange(n_cycles)[:, None]
    state = 1e5 * np.sin(0.05 * cycle + np.arange(3.0))
    return inverse_map.mean_strain + state @ inverse_map.state_operator.T, 9e4 + 5.0 * (cycle[:, 0] % 1000)


def fly(vehicle: tuple[InverseMap, Path], cycle_time: float, n_cycles: int, *mode: str) -> Run:
    """Start the bridge, then the sender, on a port of their own; end the bridge by SIGTERM."""
    (inverse_map, fmu), port = vehicle, free_port()
    given, out = fmu.with_name(f"given_{port}.npz"), fmu.with_name(f"results_{port}.npz")
    strain, pressure = flight(inverse_map, n_cycles)
    np.savez(given, names=np.array(gauge_names_of(fmu)), strain=strain, pressure=pressure)
    bridge = subprocess.Popen(
        [
            *STRAINFMU,
            *("bridge", str(fmu), "--interface", "udp_multicast", "--channel", GROUP),
            *("--bus-option", f"port={port}", "--set", f"input.cycle_time_ms={1e3 * cycle_time:g}"),
            *("--set", "trust.restart=accept"),  # this sender hears no result
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert bridge.stdout is not None
        first = bridge.stdout.readline()
        assert "54 gauges" in first
        command = [sys.executable, str(SENDER), GROUP, str(port), str(cycle_time), str(given), str(out)]
        subprocess.run([*command, *mode], check=True, timeout=300)
        bridge.send_signal(signal.SIGTERM)
        printed, errors = bridge.communicate(timeout=120)
    finally:
        bridge.kill()
    assert bridge.returncode == 0, errors
    assert errors == ""
    plan = SignalPlan(result_layouts("fd", Identifiers(), cycle_time)[0])
    heard = np.load(out)
    values = np.array([plan.physical(plan.raw(data.tobytes())) for data in heard["results"]])
    print(printed)
    table = BridgeTable(printed)
    is_late = (
        bool(np.mean(heard["late"] > 0.2 * cycle_time) > 0.01) or table.percentile(LATENCY) > 0.2 * cycle_time
    )
    return Run(table, [signal.name for signal in plan.signals], values, int(heard["dropped"]), is_late)


def check(run: Run, vehicle: tuple[InverseMap, Path], cycle_time: float, n_cycles: int, lossless: bool) -> None:
    """Hold every answer against the direct estimate of what was sent, and the account against both."""
    answers = run.column("SampleTime") != 2**32 - 1
    cycles = np.rint(run.column("SampleTime")[answers] * 1e-6 / cycle_time).astype(int)
    assert len(set(cycles.tolist())) == len(cycles), "one answer for a cycle"
    missing = sorted(set(range(n_cycles)) - set(cycles.tolist()))
    causes = run.column("Causes")[answers].astype(int)
    # A cycle without an answer has lost all its frames of strains, a partial one of them each.
    partial = int(((causes & Cause.PARTIAL_CYCLE) != 0).sum())
    bridge, results_lost = run.bridge, run.bridge.results_lost + run.results_dropped
    account = (
        f"{len(missing)} cycles not answered, {partial} partial; {bridge.frames_lost} frames late or dropped, "
        f"{results_lost} results lost"
    )
    print(account)
    if lossless:
        assert STRAIN_FRAMES * (len(missing) - results_lost) + partial <= bridge.frames_lost, account
    quality = run.column("Quality")[answers].astype(int)
    valid = quality == Quality.VALID
    if lossless:
        # Three cycles until it is trusted. A host that stands still makes others late or partial; they report it.
        assert run.is_late or valid.sum() >= 0.8 * n_cycles
        assert (causes[~valid] != 0).all()
        # Behind lost or late cycles delay may hide: cause 16, which the frame of results only says to be above 15.
        hides = np.where(is_behind_pause(run, cycle_time), 1 << 15, 0)
        # A partial cycle lacks the gauges of a frame, and health says so.
        lacks_gauges = np.where(causes & Cause.PARTIAL_CYCLE, int(Cause.HEALTH), 0)
        explained = int(OF_LATENESS) | hides[answers] | lacks_gauges
        assert ((causes[~valid] & ~explained[~valid]) == 0).all()
    found = np.column_stack([run.column(name) for name in COEFFICIENT_NAMES])[answers]
    largest = largest_error(vehicle[0], n_cycles, cycles[valid], found[valid])
    print(f"{valid.sum()} of {n_cycles} cycles VALID; largest error {largest:.3f} of the bound by quantisation")
    assert largest <= 1.0
    assert bridge.number("frames: not accounted for") == 0
    # Own results come back on udp_multicast; what the system dropped may be those as well.
    foreign = bridge.number("frames: own frame") + bridge.number("frames: unknown identifier")
    taken = bridge.number("frames: received") - foreign
    assert taken <= 4 * n_cycles <= taken + bridge.number("dropped by the system")


def is_behind_pause(run: Run, cycle_time: float) -> np.ndarray:
    """Return for each result (n,) whether no answer is before it, or cycles are missing there, or it is late."""
    time = np.where(run.column("SampleTime") == 2**32 - 1, -1e9, 1e-6 * run.column("SampleTime"))
    before = np.concatenate([[-1e9], time[:-1]])
    return (time - before > 1.5 * cycle_time) | (run.column("Age") > 1e3 * cycle_time)


def largest_error(inverse_map: InverseMap, n_cycles: int, cycles: np.ndarray, found: np.ndarray) -> float:
    """Return the largest error of coefficients (n, 5), over what quantisation can do at worst."""
    estimator = Estimator(inverse_map)
    strain, pressure = flight(inverse_map, n_cycles)
    length = inverse_map.reference_length
    reference = inverse_map.reference_area * np.array([1.0, 1.0, 1.0, length, length])
    # Half a quantum on every strain, all in the worst direction; then float32 of the result and of q_inf.
    on_loads = 0.125e-6 * np.abs(inverse_map.load_per_state @ state_gain(inverse_map)).sum(axis=1)
    largest = 0.0
    for cycle, coefficients in zip(cycles.tolist(), found, strict=True):
        direct = estimator.estimate(strain[cycle], float(pressure[cycle])).coefficients
        bound = on_loads / (pressure[cycle] * reference) + 2e-7 * np.abs(direct)
        largest = max(largest, float((np.abs(coefficients - direct) / bound).max()))
    return largest


@pytest.mark.slow
def test_three_seconds_at_100_hz(vehicle: tuple[InverseMap, Path]) -> None:
    run = fly(vehicle, 0.01, 300)
    check(run, vehicle, 0.01, 300, lossless=True)


def test_foreign_frames_and_malformed_datagrams_between_the_cycles(
    vehicle: tuple[InverseMap, Path],
) -> None:
    run = fly(vehicle, 0.01, 150, "flood")
    check(run, vehicle, 0.01, 150, lossless=True)
    assert run.bridge.number("frames: unknown identifier") == 75 * FOREIGN
    assert run.bridge.number("messages that are no frames") == 75


@pytest.mark.slow
def test_one_minute_at_100_hz(vehicle: tuple[InverseMap, Path]) -> None:
    run = fly(vehicle, 0.01, 6000)
    check(run, vehicle, 0.01, 6000, lossless=True)


@pytest.mark.slow
def test_one_minute_at_1_khz_with_all_losses_accounted_for(
    vehicle: tuple[InverseMap, Path],
) -> None:
    run = fly(vehicle, 0.001, 60_000)
    check(run, vehicle, 0.001, 60_000, lossless=False)
