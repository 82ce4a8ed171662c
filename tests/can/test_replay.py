"""Replay: the results of a live run again, from the log alone."""

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from bus_run import CYCLE, LiveRun, live_run
from can_faults import Fault, FaultKind
from other_load_maps import with_own_further
from scaled_maps import scaled_map
from sweeps import sweep
from synthetic_vehicle import SyntheticFiles

from strainfmu.can.log_description import sidecar
from strainfmu.can.machine import Result
from strainfmu.can.options import BridgeOptions
from strainfmu.can.quality import FrameClass
from strainfmu.can.recording import LOG_SUFFIXES
from strainfmu.can.replay import ReplaySummary, replay_log
from strainfmu.cli.commands.can_bus import summary_rows
from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.cosim.estimators.source import open_step
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.export import export_estimator

Run = Callable[..., tuple[int, str, str]]

FAULTS = (
    Fault(kind=FaultKind.LOSS, start=15, cycles=4, seed=1),
    Fault(kind=FaultKind.STUCK_GAUGE, start=25, cycles=30, seed=2),
    Fault(kind=FaultKind.RESTART, start=40, cycles=2, seed=3),
)


def recorded(options: BridgeOptions | None) -> BridgeOptions:
    assert options is not None
    return options


def replayed(log: Path, fmu: Path) -> tuple[list[Result], ReplaySummary]:
    results: list[Result] = []
    with open_step(fmu) as ready:
        summary = replay_log(
            log, fmu, step=ready.step, gauge_names=ready.gauge_names, options=recorded, on_result=results.append
        )
    return results, summary


def check_equal(run: LiveRun, results: list[Result]) -> None:
    """Compare every published result with its replay, bit by bit; a bridge that stood still may report STALE."""
    assert len(results) == len(run.results)
    for live, again in zip(run.results, results, strict=True):
        assert (again.counter, again.sample_time) == (live.counter, live.sample_time)
        np.testing.assert_array_equal(again.strain, live.strain)
        if live.quality.has_coefficients:
            assert (again.quality, again.causes, again.health) == (live.quality, live.causes, live.health)
            np.testing.assert_array_equal(again.coefficients, live.coefficients)
            np.testing.assert_array_equal(again.coefficients_std, live.coefficients_std)
            assert again.chi_square == live.chi_square


