"""Flush ports, inertial unit and load cells beside the gauges of the shipped vehicle, flights and errors drawn."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import read_model_description
from fmu_host import loaded

from builder.aero.load_operator import load_operator
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.ensemble import ensemble_of
from builder.inverse.problem import inverse_problem
from builder.inverse.sensor_set import port_row
from builder.inverse.solution import Problem
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.sensor_entries import (
    AngularAccelerometers,
    DisplacementPoint,
    Displacements,
    Fibre,
    InertialUnit,
    LoadCells,
    Ports,
    Sensors,
)
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.step import reading_units_of
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.interface.sensor_variables import reading_names

PORTS = Ports(x_m=0.3, roll_deg=[0.0, 90.0, 180.0, 270.0], std_Pa=300.0, range_Pa=2e5, gain_percent=0.25)
IMU = InertialUnit(x_m=1.2, mass_kg=150.0, center_x_m=2.0, inertia_kg_m2=130.0, thrust_std_N=5.0)
CELLS = LoadCells(
    station_m=3.6,
    components=["axial", "normal", "yaw"],
    force_std_N=2.0,
    moment_std_N_m=2.0,
    force_range_N=1e5,
    moment_range_N_m=1e5,
)

TIP = DisplacementPoint(name="tip_up", x_m=0.2, roll_deg=0.0, direction=[0.0, 0.0, 1.0])
POINTS = Displacements(
    point=[
        TIP,
        DisplacementPoint(name="tip_starboard", x_m=0.2, roll_deg=0.0, direction=[0.0, 2.0, 0.0]),
        DisplacementPoint(x_m=2.0, roll_deg=45.0, direction=[0.0, 1.0, 1.0]),
    ],
    std_um=20.0,
    range_mm=50.0,
    gain_percent=0.5,
)
FIBRE = Fibre(
    first_x_m=0.5,
    last_x_m=3.0,
    count=4,
    roll_deg=[0.0, 90.0],
    std_um_per_m=2.0,
    range_um_per_m=5e3,
    drift_um_per_m=5.0,
)

ANGULAR = AngularAccelerometers(
    x_m=3.0, inertia_kg_m2=130.0, center_x_m=2.0, std_rad_per_s2=0.02, range_rad_per_s2=500.0
)

UNIT = ["imu_axial", "imu_normal", "imu_side", "imu_pitch", "imu_yaw"]


def with_sensors(vehicle: Vehicle, sensors: Sensors | None, **entry: Any) -> Vehicle:
    changed = vehicle.map.model_copy(update={"case": 2, **entry})
    return vehicle.model_copy(update={"map": changed, "sensors": sensors})


def flights(
    vehicle: Vehicle, problem: Problem, held_out: Snapshots, structure: StructuralModel, draws: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows, dynamic pressure and true coefficients of held-out flows, every error drawn, at all rolls."""
    random = np.random.default_rng(3)
    ensemble = ensemble_of(vehicle, held_out)
    clean = ensemble.responses(problem.strain_operator)
    truth = ensemble.coefficients(problem.load_operator[:5])
    chosen = random.choice(len(clean), size=draws, p=ensemble.member_weight)
    readings = clean[chosen] + problem.offset
    following = {one.name for one in problem.errors}
    for term in problem.noise:
        if term.name not in following:
            readings += term.draw(random, draws)
    for one in inverse_problem(vehicle, held_out, structure).errors:
        error = one.strain[chosen]
        readings += error * random.standard_normal((draws, 1 if one.common else error.shape[1]))
    return readings, np.full(draws, ensemble.nominal_dynamic_pressure), truth[chosen]


def in_units(inverse_map: InverseMap, rows: np.ndarray) -> np.ndarray:
    return rows * inverse_map.sensors.scale


def scored(
    vehicle: Vehicle, snapshots: Snapshots, held_out: Snapshots, structure: StructuralModel
) -> tuple[np.ndarray, np.ndarray]:
    """Return root mean square sigma of the coefficients, and the fraction of errors within 3 sigma."""
    problem = inverse_problem(vehicle, snapshots, structure)
    inverse_map = build_inverse_map(vehicle, snapshots, structure, problem=problem)
    rows, q, truth = flights(vehicle, problem, held_out, structure, 3000)
    found = Estimator(inverse_map).estimate(in_units(inverse_map, rows), q, dynamic_pressure_std=0.0)
    inside = np.abs(found.coefficients - truth) <= 3.0 * found.coefficients_std
    return np.sqrt(np.mean(found.coefficients_std**2, axis=0)), inside.mean(axis=0)


