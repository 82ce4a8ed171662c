"""Case 2 the whole way: vehicle entries to map.h5 to the estimator, against formulas written out."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from coarse_vehicle import with_paper_map
from inverse_case import Case, estimated_field
from state_estimates import state_gain, state_offset

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.noise.model import nuisance_modes
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import MapEntry, Noise
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.estimator.reference.gain import load_covariance
from strainfmu.estimator.settings import SENSOR_RANGE, default_settings
from strainfmu.linear.pressure_modes import LowRankPrior
from strainfmu.linear.state_map import gaussian_map

DYNAMIC_PRESSURE = 137970.0


def built(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel, noise: Noise | None = None, **entry: Any
) -> InverseMap:
    """Return the map of the source: pressure in Pa, listed angles, no hardware errors but those of ``noise``."""
    changed = with_paper_map(vehicle, case=2, **entry)
    if noise is not None:
        changed = changed.model_copy(update={"noise": noise})
    return build_inverse_map(changed, snapshots, structure)


@pytest.mark.parametrize("gamma", [1e-2, 1.0, 10**0.5])
def test_estimator_gives_the_loads_of_the_published_formula(
    gamma: float, vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel, case: Case
) -> None:
    """f = G [p_mean + Gamma_pr Z' (gamma Gamma_n + Z Gamma_pr Z')^-1 (d - Z p_mean)], in the field: 1e-7."""
    inverse_map = built(vehicle, prior_snapshots, structure, gamma=gamma)
    mean = prior_snapshots.pressure.mean(axis=0)
    gamma_pr, z = np.cov(prior_snapshots.pressure.T), case.strain_operator / inverse_map.noise_std[:, None]
    random = np.random.default_rng(1)
    truth = prior_snapshots.pressure[17] - case.internal_pressure
    strain = case.strain_operator @ truth + inverse_map.noise_std * random.normal(size=54)
    deviation = strain / inverse_map.noise_std - z @ (mean - case.internal_pressure)
    weights = np.linalg.solve(gamma * np.eye(54) + z @ gamma_pr @ z.T, deviation)
    loads = case.loads @ (mean - case.internal_pressure + gamma_pr @ z.T @ weights)
    estimate = Estimator(inverse_map).estimate(strain, DYNAMIC_PRESSURE)
    np.testing.assert_allclose(estimate.loads, loads, rtol=0.0, atol=1e-7 * np.abs(loads).max())
    # The chi-square of the model, (d - m)' (Gamma + Z Gamma_pr Z')^-1 (d - m), whatever gamma.
    chi_square = deviation @ np.linalg.solve(np.eye(54) + z @ gamma_pr @ z.T, deviation)
    assert estimate.chi_square == pytest.approx(chi_square, rel=1e-6)
    assert estimate.health is HealthState.OK
    # Joseph's form in the field, its square root over q S and q S L.
    gain = case.loads @ np.linalg.solve(gamma * np.eye(54) + z @ gamma_pr @ z.T, z @ gamma_pr).T
    left = case.loads - gain @ z
    covariance = gain @ gain.T + left @ gamma_pr @ left.T
    scale = (
        DYNAMIC_PRESSURE * inverse_map.reference_area * np.array([1, 1, 1, *[inverse_map.reference_length] * 2])
    )
    expected = np.sqrt(np.diag(covariance)) / scale
    np.testing.assert_allclose(estimate.coefficients_std, expected, rtol=1e-5)


@pytest.mark.parametrize("gauge", [0, 20])
def test_estimator_without_a_gauge_is_the_map_of_the_others(
    gauge: int, vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel, case: Case
) -> None:
    """A broken gauge (NaN) leaves the posterior mean of the other 53, formed in the field: 1e-7."""
    inverse_map = built(vehicle, prior_snapshots, structure)
    mean, keep = prior_snapshots.pressure.mean(axis=0), np.arange(54) != gauge
    gamma_pr, std = np.cov(prior_snapshots.pressure.T), inverse_map.noise_std
    strain = case.strain_operator @ (prior_snapshots.pressure[40] - case.internal_pressure)
    strain += std * np.random.default_rng(2).normal(size=54)
    z = (case.strain_operator / std[:, None])[keep]
    deviation = (strain / std)[keep] - z @ (mean - case.internal_pressure)
    weights = np.linalg.solve(np.eye(53) + z @ gamma_pr @ z.T, deviation)
    loads = case.loads @ (mean - case.internal_pressure + gamma_pr @ z.T @ weights)
    strain[gauge] = np.nan
    estimate = Estimator(inverse_map).estimate(strain, DYNAMIC_PRESSURE)
    np.testing.assert_allclose(estimate.loads, loads, rtol=0.0, atol=1e-7 * np.abs(loads).max())


def test_map_is_small_saved_whole_and_says_what_it_is(
    tmp_path: Path, vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel
) -> None:
    inverse_map = built(vehicle, prior_snapshots, structure, gamma="evidence")
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    assert (tmp_path / "map.h5").stat().st_size < 2**20
    loaded = load_inverse_map(tmp_path / "map.h5")
    np.testing.assert_array_equal(state_gain(loaded), state_gain(inverse_map))
    assert (loaded.case, loaded.state_operator.shape, loaded.has_field) == (2, (54, 54), False)
    assert loaded.regularisation == pytest.approx(1.0, rel=1e-3)
    facts = loaded.provenance
    assert facts["gamma_rule"] == "evidence"
    eigenvalues = np.array(facts["hessian_eigenvalues"])
    assert facts["recoverable_modes"] == np.sum(eigenvalues >= loaded.regularisation)
    assert eigenvalues[0] / eigenvalues[7] > 1e3
    assert [term["name"] for term in facts["noise_terms"]] == ["gauge noise"]


def test_morozov_gives_the_published_order_of_gamma(
    vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel
) -> None:
    """The paper: 10^0.5; here within 1 to 30, another body and another flow solver."""
    assert 1.0 < built(vehicle, prior_snapshots, structure, gamma="morozov").regularisation < 30.0


def test_field_of_the_map_is_the_estimate(
    tmp_path: Path,
    vehicle: Vehicle,
    prior_snapshots: Snapshots,
    structure: StructuralModel,
    case: Case,
    prior: LowRankPrior,
) -> None:
    """field_mean + field_modes q of the saved map against F T (d - m) of all 243 states, single precision."""
    inverse_map = built(vehicle, prior_snapshots, structure, keep_field=True)
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    loaded = load_inverse_map(tmp_path / "map.h5")
    strain = loaded.mean_strain + 1e-6 * np.random.default_rng(3).normal(size=54)
    state = state_gain(loaded) @ strain + state_offset(loaded)
    found = loaded.field_mean + loaded.field_modes @ state
    of_prior = gaussian_map(case.strain_operator @ prior.factor, loaded.mean_strain, loaded.noise_covariance)
    expected = estimated_field(prior, of_prior, strain)
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert loaded.triangle.max() < len(expected)


def test_cut_prior_counts_what_is_cut(
    vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel
) -> None:
    """10 modes: the rest is noise with its load, unless the noise model is the paper's."""
    cut = built(vehicle, prior_snapshots, structure, prior_modes=10)
    assert state_gain(cut).shape == (10, 54)
    assert [term["name"] for term in cut.provenance["noise_terms"]] == ["gauge noise", "truncated modes"]
    assert np.all(np.abs(cut.strain_load_covariance).max(axis=0) > 0.0)
    assert 0.99 < cut.provenance["energy_of_modes"] < 1.0
    whole = built(vehicle, prior_snapshots, structure)
    # What is not estimated stays uncertain: the cut map cannot be surer than the whole one.
    ratio = np.diag(load_covariance(cut)) / np.diag(load_covariance(whole))
    assert np.all(ratio > 1.0 - 1e-9)
    paper = Noise(percent_of_median_strain=1.0, of_layout="configuration_2", model="paper")
    alone = built(vehicle, prior_snapshots, structure, paper, prior_modes=10)
    size = (np.linalg.norm(one, axis=1) for one in (alone.error_strain, alone.error_load))
    assert np.all(np.abs(alone.strain_load_covariance) <= 1e-12 * np.outer(*size))
    np.testing.assert_allclose(alone.noise_covariance, np.diag(alone.noise_std**2), rtol=1e-12)
    assert np.all(np.diag(load_covariance(alone)) < np.diag(load_covariance(cut)))


