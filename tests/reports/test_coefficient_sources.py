"""Causes of the coefficients' variance add up, and each is what it would be alone."""

from dataclasses import replace

import numpy as np
import pytest
from report_case import CASE_1, CASE_2, ReportCase, case_of

from builder.campaign.snapshots import Snapshots
from builder.inverse.solution import ordered_modes
from builder.reports.findings.coefficient_sources import OF_STATES, coefficient_sources, gamma_choice
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.observability import SYMMETRIES
from builder.vehicle.file import Vehicle
from strainfmu.estimator.reference.gain import load_covariance, load_gain
from strainfmu.linear.regularisation import expected_data, select_gamma

pytestmark = pytest.mark.fast

Parts = tuple[Vehicle, Snapshots, StructuralModel]


def test_causes_add_up_to_the_variance(case: ReportCase) -> None:
    found = coefficient_sources(case.inverse_map, case.problem, case.solution)
    np.testing.assert_allclose(found.variance.sum(axis=0), found.std**2, rtol=1e-9)
    assert (found.variance >= 0.0).all()
    one = case.inverse_map
    area, length, q = one.reference_area, one.reference_length, one.nominal_dynamic_pressure
    by_hand = np.sqrt(np.diag(load_covariance(one))) / (q * area * np.array([1, 1, 1, length, length]))
    np.testing.assert_allclose(found.std, by_hand, rtol=1e-12)
    np.testing.assert_allclose(np.diag(found.correlation), 1.0)


def test_truncated_modes_are_what_flying_them_does(case_1: ReportCase) -> None:
    """Each truncated mode at one deviation through gain and loads; squares of the errors in C_A .. M_Y, 1e-8."""
    case = case_1
    found, one = coefficient_sources(case.inverse_map, case.problem, case.solution), case.inverse_map
    modes, _, states, _ = ordered_modes(case.problem)
    scale = found.std / np.sqrt(np.diag(load_covariance(one)))
    total = np.zeros(5)
    for j in range(len(states), modes.modes.shape[1]):
        pressure = modes.modes[:, j] * modes.coefficient_std[j]
        error = load_gain(one) @ (case.problem.strain_operator @ pressure) - case.problem.load_operator @ pressure
        total += (scale * error) ** 2
    row = found.names.index("truncated modes")
    np.testing.assert_allclose(found.variance[row], total, rtol=1e-8)


def test_gauge_noise_alone(case: ReportCase) -> None:
    """G Gamma G' of the ogive's 0.3 um/m."""
    found, one = coefficient_sources(case.inverse_map, case.problem, case.solution), case.inverse_map
    scale = found.std / np.sqrt(np.diag(load_covariance(one)))
    expected = (scale * 0.3e-6) ** 2 * np.sum(load_gain(one) ** 2, axis=1)
    np.testing.assert_allclose(found.variance[found.names.index("gauge noise")], expected, rtol=1e-9)


def test_the_prior_is_a_cause_in_case_2_only(parts: Parts) -> None:
    for entry, there in ((CASE_1, False), (CASE_2, True)):
        case = case_of(parts, entry)
        assert (OF_STATES in coefficient_sources(case.inverse_map, case.problem, case.solution).names) == there


def test_gamma_of_every_rule(case_2: ReportCase) -> None:
    """The gamma in use gives the map's own sigmas; the others are those that the rules select."""
    case = case_2
    choice = gamma_choice(case.inverse_map, case.problem, case.solution, case.structure.surface)
    assert choice is not None
    used = choice.rules[0]
    assert (used.rule, used.gamma) == ("this map", 2.0)
    assert used.coefficient_std is not None
    expected = coefficient_sources(case.inverse_map, case.problem, case.solution).std
    np.testing.assert_allclose(used.coefficient_std, expected, rtol=1e-9)
    assert used.n_recoverable == int(np.sum(choice.eigenvalues >= 2.0))
    assert used.degrees_of_freedom == pytest.approx(np.sum(choice.eigenvalues / (choice.eigenvalues + 2.0)))
    data = expected_data(
        case.solution.solved.spectrum.eigenvalues, len(case.solution.solved.spectrum.left_vectors)
    )  # type: ignore[attr-defined]
    for one in choice.rules[1:]:
        if one.gamma is None:
            assert one.why_not
        else:
            assert one.gamma == pytest.approx(select_gamma(one.rule, data))  # type: ignore[arg-type]
    assert sum(one.gamma is not None for one in choice.rules) >= 3


def test_classes_of_the_modes_are_those_of_their_waves(case_2: ReportCase) -> None:
    """The same fractions in another way: cosines and sines of each ring by FFT, sorted by Symmetry.waves."""
    case = case_2
    grid, solved = case.structure.surface, case.solution.solved
    choice = gamma_choice(case.inverse_map, case.problem, case.solution, grid)
    assert choice is not None
    spectrum = solved.spectrum  # type: ignore[attr-defined]
    fields = case.solution.field_modes @ spectrum.right_vectors[:, : len(choice.eigenvalues)]
    waves = np.fft.rfft(grid.as_map(fields.T))
    weight = grid.as_map(case.problem.node_area)[:, 0]
    m = np.arange(waves.shape[-1])
    # The constant and, of an even number of nodes, the last wave are there once, all others twice.
    twice = np.where((m == 0) | (2 * m == grid.n_roll), 1.0, 2.0)
    parts_of_waves = ((False, waves.real), (True, waves.imag))
    energy = {sine: np.einsum("nxm,x->nm", part**2, weight) for sine, part in parts_of_waves}
    fractions = np.stack(
        [
            sum((energy[sine] * twice) @ one.waves(m, np.full(len(m), sine)) for sine in (False, True))
            for one in SYMMETRIES
        ],
        axis=1,
    )
    np.testing.assert_allclose(choice.mode_classes, fractions / fractions.sum(axis=1, keepdims=True), atol=1e-12)
    assert np.ptp(np.argmax(choice.mode_classes, axis=1)) > 0


def test_case_1_has_no_gamma(case_1: ReportCase) -> None:
    case = case_1
    assert gamma_choice(case.inverse_map, case.problem, case.solution, case.structure.surface) is None


def test_a_coefficient_that_does_not_change_has_no_share_of_range(case_1: ReportCase) -> None:
    """C_Y without sideslip: a range of round-off."""
    case = case_1
    changed = case.inverse_map.coefficient_range.copy()
    changed[2] = [-1e-17, 1e-17]
    one = replace(case.inverse_map, coefficient_range=changed)
    fraction = coefficient_sources(one, case.problem, case.solution).std_of_range
    assert np.isinf(fraction[2])
    assert np.isfinite(np.delete(fraction, 2)).all()
