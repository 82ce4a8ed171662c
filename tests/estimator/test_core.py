"""The handle on the compiled core: which core serves, what a machine without it does, what is remembered."""

import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_fmu import random_flight, whole_map
from random_map import map_of, random_model
from scaled_maps import NOMINAL, whole_scaled_map

from strainfmu.errors import InputError
from strainfmu.estimator.core import Core, library_file
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map

pytestmark = pytest.mark.fast

PROGRAM = """
import sys, numpy as np
from pathlib import Path
import strainfmu, strainfmu.estimator.core as core
core.library_file = lambda: Path("nowhere")
if sys.argv[3:]:
    sys.modules["ziglang"] = None
estimator = strainfmu.load(sys.argv[1])
found = estimator.estimate(estimator.inverse_map.mean_strain, float(sys.argv[2]))
print(type(estimator.core).__name__, repr(found.coefficients.tolist()))
"""


@pytest.fixture(scope="module")
def linear() -> InverseMap:
    return whole_scaled_map(1, 3)


@pytest.fixture(scope="module")
def nonlinear() -> InverseMap:
    return whole_map()


def run_without_library(
    path: Path, tmp_path: Path, known: dict[str, str], *more: str
) -> subprocess.CompletedProcess[str]:
    arguments = [sys.executable, "-c", PROGRAM, str(path), str(NOMINAL), *more]
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "LOCALAPPDATA": str(tmp_path / "cache")}
    return subprocess.run(arguments, capture_output=True, text=True, check=False, env=os.environ | cache | known)


def test_the_shipped_library_serves(linear: InverseMap, nonlinear: InverseMap) -> None:
    assert library_file().exists()
    for one in (linear, nonlinear):
        assert type(Estimator(one).core) is Core


@pytest.mark.skipif(shutil.which("cc") is None or os.name == "nt", reason="no C compiler 'cc' is installed")
def test_without_it_the_sources_are_compiled_once(linear: InverseMap, tmp_path: Path) -> None:
    """By a compiler that the environment names; optimised it takes three times as long, with the same bits."""
    compiler = tmp_path / "quick"
    compiler.write_text('#!/bin/sh\nexec cc "$@" -O0\n', encoding="utf-8")
    compiler.chmod(0o755)
    save_inverse_map(linear, tmp_path / "map.h5")
    expected = Estimator(linear).estimate(linear.mean_strain, NOMINAL).coefficients
    for _ in range(2):
        finished = run_without_library(tmp_path / "map.h5", tmp_path, {"CC": str(compiler)})
        assert finished.stdout == f"Core {expected.tolist()!r}\n", finished.stderr
    (made,) = (tmp_path / "cache" / "strainfmu").glob("estimator-*")
    assert made.stat().st_size > 1e5


def test_without_a_compiler_a_line_says_how_to_get_the_library(linear: InverseMap, tmp_path: Path) -> None:
    save_inverse_map(linear, tmp_path / "linear.h5")
    refused = run_without_library(
        tmp_path / "linear.h5", tmp_path, {"PATH": str(tmp_path), "CC": ""}, "without zig"
    )
    assert refused.returncode != 0
    assert "no C compiler (CC, cc, gcc, clang) found: install one, or ziglang" in refused.stderr.splitlines()[-1]


def test_a_time_that_is_no_number_is_that_of_the_sample_before(linear: InverseMap, nonlinear: InverseMap) -> None:
    for one in (linear, nonlinear):
        core = Estimator(one).core
        inputs = np.full((3, core.n_inputs), np.nan)
        inputs[:, : one.n_gauges] = one.mean_strain
        known = core.series(1, inputs, time=np.array([1.0, 1.0, 1.0]))
        state = core.state
        core.restart()
        np.testing.assert_array_equal(core.series(1, inputs, time=np.array([1.0, np.nan, -np.inf])), known)
        assert core.state == state
        core.state = state  # it is accepted


