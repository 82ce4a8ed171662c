"""Closed-loop flight: against the law's closed form, with every fault, in other engines, and as a command."""

from __future__ import annotations

import ctypes.util
import importlib.util
import json
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from math import radians
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.validation import validate_fmu
from lxml import etree
from slender_vehicle import NOISE_STD, SlenderFiles, make_slender_files, slender_flight_model

from strainfmu.atmosphere import speed_of_sound
from strainfmu.cosim.autopilot import normal_force_table
from strainfmu.cosim.flight import INSTANCES, FlightResult, fault_text, flight_result, flight_system, fly
from strainfmu.cosim.flight_model import load_flight_model
from strainfmu.cosim.master import simulate
from strainfmu.cosim.recording import Recording, load_recording
from strainfmu.cosim.scenario import FaultEvent, Scenario, load_scenario
from strainfmu.cosim.ssp import write_ssp
from strainfmu.cosim.system import Connection, System
from strainfmu.errors import InputError
from strainfmu.estimator.inverse_map import load_inverse_map, save_inverse_map
from strainfmu.estimator.sensors import SensorRows
from strainfmu.fmu.flight_package import export_flight
from strainfmu.interface.plant_variables import FlightStart, GaugeFault

MODEL = slender_flight_model()
WATCHED = (
    "plant.angle_of_attack",
    "plant.pitch_rate",
    "autopilot.estimated_angle_of_attack",
    "autopilot.control_moment",
)
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> SlenderFiles:
    return make_slender_files(tmp_path_factory.mktemp("slender"))


@pytest.fixture(scope="module")
def scenario(files: SlenderFiles) -> Scenario:
    return load_scenario(files.scenario)


@pytest.fixture(scope="module")
def fmus(scenario: Scenario, files: SlenderFiles) -> dict[str, Path]:
    return export_flight(scenario, files.folder / "fmus")


def flown(scenario: Scenario, folder: Path, feedback: str = "estimate") -> tuple[Recording, FlightResult]:
    recording = fly(scenario, export_flight(scenario, folder), feedback)
    return recording, flight_result(scenario, recording, MODEL)


def test_packages_are_compliant(fmus: dict[str, Path]) -> None:
    for path in fmus.values():
        assert validate_fmu(str(path)) == []


@pytest.mark.fast
def test_truth_gives_the_motion_of_the_law(scenario: Scenario, fmus: dict[str, Path]) -> None:
    recording = fly(scenario, fmus, "truth")
    w, z = scenario.autopilot.frequency, scenario.autopilot.damping_ratio
    time = np.maximum(recording.time - 0.5, 0.0)
    damped = w * np.sqrt(1.0 - z**2)
    decay = np.exp(-z * w * time) * (np.cos(damped * time) + z * w / damped * np.sin(damped * time))
    wanted = radians(5.0) - radians(3.0) * decay
    # The control moment is held for 10 ms, a mean delay of 5 ms: at 4 rad/s some 0.7 % of the step of 3 deg.
    assert np.abs(recording["plant.angle_of_attack"] - wanted).max() < radians(0.03)
    # The step begins from 2 deg, where the sampled pitch damping of the air leaves next to nothing.
    np.testing.assert_allclose(
        recording["autopilot.estimated_angle_of_attack"], recording["plant.angle_of_attack"], rtol=0.0, atol=1e-6
    )


def test_unexplained_moments_leave_no_standing_error(scenario: Scenario, fmus: dict[str, Path]) -> None:
    # The autopilot knows nothing of the damping of the air, which in a steady turn is a constant moment.
    damping, w, start = -4000.0, scenario.autopilot.frequency, scenario.start
    for rate in (0.0, scenario.autopilot.observer_rate):
        system = flight_system(scenario, fmus, "truth")
        values = {"plant.pitch_damping": damping, "autopilot.observer_rate": rate}
        recording = simulate(replace(system, start_values=values), 10.0, scenario.step_size)
        error = float((recording["schedule.commanded_angle_of_attack"] - recording["plant.angle_of_attack"])[-1])
        scale = float(recording["plant.dynamic_pressure"][-1]) * MODEL.reference_area * MODEL.reference_length
        speed = start.mach_number * speed_of_sound(start.altitude)
        turn = float(recording["plant.pitch_rate"][-1]) * MODEL.reference_length / (2.0 * speed)
        standing = -scale * damping * turn / (start.pitch_inertia * w**2)
        assert standing > radians(0.05)
        # With that damping the slowest pole is -1 per s: after 9.5 s some e^-9.5 of the step of 3 deg is left.
        assert error == pytest.approx(standing if rate == 0.0 else 0.0, abs=radians(0.001))