def test_ports_and_inertial_unit_sharpen_what_strain_says(
    vehicle: Vehicle, snapshots: Snapshots, held_out: Snapshots, structure: StructuralModel
) -> None:
    """Base pressure +-20 % of p_inf, friction +-0.005 in C_A: C_A at most half, C_N a quarter, M_P a fifth."""
    sensors = Sensors(ports=PORTS, imu=IMU, base_pressure_percent=20.0, friction_C_A_std=0.005)
    args = snapshots, held_out, structure
    alone, _ = scored(with_sensors(vehicle, None), *args)
    both, coverage = scored(with_sensors(vehicle, sensors), *args)
    axial, normal, side, pitch, yaw = both / alone
    assert axial <= 0.5
    assert max(normal, side) <= 0.25
    assert max(pitch, yaw) <= 0.2
    assert np.all(coverage >= 0.99)


def test_displacement_and_fibres_sharpen_what_strain_says(
    vehicle: Vehicle, snapshots: Snapshots, held_out: Snapshots, structure: StructuralModel
) -> None:
    """Forces by a tenth: the wall's own errors, which are most of their sigma, are those of the gauges."""
    args = snapshots, held_out, structure
    alone, _ = scored(with_sensors(vehicle, None), *args)
    both, coverage = scored(with_sensors(vehicle, Sensors(displacement=POINTS, fibre=FIBRE)), *args)
    assert np.all(both <= alone * (1.0 + 1e-9))
    assert np.all(both[1:3] <= 0.92 * alone[1:3])
    assert np.all(coverage >= 0.99)


