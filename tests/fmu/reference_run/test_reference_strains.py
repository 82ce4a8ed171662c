"""The run inside an estimator FMU: within the map's validity, errors as large as stated, a fault that is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_map import random_map
from scaled_maps import whole_scaled_map, with_envelope

from strainfmu.estimator.health import HealthState
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.fmu.documentation.run_panels import estimate_figure
from strainfmu.fmu.reference_run.run import N_ROWS, ReferenceRun, reference_run
from strainfmu.fmu.reference_run.strains import (
    error_covariance,
    failing_gauge,
    largest_states,
    reference_strains,
    reference_truth,
    true_states,
)
from strainfmu.interface.fmi_variables import COEFFICIENTS

pytestmark = pytest.mark.fast

CASES = ("case 1", "case 2", "envelope", "scaled")


def made(name: str) -> InverseMap:
    """A map whose mean is inside its own ranges, as the mean of snapshots is."""
    if name == "scaled":
        raw = whole_scaled_map(1, seed=4, n=54, n_states=5)
    else:
        raw = random_map({"case 1": 1, "case 2": 2, "envelope": 2}[name])
    force = raw.nominal_dynamic_pressure * raw.reference_area
    scale = force * np.array([1.0, 1.0, 1.0, raw.reference_length, raw.reference_length])
    mean, spread = raw.load_of_mean / scale, np.abs(raw.load_per_state / scale[:, None]).sum(axis=1)
    changed = {
        "coefficient_range": np.stack((mean - spread, mean + 0.5 * spread), axis=1),
        "strain_range": np.abs(raw.mean_strain) + np.abs(raw.state_operator).sum(axis=1),
    }
    if name == "envelope":
        stated = with_envelope(n=21, size=0.02)
        direction = np.asarray(stated["envelope_direction"])
        limit = direction @ mean + 0.3 * np.abs(direction) @ spread
        changed |= {"envelope_direction": direction, "envelope_limit": limit}
    return replace(raw, **changed)


@pytest.fixture(scope="module", params=CASES)
def case(request: pytest.FixtureRequest) -> InverseMap:
    return made(request.param)


@pytest.fixture(scope="module")
def run(case: InverseMap) -> ReferenceRun:
    return reference_run(case)


def test_the_motion_stays_inside_what_the_snapshots_cover(case: InverseMap) -> None:
    truth, states = reference_truth(case, N_ROWS), true_states(case, N_ROWS)
    low, high = case.coefficient_range.T
    room = 1e-12 * np.maximum(np.abs(low), np.abs(high))
    assert np.all(truth >= low - room)
    assert np.all(truth <= high + room)
    healthy = case.mean_strain + states @ case.state_operator.T
    assert np.all(np.abs(healthy) <= case.strain_range * (1.0 + 1e-12))
    if case.envelope_direction is not None:
        assert case.envelope_limit is not None
        assert np.all(truth @ case.envelope_direction.T <= case.envelope_limit + 1e-12)
    # It moves, and uses a good part of the room.
    assert np.all(np.max(np.abs(states), axis=0)[:2] > 0.2 * largest_states(case)[:2])
    assert np.ptp(truth, axis=0).max() > 0.0


def test_estimates_agree_with_the_truth_but_for_the_fault(case: InverseMap, run: ReferenceRun) -> None:
    """Rows of a run belong to the inputs of the row before; errors of the strains are those of the map."""
    truth = np.concatenate([reference_truth(case, N_ROWS)[:1], reference_truth(case, N_ROWS)[:-1]])
    _, fails = reference_strains(case, N_ROWS)
    held = np.concatenate([fails[:1], fails[:-1]])
    found = np.stack([run.outputs[name] for name in COEFFICIENTS], axis=1)
    sigma = np.stack([run.outputs[f"sigma.{name}"] for name in COEFFICIENTS], axis=1)
    assert np.all(np.abs(found - truth)[~held] < 5.0 * sigma[~held])
    state, suspect = run.outputs["health.state"], run.outputs["health.suspect_gauge"]
    gauge, _ = failing_gauge(case)
    assert set(state[~held]) == {float(HealthState.OK)}
    assert set(state[held]) <= {float(HealthState.INCONSISTENT), float(HealthState.SUSPECT)}
    assert held.sum() >= 4
    assert set(suspect[held]) == {gauge + 1.0}
    # Not round-off: the residual is that of errors.
    freedom = case.residual_degrees_of_freedom
    assert np.all(run.outputs["health.chi_square"][~held] > 0.1 * freedom)


def test_errors_follow_the_strain(case: InverseMap) -> None:
    """Symmetric, without negative variances; the map's own where no error follows the strain."""
    at = error_covariance(case, reference_truth(case, 3))
    np.testing.assert_allclose(at, at.transpose(0, 2, 1), rtol=1e-12, atol=0.0)
    assert np.linalg.eigvalsh(at).min() > -1e-9 * np.abs(at).max()
    if case.mean_product is None:
        np.testing.assert_array_equal(at, np.repeat(case.noise_covariance[None], 3, axis=0))


def test_the_run_is_in_its_file_to_the_last_digit(case: InverseMap, run: ReferenceRun) -> None:
    """Strains are rounded first, so that outputs belong to what the file holds."""
    strain = np.stack(list(run.inputs.values()), axis=1)
    assert strain.tolist() == [[float(f"{value:.9g}") for value in row] for row in strain.tolist()]
    last = Estimator(case).step(strain[-2], case.nominal_dynamic_pressure)
    assert run.outputs["C_N"][-1] == last.coefficients[1]


def test_the_figure_has_ticks_bands_and_words(case: InverseMap, run: ReferenceRun) -> None:
    figure = estimate_figure(case, run)
    assert figure.count("<polygon") == 5
    assert figure.count('class="tick"') > 30
    for text in (*COEFFICIENTS, "true", "OK", "time [s]", "0.2"):
        assert f">{text}" in figure