@pytest.mark.fast
def test_estimate_flies_as_truth_does(scenario: Scenario, fmus: dict[str, Path]) -> None:
    results = {f: flight_result(scenario, fly(scenario, fmus, f), MODEL) for f in ("truth", "estimate")}
    assert results["estimate"].tracking_error == pytest.approx(results["truth"].tracking_error, rel=0.1)
    assert all(result.holds for result in results.values())
    assert results["estimate"].health["OK"] > 0.99


@pytest.mark.parametrize(
    ("kind", "value", "isolated"),
    [
        (GaugeFault.DROPOUT, 0.0, False),
        (GaugeFault.BIAS, 20 * NOISE_STD, True),
        (GaugeFault.DRIFT, 500 * NOISE_STD, True),
        (GaugeFault.STUCK, 0.0, True),
    ],
)
def test_a_failing_gauge_is_reported_and_the_loop_holds(
    scenario: Scenario, tmp_path: Path, kind: GaugeFault, value: float, isolated: bool
) -> None:
    broken = replace(scenario, faults=(FaultEvent(time=2.0, gauge="G1", kind=kind, value=value),))
    recording, result = flown(broken, tmp_path)
    report = result.faults[0]
    assert report.reported_after is not None
    assert report.reported_after <= 0.05 + 1e-9
    assert (report.isolated_after is not None) == isolated
    assert result.holds
    # The estimator leaves it out, whoever found it, and says so for the rest of the flight.
    np.testing.assert_array_equal(recording["estimator.health.valid_gauges"][-100:], MODEL.n_gauges - 1)


def test_a_fault_that_nobody_can_see_is_not_reported(scenario: Scenario, tmp_path: Path) -> None:
    # Health has told of the first for good when the second, which changes nothing, begins.
    faults = (
        FaultEvent(1.0, 1, GaugeFault.DROPOUT),
        FaultEvent(time=2.0, gauge=2, kind=GaugeFault.DRIFT, value=0.0),
    )
    _, result = flown(replace(scenario, faults=faults, noise_seed=3), tmp_path)
    assert result.faults[0].reported_after is not None
    assert result.faults[1].isolated_after is None
    assert result.faults[1].reported_after is None
    healed = FaultEvent(2.0, 1, GaugeFault.NONE)
    assert fault_text(healed) == "gauge 1 healed at 2 s"


def test_steps_longer_than_a_second_are_scored(scenario: Scenario, tmp_path: Path) -> None:
    still = replace(scenario, step_size=2.5, commands=scenario.commands[:1])
    _, result = flown(still, tmp_path)
    assert np.isfinite(result.settled_error)


def test_a_frozen_gauge_is_found_when_the_load_moves(scenario: Scenario, tmp_path: Path) -> None:
    broken = replace(scenario, faults=(FaultEvent(0.2, 1, GaugeFault.FROZEN),))
    _, result = flown(broken, tmp_path)
    report = result.faults[0]
    # It freezes in steady flight: only after the step at 0.5 s can anyone know.
    assert report.reported_after is not None
    assert report.isolated_after is not None
    assert 0.3 < report.isolated_after < 0.8
    assert result.holds


def test_isolation_can_be_switched_off(scenario: Scenario, tmp_path: Path) -> None:
    settings = replace(scenario.autopilot, confirmations=0)
    faults = (FaultEvent(time=2.0, gauge=1, kind=GaugeFault.BIAS, value=20 * NOISE_STD),)
    recording, result = flown(replace(scenario, autopilot=settings, faults=faults), tmp_path)
    assert result.faults[0].isolated_after is None
    assert not np.any(recording["autopilot.isolated_gauges"])


