"""What masks are made from: equal to LAPACK's to round-off, and to themselves on every processor to the bit."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from random_map import map_of, random_map, random_model

from strainfmu.estimator.linear.map_parts import map_parts
from strainfmu.estimator.map.innovation import innovation_whitening, inverse_cholesky
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.estimator.map.load_errors import load_error_model
from strainfmu.estimator.numerics.fixed_order import (
    apply_orthogonal,
    cholesky,
    eigen,
    householder,
    product,
    solve_lower,
)

MAPS = {
    "case 1": lambda: map_of(random_model(gamma=0.0, n_gauges=54, n_states=5)),
    "case 1, few gauges": random_map,
    "case 2": lambda: map_of(random_model(gamma=1.0, n_gauges=27, n_states=12)),
    "case 2, weak": lambda: map_of(random_model(gamma=1e-2, n_gauges=27, n_states=40)),
}


def test_algebra_is_that_of_numpy() -> None:
    """1e-13 of the largest element."""
    random = np.random.default_rng(3)
    a, b = random.normal(size=(7, 9)), random.normal(size=(9, 4))
    np.testing.assert_allclose(product(a, b), a @ b, rtol=0.0, atol=1e-13)
    spd = a @ a.T
    lower = cholesky(spd)
    np.testing.assert_allclose(lower, np.linalg.cholesky(spd), rtol=0.0, atol=1e-13)
    right = random.normal(size=(7, 3))
    np.testing.assert_allclose(solve_lower(lower, right), np.linalg.solve(lower, right), rtol=0.0, atol=1e-12)
    for matrix in (a, a.T, np.zeros((3, 3)), np.array([[0.0, 1.0], [0.0, 0.0]])):
        r, reflectors = householder(matrix)
        np.testing.assert_array_equal(r, np.triu(r))
        np.testing.assert_allclose(apply_orthogonal(reflectors, r), matrix, rtol=0.0, atol=1e-13)
        q = apply_orthogonal(reflectors, np.eye(len(matrix)))
        np.testing.assert_allclose(q.T @ q, np.eye(len(matrix)), rtol=0.0, atol=1e-13)
    values, vectors = eigen(spd)
    np.testing.assert_allclose(np.sort(values), np.linalg.eigvalsh(spd), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose((vectors * values) @ vectors.T, spd, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(7), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("name", MAPS)
def test_parts_are_those_of_lapack(name: str) -> None:
    """To 1e-10 of each matrix; of W that of W' W, from which all follows."""
    inverse_map = MAPS[name]()
    found = map_parts(inverse_map)
    a, covariance = inverse_map.state_operator, inverse_map.noise_covariance
    assert_close(found.load_gain, inverse_map.load_gain)
    assert_close(found.noise_whitening, inverse_cholesky(covariance))
    model = load_error_model(
        gauge_covariance=inverse_map.gauge_covariance,
        error_strain=inverse_map.error_strain,
        error_load=inverse_map.error_load,
        state_operator=a,
        load_per_state=inverse_map.load_per_state,
        known_prior=inverse_map.case == 2,
    )
    assert_close(found.load_covariance, inverse_map.load_covariance)
    assert_close(found.error_model.noise_root, model.noise_root)
    assert_close(found.error_model.regression, model.regression)
    size = np.sqrt(np.diag(inverse_map.load_covariance))
    difference = found.error_model.remainder - model.remainder
    np.testing.assert_allclose(difference / np.outer(size, size), 0.0, atol=1e-10)
    assert found.error_model.known_prior is model.known_prior
    std = np.outer(inverse_map.noise_std, inverse_map.noise_std)
    whitening = innovation_whitening(a, covariance, inverse_map.regularisation)
    assert_close(found.gain_whitening.T @ found.gain_whitening * std, whitening.T @ whitening * std)
    whitening = inverse_map.residual_whitening
    assert_close(found.residual_whitening.T @ found.residual_whitening * std, whitening.T @ whitening * std)


def assert_close(found: np.ndarray, wanted: np.ndarray) -> None:
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-10 * np.abs(wanted).max())


def digest(inverse_map: InverseMap) -> str:
    """Hash of every bit of the parts."""
    parts = map_parts(inverse_map)
    model = parts.error_model
    of_all = (parts.load_gain, parts.load_covariance, parts.noise_whitening, parts.gain_whitening)
    arrays = (*of_all, parts.residual_whitening, model.regression, model.remainder)
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


def test_bits_do_not_follow_the_processor(tmp_path: Path) -> None:
    """OpenBLAS with the kernels of two processors, numpy without the wide instructions."""
    inverse_map = MAPS["case 2"]()
    save_inverse_map(inverse_map, tmp_path / "map.h5")
    program = (
        "import sys; sys.path[:0] = sys.argv[2:]\n"
        "from pathlib import Path\n"
        "from strainfmu.estimator.map.inverse_map import load_inverse_map\n"
        "from test_map_parts import digest\n"
        "print(digest(load_inverse_map(Path(sys.argv[1]))))\n"
    )
    features = "AVX2 FMA3 AVX512F AVX512_SKX"
    machines = (
        {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": features},
        {"OPENBLAS_CORETYPE": "Haswell"},
    )
    here = Path(__file__).parent
    folders = [str(here), str(here.parents[1] / "support")]
    command = [sys.executable, "-W", "ignore", "-c", program, str(tmp_path / "map.h5"), *folders]
    digests = {
        subprocess.run(
            command, env={**os.environ, **machine}, capture_output=True, text=True, check=True, timeout=60
        ).stdout
        for machine in machines
    }
    assert digests == {digest(inverse_map) + "\n"}
