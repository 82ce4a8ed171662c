"""Closed-loop flight: against the law's closed form, and with every fault."""

from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from slender_vehicle import NOISE_STD, slender_flight_model
from sweeps import sweep

from strainfmu.atmosphere import speed_of_sound
from strainfmu.cosim.flight import INSTANCES, FlightResult, fault_text, flight_result, flight_system, fly
from strainfmu.cosim.models.autopilot import normal_force_table
from strainfmu.cosim.models.flight_model import evaluate, load_flight_model, save_flight_model
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.cosim.scenario import FaultEvent, Scenario, load_scenario
from strainfmu.cosim.systems.master import simulate
from strainfmu.cosim.systems.recording import Recording
from strainfmu.cosim.systems.system import Connection, System
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import load_inverse_map, save_inverse_map
from strainfmu.estimator.map.sensors import SensorRows
from strainfmu.fmu.export import export_plant
from strainfmu.fmu.flight_export import export_flight
from strainfmu.interface.plant_variables import FlightStart, GaugeFault

MODEL = slender_flight_model()


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
    sweep(
        [
            (GaugeFault.DROPOUT, 0.0, False),
            (GaugeFault.BIAS, 20 * NOISE_STD, True),
            (GaugeFault.DRIFT, 500 * NOISE_STD, True),
            (GaugeFault.STUCK, 0.0, True),
        ],
        [(GaugeFault.DROPOUT, 0.0, False), (GaugeFault.STUCK, 0.0, True)],
    ),
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


def test_fmus_of_fmi_3_have_the_variables_of_fmi_2(
    scenario: Scenario, fmus: dict[str, Path], tmp_path: Path
) -> None:
    """Names, causalities and units of all four, so that another engine connects them alike."""
    third = export_flight(scenario, tmp_path, platforms=["linux64"], fmi_version="3")
    for name in INSTANCES:
        before, after = (read_model_description(str(one[name])) for one in (fmus, third))
        assert (before.fmiVersion, after.fmiVersion) == ("2.0", "3.0")
        listed = [[(v.name, v.causality, v.unit) for v in one.modelVariables] for one in (before, after)]
        assert listed[1] == [*listed[0], ("time", "independent", "s")]
        assert validate_fmu(str(third[name])) == []


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


def with_a_port_and_a_cell(scenario: Scenario, folder: Path) -> Scenario:
    """``scenario`` of a vehicle whose last two rows are no gauges, in the map and in the vehicle that flies."""
    held, n = load_inverse_map(scenario.inverse_map), MODEL.n_gauges
    ones = np.ones(n - 2)
    rows = SensorRows(
        kind=(*("strain",) * (n - 2), "pressure", "force"),
        unit=(*("m/m",) * (n - 2), "Pa", "N"),
        scale=np.append(ones, [2e9, 5e7]),
        largest=np.append(ones, [1e6, 1e5]),
        thrust_response=np.append(0.0 * ones, [0.0, 1.0]),
    )
    names = (*MODEL.gauge_names[:-2], "port 0.2m", "cell_axial")
    # Each row has a channel of its own, so that the last two can be in Pa and N.
    table = MODEL.strain_table[..., MODEL.gauge_channel, :, :] * rows.scale[:, None, None]
    flown = replace(MODEL, gauge_names=names, strain_table=table, gauge_channel=np.arange(n), sensors=rows)
    folder.mkdir(exist_ok=True)
    save_flight_model(flown, folder / "flight_model.h5")
    save_inverse_map(replace(held, gauge_names=names, sensors=rows), folder / "map.h5")
    return replace(scenario, inverse_map=folder / "map.h5", flight_model=folder / "flight_model.h5", stop_time=1.0)


@pytest.mark.fast
def test_auxiliary_sensors_fly_and_fail_as_gauges_do(
    scenario: Scenario, fmus: dict[str, Path], tmp_path: Path
) -> None:
    """Readings are the strains of the same rows in other units, so that the flight is the same, bit by bit but for
    the scale; a sensor that fails is reported and isolated; the estimator is that of Python."""
    short = replace(scenario, stop_time=1.0)
    expected = fly(short, fmus, "estimate")
    sensed = with_a_port_and_a_cell(short, tmp_path / "files")
    recording = fly(sensed, export_flight(sensed, tmp_path / "fmus"), "estimate")
    held, n = load_inverse_map(sensed.inverse_map), MODEL.n_gauges
    port, cell = recording["plant.sensor.port_0_2m"], recording["plant.sensor.cell_axial"]
    np.testing.assert_allclose(port, 2e9 * expected[f"plant.strain[{n - 1}]"], rtol=1e-9)
    np.testing.assert_allclose(cell, 5e7 * expected[f"plant.strain[{n}]"], rtol=1e-9)
    for name in ("plant.angle_of_attack", "estimator.C_N", "estimator.sigma.C_N"):
        np.testing.assert_allclose(recording[name], expected[name], rtol=1e-6, atol=1e-9)
    read = np.column_stack([recording[f"plant.strain[{i + 1}]"] for i in range(n - 2)] + [port, cell])
    python = Estimator(held).estimate(read, recording["plant.dynamic_pressure"])
    np.testing.assert_allclose(recording["estimator.C_N"], python.coefficients[:, 1], rtol=1e-7, atol=1e-12)
    bias = FaultEvent(time=0.4, gauge="port 0.2m", kind=GaugeFault.BIAS, value=2e5, of_sensor=True)
    failing = replace(sensed, faults=(bias,))
    recording = fly(failing, export_flight(failing, tmp_path / "failing"), "estimate")
    report = flight_result(failing, recording, load_flight_model(sensed.flight_model)).faults[0]
    assert report.reported_after == pytest.approx(0.01, abs=0.011)
    assert report.isolated_after is not None
    assert recording[f"autopilot.valid[{n - 1}]"][-1] == 0.0
    assert fault_text(bias) == "bias 200000 of sensor port 0.2m at 0.4 s"
    with pytest.raises(InputError, match=r"'port 0\.2m': expected its value in the unit of the sensor"):
        export_flight(replace(sensed, faults=(replace(bias, of_sensor=False),)), tmp_path / "none")
    with pytest.raises(InputError, match="expected the gauges and sensors of"):
        export_flight(replace(sensed, flight_model=scenario.flight_model), tmp_path / "none")


@pytest.mark.fast
def test_plant_of_kind_python_has_sensors(scenario: Scenario, tmp_path: Path) -> None:
    sensed = with_a_port_and_a_cell(scenario, tmp_path / "files")
    table = "time_s,mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km\n0,6,1,0,20\n0.2,6,4,1,20\n"
    (tmp_path / "trajectory.csv").write_text(table)
    export_plant(sensed.flight_model, tmp_path / "trajectory.csv", tmp_path / "plant.fmu")
    recording = simulate(System({"plant": tmp_path / "plant.fmu"}, ()), 0.2, 0.01)
    model, trajectory = load_flight_model(sensed.flight_model), load_trajectory(tmp_path / "trajectory.csv")
    exact = [evaluate(model, trajectory.condition_at(t)).strain for t in recording.time.tolist()]
    read = np.column_stack([recording[f"plant.{name}"] for name in model.reading_names])
    noise = (read - np.array(exact)) / (model.noise_std * model.noise_scale)
    assert np.abs(noise.std(axis=0) - 1.0).max() < 0.5
