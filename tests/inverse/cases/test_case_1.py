"""The least-squares map: exact where it can be, unbiased, and independent of the unit of strain."""

from dataclasses import replace

import numpy as np
import pytest
from coarse_vehicle import with_paper_map
from inverse_case import Case, least_squares, noise_model
from state_estimates import precision_of

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map, inverse_map_of, snapshot_coefficients
from builder.inverse.problem import gauge_noise_covariance, inverse_problem
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import MapEntry, Noise
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.linear.pressure_modes import PressureModes
from strainfmu.linear.state_map import LeastSquaresMap, least_squares_map, relative_condition

pytestmark = pytest.mark.fast

N_MODES = 5


@pytest.fixture(scope="module")
def solved(case: Case) -> LeastSquaresMap:
    return least_squares(case, N_MODES)


def states(modes: PressureModes, n: int = 8) -> np.ndarray:
    """(n, 5) states of the size they have over the snapshots [Pa]."""
    return np.random.default_rng(5).normal(size=(n, N_MODES)) * modes.coefficient_std[:N_MODES]


def test_strain_of_modes_gives_the_states_back(case: Case, solved: LeastSquaresMap) -> None:
    """Without noise q = T d + k to 1e-9 of the first state's spread, as the data hold the mean's strain."""
    q = states(case.modes)
    pressure = case.modes.mean + q @ case.modes.modes[:, :N_MODES].T
    strain = (pressure - case.internal_pressure) @ case.strain_operator.T
    found = strain @ solved.strain_gain.T + solved.state_offset
    np.testing.assert_allclose(found, q, rtol=0.0, atol=1e-9 * case.modes.coefficient_std[0])


def test_gain_is_a_left_inverse(solved: LeastSquaresMap) -> None:
    np.testing.assert_allclose(solved.strain_gain @ solved.state_operator, np.eye(N_MODES), atol=1e-10)


def test_mean_pressure_is_the_zero_state(case: Case, solved: LeastSquaresMap) -> None:
    """T Z_p (p_mean - p_internal) + k = 0 to 1e-12 of its terms."""
    strain = case.strain_operator @ (case.modes.mean - case.internal_pressure)
    np.testing.assert_allclose(solved.mean_strain, strain, rtol=1e-12)
    state = solved.strain_gain @ strain + solved.state_offset
    np.testing.assert_allclose(state, 0.0, atol=1e-12 * np.abs(solved.state_offset).max())


def test_gain_is_the_weighted_least_squares_solution(case: Case, solved: LeastSquaresMap) -> None:
    """Gain and covariance against (Z' C^-1 Z)^-1 Z' C^-1 and (Z' C^-1 Z)^-1, formed by the book: 1e-6."""
    weight = np.linalg.inv(noise_model(case, N_MODES).covariance)
    z = solved.state_operator
    expected = np.linalg.solve(z.T @ weight @ z, z.T @ weight)
    np.testing.assert_allclose(solved.strain_gain, expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())
    covariance = np.linalg.inv(z.T @ weight @ z)
    size = np.outer(*2 * [np.sqrt(np.diag(covariance))])
    np.testing.assert_allclose(solved.state_covariance / size, covariance / size, rtol=0.0, atol=1e-6)


def test_estimate_is_stationary(case: Case, solved: LeastSquaresMap) -> None:
    """The gradient Z' C^-1 (d - m - Z q) vanishes at the estimate of any strain, to 1e-9 of its terms."""
    strain = solved.mean_strain + 10.0 * case.noise_std * np.random.default_rng(3).normal(size=len(case.noise_std))
    state = solved.strain_gain @ strain + solved.state_offset
    residual = np.linalg.solve(
        solved.noise_covariance, strain - solved.mean_strain - solved.state_operator @ state
    )
    terms = np.abs(solved.state_operator.T) @ np.abs(residual)
    assert np.all(np.abs(solved.state_operator.T @ residual) < 1e-9 * terms)


