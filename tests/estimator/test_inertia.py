"""Inertial inputs: what they take off, what they leave in the uncertainty, and vibration."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_maps import exact_response, whole_map
from inertia_maps import ERRORS, PRIOR, with_masses
from raw_fmu import Fmu2, write_resource
from recorded_case import write_csv
from scaled_maps import NOMINAL, scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import INERTIAL_NAMES, NOT_KNOWN
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.estimator.map.sensors import with_inertia
from strainfmu.estimator.off_deadline import channels_of, vibration_ratio
from strainfmu.estimator.reference.readings import amplitudes
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.fmi_variables import value_references
from strainfmu.recorded.estimators import LATERAL_FORCES
from strainfmu.recorded.run import estimate_file

pytestmark = pytest.mark.fast

MOTION = {
    "specific_force_x": -12.0,
    "specific_force_y": 30.0,
    "specific_force_z": -45.0,
    "angular_rate_x": 1.0,
    "angular_rate_y": -0.5,
    "angular_rate_z": 2.0,
    "angular_acceleration_y": 3.0,
    "angular_acceleration_z": -4.0,
}
STANDARD_GRAVITY = 9.80665
AT_REST = dict.fromkeys(MOTION, 0.0)


def linear() -> InverseMap:
    return with_masses(with_temperature(scaled_map(2, seed=4, n=24)))


def tables() -> InverseMap:
    return with_masses(whole_map(), size=3e-6)


KINDS = pytest.mark.parametrize("held", [linear(), tables()], ids=["linear", "tables"])


def air(held: InverseMap) -> dict[str, float]:
    if held.manifold is None:
        return {"dynamic_pressure": NOMINAL}
    return {"dynamic_pressure": 0.7 * 36.0 * 5500.0, "mach_number": 6.0, "static_pressure": 5500.0}


def fitting(held: InverseMap) -> np.ndarray:
    """Strain (n_d,) of air loads alone."""
    if held.manifold is None:
        return held.mean_strain
    return exact_response(6.0, 0.03, 0.01, 5500.0)[: held.n_gauges]


def strain_of(held: InverseMap, motion: dict[str, float]) -> np.ndarray:
    """Strain by inertia (n_d,)."""
    assert held.inertia is not None
    values = {name: np.array([motion.get(name, np.nan)]) for name in INERTIAL_NAMES}
    return np.asarray(channels_of(values)[0] @ held.inertia.mode_strain.T)


def test_channels_are_specific_force_angular_acceleration_and_products_of_rates() -> None:
    found = channels_of({name: np.array([MOTION.get(name, NOT_KNOWN)]) for name in INERTIAL_NAMES})[0]
    w = np.array([1.0, -0.5, 2.0])
    p = np.outer(w, w) - w @ w * np.eye(3)
    expected = [-12.0, 30.0, -45.0, 3.0, -4.0, p[0, 0], p[1, 1], p[2, 2], p[0, 1], p[0, 2], p[1, 2]]
    assert found == pytest.approx(expected)
    lost = channels_of(
        {name: np.array([{**MOTION, "angular_rate_z": np.nan}.get(name, 0.0)]) for name in INERTIAL_NAMES}
    )
    assert np.isnan(lost[0]).tolist() == [False] * 5 + [True, True, False, False, True, True]


@KINDS
def test_what_is_measured_is_taken_off(held: InverseMap) -> None:
    estimator, strain = Estimator(held), fitting(held)
    # A measured channel leaves its error, and a part of the prior that the error hides.
    seen = PRIOR**2 / (PRIOR**2 + ERRORS**2)
    taken = channels_of({name: np.array([MOTION.get(name, np.nan)]) for name in INERTIAL_NAMES})[0] * seen
    assert held.inertia is not None
    expected = estimator.estimate(strain, **air(held), **AT_REST)
    found = estimator.estimate(strain + held.inertia.mode_strain @ taken, **air(held), **MOTION)
    np.testing.assert_allclose(found.loads, expected.loads, rtol=1e-6, atol=1e-6 * np.abs(expected.loads).max())
    np.testing.assert_allclose(found.loads_std, expected.loads_std, rtol=1e-6)
    off = estimator.estimate(strain + strain_of(held, MOTION), **air(held), **AT_REST)
    assert np.abs(off.loads - expected.loads).max() > 10.0 * np.abs(found.loads - expected.loads).max()


@KINDS
def test_what_is_not_measured_stays_in_the_uncertainty(held: InverseMap) -> None:
    estimator, strain = Estimator(held), fitting(held)
    without = estimator.estimate(strain, **air(held))
    unknown = estimator.estimate(strain, **air(held), **dict.fromkeys(INERTIAL_NAMES, NOT_KNOWN))
    np.testing.assert_array_equal(unknown.loads, without.loads)
    np.testing.assert_array_equal(unknown.loads_std, without.loads_std)
    one = estimator.estimate(strain, **air(held), specific_force_z=0.0)
    every = estimator.estimate(strain, **air(held), **AT_REST)
    assert np.all(every.loads_std <= one.loads_std * (1.0 + 1e-9))
    assert np.all(one.loads_std <= without.loads_std * (1.0 + 1e-9))
    assert every.loads_std[1] < 0.97 * without.loads_std[1]


@KINDS
def test_vibration_widens_the_uncertainty_and_health_shows_it(held: InverseMap) -> None:
    assert held.inertia is not None
    estimator, stated = Estimator(held), held.inertia.vibration_std
    at = {**air(held), **AT_REST}
    usual = estimator.estimate(fitting(held), **at)
    found = [estimator.estimate(fitting(held), **at, vibration=part * stated) for part in (0.0, 0.5, 1.0, 4.0)]
    stds = np.array([one.loads_std for one in found])
    assert np.all(np.diff(stds, axis=0) >= -1e-9 * stds[:-1])
    assert stds[3, 1] > 1.002 * stds[1, 1]
    np.testing.assert_allclose(stds[2], usual.loads_std, rtol=1e-12)
    assert [one.health for one in found] == [*3 * [usual.health], HealthState.DEGRADED]


def test_vibration_counts_in_steps_from_above() -> None:
    inertia = linear().inertia
    assert inertia is not None
    ratio = np.array([np.nan, NOT_KNOWN, 0.0, 0.0625, 0.07, 1.0, 1.0001, 1.5, 3.0, 1e5])
    found = vibration_ratio(inertia, ratio * inertia.vibration_std)
    root = np.sqrt(2.0)
    np.testing.assert_allclose(found, [np.nan, np.nan, 1e-6, 1e-6, root / 16.0, 1.0, root, 2.0, 4.0, 1024.0])


def test_temperature_and_inertia_are_joint() -> None:
    held = linear()
    joint = with_inertia(held.thermal, held.inertia)
    assert joint.n_sensors == held.thermal.n_sensors + len(PRIOR)
    known = np.arange(joint.n_sensors) >= held.thermal.n_sensors
    left = amplitudes(joint, np.full((1, joint.n_sensors), REFERENCE), known).covariance[0]
    n, k = held.thermal.n_modes, len(PRIOR)
    np.testing.assert_allclose(np.diag(left)[:n], held.thermal.prior_std**2)
    np.testing.assert_allclose(np.diag(left)[n : n + k], 1.0 / (PRIOR**-2 + ERRORS**-2))


def test_a_track_goes_on_from_a_state_with_vibration() -> None:
    held = tables()
    estimator, other = Estimator(held), Estimator(held)
    at = {**air(held), **AT_REST, "vibration": 1e-5}
    estimator.track(held.mean_strain, **at)
    other.memory = estimator.memory
    first, second = estimator.track(held.mean_strain, **at), other.track(held.mean_strain, **at)
    np.testing.assert_array_equal(first.loads_std, second.loads_std)


def test_a_file_holds_the_modes(tmp_path) -> None:
    held = tables()
    save_inverse_map(held, tmp_path / "map.h5")
    read = load_inverse_map(tmp_path / "map.h5").inertia
    assert read is not None
    assert held.inertia is not None
    np.testing.assert_array_equal(read.mode_strain, held.inertia.mode_strain)
    assert read.vibration_std == held.inertia.vibration_std


def test_inputs_that_a_map_does_not_take_are_refused() -> None:
    with pytest.raises(InputError, match=r"specific_force_x: expected none, the map was built without \[mass\]"):
        Estimator(scaled_map(2, seed=4, n=12)).estimate(np.zeros(12), NOMINAL, specific_force_x=1.0)
    with pytest.raises(InputError, match="specific_force: expected a quantity of a sample"):
        Estimator(linear()).estimate(np.zeros(24), NOMINAL, specific_force=1.0)


@pytest.mark.parametrize("name", ["prior_std", "sensor_std", "vibration_std", "vehicle_mass"])
def test_deviations_are_positive(name: str) -> None:
    inertia = linear().inertia
    assert inertia is not None
    inertia = replace(inertia, vehicle_mass=100.0)
    with pytest.raises(InputError, match=f"inertia: {name} (is 0, )?must be positive"):
        replace(inertia, **{name: 0.0 * getattr(inertia, name)})


def accelerated(held: InverseMap, load_factor: float = 5.0) -> tuple[InverseMap, np.ndarray, dict[str, float]]:
    """Return a map with the mass of the vehicle, and strain (n_d,) and motion of its free flight at a load factor.

    Air loads are those of ``fitting``: the mass is such that they cause the load factor.
    """
    assert held.inertia is not None
    loads = Estimator(held).estimate(fitting(held), **air(held), **AT_REST).loads
    mass = np.hypot(loads[1], loads[2]) / (load_factor * STANDARD_GRAVITY)
    motion = {**AT_REST, "specific_force_y": loads[2] / mass, "specific_force_z": loads[1] / mass}
    with_mass = replace(held, inertia=replace(held.inertia, vehicle_mass=float(mass)))
    return with_mass, fitting(held) + strain_of(held, motion), motion


@KINDS
def test_loads_over_the_weight_are_the_load_factor(held: InverseMap) -> None:
    """n = F / (m g), where the mass is stated; no values where it is not."""
    with_mass, strain, motion = accelerated(held, load_factor=4.0)
    estimate = Estimator(with_mass).step(strain, **air(held), **motion)
    weight = with_mass.inertia.vehicle_mass * STANDARD_GRAVITY
    np.testing.assert_allclose(estimate.load_factor, estimate.loads[:3] / weight, rtol=1e-15)
    assert np.hypot(*estimate.load_factor[1:]) == pytest.approx(4.0, rel=0.05)
    assert Estimator(held).step(fitting(held), **air(held)).load_factor.shape == (0,)


def in_g(motion: dict[str, float]) -> dict[str, float]:
    """Return the motion with specific forces in g, as if they were in m/s2."""
    return {name: value / STANDARD_GRAVITY if name in LATERAL_FORCES else value for name, value in motion.items()}


@KINDS
def test_a_specific_force_in_g_contradicts_load_and_mass(held: InverseMap) -> None:
    with_mass, strain, motion = accelerated(held)
    estimator, at = Estimator(with_mass), air(held)
    assert estimator.estimate(strain, **at, **motion).health == HealthState.OK
    assert estimator.estimate(strain, **at, **in_g(motion)).health == HealthState.INCONSISTENT
    assert estimator.estimate(strain, **at).health == HealthState.OK, "nothing measures it"
    along = {**motion, "specific_force_z": motion["specific_force_z"] / STANDARD_GRAVITY}
    assert estimator.estimate(strain, **at, **along).health == HealthState.INCONSISTENT
    assert Estimator(held).estimate(strain, **at, **motion).health == HealthState.OK


def test_an_fmu_and_a_recording_name_the_specific_force(tmp_path: Path) -> None:
    held, strain, motion = accelerated(linear())
    given = in_g(motion)
    of = value_references(estimator_interface(held))
    fmu = Fmu2(write_resource(held, tmp_path).as_uri(), held.n_gauges, logging=True).start()
    values = {"dynamic_pressure": NOMINAL, **given}
    values |= {f"temperature[{k + 1}]": REFERENCE for k in range(held.thermal.n_sensors)}
    fmu.set_strain(strain)
    assert fmu.set_reals([of[name] for name in values], list(values.values())) == 0
    fmu.step()
    (said,) = [text for _, _, text in fmu.messages if "health INCONSISTENT" in text]
    named = re.search(r"; specific_force_y: expected about (\S+) m/s2 by load and mass, got (\S+)$", said)
    assert named is not None
    assert float(named[1]) == pytest.approx(motion["specific_force_y"], rel=0.05)
    assert float(named[2]) == pytest.approx(given["specific_force_y"], rel=0.01)

    save_inverse_map(held, tmp_path / "map.h5")
    headings = ["time", *held.gauge_names, "dynamic_pressure", *(f"{name} [m/s2]" for name in LATERAL_FORCES)]
    rows = np.tile([*strain, NOMINAL, *(given[name] for name in LATERAL_FORCES)], (8, 1))
    data = write_csv(tmp_path / "d.csv", headings, 0.01 * np.arange(8.0), rows)
    summary = estimate_file(tmp_path / "map.h5", data, tmp_path / "o.csv")
    assert "most often to blame: 'specific_force_y' (in 8)" in "\n".join(summary.health_lines())


@pytest.mark.parametrize(("factor", "is_named"), [(1.0, False), (1.0 / STANDARD_GRAVITY, True)])
def test_a_recording_without_the_mass_names_a_specific_force_in_g(
    tmp_path: Path, factor: float, is_named: bool
) -> None:
    held, strain, motion = accelerated(linear())
    assert held.inertia is not None
    save_inverse_map(replace(held, inertia=replace(held.inertia, vehicle_mass=None)), tmp_path / "map.h5")
    headings = ["time", *held.gauge_names, "dynamic_pressure", *(f"{name} [m/s2]" for name in LATERAL_FORCES)]
    rows = np.tile([*strain, NOMINAL, *(factor * motion[name] for name in LATERAL_FORCES)], (8, 1))
    data = write_csv(tmp_path / "d.csv", headings, 0.01 * np.arange(8.0), rows)
    notes = estimate_file(tmp_path / "map.h5", data, tmp_path / "o.csv").notes
    named = [note for note in notes if "strain fits 9.81 times the readings" in note]
    assert len(named) == is_named
    assert all("specific_force_y, specific_force_z: " in note for note in named)