def test_cycles_that_a_live_bridge_skipped_are_skipped_again(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """Behind result 30 it stands still for 12 cycles: those that waited for more than 2.5 are not answered."""
    log = tmp_path / "run.blf"
    run = live_run(synthetic.estimator_1, "replay-skips", 80, record=log, stall=(30, 12 * CYCLE))
    assert run.summary.account.classes[FrameClass.SKIPPED] >= 10
    results, summary = replayed(log, synthetic.estimator_1)
    check_equal(run, results)
    assert summary.account.classes[FrameClass.SKIPPED] == run.summary.account.classes[FrameClass.SKIPPED]


@pytest.mark.parametrize("suffix", sweep(LOG_SUFFIXES, [".blf"]))
def test_coefficients_of_a_live_run_bit_by_bit(synthetic: SyntheticFiles, tmp_path: Path, suffix: str) -> None:
    log = tmp_path / f"run{suffix}"
    run = live_run(synthetic.estimator_1, f"replay{suffix}", 70, FAULTS, record=log)
    assert sum(result.quality.has_coefficients for result in run.results) > 20
    results, summary = replayed(log, synthetic.estimator_1)
    check_equal(run, results)
    assert summary.account.rows() == run.summary.account.rows()
    assert summary.account.unaccounted == 0
    assert summary.notes == []
    # Result frames as they were on the bus; those may differ that went out late.
    assert summary.compared >= len(run.results) - 3
    assert summary.equal >= summary.compared - 3


def test_replay_of_a_classic_profile(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    log = tmp_path / "run.log"
    run = live_run(synthetic.estimator_1, "replay_be", 40, record=log, profile="classic-le")
    results, summary = replayed(log, synthetic.estimator_1)
    check_equal(run, results)
    assert summary.compared > 100  # five frames per result
    assert summary.equal >= 0.9 * summary.compared


def test_navigation_is_replayed_counted_and_written(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    log, out = tmp_path / "run.blf", tmp_path / "run.h5"
    live = live_run(synthetic.estimator_1, "replay_nav", 40, record=log, navigated=True)
    known = [result for result in live.results if np.isfinite(result.mach_number)]
    assert len(known) > 30
    rows = dict(summary_rows(live.summary))
    assert rows["results with Mach number and altitude"] == str(len(known))
    assert int(rows["health OK"]) > 30
    assert int(rows["cause NOT_TRUSTED: a frame is not trusted end to end"]) < 10
    code, printed, errors = run("replay", log, synthetic.estimator_1, "-o", out)
    assert (code, errors) == (0, "")
    assert "results with Mach number and altitude" in printed
    assert "health OK" in printed
    with h5py.File(out) as file:
        np.testing.assert_array_equal(file["mach_number"][()], [r.mach_number for r in live.results])
        np.testing.assert_array_equal(file["altitude"][()], [r.altitude for r in live.results])
        np.testing.assert_array_equal(file["health.envelope_score"][()], [r.envelope_score for r in live.results])
        assert file["altitude"].attrs["unit"] == "m"


def test_rolling_moment_and_section_loads_are_recorded_replayed_and_written(tmp_path: Path, run: Run) -> None:
    held = with_own_further(scaled_map(2, seed=4, n=6))
    save_inverse_map(replace(held, gauge_names=tuple(f"G{i}" for i in range(6))), tmp_path / "map.h5")
    fmu, log, out = tmp_path / "estimator.fmu", tmp_path / "run.blf", tmp_path / "run.h5"
    export_estimator(tmp_path / "map.h5", fmu)
    live = live_run(fmu, "replay_sections", 40, record=log)
    results, summary = replayed(log, fmu)
    check_equal(live, results)
    # LoadEstimate, RollingMoment and three sections of every result; those may differ that went out late.
    assert summary.compared >= 5 * (len(live.results) - 3)
    assert summary.equal >= summary.compared - 15
    code, _, errors = run("replay", log, fmu, "-o", out)
    assert (code, errors) == (0, "")
    with h5py.File(out) as file:
        torsion, std = file["section.torsion[3]"], file["sigma.rolling_moment"]
        known = [r.other_outputs["section.torsion[3]"] if r.quality.has_coefficients else np.nan for r in results]
        np.testing.assert_array_equal(torsion[()], known)
        assert torsion.attrs["unit"] == std.attrs["unit"] == "N m"
        assert np.isfinite(known).sum() > 20


def test_replay_is_deterministic_and_needs_no_description_of_a_foreign_log(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    log = tmp_path / "run.blf"
    live = live_run(synthetic.estimator_1, "replay_foreign", 40, record=log)
    sidecar(log).unlink()
    outputs = []
    for name in ("a.csv", "b.csv"):
        code, out, errors = run("replay", log, synthetic.estimator_1, "-o", tmp_path / name, "--profile", "fd64")
        assert (code, errors) == (0, "")
        assert "no description next to it" in " ".join(out.split())
        outputs.append((tmp_path / name).read_bytes())
    assert outputs[0] == outputs[1]
    rows = list(csv.DictReader(outputs[0].decode().splitlines()))
    answered = {r.counter: r for r in live.results if r.quality.has_coefficients}
    compared = 0
    for row in rows:
        if row["C_N [1]"] != "nan" and int(float(row["counter [1]"])) in answered:
            assert float(row["C_N [1]"]) == answered[int(float(row["counter [1]"]))].coefficients[1]
            compared += 1
    assert compared > 20


def test_estimate_takes_a_log_and_a_map(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    """The map in numpy and the native FMU of it agree to round-off, 1e-9 of sigma and more."""
    log = tmp_path / "run.asc"
    live = live_run(synthetic.estimator_1, "replay_map", 30, record=log)
    out = tmp_path / "run.h5"
    code, printed, errors = run("estimate", synthetic.map_1, log, "-o", out)
    assert (code, errors) == (0, "")
    assert "is not the FMU of the recording" in " ".join(printed.split())
    with h5py.File(out) as file:
        found = file["C_A"][()]
        assert file["time"].attrs["unit"] == "s"
    expected = np.array([r.coefficients[0] for r in live.results])
    assert len(found) == len(expected)
    both = np.isfinite(expected)
    np.testing.assert_allclose(found[both], expected[both], rtol=1e-9)


def test_bad_logs_get_one_line(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    (tmp_path / "x.blf").write_bytes(b"this is no log at all" * 20)
    (tmp_path / "x.db").write_bytes(b"")
    (tmp_path / "x.log").write_text("(1.0) can0 123#00\n")
    (tmp_path / "empty.log").write_text("")
    for name, line in (
        ("x.blf", "damaged"),
        ("x.db", "expected one of .asc"),
        ("none.log", "no such file"),
        ("empty.log", "empty.log: holds no frame\n"),
        ("x.log", "x.log: holds no frame on bus.log_channel can7, but on can0\n"),
    ):
        set_channel = ("--set", "bus.log_channel=can7") if name == "x.log" else ()
        code, _, errors = run(
            "replay", tmp_path / name, synthetic.estimator_1, "-o", tmp_path / "o.csv", *set_channel
        )
        assert code == 2
        assert line in errors
        assert errors.count("\n") == 1
    assert not (tmp_path / "o.csv").exists()


def test_settings_of_the_run_are_those_of_the_replay(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """A replay with another period is another run: the comparison with the log shows it."""
    log = tmp_path / "run.blf"
    live_run(synthetic.estimator_1, "replay_other", 30, record=log)

    def slower(options: BridgeOptions | None) -> BridgeOptions:
        assert options is not None
        assert options.cycle_time == CYCLE
        return BridgeOptions(interface="virtual", channel="x", cycle_time=10.0 * CYCLE)

    with FmuStep(synthetic.estimator_1) as step:
        summary = replay_log(
            log,
            synthetic.estimator_1,
            step=step,
            gauge_names=step.gauge_names,
            options=slower,
            on_result=lambda _: None,
        )
    assert summary.equal < summary.compared

    with pytest.raises(InputError, match="cycle time"), FmuStep(synthetic.estimator_1) as step:
        replay_log(
            log,
            synthetic.estimator_1,
            step=step,
            gauge_names=step.gauge_names,
            options=lambda _: BridgeOptions(interface="v", channel="x", cycle_time=0.0),
            on_result=print,
        )