def test_gauges_in_another_order_and_scale_give_the_same_state(solved: LeastSquaresMap, case: Case) -> None:
    """d -> D P d with every gauge's own sensitivity: the gain goes to T (D P)^-1."""
    random = np.random.default_rng(2)
    order = random.permutation(len(case.noise_std))
    scale = random.uniform(0.5, 2.0, len(order))
    changed = least_squares_map(
        scale[:, None] * solved.state_operator[order],
        scale * solved.mean_strain[order],
        np.outer(scale, scale) * solved.noise_covariance[np.ix_(order, order)],
        case.modes.coefficient_std[:N_MODES],
    )
    expected = solved.strain_gain[:, order] / scale
    np.testing.assert_allclose(changed.strain_gain, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())
    np.testing.assert_allclose(changed.state_offset, solved.state_offset, rtol=1e-8)
    assert changed.condition_number == pytest.approx(solved.condition_number, rel=1e-8)


def test_rotated_gauges_give_the_same_state(case: Case, solved: LeastSquaresMap) -> None:
    """d -> R d with R orthogonal: T goes to T R', chi-square stays."""
    n = len(case.noise_std)
    rotation = np.linalg.qr(np.random.default_rng(4).normal(size=(n, n)))[0]
    covariance = rotation @ solved.noise_covariance @ rotation.T
    changed = least_squares_map(
        rotation @ solved.state_operator,
        rotation @ solved.mean_strain,
        0.5 * (covariance + covariance.T),
        case.modes.coefficient_std[:N_MODES],
    )
    expected = solved.strain_gain @ rotation.T
    np.testing.assert_allclose(changed.strain_gain, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())
    strain = solved.mean_strain + case.noise_std * np.random.default_rng(6).normal(size=n)
    before, after = strain - solved.mean_strain, rotation @ strain - changed.mean_strain
    chi_square = before @ precision_of(solved) @ before
    assert after @ precision_of(changed) @ after == pytest.approx(chi_square, rel=1e-8)


def test_residual_does_not_see_the_kept_modes(case: Case, solved: LeastSquaresMap) -> None:
    """P Z = 0, and L' P L is a projection of rank n_d - r, C = L L'."""
    spread = case.modes.coefficient_std[:N_MODES]
    strain, precision = solved.state_operator * spread, precision_of(solved)
    scale = np.abs(precision).max() * np.abs(strain).max()
    np.testing.assert_allclose(precision @ strain, 0.0, atol=1e-10 * scale)
    root = np.linalg.cholesky(solved.noise_covariance)
    projection = root.T @ precision @ root
    np.testing.assert_allclose(projection @ projection, projection, atol=1e-8)
    assert np.trace(projection) == pytest.approx(len(case.noise_std) - N_MODES, rel=1e-9)


