"""The flight model's tables against flows that are solved and applied directly."""

from math import pi, radians

import numpy as np
import pytest
from inverse_case import Case, snapshots_at

from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.euler import EulerEngine
from builder.aero.euler.planes import marching_grid_of
from builder.aero.load_operator import coefficient_scale
from builder.inverse.build import snapshot_coefficients
from builder.inverse.sensor_set import surface_rows
from builder.inverse.structural_sensors import rows_on_surface
from builder.pipeline.built_sensors import flown_sensors
from builder.structure.as_built.as_built_vehicle import exactly_built
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.fourier.shell_mesh import meshed_wall
from builder.truth.flow_table import FlowTable, flow_keys, pressure_harmonics, truth_engine, truth_knots
from builder.truth.true_structure import TrueStructure, flight_model, sensor_readings
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.sensor_entries import Fibre, InertialUnit, Ports, Sensors
from strainfmu.cosim.models.flight_model import FlightModel, FlightPoint, evaluate
from strainfmu.flight_condition import FlightCondition


@pytest.fixture(scope="module")
def model(vehicle: Vehicle, table: FlowTable, true_model: TrueStructure) -> FlightModel:
    """The vehicle of the file, without hardware errors."""
    return flight_model(vehicle, table, true_model, exactly_built(len(true_model.names)), 1e-7)


def condition(mach_number: float, alpha: float, beta: float) -> FlightCondition:
    """At 20 km; angles in degrees."""
    return FlightCondition(
        mach_number=mach_number, angle_of_attack=radians(alpha), sideslip_angle=radians(beta), altitude=20e3
    )


def direct(
    vehicle: Vehicle, structure: StructuralModel, case: Case, at: FlightCondition
) -> tuple[np.ndarray, ...]:
    """Strain and coefficients of a flow solved for this condition, by nodal pressure."""
    engine = EulerEngine(vehicle.body(), marching_grid_of(vehicle.resolution.truth), structure.surface)
    snapshot = snapshots_at(engine, vehicle, [at])
    strain = case.strain_operator @ (snapshot.pressure[0] - at.ambient_pressure)
    return strain, snapshot_coefficients(vehicle, snapshot, case.loads)[0]


def gauge(model: FlightModel, name: str) -> int:
    return model.gauge_names.index(name)


def test_knots_are_those_of_the_vehicle_file(vehicle: Vehicle, model: FlightModel) -> None:
    assert len(flow_keys(*truth_knots(vehicle.truth))) == 36
    np.testing.assert_array_equal(model.mach_knots, [5.0, 5.25, 5.75, 6.25, 6.75, 7.0])
    np.testing.assert_allclose(np.degrees(model.incidence_knots), [0, 1, 3, 5, 7, 9, 11], atol=1e-6)


