"""The least-squares map: exact where it can be, unbiased, and independent of how strain is written."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from inverse_case import Case

from builder.build import build_inverse_map, gauge_noise_std, snapshot_coefficients
from builder.inversion import LeastSquaresMap, least_squares_map
from builder.reduction import PressureModes
from builder.snapshots import Snapshots
from builder.structural_model import StructuralModel
from builder.vehicle import Vehicle
from strainfmu.errors import InputError
from strainfmu.estimator import Estimator
from strainfmu.health import HealthState

N_MODES = 5


@pytest.fixture(scope="module")
def solved(case: Case) -> LeastSquaresMap:
    return least_squares_map(case.strain_operator, case.modes, N_MODES, case.noise_std, case.internal_pressure)


def states(modes: PressureModes, n: int = 8) -> np.ndarray:
    """(n, 5) states of the size they have over the snapshots [Pa]."""
    return np.random.default_rng(5).normal(size=(n, N_MODES)) * modes.coefficient_std()[:N_MODES]


def test_strain_of_modes_gives_the_states_back(case: Case, solved: LeastSquaresMap) -> None:
    """Without noise q = T d + k to 1e-9 of the first state's spread, as the data hold the mean's strain."""
    q = states(case.modes)
    pressure = case.modes.mean + q @ case.modes.modes[:, :N_MODES].T
    strain = (pressure - case.internal_pressure) @ case.strain_operator.T
    found = strain @ solved.strain_gain.T + solved.state_offset
    np.testing.assert_allclose(found, q, rtol=0.0, atol=1e-9 * case.modes.coefficient_std()[0])


def test_gain_is_a_left_inverse(solved: LeastSquaresMap) -> None:
    np.testing.assert_allclose(solved.strain_gain @ solved.strain_per_state, np.eye(N_MODES), atol=1e-10)


def test_mean_pressure_is_the_zero_state(case: Case, solved: LeastSquaresMap) -> None:
    """T Z_p (p_mean - p_internal) + k = 0 to 1e-12 of its terms."""
    strain = case.strain_operator @ (case.modes.mean - case.internal_pressure)
    np.testing.assert_allclose(solved.mean_strain, strain, rtol=1e-12)
    state = solved.strain_gain @ strain + solved.state_offset
    np.testing.assert_allclose(state, 0.0, atol=1e-12 * np.abs(solved.state_offset).max())


def test_gain_is_the_weighted_least_squares_solution(case: Case, solved: LeastSquaresMap) -> None:
    """Against (Z' C^-1 Z)^-1 Z' C^-1 with C of noise and truncated modes, formed by the book: 1e-6."""
    weight = np.linalg.inv(np.diag(case.noise_std**2) + solved.strain_of_truncated @ solved.strain_of_truncated.T)
    z = solved.strain_per_state
    expected = np.linalg.solve(z.T @ weight @ z, z.T @ weight)
    np.testing.assert_allclose(solved.strain_gain, expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())


def test_truncated_modes_have_the_strain_of_their_snapshots(
    case: Case, solved: LeastSquaresMap, snapshots: Snapshots
) -> None:
    """Their covariance is that of the snapshots' strain less what the kept modes explain."""
    centred = snapshots.pressure - case.modes.mean
    kept = case.modes.modes[:, :N_MODES]
    strain = (centred - centred @ kept @ kept.T) @ case.strain_operator.T
    expected = strain.T @ strain / (len(strain) - 1)
    found = solved.strain_of_truncated @ solved.strain_of_truncated.T
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())


def test_gauges_in_another_order_and_scale_give_the_same_state(case: Case, solved: LeastSquaresMap) -> None:
    """d -> D P d with every gauge's own sensitivity: the gain goes to T (D P)^-1."""
    random = np.random.default_rng(2)
    order = random.permutation(len(case.noise_std))
    scale = random.uniform(0.5, 2.0, len(order))
    changed = least_squares_map(
        scale[:, None] * case.strain_operator[order],
        case.modes,
        N_MODES,
        scale * case.noise_std[order],
        case.internal_pressure,
    )
    expected = solved.strain_gain[:, order] / scale
    np.testing.assert_allclose(changed.strain_gain, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())
    np.testing.assert_allclose(changed.state_offset, solved.state_offset, rtol=1e-8)
    assert changed.condition_number == pytest.approx(solved.condition_number, rel=1e-8)


def test_rotated_gauges_give_the_same_state(case: Case, solved: LeastSquaresMap) -> None:
    """d -> R d with R orthogonal leaves equal noise equal: T goes to T R', chi-square stays."""
    n = len(case.noise_std)
    rotation = np.linalg.qr(np.random.default_rng(4).normal(size=(n, n)))[0]
    changed = least_squares_map(
        rotation @ case.strain_operator, case.modes, N_MODES, case.noise_std, case.internal_pressure
    )
    expected = solved.strain_gain @ rotation.T
    np.testing.assert_allclose(changed.strain_gain, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())
    strain = solved.mean_strain + case.noise_std * np.random.default_rng(6).normal(size=n)
    before = solved.residual_whitening @ (strain - solved.mean_strain)
    after = changed.residual_whitening @ (rotation @ strain - changed.mean_strain)
    assert after @ after == pytest.approx(before @ before, rel=1e-8)


