"""The map from arrays against the formulas of the paper by the book, dense, in its own notation."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.linalg import aslinearoperator

import strainfmu
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

N_D, N_P, N = 14, 90, 30
INSIDE = 4e3  # internal pressure [Pa]
REFERENCES = {"reference_area": 0.2, "reference_length": 0.5, "dynamic_pressure": 9e4}


def arrays(seed: int = 1) -> tuple[np.ndarray, ...]:
    """Z (n_d, n_p), snapshots (n_p, N), noise covariance (n_d, n_d), loads (5, n_p), node areas (n_p,)."""
    random = np.random.default_rng(seed)
    Z = 1e-9 * random.normal(size=(N_D, N_P))
    left, _ = np.linalg.qr(random.normal(size=(N_P, N)))
    snapshots = 5e3 + (left * np.logspace(4, 1, N)) @ random.normal(size=(N, N))
    root = 3e-7 * (np.eye(N_D) + 0.05 * random.normal(size=(N_D, N_D)))
    return Z, snapshots, root @ root.T, 1e-2 * random.normal(size=(5, N_P)), random.uniform(0.5, 2.0, N_P)


def near(found: np.ndarray | None, expected: np.ndarray, digits: float = 1e-9) -> None:
    assert found is not None
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=digits * np.abs(expected).max())


@pytest.mark.parametrize("gamma", [0.3, 1.0, 30.0])
@pytest.mark.parametrize("kind", [np.asarray, csr_array, aslinearoperator])
def test_case_2_is_the_published_solution(gamma: float, kind: Callable[[np.ndarray], Any]) -> None:
    """T, k, H^-1 by Woodbury (eq. p2o-ls-solution), eigenpairs (eq. eigproblem), loads, their covariance: 1e-9."""
    Z, P, Gn, G, _ = arrays()
    found = strainfmu.linear_map(kind(Z), P, noise_covariance=Gn, loads=G, gamma=gamma, internal_pressure=INSIDE)
    mean = P.mean(axis=1)
    prior = np.cov(P)
    T = prior @ Z.T @ np.linalg.inv(gamma * Gn + Z @ prior @ Z.T)
    near(found.T, T)
    near(found.k, mean - T @ Z @ (mean - INSIDE))
    inverse_hessian = (prior - T @ Z @ prior) / gamma
    near(found.posterior_covariance, inverse_hessian)
    near(found.posterior_factor @ found.posterior_factor.T, inverse_hessian)
    hessian = prior @ Z.T @ np.linalg.inv(Gn) @ Z
    near(found.eigenvalues, np.sort(np.linalg.eigvals(hessian).real)[::-1][:N_D])
    near(hessian @ found.eigenvectors, found.eigenvectors * found.eigenvalues)
    assert found.recoverable(1.0) == np.sum(found.eigenvalues >= 1.0)
    near(found.load_gain, G @ T)
    near(found.load_offset, G @ (mean - INSIDE) - G @ T @ Z @ (mean - INSIDE))
    missing = np.eye(N_P) - T @ Z
    near(found.load_covariance, G @ (missing @ prior @ missing.T + T @ Gn @ T.T) @ G.T)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("truncated", [False, True])
def test_case_1_is_least_squares_on_pod_modes(weighted: bool, truncated: bool) -> None:
    """T, k, (Z' Gamma^-1 Z)^-1 (eq. sls-cov), loads, with and without the truncated modes as noise: 1e-9."""
    Z, P, Gn, G, area = arrays()
    weights = area if weighted else np.ones(N_P)
    found = strainfmu.linear_map(
        Z,
        P,
        noise_covariance=Gn,
        loads=G,
        modes=5,
        weights=area if weighted else None,
        internal_pressure=INSIDE,
        truncated_noise=truncated,
    )
    mean = P.mean(axis=1)
    left, std, _ = np.linalg.svd(
        np.sqrt(weights)[:, None] * (P - mean[:, None]) / np.sqrt(N - 1), full_matrices=False
    )
    V = left / np.sqrt(weights)[:, None]
    pod = found.pod
    assert pod is not None
    near(pod.modes.T @ (weights[:, None] * pod.modes), np.eye(5))
    near(pod.coefficient_std, std[:5])
    near(pod.energy, (np.cumsum(std**2) / np.sum(std**2))[:5])
    kept = V[:, :5] * np.sign(np.sum(V[:, :5] * weights[:, None] * pod.modes, axis=0))
    near(pod.modes, kept)
    A, tail = Z @ kept, V[:, 5:] * std[5:]
    gamma = Gn + (Z @ tail @ tail.T @ Z.T if truncated else 0.0)
    inverse = np.linalg.inv(gamma)
    cross = Z @ tail @ tail.T @ G.T if truncated else np.zeros((N_D, 5))
    T = np.linalg.solve(A.T @ inverse @ A, A.T @ inverse)
    near(found.T, T)
    near(found.k, -T @ Z @ (mean - INSIDE))
    near(found.posterior_covariance, np.linalg.inv(A.T @ inverse @ A))
    gain = (G @ kept - cross.T @ inverse @ A) @ T + cross.T @ inverse
    near(found.load_gain, gain)
    error = gain @ Z @ tail - G @ tail if truncated else np.zeros((5, 1))
    near(found.load_covariance, gain @ Gn @ gain.T + error @ error.T)
    smallest = np.linalg.svd(A, compute_uv=False)[-1]
    assert found.relative_condition(1e-3, 50.0).value == pytest.approx(1e-3 / (smallest * 50.0))
    assert "um/m" in found.relative_condition(1e-3, 50.0).scaling


@pytest.mark.parametrize("options", [{}, {"gamma": 4.0}, {"modes": 4}, {"modes": 4, "truncated_noise": False}])
def test_estimator_of_the_map_gives_the_same_loads(options: dict[str, object]) -> None:
    """Loads of an Estimator against load_gain d + load_offset, 1e-12; its sigmas against the covariance, 1e-9."""
    Z, P, Gn, G, _ = arrays()
    found = strainfmu.linear_map(Z, P, noise_covariance=Gn, loads=G, **options)  # type: ignore[arg-type]
    d = Z @ P[:, :6]
    inverse_map = found.to_map(**REFERENCES)
    result = strainfmu.Estimator(inverse_map).estimate(d.T, dynamic_pressure=9e4)
    assert found.load_gain is not None
    near(np.asarray(result.loads), d.T @ found.load_gain.T + found.load_offset, 1e-12)
    near(np.asarray(result.loads_std)[0], np.sqrt(np.diag(found.load_covariance)))  # type: ignore[arg-type]


@pytest.mark.parametrize("rule", ["morozov", "corrected_discrepancy", "gcv", "evidence"])
def test_rules_choose_gamma_on_expected_data(rule: str) -> None:
    """Prior and noise are as stated, so that three rules give 1; Morozov's smooths more."""
    Z, P, Gn, *_ = arrays()
    found = strainfmu.linear_map(Z, P, noise_covariance=Gn, gamma=rule)  # type: ignore[arg-type]
    assert (found.gamma > 1.5) if rule == "morozov" else found.gamma == pytest.approx(1.0, rel=1e-4)


def test_archive_holds_what_other_programs_need(tmp_path: Path) -> None:
    Z, P, _, G, _ = arrays()
    found = strainfmu.linear_map(Z, P, noise_std=1e-7, loads=G)
    found.save_npz(tmp_path / "map.npz")
    with np.load(tmp_path / "map.npz") as archive:
        near(archive["T"] @ (Z @ P[:, 0]) + archive["k"], found.estimate(Z @ P[:, 0]), 1e-15)
        near(archive["load_gain"], np.asarray(found.load_gain), 1e-15)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"noise_std": None}, "exactly one"),
        ({"noise_covariance": np.eye(N_D)}, "exactly one"),
        ({"noise_std": -1.0}, "noise_std: expected one positive number"),
        ({"modes": 3, "gamma": 1.0}, "gamma: expected none with modes=3"),
        ({"weights": np.ones(N_P)}, "weights: expected none in Case 2"),
        ({"modes": N_D + 1}, f"at most {N_D} with {N_D} gauges"),
        ({"modes": N}, f"modes: expected 1 to {N - 1}"),
        ({"gamma": 0.0}, "gamma: expected a positive number or one of morozov"),
        ({"gamma": "best"}, "'best'"),
        ({"loads": np.ones((5, 3))}, "loads: expected"),
        ({"snapshots": arrays()[1].T}, "a column is a snapshot"),
        ({"snapshots": np.full((N_P, N), np.nan)}, "snapshots: expected finite"),
        ({"snapshots": np.ones((N_P, N))}, "all equal"),
    ],
)
def test_wrong_arguments_are_named(changes: dict[str, object], words: str) -> None:
    Z, P, *_ = arrays()
    given = {"Z": Z, "snapshots": P, "noise_std": 1e-7} | changes
    with pytest.raises(InputError, match=words.replace("(", r"\(")):
        strainfmu.linear_map(**given)  # type: ignore[arg-type]


def test_covariance_of_many_nodes_is_not_formed() -> None:
    random = np.random.default_rng(1)
    found = strainfmu.linear_map(random.normal(size=(3, 6000)), random.normal(size=(6000, 4)), noise_std=1.0)
    assert found.posterior_factor.shape == (6000, 4)
    with pytest.raises(InputError, match="use posterior_factor"):
        _ = found.posterior_covariance