@pytest.mark.parametrize(("mach_number", "incidence"), [(5.25, 3.0), (6.25, 5.0), (6.75, 11.0)])
def test_at_a_knot_strain_and_loads_are_those_of_the_harmonics(
    mach_number: float,
    incidence: float,
    vehicle: Vehicle,
    model: FlightModel,
    truth_flows: dict[FlowKey, Flow],
    structure: StructuralModel,
    case: Case,
) -> None:
    """Nodal pressure made of the same harmonics, rolled to (a, b), through Z_p and the load operator: equal to
    1e-9 of the largest."""
    flow = truth_flows[mach_number, round(radians(incidence), 9)]
    harmonics = pressure_harmonics(flow, structure.surface, 10)
    at = condition(mach_number, 0.6 * incidence, -0.8 * incidence)
    # Total incidence is not exactly that of the knot: roll angle from (a, b), incidence from the knot.
    roll = at.leeward_roll_angle
    exact = FlightCondition(
        mach_number=mach_number,
        angle_of_attack=np.arctan(np.tan(flow.key[1]) * np.cos(roll)),
        sideslip_angle=-np.arcsin(np.sin(flow.key[1]) * np.sin(roll)),
        altitude=20e3,
    )
    assert exact.total_incidence == pytest.approx(flow.key[1], rel=1e-12)
    phase = np.outer(np.arange(11), structure.surface.roll_angle - exact.leeward_roll_angle)
    pressure = exact.ambient_pressure * (harmonics @ np.cos(phase)).ravel()
    expected = case.strain_operator @ (pressure - exact.ambient_pressure)
    found = evaluate(model, exact)
    np.testing.assert_allclose(found.strain, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
    scale = coefficient_scale(exact.dynamic_pressure, vehicle.reference_quantities())
    loads = scale * (case.loads @ (pressure - exact.ambient_pressure))
    np.testing.assert_allclose(found.coefficients, loads, rtol=0.0, atol=1e-9 * np.abs(loads).max())


def test_sensors_read_what_the_rows_of_the_map_give(
    vehicle: Vehicle,
    table: FlowTable,
    true_model: TrueStructure,
    truth_flows: dict[FlowKey, Flow],
    structure: StructuralModel,
) -> None:
    """At a knot, rolled: rows of the map on nodal pressure, base pressure and friction; errors as stated."""
    sensors = Sensors(
        ports=Ports(x_m=0.3, roll_deg=[0.0, 50.0], std_Pa=300.0, range_Pa=2e5, gain_percent=1.0),
        imu=InertialUnit(x_m=1.2, mass_kg=150.0, center_x_m=2.0, inertia_kg_m2=130.0),
        fibre=Fibre(first_x_m=0.5, last_x_m=3.0, count=2, roll_deg=[30.0], std_um_per_m=2.0, range_um_per_m=5e3),
        base_pressure_ratio=0.7,
        friction_C_A=0.01,
    )
    sensed = vehicle.model_copy(update={"sensors": sensors})
    flown, n = flown_sensors(sensed, true_model.surface), len(true_model.names)
    assert flown is not None
    exact = exactly_built(n)
    model = flight_model(sensed, table, true_model, exact, 1e-7, flown.as_built(exact, None))
    assert model.reading_names[n:] == tuple(f"sensor.{name}" for name in model.gauge_names[n:])
    np.testing.assert_allclose(1e-7 * model.noise_scale[n:], flown.std)
    flow = truth_flows[6.25, round(radians(5.0), 9)]
    at = FlightCondition(
        mach_number=6.25,
        angle_of_attack=np.arctan(np.tan(flow.key[1]) * np.cos(1.0)),
        sideslip_angle=-np.arcsin(np.sin(flow.key[1]) * np.sin(1.0)),
        altitude=20e3,
    )
    phase = np.outer(np.arange(11), structure.surface.roll_angle - at.leeward_roll_angle)
    ratio = (pressure_harmonics(flow, structure.surface, 10) @ np.cos(phase)).ravel()
    rows = [
        *surface_rows(sensors, structure.surface),
        *rows_on_surface(sensors, sensed.noise, meshed_wall(sensed), structure.surface, 10),
    ]
    axial = 0.3 * at.ambient_pressure + 0.01 * at.dynamic_pressure
    axial *= vehicle.reference_quantities().area
    expected = np.array(
        [at.ambient_pressure * one.operator @ (ratio - 1.0) + axial * one.per_axial_force for one in rows]
    )
    found = evaluate(model, at).strain[n:]
    np.testing.assert_allclose(found / flown.std, expected / flown.std, rtol=1e-9, atol=1e-6)
    harmonic = pressure_harmonics(flow, structure.surface, 10)[None]
    np.testing.assert_allclose(sensor_readings(flown.as_built(exact, None), harmonic, [at])[0], found, rtol=1e-9)
    drawn = [flown.as_built(exact, np.random.default_rng(k)) for k in range(40)]
    error = np.array([sensor_readings(one, harmonic, [at])[0] - found for one in drawn])
    gain = np.array([one.gain for one in rows[:2]])
    np.testing.assert_allclose(error[:, :2].std(axis=0), np.abs(gain * found[:2]), rtol=0.35)
    assert np.all(error[:, 2:].std(axis=0) > 0.0)


@pytest.mark.parametrize(("mach_number", "incidence"), [(5.25, 3.0), (6.25, 5.0), (6.75, 11.0)])
def test_at_a_knot_the_flow_is_met(
    mach_number: float,
    incidence: float,
    vehicle: Vehicle,
    model: FlightModel,
    structure: StructuralModel,
    case: Case,
) -> None:
    """Coefficients and strain to 0.2 % of the force's and the strain's size: harmonics of the cells against nodes
    interpolated between them."""
    at = condition(mach_number, incidence, 0.0)
    strain, coefficients = direct(vehicle, structure, case, at)
    point = evaluate(model, at)
    assert np.linalg.norm(point.strain - strain) < 2e-3 * np.linalg.norm(strain)
    np.testing.assert_allclose(point.coefficients, coefficients, rtol=0.0, atol=2e-3 * coefficients[1])


@pytest.mark.parametrize(
    ("mach_number", "alpha", "beta"),
    [(6.0, 4.0, 0.0), (5.5, 2.0, 0.0), (6.5, 6.0, 3.0), (6.1, 8.0, 5.0), (6.0, 0.0, 4.0)],
)
def test_between_the_knots_the_flow_is_met(
    mach_number: float,
    alpha: float,
    beta: float,
    vehicle: Vehicle,
    model: FlightModel,
    structure: StructuralModel,
    case: Case,
) -> None:
    """Against a flow solved there: strain, force and moment within 1 % of their size."""
    at = condition(mach_number, alpha, beta)
    strain, coefficients = direct(vehicle, structure, case, at)
    point = evaluate(model, at)
    assert np.linalg.norm(point.strain - strain) < 0.01 * np.linalg.norm(strain)
    assert point.coefficients[0] == pytest.approx(coefficients[0], rel=0.01)
    force = np.hypot(*coefficients[1:3])
    np.testing.assert_allclose(point.coefficients[1:3], coefficients[1:3], rtol=0.0, atol=0.01 * force)
    # The moment point lies near the centre of pressure: 1 % of the force over a calibre.
    np.testing.assert_allclose(point.coefficients[3:], coefficients[3:], rtol=0.0, atol=0.01 * force)


def test_without_incidence_nothing_points_sideways(model: FlightModel) -> None:
    """C_N, C_Y, M_P, M_Y vanish, opposite gauges agree, to 1e-10."""
    point = evaluate(model, condition(6.0, 0.0, 0.0))
    np.testing.assert_allclose(point.coefficients[1:], 0.0, atol=1e-10)
    for i in range(1, 10):
        axial = [point.strain[gauge(model, f"axial_{roll}deg_{i}")] for roll in (0, 180)]
        assert axial[0] == pytest.approx(axial[1], rel=1e-10)


def test_strain_is_even_and_odd_as_it_must_be_near_zero(model: FlightModel) -> None:
    """Up and down by 0.01 deg: C_A changes by less than 1e-6, C_N and the lateral strain change sign."""
    up, down, level = (evaluate(model, condition(6.0, angle, 0.0)) for angle in (0.01, -0.01, 0.0))
    assert up.coefficients[0] == pytest.approx(level.coefficients[0], rel=1e-6)
    assert up.coefficients[1] == pytest.approx(-down.coefficients[1], rel=1e-9)
    top, bottom = gauge(model, "axial_0deg_5"), gauge(model, "axial_180deg_5")
    assert up.strain[top] == pytest.approx(down.strain[bottom], rel=1e-9)
    assert up.coefficients[1] > 0.0


def test_sideslip_to_the_other_side_mirrors(model: FlightModel) -> None:
    """b -> -b: C_Y and M_Y change sign, gauges at 90 and 270 deg swap."""
    left, right = (evaluate(model, condition(6.2, 3.0, beta)) for beta in (4.0, -4.0))
    np.testing.assert_allclose(right.coefficients, left.coefficients * [1, 1, -1, 1, -1], rtol=1e-12)
    for i in range(1, 10):
        swapped = [gauge(model, f"axial_{roll}deg_{i}") for roll in (90, 270)]
        np.testing.assert_allclose(right.strain[swapped], left.strain[swapped[::-1]], rtol=1e-9)
        same = [gauge(model, f"{kind}_{roll}deg_{i}") for kind in ("axial", "hoop") for roll in (0, 180)]
        np.testing.assert_allclose(right.strain[same], left.strain[same], rtol=1e-9)


def test_quarter_turn_moves_the_strain_to_the_next_row(model: FlightModel) -> None:
    """(a, b) = (5, 0) and (0, 5): leeward from 0 to 270 deg, so the axial rows move by one."""
    attack, sideslip = evaluate(model, condition(6.2, 5.0, 0.0)), evaluate(model, condition(6.2, 0.0, 5.0))
    for i in range(1, 10):
        before = [gauge(model, f"axial_{roll}deg_{i}") for roll in (0, 90, 180, 270)]
        after = [gauge(model, f"axial_{roll}deg_{i}") for roll in (270, 0, 90, 180)]
        np.testing.assert_allclose(sideslip.strain[after], attack.strain[before], rtol=1e-8)
    assert sideslip.coefficients[2] == pytest.approx(-attack.coefficients[1], rel=1e-9)
    assert sideslip.coefficients[4] == pytest.approx(-attack.coefficients[3], rel=1e-9)


def test_fixed_internal_pressure(
    vehicle: Vehicle,
    table: FlowTable,
    true_model: TrueStructure,
    model: FlightModel,
    case: Case,
) -> None:
    """A sealed body at 1 bar: strain of the difference from p_inf, and C_A less its push on the base."""
    sealed = vehicle.model_copy(
        update={"structure": vehicle.structure.model_copy(update={"internal_pressure_Pa": 1e5})}
    )
    at = condition(6.0, 4.0, 2.0)
    exact = exactly_built(len(true_model.names))
    vented, closed = evaluate(model, at), evaluate(flight_model(sealed, table, true_model, exact, 1e-7), at)
    difference = 1e5 - at.ambient_pressure
    uniform = case.strain_operator @ np.ones(true_model.surface.n_nodes)
    size = np.abs(closed.strain).max()
    np.testing.assert_allclose(closed.strain, vented.strain - difference * uniform, rtol=0.0, atol=1e-10 * size)
    area = pi * vehicle.body().base_radius ** 2
    push = difference * area / (at.dynamic_pressure * area)
    expected = vented.coefficients - [push, 0.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(closed.coefficients, expected, rtol=1e-9)
    assert isinstance(vented, FlightPoint)


def test_without_incidence_pressure_is_level_round_the_body(vehicle: Vehicle, true_model: TrueStructure) -> None:
    """All harmonics but the mean are below 1e-3 of p_inf."""
    level = truth_engine(vehicle).solve((6.25, 0.0))
    assert np.abs(pressure_harmonics(level, true_model.surface, 8)[:, 1:]).max() < 1e-3