def test_residual_does_not_see_the_kept_modes(case: Case, solved: LeastSquaresMap) -> None:
    """W Z = 0, and W C W' is a projection of rank n_d - r."""
    spread = case.modes.coefficient_std()[:N_MODES]
    strain = solved.strain_per_state * spread
    scale = np.abs(solved.residual_whitening).max() * np.abs(strain).max()
    np.testing.assert_allclose(solved.residual_whitening @ strain, 0.0, atol=1e-10 * scale)
    covariance = np.diag(case.noise_std**2) + solved.strain_of_truncated @ solved.strain_of_truncated.T
    projection = solved.residual_whitening @ covariance @ solved.residual_whitening.T
    np.testing.assert_allclose(projection @ projection, projection, atol=1e-8)
    assert np.trace(projection) == pytest.approx(len(case.noise_std) - N_MODES, rel=1e-9)


def test_more_modes_than_gauges_or_snapshots_are_refused(case: Case) -> None:
    with pytest.raises(InputError, match=r"map.modes: 55 found, at most 54 with 54 gauges and 90 snapshots"):
        least_squares_map(case.strain_operator, case.modes, 55, case.noise_std, 0.0)
    few = replace(case.modes, modes=case.modes.modes[:, :3], singular_values=case.modes.singular_values[:3])
    with pytest.raises(InputError, match=r"map.modes: 4 found, at most 3"):
        least_squares_map(case.strain_operator, few, 4, case.noise_std, 0.0)


def test_gauges_that_read_the_same_are_refused(case: Case) -> None:
    same = np.tile(case.strain_operator[:1], (8, 1))
    with pytest.raises(InputError, match=r"the 8 gauges cannot tell 3 modes apart \(condition number"):
        least_squares_map(same, case.modes, 3, case.noise_std[:8], 0.0)


@pytest.mark.parametrize("layout", ["configuration_1", "configuration_2", "configuration_45"])
def test_estimator_recovers_the_coefficients(
    layout: str, vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel, case: Case
) -> None:
    """The whole way: strain of representable pressures through the map and the estimator, to 1e-9."""
    gauges = vehicle.gauges.model_copy(update={"layout": layout})
    inverse_map = build_inverse_map(vehicle.model_copy(update={"gauges": gauges}), snapshots, structure)
    estimator = Estimator(inverse_map)
    q = states(case.modes, 3)
    pressure = case.modes.mean + q @ case.modes.modes[:, :N_MODES].T
    dynamic_pressure = 137970.0
    scale = dynamic_pressure * inverse_map.reference_area
    for net in pressure - case.internal_pressure:
        estimate = estimator.estimate(structure.strain_operator(layout) @ net, dynamic_pressure)
        loads = case.loads @ net
        np.testing.assert_allclose(estimate.loads, loads, rtol=0.0, atol=1e-9 * np.abs(loads).max())
        expected = loads / scale
        expected[3:] /= inverse_map.reference_length
        np.testing.assert_allclose(estimate.coefficients, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
        assert estimate.chi_square < 1e-9
        assert estimate.health is HealthState.OK


def test_map_holds_what_it_was_built_from(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel, case: Case
) -> None:
    """Units, ranges and envelope: S and L of the base, q_inf of US Std Atm at 20 km, sigma 1 % of the median."""
    built = build_inverse_map(vehicle, snapshots, structure)
    radius = 1.75 * np.tan(np.radians(5.0)) + 1.85 * np.tan(np.radians(1.0))
    assert built.reference_area == pytest.approx(np.pi * radius**2, rel=1e-12)
    assert built.reference_length == pytest.approx(2.0 * radius, rel=1e-12)
    mean_square = np.mean(np.square([5.0, 5.5, 6.0, 6.5, 7.0]))
    assert built.nominal_dynamic_pressure == pytest.approx(0.7 * 5474.9 * mean_square, rel=1e-5)
    net = snapshots.pressure - case.internal_pressure
    strain = net @ structure.strain_operator("configuration_2").T
    np.testing.assert_allclose(built.noise_std, 0.01 * np.median(np.abs(strain)), rtol=1e-12)
    np.testing.assert_allclose(built.strain_range, np.abs(strain).max(axis=0), rtol=1e-12)
    coefficients = snapshot_coefficients(vehicle, snapshots, case.loads)
    np.testing.assert_allclose(built.coefficient_range[:, 1], coefficients.max(axis=0), rtol=1e-12)
    assert built.coefficient_range[1, 1] > 0.0 > built.coefficient_range[2, 0]
    assert built.provenance["mach_number"] == [5.0, 7.0]
    assert built.provenance["angle_of_attack_deg"] == pytest.approx([0.0, 10.0])
    assert built.provenance["flows_solved"] == 85
    assert built.residual_degrees_of_freedom == 49


def test_absolute_noise_is_taken_as_given(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    noise = vehicle.noise.model_copy(
        update={"percent_of_median_strain": None, "of_layout": None, "std_um_per_m": 0.4}
    )
    assert gauge_noise_std(vehicle.model_copy(update={"noise": noise}), snapshots, structure) == pytest.approx(
        4e-7
    )