def test_nuisance_handed_in_widens_the_uncertainty(
    vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel
) -> None:
    gauges = vehicle.gauges.model_copy(update={"range_um_per_m": 3000.0})
    changed = vehicle.model_copy(update={"map": MapEntry(case=2), "gauges": gauges})
    heat = nuisance_modes("thermal strain", np.ones((54, 1)), np.array([1e-5]))
    plain = build_inverse_map(changed, prior_snapshots, structure)
    warm = build_inverse_map(changed, prior_snapshots, structure, [heat])
    np.testing.assert_allclose(
        warm.noise_covariance - plain.noise_covariance, np.full((54, 54), 1e-10), rtol=0.0, atol=1e-20
    )
    assert load_covariance(warm)[0, 0] > load_covariance(plain)[0, 0]
    assert [term["name"] for term in warm.provenance["noise_terms"]][-1] == "thermal strain"
    assert default_settings(warm).sensor_range == pytest.approx(3e-3)  # by the vehicle file
    assert default_settings(replace(warm, provenance={})).sensor_range == SENSOR_RANGE


def test_more_prior_modes_than_snapshots_are_refused(
    vehicle: Vehicle, prior_snapshots: Snapshots, structure: StructuralModel
) -> None:
    with pytest.raises(InputError, match=r"map.prior_modes: 300 found, at most \d+ with 243 snapshots"):
        built(vehicle, prior_snapshots, structure, prior_modes=300)
