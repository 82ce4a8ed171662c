"""What is written and said of health: limits, suspects by name, residuals, causes and the gauge to blame."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from recorded_case import NAMES, read_csv, samples, suspect_names, write_csv
from scaled_maps import scaled_map
from synthetic_vehicle import SyntheticFiles, synthetic_inverse_map

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.recorded.run import estimate_file

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]
HEADINGS = ["time", *NAMES, "dynamic_pressure"]


@pytest.fixture
def faulty(tmp_path: Path) -> tuple[Path, np.ndarray, np.ndarray]:
    """Return data with a bias in G4, a lost G2, and one sample without a dynamic pressure; strains and q_inf."""
    time, strain, pressure = samples(100)
    strain[10:17, 4] += 2e-5
    strain[30:33, 2] = np.nan
    pressure[50] = np.nan
    return write_csv(tmp_path / "d.csv", HEADINGS, time, strain, pressure), strain, pressure


@pytest.mark.parametrize("suffix", [".csv", ".h5"])
def test_health_is_written_in_full(
    faulty: tuple[Path, np.ndarray, np.ndarray], suffix: str, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    data, strain, pressure = faulty
    out = tmp_path / f"o{suffix}"
    estimate_file(synthetic.map_1, data, out, residuals=True)
    expected = Estimator(synthetic_inverse_map(1)).estimate(strain, pressure)
    if suffix == ".csv":
        found = {name.partition(" [")[0]: values for name, values in read_csv(out).items()}
    else:
        with h5py.File(out) as file:
            found = {name: item[()] for name, item in file.items()}
    np.testing.assert_allclose(found["health.chi_square_limit"], expected.chi_square_limit, rtol=1e-12)
    np.testing.assert_array_equal(found["health.degrees_of_freedom"], expected.degrees_of_freedom)
    np.testing.assert_array_equal(found["health.state"], expected.health)
    np.testing.assert_array_equal(found["gauges_used"], expected.valid.sum(axis=1))
    residual = np.column_stack([found[f"residual.{name}"] for name in NAMES])
    np.testing.assert_allclose(residual, expected.standardised_residual, rtol=1e-6, atol=1e-9)
    suspects = [";".join(NAMES[i] for i in one) for one in expected.suspects]
    assert suspect_names(out) == suspects
    np.testing.assert_array_equal(found["health.suspects"], [len(one) for one in expected.suspects])
    assert any(suspects)
    suspicious = np.abs(residual).max(axis=1) > found["health.residual_limit"]
    np.testing.assert_array_equal(suspicious, [bool(one) for one in suspects])


@pytest.mark.parametrize("case", [1, 2])
def test_the_limit_of_residuals_is_that_of_the_estimator(case: int, tmp_path: Path) -> None:
    """At any dynamic pressure, with gauges lost and limits scaled, a suspect is a residual above its limit."""
    held = replace(scaled_map(case, seed=1), chi_square_scale=1.3, outlier_scale=1.7)
    save_inverse_map(held, tmp_path / "map.h5")
    random = np.random.default_rng(3)
    ratio = random.uniform(0.2, 3.0, size=400)
    strain = ratio[:, None] * held.mean_strain + 5e-6 * random.standard_normal((400, held.n_gauges))
    strain[::3, 0] += random.uniform(0.0, 1e-4, size=len(strain[::3]))
    strain[::7, 2] = np.nan
    data = write_csv(
        tmp_path / "d.csv",
        ["time", *held.gauge_names, "dynamic_pressure"],
        np.arange(400.0),
        strain,
        ratio * held.nominal_dynamic_pressure,
    )
    out = tmp_path / "o.csv"
    estimate_file(tmp_path / "map.h5", data, out, residuals=True, accept_strain_level=True)
    found = read_csv(out)
    largest = np.abs(np.column_stack([found[f"residual.{name} [1]"] for name in held.gauge_names])).max(axis=1)
    suspicious = np.array([bool(name) for name in suspect_names(out)])
    np.testing.assert_array_equal(largest > found["health.residual_limit [1]"], suspicious)
    assert 20 < suspicious.sum() < 380


def test_an_fmu_gives_what_it_states(
    faulty: tuple[Path, np.ndarray, np.ndarray], synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    data, _, _ = faulty
    out = tmp_path / "o.csv"
    summary = estimate_file(synthetic.estimator_1, data, out)
    by_map = estimate_file(synthetic.map_1, data, tmp_path / "m.csv")
    assert summary.health == by_map.health
    found, expected = read_csv(out), read_csv(tmp_path / "m.csv")
    for name in ("health.chi_square_limit [1]", "health.suspects [1]", "gauges_used [1]", "C_N [1]"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9, atol=1e-12)
    assert np.isnan(found["health.degrees_of_freedom [1]"]).all()
    firsts = [name.partition(";")[0] for name in suspect_names(tmp_path / "m.csv")]
    assert suspect_names(out) == firsts
    code, _, errors = run("estimate", synthetic.estimator_1, data, "-o", out, "--residuals")
    assert code == 2
    assert f"{synthetic.estimator_1}: --residuals: expected an inverse map, got an FMU" in errors


def test_causes_and_the_gauge_to_blame_are_said_at_the_end(
    faulty: tuple[Path, np.ndarray, np.ndarray], synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    data, strain, pressure = faulty
    code, out, errors = run("estimate", synthetic.map_1, data, "-o", tmp_path / "o.h5")
    assert (code, errors) == (0, "")
    expected = Estimator(synthetic_inverse_map(1)).estimate(strain, pressure)
    numbers = {state: int((expected.health == state).sum()) for state in HealthState}
    assert numbers[HealthState.INCONSISTENT] == 7
    assert "INCONSISTENT: 7 of 100 samples (7 %): the residual's chi-square is above its limit: " in out
    blamed = [NAMES[i] for one in expected.suspects for i in one]
    most = max(NAMES, key=blamed.count)
    assert f"most often to blame: '{most}' (in {blamed.count(most)})" in out
    assert "DEGRADED: 3 of 100 samples (3 %): " in out
    assert "most often to blame: 'G2' (in 3)" in out
    assert "NO_COEFFICIENTS: 1 of 100 samples (1 %): dynamic pressure is not 1e-6 to 1e7 Pa" in out


def test_samples_that_are_ok_need_no_words(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    data = write_csv(tmp_path / "d.csv", HEADINGS, *samples(30))
    _, out, _ = run("estimate", synthetic.map_1, data, "-o", tmp_path / "o.h5")
    assert "health: OK 30\n" in out
    assert "to blame" not in out