def test_more_modes_than_gauges_or_snapshots_are_refused(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    def build(modes: int, used: Snapshots) -> None:
        build_inverse_map(with_paper_map(vehicle, modes=modes), used, structure)

    with pytest.raises(InputError, match=r"map.modes: 55 found, at most 54 with 54 gauges and 90 snapshots"):
        build(55, snapshots)
    few = {name: getattr(snapshots, name)[:4] for name in ("condition", "pressure", "internal_pressure", "solved")}
    few |= {name: getattr(snapshots, name)[:4] for name in ("flow", "momentum_error", "mass_error", "repairs")}
    with pytest.raises(InputError, match=r"map.modes: 4 found, at most 3 with 54 gauges and 4 snapshots"):
        build(4, replace(snapshots, **few))


def test_gauges_that_read_the_same_are_refused(case: Case) -> None:
    same = np.tile((case.strain_operator @ case.modes.modes[:, :3])[:1], (8, 1))
    with pytest.raises(InputError, match=r"the 8 gauges do not identify 3 modes \(condition number"):
        least_squares_map(same, np.zeros(8), np.eye(8), case.modes.coefficient_std[:3])


def test_relative_condition_number_is_the_published_expression(case: Case) -> None:
    """kappa(Z) / (nu cos theta), nu = |Z| |q| / |Zq|, cos theta = |Zq| / |d|, equals the short form to 1e-12."""
    z = case.strain_operator @ case.modes.modes[:, :N_MODES]
    scale, random = 2.0e5, np.random.default_rng(1)
    q, d = random.normal(size=N_MODES), 1e-4 * random.normal(size=len(z))
    scaled = scale * z
    nu = np.linalg.norm(scaled, 2) * np.linalg.norm(q) / np.linalg.norm(scaled @ q)
    cosine = np.linalg.norm(scaled @ q) / np.linalg.norm(d)
    found = relative_condition(z, float(np.linalg.norm(d)), float(np.linalg.norm(q)), scale)
    assert found.value == pytest.approx(np.linalg.cond(scaled) / (nu * cosine), rel=1e-12)
    assert found.kappa == pytest.approx(np.linalg.cond(scaled), rel=1e-12)
    assert f"in units of {scale:.6g} Pa" in found.scaling


def test_relative_condition_number_bounds_the_error(case: Case) -> None:
    """|dq|/|q| <= K |dd|/|d| for ordinary least squares, and the worst perturbation reaches it."""
    z = case.strain_operator @ case.modes.modes[:, :N_MODES]
    q = case.modes.coefficient_std[:N_MODES]
    d = z @ q
    k = relative_condition(z, float(np.linalg.norm(d)), float(np.linalg.norm(q)), 1.0).value
    gain = np.linalg.pinv(z)
    worst = np.linalg.svd(z)[0][:, N_MODES - 1]
    some = np.random.default_rng(2).normal(size=len(d))
    amplified = [
        (np.linalg.norm(gain @ one) / np.linalg.norm(q)) / (np.linalg.norm(one) / np.linalg.norm(d))
        for one in (worst, some)
    ]
    assert amplified[0] == pytest.approx(k, rel=1e-9)
    assert amplified[1] < k


def test_relative_condition_number_without_a_scale_is_refused(case: Case) -> None:
    z = case.strain_operator @ case.modes.modes[:, :N_MODES]
    with pytest.raises(InputError, match=r"state scale: expected a positive number, got 0.0"):
        relative_condition(z, 1e-4, 1.0, 0.0)
    with pytest.raises(InputError, match="K is infinite"):
        relative_condition(z[:3], 1e-4, 1.0, 1.0)


def test_weights_make_the_states_surer(solved: LeastSquaresMap) -> None:
    """Gauss-Markov: the ordinary estimate is unbiased too, and no state has a smaller variance under Gamma."""
    gain = np.linalg.pinv(solved.state_operator)
    np.testing.assert_allclose(gain @ solved.state_operator, np.eye(N_MODES), atol=1e-8)
    ordinary = np.diag(gain @ solved.noise_covariance @ gain.T)
    assert np.all(np.diag(solved.state_covariance) <= ordinary * (1.0 + 1e-9))
    assert np.any(np.diag(solved.state_covariance) < 0.5 * ordinary)


@pytest.mark.parametrize("form", ["absolute", "dynamic_pressure"])
@pytest.mark.parametrize("layout", ["configuration_1", "configuration_2", "configuration_45"])
def test_estimator_recovers_the_coefficients(
    layout: str, form: str, vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel, case: Case
) -> None:
    """The whole way: strain of representable pressures through the map and the estimator, to 1e-9.

    With the hardware errors of the vehicle file in form "dynamic_pressure", at twice the snapshots' pressure.
    """
    gauges = vehicle.gauges.model_copy(update={"layout": layout})
    changed = (vehicle if form == "dynamic_pressure" else with_paper_map(vehicle)).model_copy(
        update={"gauges": gauges}
    )
    problem = inverse_problem(changed, snapshots, structure)
    solution = problem.solution
    inverse_map = inverse_map_of(changed, snapshots, structure, problem, solution)
    estimator = Estimator(inverse_map)
    # Of about the size that they have over the snapshots.
    amplitude = 0.3 * np.linalg.norm(case.modes.coefficient_std) / np.sqrt(N_MODES)
    states_of_flights = amplitude * np.random.default_rng(5).normal(size=(3, solution.field_modes.shape[1]))
    mean = solution.mean - problem.ensemble.fixed_pressure
    ratio = 1.0 if form == "absolute" else 2.0
    dynamic_pressure = ratio * inverse_map.nominal_dynamic_pressure
    scale = dynamic_pressure * inverse_map.reference_area
    for net in ratio * (mean + states_of_flights @ solution.field_modes.T):
        estimate = estimator.estimate(structure.strain_operator(layout) @ net, dynamic_pressure)
        loads = case.loads @ net
        np.testing.assert_allclose(estimate.loads, loads, rtol=0.0, atol=1e-9 * np.abs(loads).max())
        expected = loads / scale
        expected[3:] /= inverse_map.reference_length
        np.testing.assert_allclose(estimate.coefficients, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
        assert estimate.chi_square < 1e-9
        assert estimate.health in (HealthState.OK, HealthState.OUTSIDE)


def test_map_holds_what_it_was_built_from(
    vehicle: Vehicle, paper_vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel, case: Case
) -> None:
    """Units, ranges and envelope: S and L of the base, q_inf of US Std Atm at 20 km, sigma 1 % of the median."""
    default, paper = (build_inverse_map(one, snapshots, structure) for one in (vehicle, paper_vehicle))
    radius = 1.75 * np.tan(np.radians(5.0)) + 1.85 * np.tan(np.radians(1.0))
    net = snapshots.pressure - case.internal_pressure
    strain = net @ structure.strain_operator("configuration_2").T
    mean_square = np.mean(np.square([5.0, 5.5, 6.0, 6.5, 7.0]))
    for built in (default, paper):
        assert built.reference_area == pytest.approx(np.pi * radius**2, rel=1e-12)
        assert built.reference_length == pytest.approx(2.0 * radius, rel=1e-12)
        assert built.nominal_dynamic_pressure == pytest.approx(0.7 * 5474.9 * mean_square, rel=1e-5)
        np.testing.assert_allclose(built.noise_std, 0.01 * np.median(np.abs(strain)), rtol=1e-12)
        assert built.provenance["mach_number"] == [5.0, 7.0]
        assert built.provenance["angle_of_attack_deg"] == pytest.approx([0.0, 10.0])
        assert built.provenance["flows_solved"] == 85
        assert built.residual_degrees_of_freedom == 49
    np.testing.assert_allclose(paper.strain_range, np.abs(strain).max(axis=0), rtol=1e-12)
    coefficients = snapshot_coefficients(vehicle, snapshots, case.loads)
    np.testing.assert_allclose(paper.coefficient_range[:, 1], coefficients.max(axis=0), rtol=1e-12, atol=1e-15)
    assert paper.coefficient_range[1, 1] > 0.0 > paper.coefficient_range[2, 0]
    # Rolled: C_A as listed, cross force and moment to every side, to 1 % between the 24 roll angles.
    amplitude = np.hypot(coefficients[:, [1, 3]], coefficients[:, [2, 4]]).max(axis=0)
    low, high = default.coefficient_range.T
    assert high[0] == pytest.approx(coefficients[:, 0].max(), rel=1e-9)
    np.testing.assert_allclose(high[1:], np.repeat(amplitude, 2), rtol=0.01)
    np.testing.assert_allclose(low[1:], -np.repeat(amplitude, 2), rtol=0.01)


@pytest.mark.parametrize(  # every two of the choices together
    ("form", "modes", "inner_product"),
    [
        ("absolute", 1, "euclidean"),
        ("absolute", 12, "area"),
        ("dynamic_pressure", 1, "area"),
        ("dynamic_pressure", 12, "euclidean"),
    ],
)
def test_any_number_of_modes_and_both_inner_products_build(
    modes: int, inner_product: str, form: str, vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """The mean's strain gives the mean's loads back; K stands in the provenance with its scaling."""
    entry = {"modes": modes, "inner_product": inner_product}
    if form == "absolute":
        changed = with_paper_map(vehicle, **entry)
    else:
        changed = vehicle.model_copy(update={"map": MapEntry.model_validate(entry)})
    built = build_inverse_map(changed, snapshots, structure)
    estimate = Estimator(built).estimate(built.mean_strain, built.nominal_dynamic_pressure)
    np.testing.assert_allclose(estimate.loads, built.load_of_mean, atol=1e-8 * np.abs(built.load_of_mean).max())
    assert 1 <= built.provenance["modes"] <= modes
    assert built.residual_degrees_of_freedom == 54 - built.provenance["modes"]
    assert built.provenance["relative_condition_number"] > 1.0
    assert "um/m" in built.provenance["relative_condition_scaling"]
    assert sum(term["share"] for term in built.provenance["noise_terms"]) == pytest.approx(1.0, rel=1e-9)


def test_absolute_noise_is_taken_as_given(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    changed = vehicle.model_copy(update={"noise": Noise(std_um_per_m=0.4)})
    covariance = gauge_noise_covariance(changed, snapshots, structure)
    np.testing.assert_allclose(covariance, np.diag(np.full(54, 0.16e-12)), rtol=1e-12)