def test_errors_of_the_wall_are_those_of_the_gauges(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """Young's modulus and thickness move displacement, fibres and gauges together: one error, not two."""
    problem = inverse_problem(
        with_sensors(vehicle, Sensors(displacement=POINTS, fibre=FIBRE)), snapshots, structure
    )
    n_g = len(structure.layouts[vehicle.gauges.layout].names)
    errors = {one.name: one for one in problem.errors}
    assert len(errors) == len(problem.errors)
    response, gain = problem.ensemble.responses(problem.strain_operator), errors["common gain"].strain
    np.testing.assert_allclose(gain, 0.01 * vehicle.noise.common_gain_percent * response, rtol=1e-9, atol=1e-18)
    # A thicker wall deflects less: a thin one's bending goes with 1 / t.
    tip = response[:, n_g]
    by_thickness = float(errors["wall thickness"].strain[:, n_g] @ tip / (tip @ tip))
    assert by_thickness == pytest.approx(-0.01 * vehicle.noise.wall_thickness_percent, rel=0.1)
    terms = {term.name: term.columns for term in problem.noise}
    assert np.all(np.linalg.norm(terms["common gain"][n_g:], axis=1) > 0.0)
    assert np.count_nonzero(np.linalg.norm(terms["fibre 90 deg, drift"], axis=1)) == FIBRE.count


def test_lost_sensors_leave_the_map_built_without_them(
    vehicle: Vehicle, snapshots: Snapshots, held_out: Snapshots, structure: StructuralModel
) -> None:
    """One or more of each kind, a whole fibre among them."""
    whole = Sensors(ports=PORTS, imu=IMU, load_cells=CELLS, displacement=POINTS, fibre=FIBRE)
    lost = ["port_180deg", "imu_pitch", "imu_yaw", "cell_normal", "tip_up"]
    lost += [f"fibre_90deg_{k + 1}" for k in range(FIBRE.count)]
    rest = Sensors(
        ports=PORTS.model_copy(update={"roll_deg": [0.0, 90.0, 270.0]}),
        imu=IMU.model_copy(update={"angular": False}),
        load_cells=CELLS.model_copy(update={"components": ["axial", "yaw"]}),
        displacement=POINTS.model_copy(update={"point": POINTS.point[1:]}),
        fibre=FIBRE.model_copy(update={"roll_deg": [0.0]}),
    )
    equipped = with_sensors(vehicle, whole)
    problem = inverse_problem(equipped, snapshots, structure)
    built = [
        build_inverse_map(equipped, snapshots, structure, problem=problem),
        build_inverse_map(with_sensors(vehicle, rest), snapshots, structure),
    ]
    rows, q, _ = flights(equipped, problem, held_out, structure, 20)
    valid = np.array([name not in lost for name in built[0].gauge_names])
    assert built[1].gauge_names == tuple(np.array(built[0].gauge_names)[valid])
    readings = in_units(built[0], rows)
    assert not np.isnan(readings).any()
    readings[:, ~valid] = np.nan
    found = Estimator(built[0]).estimate(readings, q)
    expected = Estimator(built[1]).estimate(readings[:, valid], q)
    np.testing.assert_allclose((found.loads - expected.loads) / expected.loads_std, 0.0, atol=1e-9)
    np.testing.assert_allclose(found.loads_std, expected.loads_std, rtol=1e-9)
    np.testing.assert_allclose(found.chi_square, expected.chi_square, rtol=1e-9)


def test_readings_of_a_rigid_body(
    vehicle: Vehicle, snapshots: Snapshots, held_out: Snapshots, structure: StructuralModel
) -> None:
    """Specific force at the unit is F/m + alpha x r; thrust, base and friction come on top of the fore-body's."""
    sensors = Sensors(
        ports=PORTS,
        imu=IMU,
        angular_accelerometers=ANGULAR,
        load_cells=CELLS,
        base_pressure_ratio=0.4,
        friction_C_A=0.01,
        friction_C_A_std=0.0,
    )
    changed = with_sensors(vehicle, sensors)
    problem = inverse_problem(changed, snapshots, structure)
    inverse_map = build_inverse_map(changed, snapshots, structure, problem=problem)
    ensemble = ensemble_of(changed, held_out)
    rows = ensemble.responses(problem.strain_operator)[5] * inverse_map.sensors.scale
    net = next(ensemble.members())[5]
    reading = dict(zip(inverse_map.gauge_names, rows, strict=True))
    about_centre, about_base = (load_operator(structure.surface, x) @ net for x in (2.0, 3.6))
    pitch, yaw = about_centre[3:] / 130.0
    assert reading["imu_axial"] == pytest.approx(about_centre[0] / 150.0)
    assert reading["imu_normal"] == pytest.approx(about_centre[1] / 150.0 + 0.8 * pitch)
    assert reading["imu_side"] == pytest.approx(about_centre[2] / 150.0 + 0.8 * yaw)
    for unit in ("imu", "angular"):
        assert (reading[f"{unit}_pitch"], reading[f"{unit}_yaw"]) == pytest.approx((pitch, yaw))
    assert reading["cell_normal"] == pytest.approx(about_base[1])
    assert reading["cell_yaw"] == pytest.approx(about_base[4])
    assert reading["port_0deg"] == pytest.approx(port_row(structure.surface, 0.3, 0.0) @ net)
    ambient = float(np.average(problem.ensemble.ambient_pressure, weights=problem.ensemble.weight))
    reference = vehicle.reference_quantities()
    extra = 0.6 * ambient * reference.area + 0.01 * problem.ensemble.nominal_dynamic_pressure * reference.area
    added = dict(zip(inverse_map.gauge_names, problem.offset * inverse_map.sensors.scale, strict=True))
    assert added["imu_axial"] == pytest.approx(extra / 150.0)
    assert added["cell_axial"] == pytest.approx(extra)
    assert {name for name, value in added.items() if value != 0.0} == {"imu_axial", "cell_axial"}
    thrust = inverse_map.sensors.without_thrust(np.zeros(inverse_map.n_gauges), 300.0)
    assert dict(zip(inverse_map.gauge_names, thrust, strict=True))["imu_axial"] == pytest.approx(300.0 / 150.0)


def test_fmu_with_sensors_of_every_kind(
    tmp_path: Path, vehicle: Vehicle, snapshots: Snapshots, held_out: Snapshots, structure: StructuralModel
) -> None:
    """Flights of the vehicle, one sensor of each kind lost in turn, with thrust: the native FMU and Python."""
    sensors = Sensors(
        ports=PORTS,
        imu=IMU,
        angular_accelerometers=ANGULAR,
        load_cells=CELLS,
        displacement=POINTS,
        fibre=FIBRE,
    )
    changed = with_sensors(vehicle, sensors)
    problem = inverse_problem(changed, snapshots, structure)
    inverse_map = build_inverse_map(changed, snapshots, structure, problem=problem)
    lost = [
        "none",
        "port_90deg",
        "imu_axial",
        "angular_pitch",
        "cell_axial",
        "cell_yaw",
        "tip_up",
        "fibre_90deg_1",
    ]
    rows, q, _ = flights(changed, problem, held_out, structure, len(lost))
    thrust = 250.0
    readings = in_units(inverse_map, rows)
    for row, name in zip(readings, lost, strict=True):
        row[[one == name for one in inverse_map.gauge_names]] = np.nan
    moved = readings + thrust * inverse_map.sensors.thrust_response
    expected = Estimator(inverse_map).estimate(inverse_map.sensors.without_thrust(moved, thrust), q)
    assert expected.valid.sum(axis=1).tolist() == [inverse_map.n_gauges, *[inverse_map.n_gauges - 1] * 7]
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", tmp_path / "e.fmu", ExportOptions(platforms=["linux64"]))
    found = np.empty((len(lost), 20))
    with loaded(tmp_path / "e.fmu", tmp_path / "e") as host:
        host.initialize()
        names = list(host.references)[:20]
        for k, row in enumerate(moved):
            host.set([*reading_names(inverse_map), "dynamic_pressure", "thrust"], [*row, q[k], thrust])
            found[k] = host.get(names)
    forces, moments = slice(10, 13), slice(13, 15)
    for group, values in ((forces, expected.loads[:, :3]), (moments, expected.loads[:, 3:])):
        size = np.abs(values).max(axis=1, keepdims=True)
        np.testing.assert_allclose((found[:, group] - values) / size, 0.0, atol=1e-12)
    np.testing.assert_allclose(found[:, 15:20], expected.loads_std, rtol=1e-12)


@pytest.mark.fast
def test_port_between_nodes_reads_what_the_grid_means(structure: StructuralModel) -> None:
    """Linear along the body, trigonometric round it: exact for such a field."""
    grid = structure.surface
    field = np.outer(2.0 + 3.0 * grid.x, 1.0 + 0.5 * np.cos(3.0 * grid.roll_angle - 0.7)).ravel()
    for x, roll in ((0.333, 0.21), (1.9, 4.0), (0.0, 0.0), (3.6, 6.0)):
        expected = (2.0 + 3.0 * x) * (1.0 + 0.5 * np.cos(3.0 * roll - 0.7))
        assert port_row(grid, x, roll) @ field == pytest.approx(expected, rel=1e-12)


def test_faults_of_the_section(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> None:
    off = with_sensors(vehicle, Sensors(ports=PORTS.model_copy(update={"x_m": 4.0})))
    with pytest.raises(InputError, match=r"sensors.ports.x_m: expected 0 to 3.6 m, got 4"):
        build_inverse_map(off, snapshots, structure)
    with pytest.raises(ValueError, match="expected ports or imu or angular_accelerometers or load_cells or"):
        Sensors()
    ahead = POINTS.model_copy(update={"point": [TIP.model_copy(update={"x_m": 0.05})]})
    with pytest.raises(
        InputError, match=r"sensors\.displacement: expected a station from 0\.1 to 3\.6 m, got 0\.05"
    ):
        build_inverse_map(with_sensors(vehicle, Sensors(displacement=ahead)), snapshots, structure)
    with pytest.raises(ValueError, match="point: expected each name once, got 'tip_up' twice"):
        Displacements(**(POINTS.model_dump() | {"point": [TIP, TIP]}))
    with pytest.raises(ValueError, match="expected a vector"):
        DisplacementPoint(x_m=1.0, roll_deg=0.0, direction=[0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"last_x_m: expected a station behind 0\.5, got 0\.5"):
        Fibre(**(FIBRE.model_dump() | {"last_x_m": 0.5}))
    with pytest.raises(ValueError, match="axes: expected each once"):
        AngularAccelerometers(**(ANGULAR.model_dump() | {"axes": ["yaw", "yaw"]}))
    other = AngularAccelerometers(**(ANGULAR.model_dump() | {"inertia_kg_m2": 131.0}))
    with pytest.raises(ValueError, match=r"angular_accelerometers\.inertia_kg_m2: expected 130 of imu, got 131"):
        Sensors(imu=IMU, angular_accelerometers=other)
    with pytest.raises(ValueError, match="components: expected each once"):
        LoadCells(**(CELLS.model_dump() | {"components": ["axial", "axial"]}))


def test_fmu_holds_the_sensors_and_the_bridge_takes_them(
    tmp_path: Path, vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    inverse_map = build_inverse_map(with_sensors(vehicle, Sensors(ports=PORTS)), snapshots, structure)
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    assert load_inverse_map(tmp_path / "map.h5").has_auxiliary_sensors
    export_estimator(tmp_path / "map.h5", tmp_path / "estimator.fmu", ExportOptions(platforms=["linux64"]))
    variables = {one.name: one for one in read_model_description(str(tmp_path / "estimator.fmu")).modelVariables}
    assert [name for name in variables if name.startswith("sensor.")] == [
        f"sensor.port_{roll}deg" for roll in (0, 90, 180, 270)
    ]
    assert variables["sensor.port_90deg"].unit == "Pa"
    assert "thrust" not in variables
    for name in ("map.h5", "estimator.fmu"):
        with open_step(tmp_path / name) as ready:
            assert ready.gauge_names == inverse_map.gauge_names[: inverse_map.n_strain_gauges]
            assert set(reading_units_of(ready.step).values()) == {"Pa"}