def test_without_any_gauge_the_motion_is_damped(scenario: Scenario, tmp_path: Path) -> None:
    faults = tuple(FaultEvent(1.0, i + 1, GaugeFault.DROPOUT) for i in range(MODEL.n_gauges))
    recording, result = flown(replace(scenario, faults=faults), tmp_path)
    assert np.all(np.isnan(recording["estimator.C_N"][-50:]))
    gone = recording.time > 1.0 + 3 * scenario.autopilot.hold_time
    rate, moment = recording["plant.pitch_rate"][gone], recording["autopilot.control_moment"][gone]
    damping = -scenario.start.pitch_inertia * 2.0 * scenario.autopilot.damping_ratio * scenario.autopilot.frequency
    np.testing.assert_allclose(moment, damping * rate, rtol=1e-12)
    assert result.health["INVALID"] > 0.5


def test_same_flight_same_bits(scenario: Scenario, fmus: dict[str, Path], tmp_path: Path) -> None:
    again = export_flight(scenario, tmp_path)
    for name in INSTANCES:
        assert again[name].read_bytes() == fmus[name].read_bytes()
    np.testing.assert_array_equal(fly(scenario, fmus, "estimate").values, fly(scenario, again, "estimate").values)


def test_cycles_need_a_delay(scenario: Scenario, fmus: dict[str, Path]) -> None:
    system = flight_system(scenario, fmus, "estimate")
    without = replace(system, connections=[replace(c, delayed=False) for c in system.connections])
    with pytest.raises(InputError, match=r"form a cycle: .* one of them must be delayed"):
        simulate(without, 0.1, 0.01)


def test_a_delayed_connection_brings_the_value_before(scenario: Scenario, fmus: dict[str, Path]) -> None:
    name = "commanded_angle_of_attack"
    for delayed, first in ((False, 50), (True, 51)):
        link = Connection(f"schedule.{name}", f"autopilot.{name}", delayed)
        instances = {key: fmus[key] for key in ("schedule", "autopilot")}
        # Nothing moves here, which the observer would wonder at.
        recording = simulate(System(instances, [link], {"autopilot.observer_rate": 0.0}), 1.0, 0.01)
        jumps = np.flatnonzero(np.diff(recording["autopilot.control_moment"])[1:]) + 2
        assert jumps[0] == first


@pytest.fixture(scope="module")
def ssp(scenario: Scenario, fmus: dict[str, Path], files: SlenderFiles) -> dict[bool, Path]:
    """The package without and with connectors of the system."""
    system = flight_system(scenario, fmus, "estimate")
    paths = {with_them: files.folder / f"flight_{with_them}.ssp" for with_them in (False, True)}
    for with_them, path in paths.items():
        write_ssp(system, path, scenario.name, scenario.stop_time, scenario.step_size, with_them)
    return paths


@pytest.fixture(scope="module")
def at_once(scenario: Scenario, fmus: dict[str, Path]) -> Recording:
    """The flight as other engines step it."""
    return fly(scenario, fmus, "estimate", at_once=True)


@pytest.mark.parametrize("connectors", [False, True])
def test_ssp_packages_are_valid(ssp: dict[bool, Path], connectors: bool) -> None:
    schema = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureDescription.xsd"
    with zipfile.ZipFile(ssp[connectors]) as archive:
        root = etree.fromstring(archive.read("SystemStructure.ssd"))
        assert sorted(archive.namelist())[1:] == sorted(f"resources/{name}.fmu" for name in INSTANCES)
    etree.XMLSchema(etree.parse(str(schema))).assertValid(root)
    ssd = {"ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription"}
    assert bool(root.findall("ssd:System/ssd:Connectors", ssd)) == connectors


@pytest.mark.parametrize("connectors", [False, True])
def test_fmpy_flies_the_ssp(
    ssp: dict[bool, Path], scenario: Scenario, fmus: dict[str, Path], connectors: bool
) -> None:
    # FMPy gives every connected input 0 for the first step, so the flights begin differently and meet later.
    found = simulate_ssp(str(ssp[connectors]), stop_time=scenario.stop_time - 1e-6, step_size=scenario.step_size)
    wanted = fly(scenario, fmus, "estimate", at_once=True)
    assert len(found) == len(wanted.time) - 1
    last = slice(-50, None)
    for name in WATCHED:
        # What is left of the start after 4.5 s of a motion that decays with 3.2 per s.
        scale = np.abs(wanted[name]).max()
        np.testing.assert_allclose(found[name][last], wanted[name][1:][last], rtol=0.0, atol=1e-5 * scale)


