"""The envelope of a map: every flow it is built on inside, flows beyond outside at any roll angle."""

from dataclasses import replace

import numpy as np
import pytest
from ensembles import listed_ensemble

from builder.inverse.ensemble import ROLLS, Ensemble
from builder.inverse.envelope import PRESSURE_SLACK, coefficient_half_spaces, flight_ranges
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.map_options import MapEntry
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.atmosphere import dynamic_pressure
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast

TINY = 1e-16 * np.eye(5)


def coefficients_at(mach: float, incidence: float, roll: float) -> np.ndarray:
    """Return (5,) C of a slender body: axial nearly constant, cross force and moment about linear in incidence."""
    force, moment = (2.0 + 0.1 * mach) * incidence + 3.0 * incidence**2, (0.4 - 0.02 * mach) * incidence
    axial = 0.2 / mach + 0.5 * incidence**2
    c, s = np.cos(roll), np.sin(roll)
    return np.array([axial, force * c, force * s, moment * c, moment * s])


FLOWS = [(mach, incidence) for mach in (5.0, 6.0, 7.0) for incidence in (0.0, 0.05, 0.1, 0.15, 0.2)]


def rolled() -> tuple[Ensemble, np.ndarray]:
    """Return an ensemble on a grid and (n, 5) coefficients of its members, each flow from another roll angle."""
    x = np.array([0.0, 1.0])
    ensemble = replace(
        listed_ensemble(np.ones((len(FLOWS), 2 * ROLLS))),
        grid=SurfaceGrid(x=x, radius=0.1 * x, angle=np.full(2, 0.1), n_roll=ROLLS),
    )
    first = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, len(FLOWS))
    members = [
        coefficients_at(mach, incidence, start + 2.0 * np.pi * turn / ROLLS)
        for turn in range(ROLLS)
        for (mach, incidence), start in zip(FLOWS, first, strict=True)
    ]
    return ensemble, np.array(members)


def scores(envelope: tuple[np.ndarray, np.ndarray], coefficients: np.ndarray) -> np.ndarray:
    """Return by how many standard deviations of :data:`TINY` each leaves the half-spaces; 0 inside."""
    direction, limit = envelope
    sigma = np.sqrt(np.einsum("mi,ij,mj->m", direction, TINY, direction))
    return np.maximum(0.0, np.max((coefficients @ direction.T - limit) / sigma, axis=1))


def test_every_flow_is_inside_at_every_roll_angle() -> None:
    """Not at the members' own roll angles alone."""
    ensemble, members = rolled()
    envelope = coefficient_half_spaces(ensemble, members)
    assert not scores(envelope, members).any()
    roll = np.radians(np.arange(0.0, 360.0, 2.5))
    between = np.array([coefficients_at(mach, incidence, angle) for mach, incidence in FLOWS for angle in roll])
    excess = between @ envelope[0].T - envelope[1]
    assert excess.max() < 1e-12


def test_five_percent_beyond_is_outside_at_every_roll_angle() -> None:
    ensemble, members = rolled()
    envelope = coefficient_half_spaces(ensemble, members)
    beyond = np.array(
        [
            coefficients_at(mach, 1.05 * 0.2, np.radians(roll))
            for mach in (5.0, 5.5, 6.0, 6.5, 7.0)
            for roll in np.arange(0.0, 360.0, 2.5)
        ]
    )
    assert np.all(scores(envelope, beyond) > 1e3)


def test_as_listed_the_sign_counts() -> None:
    """Members inside; the mirrored flow of the largest incidence outside."""
    members = np.array([coefficients_at(mach, incidence, 0.3) for mach, incidence in FLOWS])
    envelope = coefficient_half_spaces(listed_ensemble(np.ones((len(FLOWS), 3))), members)
    assert len(envelope[0]) == 210
    np.testing.assert_allclose(np.linalg.norm(envelope[0], axis=1), 1.0, rtol=1e-12)
    assert not scores(envelope, members).any()
    others = np.array([coefficients_at(6.0, 0.2, -0.3), coefficients_at(6.0, 0.21, 0.3)])
    assert np.all(scores(envelope, others) > 1e3)


def with_map(**entry: object) -> Vehicle:
    return load_vehicle(IC3X).model_copy(update={"map": MapEntry.model_validate(entry)})


def test_ranges_of_both_forms() -> None:
    conditions = tuple(
        FlightCondition(mach, 0.0, 0.0, altitude) for mach in (5.0, 7.0) for altitude in (18e3, 22e3)
    )
    slack = np.array([1.0 - PRESSURE_SLACK, 1.0 + PRESSURE_SLACK])
    absolute = flight_ranges(with_map(form="absolute").map, conditions)
    q = [dynamic_pressure(5.0, 22e3), dynamic_pressure(7.0, 18e3)]
    np.testing.assert_allclose(absolute["dynamic_pressure_range"], q * slack, rtol=1e-12)
    np.testing.assert_array_equal(absolute["altitude_range"], [18e3, 22e3])
    scaled = flight_ranges(with_map(valid_altitude_km=[10.0, 30.0]).map, conditions)
    q = [dynamic_pressure(5.0, 30e3), dynamic_pressure(7.0, 10e3)]
    np.testing.assert_allclose(scaled["dynamic_pressure_range"], q * slack, rtol=1e-12)
    np.testing.assert_array_equal(scaled["altitude_range"], [10e3, 30e3])
    for found in (absolute, scaled):
        np.testing.assert_array_equal(found["mach_number_range"], [5.0, 7.0])