def test_one_sample_and_a_series_are_the_same(linear: InverseMap, nonlinear: InverseMap) -> None:
    for held, q in ((linear, NOMINAL), (nonlinear, 1.2e5)):
        estimator = Estimator(held)
        flight = random_flight(held, 60, seed=3) if held is nonlinear else None
        strain = (
            np.array([one.strain for one in flight])
            if flight
            else held.mean_strain + 1e-6 * np.random.default_rng(2).normal(size=(60, held.n_gauges))
        )
        series = estimator.estimate(strain, q)
        for row in (0, 17, 59):
            one = estimator.estimate(strain[row], q)
            for name in ("coefficients", "loads_std", "load_covariance", "standardised_residual", "valid"):
                np.testing.assert_array_equal(getattr(one, name), getattr(series, name)[row], err_msg=name)
            assert one.suspects == series.suspects[row] == series[row].suspects
            assert one.health == series.health[row]


def test_a_track_goes_on_in_another_estimator_and_with_other_zeros(nonlinear: InverseMap) -> None:
    first, second = Estimator(nonlinear).filter(0.5), Estimator(nonlinear).filter(0.5)
    flight = random_flight(nonlinear, 12, seed=5)
    for k, one in enumerate(flight[:6]):
        first.track(one.strain, time=0.01 * k, **one.flow)
    second.memory = first.memory
    zeros = GaugeZeros(value=np.full(nonlinear.n_strain_gauges, 1e-6), std=np.zeros(nonlinear.n_strain_gauges))
    third = first.with_zeros(zeros)
    for k, one in enumerate(flight[6:], start=6):
        found = [
            estimator.track(strain, time=0.01 * k, **one.flow).coefficients
            for estimator, strain in ((first, one.strain), (second, one.strain), (third, one.strain + 1e-6))
        ]
        np.testing.assert_array_equal(found[0], found[1])
        np.testing.assert_allclose(found[0], found[2], rtol=1e-9, atol=1e-12)
    with pytest.raises(InputError, match="bytes found, must be"):
        second.memory = first.memory[:-1]


def test_threads_may_share_an_estimator(linear: InverseMap) -> None:
    estimator = Estimator(linear)
    strain = linear.mean_strain + 1e-6 * np.random.default_rng(4).normal(size=(8, 300, linear.n_gauges))
    expected = [Estimator(linear).estimate(one, NOMINAL).coefficients for one in strain]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda one: [estimator.track(row, NOMINAL).coefficients for row in one], strain))
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_filter_needs_times_and_a_map_that_has_one(linear: InverseMap) -> None:
    filtered = Estimator(linear).filter(1.0)
    with pytest.raises(InputError, match="time: expected the time of each sample"):
        filtered.track(linear.mean_strain, NOMINAL)
    with pytest.raises(InputError, match="time_constant: expected 0 or"):
        Estimator(linear).filter(-1.0)
    with pytest.raises(InputError, match=r"filter: expected a map of gamma 1 in Case 2, .* got gamma 0\.001"):
        Estimator(map_of(random_model(1e-3, n_states=20))).filter(1.0)


def test_an_exact_standard_deviation_is_0_in_python(linear: InverseMap) -> None:
    """To hosts of FMUs 0 is a deviation that is not given."""
    estimator = Estimator(replace(linear, dynamic_pressure_error=0.1))
    exact, usual = (estimator.estimate(linear.mean_strain, NOMINAL, dynamic_pressure_std=s) for s in (0.0, np.nan))
    assert np.all(exact.coefficients_std < usual.coefficients_std)
    tiny = estimator.estimate(linear.mean_strain, NOMINAL, dynamic_pressure_std=1e-9)
    np.testing.assert_allclose(exact.coefficients_std, tiny.coefficients_std, rtol=1e-9)


def test_results_are_of_their_sample_when_the_caller_reuses_its_array(linear: InverseMap) -> None:
    estimator, strain = Estimator(linear), linear.mean_strain.copy()
    found = estimator.estimate(strain, NOMINAL)
    series = estimator.estimate(np.tile(strain, (3, 1)), NOMINAL)
    strain[:] = np.nan
    assert found.valid.all()
    assert series.valid.all()
    assert found.health is HealthState.OK