def other_engine(engine: str, path: Path, scenario: Scenario, fmus: dict[str, Path], folder: Path) -> np.ndarray:
    """(n, k) watched signals after every step, by a program of its own: should the engine die, only that."""
    references = {}
    for name in INSTANCES:
        variables = fmpy.read_model_description(str(fmus[name]), validate=False).modelVariables
        references |= {f"{name}.{variable.name}": variable.valueReference for variable in variables}
    task = {
        "engine": engine,
        "ssp": str(path),
        "folder": str(folder),
        "step": scenario.step_size,
        "steps": round(scenario.stop_time / scenario.step_size),
        "signals": [(name, references[name]) for name in WATCHED],
        "output": str(folder / "found.npy"),
    }
    program = Path(__file__).with_name("ssp_engines.py")
    finished = subprocess.run(
        [sys.executable, str(program), json.dumps(task)], capture_output=True, text=True, check=False
    )
    assert finished.returncode == 0, finished.stderr[-2000:]
    found: np.ndarray = np.load(folder / "found.npy")
    return found


@pytest.mark.parametrize(("engine", "package"), [("ecos", "ecospy"), ("libcosim", "libcosimpy")])
def test_other_engines_fly_the_ssp(
    engine: str,
    package: str,
    ssp: dict[bool, Path],
    scenario: Scenario,
    fmus: dict[str, Path],
    at_once: Recording,
    tmp_path: Path,
) -> None:
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"needs {engine}: pip install {package}")
    if engine == "ecos" and not (ctypes.util.find_library("tbb") or Path(sys.prefix, "lib/libtbb.so.12").exists()):
        pytest.skip("ecos needs libtbb.so.12: apt install libtbb12")
    found = other_engine(engine, ssp[False], scenario, fmus, tmp_path)
    wanted = np.column_stack([at_once[name] for name in WATCHED])[1:]
    # The same FMUs, steps and delays: round-off of the engines' clocks is all that differs.
    size = np.abs(wanted).max(axis=0)
    np.testing.assert_allclose(found / size, wanted / size, rtol=0.0, atol=1e-10)


def test_the_command(files: SlenderFiles, tmp_path: Path, run: Run) -> None:
    package = tmp_path / "f.ssp"
    code, out, err = run("fly", files.scenario, "-o", tmp_path / "out", "--ssp", package)
    assert (code, err) == (0, "")
    assert "tracking error, rms" in out
    assert "of that with truth" in out
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {
        *(f"{name}.fmu" for name in INSTANCES),
        *(f"flight_{f}.{end}" for f in ("truth", "estimate") for end in ("h5", "csv", "png")),
    }
    assert package.is_file()
    assert (tmp_path / "f_connectors.ssp").is_file()
    recording = load_recording(tmp_path / "out" / "flight_estimate.h5")
    assert recording.time[-1] == 5.0


def test_a_loop_that_does_not_hold_ends_with_1(files: SlenderFiles, tmp_path: Path, run: Run) -> None:
    weak = files.folder / "weak.toml"
    weak.write_text(files.scenario.read_text() + "[autopilot]\nlargest_moment_N_m = 0.0\n")
    code, out, _ = run("fly", weak, "-o", tmp_path / "out", "--no-figures")
    assert code == 1
    assert "does not hold" in out


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("stop_time_s = 5.0", "", "stop_time_s: entry is missing"),
        ("stop_time_s = 5.0", "stop_time_s = -1", "stop_time_s: expected a number from 0.001 to 100000, got -1"),
        (
            "stop_time_s = 5.0",
            "stop_time_s = true",
            "stop_time_s: expected a number from 0.001 to 100000, got True",
        ),
        ("mach_number = 6.0", "mach_number = 6.0\nmac = 1", "flight.mac: unknown entry"),
        ("mach_number = 6.0", "mach_number = nan", "flight.mach_number: expected a number from 0 to 100, got nan"),
        (
            "mach_number = 6.0",
            "mach_number = 6.0\nnoise_seed = 1.5",
            "flight.noise_seed: expected a whole number, got 1.5",
        ),
        (
            "mach_number = 6.0",
            "mach_number = 6.0\nnoise_seed = -1",
            "noise_seed: expected a number from 0 to 2.14748e+09, got -1",
        ),
        ("time_s = 0.0", "time_s = 0.1", "command: the times of the commands must start at 0 and increase"),
        ('name = "slender vehicle"', 'feedback = "guess"', "feedback: 'guess' found, must be truth or estimate"),
        ('name = "slender vehicle"', "name = 3", "name: expected text, got 3"),
        ("[flight]", "flight = 3\n[other]", "flight: expected a table, got 3"),
        ("[[command]]", "[command", "no TOML file"),
        ("[flight]", '[files]\nmap = "none.h5"\n[flight]', "none.h5: no such file"),
        (
            "[flight]",
            "[vehicle]\nmass_kg = 0\n[flight]",
            "vehicle.mass_kg: expected a number from 0.001 to 1e+09, got 0",
        ),
    ],
)
def test_wrong_scenarios(files: SlenderFiles, tmp_path: Path, run: Run, old: str, new: str, message: str) -> None:
    text = files.scenario.read_text()
    assert old in text
    path = tmp_path / "wrong.toml"
    path.write_text(text.replace(old, new, 1))
    code, _, err = run("fly", path, "--files", files.folder, "-o", tmp_path / "out")
    assert code == 2
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ('kind = "bias"\ngauge = 1', "fault.1.value_um_per_m: entry is missing"),
        ('kind = "broken"\ngauge = 1', "fault.1.kind: 'broken' found, must be one of none, dropout, bias"),
        ('kind = "dropout"\ngauge = 99', "gauge 99 found, must be a number from 1 to 16"),
        ('kind = "dropout"\ngauge = "X"', "gauge 'X' found"),
        ('kind = "dropout"', "fault.1.gauge: expected the name of a gauge or its number from 1, got None"),
        ('kind = "dropout"\ngauge = 1\nvalue_um_per_m = 3', "fault.1.value_um_per_m: unknown entry"),
        (
            'kind = "dropout"\ngauge = 1\n[[fault]]\ntime_s=1\nkind="none"\ngauge=1',
            "times of fault_kind[1] must increase",
        ),
    ],
)
def test_wrong_faults(files: SlenderFiles, tmp_path: Path, run: Run, fault: str, message: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(files.scenario.read_text() + "[[fault]]\ntime_s = 1.0\n" + fault)
    code, _, err = run("fly", path, "--files", files.folder, "-o", tmp_path / "out")
    assert code == 2
    assert message in err


def test_the_plant_alone(files: SlenderFiles, tmp_path: Path, run: Run) -> None:
    path, model = tmp_path / "p.fmu", files.folder / "flight_model.h5"
    assert run("plant", model, "-o", path, "--mach-number", 5.5, "--angle-of-attack", 3.0)[::2] == (0, "")
    found = fmpy.simulate_fmu(str(path), stop_time=0.02, output=["C_N", "dynamic_pressure"])
    # C_N = c1 a without sideslip.
    assert found["C_N"][0] == pytest.approx(3.0 * radians(3.0), rel=1e-12)
    for arguments, message in (
        (["--motion", "loop"], "motion: 'loop' found, must be one of inputs, trajectory, short_period"),
        (["--motion", "trajectory"], "a trajectory is needed"),
        (["--trajectory", "none.csv"], "only for that"),
        (["--motion", "trajectory", "--trajectory", "t.csv", "--altitude", 3], "--altitude: not with --motion"),
        (["--angle-of-attack", "nan"], "--angle-of-attack: expected -60 .. 60 deg, got nan"),
        (["--altitude", "inf"], "--altitude: expected 0 .. 71 km, got inf"),
        (["--mach-number", 60], "--mach-number: expected 1.01 .. 30, got 60"),
        (["--mach-number", 20], "start: mach_number: 20 found"),
        (["--motion", "short_period", "--angle-of-attack", 50], "start: total incidence: 50 deg found"),
        (["--altitude", 1000], "--altitude: expected 0 .. 71 km, got 1000"),
    ):
        code, _, err = run("plant", model, "-o", tmp_path / "q.fmu", *arguments)
        assert code == 2
        assert message in err


def test_scenario_that_is_not_there(tmp_path: Path, run: Run) -> None:
    code, _, err = run("fly", tmp_path / "none.toml", "-o", tmp_path / "out")
    assert (code, err) == (2, f"strainfmu: {tmp_path / 'none.toml'}: no such file\n")


def test_packages_have_the_right_name(scenario: Scenario, fmus: dict[str, Path], tmp_path: Path) -> None:
    system = flight_system(scenario, fmus, "truth")
    with pytest.raises(InputError, match=r"must end in \.ssp"):
        write_ssp(system, tmp_path / "x.zip", "x", 1.0, 0.1)
    with pytest.raises(InputError, match="start values"):
        write_ssp(replace(system, start_values={"plant.mass": 3.0}), tmp_path / "x.ssp", "x", 1.0, 0.1)


@pytest.mark.fast
def test_the_table_of_normal_force_covers_the_envelope() -> None:
    start = FlightStart(6.0, 20e3, sideslip_angle=radians(5.0))
    table = normal_force_table(MODEL, start)
    # C_N = c1 a_T cos phi_T at cos a_T = cos a cos b.
    total = np.arccos(np.cos(table[:, 0]) * np.cos(start.sideslip_angle))
    up = np.sin(table[:, 0]) * np.cos(start.sideslip_angle)
    np.testing.assert_allclose(
        table[:, 1], 3.0 * total * up / np.hypot(up, np.sin(start.sideslip_angle)), atol=1e-12
    )
    assert total[0] == pytest.approx(radians(12.0))
    with pytest.raises(InputError, match="sideslip"):
        normal_force_table(MODEL, replace(start, sideslip_angle=radians(13.0)))
    falling = replace(MODEL, coefficient_table=-MODEL.coefficient_table)
    with pytest.raises(InputError, match="does not rise"):
        normal_force_table(falling, start)


@pytest.mark.slow
def test_twenty_seconds_of_the_surrogate(ic3x_demo: Path, tmp_path: Path) -> None:
    shipped = Path(__file__).parents[2] / "builder" / "vehicles" / "ic3x_flight.toml"
    scenario = load_scenario(shipped, ic3x_demo)
    model = load_flight_model(scenario.flight_model)
    clean = replace(scenario, faults=())
    fmus = export_flight(clean, tmp_path / "clean")
    errors = [flight_result(clean, fly(clean, fmus, f), model).tracking_error for f in ("truth", "estimate")]
    assert errors[1] == pytest.approx(errors[0], rel=0.1)
    for kind, value in (
        (GaugeFault.DROPOUT, 0.0),
        (GaugeFault.BIAS, 1e-5),
        (GaugeFault.DRIFT, 1e-4),
        (GaugeFault.STUCK, 0.0),
    ):
        broken = replace(scenario, faults=(FaultEvent(time=10.0, gauge=5, kind=kind, value=value),))
        result = flight_result(broken, fly(broken, export_flight(broken, tmp_path / kind.name), "estimate"), model)
        assert result.faults[0].reported_after is not None, kind
        assert result.faults[0].reported_after <= 0.05 + 1e-9, kind
        assert result.tracking_error == pytest.approx(errors[0], rel=0.1)
        assert result.holds


def test_a_map_with_further_sensors_is_refused(scenario: Scenario, tmp_path: Path) -> None:
    """The vehicle that flies has strain gauges alone."""
    held = load_inverse_map(scenario.inverse_map)
    n = held.n_gauges
    rows = SensorRows(
        kind=(*("strain",) * (n - 1), "force"),
        unit=(*("m/m",) * (n - 1), "N"),
        scale=np.ones(n),
        largest=np.ones(n),
        thrust_response=np.zeros(n),
    )
    save_inverse_map(replace(held, sensors=rows), tmp_path / "map.h5")
    with pytest.raises(
        InputError, match="closed-loop flight: expected a map of strain gauges alone, got one with fo"
    ):
        export_flight(replace(scenario, inverse_map=tmp_path / "map.h5"), tmp_path / "fmus")
