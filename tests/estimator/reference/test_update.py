"""The update agrees with conditioning of the joint Gaussian of rows and outputs, written out in full."""

import numpy as np
import pytest

from strainfmu.errors import InputError
from strainfmu.estimator.reference.update import Model, condition, joseph, prepare

pytestmark = pytest.mark.fast

N, M = 11, 4


def model(n_free: int, n_columns: int, seed: int = 1) -> Model:
    """Return a random model of :data:`N` rows and :data:`M` outputs."""
    random = np.random.default_rng(seed)
    both = random.standard_normal((N + M, N + M))
    noise = both @ both.T
    return Model(
        fixed=random.standard_normal(N),
        mean=random.standard_normal(N),
        free=random.standard_normal((N, n_free)),
        columns=random.standard_normal((N, n_columns)),
        noise=noise[:N, :N],
        output_fixed=random.standard_normal(M),
        output_mean=random.standard_normal(M),
        output_free=random.standard_normal((M, n_free)),
        output_columns=random.standard_normal((M, n_columns)),
        cross=noise[:N, N:],
        output_noise=noise[N:, N:],
    )


def joint_covariance(m: Model, s: float) -> np.ndarray:
    """Return (N + M, N + M) of rows and outputs, free states left out."""
    both = s * np.vstack([m.columns, m.output_columns])
    return both @ both.T + np.block([[m.noise, m.cross], [m.cross.T, m.output_noise]])


def conditioned(m: Model, y: np.ndarray, s: float, used: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return mean and covariance of the outputs and chi-square: generalised least squares for the free states,
    conditioning of the joint covariance for all else."""
    joint = joint_covariance(m, s)
    inverse = np.linalg.inv(joint[:N, :N][np.ix_(used, used)])
    regression = joint[N:, :N][:, used] @ inverse
    residual = (y - m.fixed - s * m.mean)[used]
    x, f = s * m.free[used], s * m.output_free
    left = f - regression @ x
    of_x = np.linalg.inv(x.T @ inverse @ x)
    state = of_x @ x.T @ inverse @ residual
    mean = m.output_fixed + s * m.output_mean + f @ state + regression @ (residual - x @ state)
    covariance = joint[N:, N:] - regression @ joint[:N, N:][used] + left @ of_x @ left.T
    return mean, covariance, float((residual - x @ state) @ inverse @ (residual - x @ state))


@pytest.mark.parametrize(("n_free", "n_columns"), [(0, 3), (0, 30), (2, 0), (3, 5), (3, 30), (0, 0)])
@pytest.mark.parametrize("lost", [(), (0, 7)])
def test_outputs_are_those_of_joint_conditioning(n_free: int, n_columns: int, lost: tuple[int, ...]) -> None:
    m, used = model(n_free, n_columns), np.ones(N, dtype=bool)
    used[list(lost)] = False
    random = np.random.default_rng(2)
    rows, scale = 5.0 * random.standard_normal((6, N)), np.geomspace(0.1, 10.0, 6)
    rows[:, ~used] = np.nan
    found = condition(prepare(m, used), rows, scale)
    for k, s in enumerate(scale):
        mean, covariance, chi_square = conditioned(m, np.nan_to_num(rows[k]), s, used)
        std = np.sqrt(np.diag(covariance))
        np.testing.assert_allclose(found.mean[k], mean, rtol=0.0, atol=1e-10 * std.max())
        np.testing.assert_allclose(found.covariance[k], covariance, rtol=0.0, atol=1e-10 * std.max() ** 2)
        assert found.chi_square[k] == pytest.approx(chi_square, rel=1e-10)
    np.testing.assert_array_equal(found.gain[:, :, ~used], 0.0)


def test_standardised_residual_is_the_distance_from_what_other_rows_predict() -> None:
    m = model(2, 6)
    rows, s = 5.0 * np.random.default_rng(3).standard_normal((1, N)), np.array([1.7])
    found = condition(prepare(m, np.ones(N, dtype=bool)), rows, s)
    for row in range(N):
        others = np.arange(N) != row
        as_output = Model(
            **(
                vars(m)
                | {
                    "output_fixed": m.fixed[[row]],
                    "output_mean": m.mean[[row]],
                    "output_free": m.free[[row]],
                    "output_columns": m.columns[[row]],
                    "cross": m.noise[:, [row]],
                    "output_noise": m.noise[[row]][:, [row]],
                }
            )
        )
        expected = condition(prepare(as_output, others), rows, s)
        z = (rows[0, row] - expected.mean[0, 0]) / np.sqrt(expected.covariance[0, 0, 0])
        assert found.standardised[0, row] == pytest.approx(z, rel=1e-9)


def test_a_row_that_no_other_checks_has_no_residual() -> None:
    m = model(2, 3)
    m.free[0], m.free[1:, 0] = [1.0, 0.0], 0.0
    rows = np.random.default_rng(4).standard_normal((1, N))
    noise = m.noise.copy()
    noise[0, 1:] = noise[1:, 0] = 0.0
    alone = Model(**(vars(m) | {"noise": noise}))
    assert condition(prepare(alone, np.ones(N, dtype=bool)), rows, np.ones(1)).standardised[0, 0] == 0.0


def test_joseph_is_the_covariance_of_the_error_of_any_gain() -> None:
    m, other, s = model(0, 7), model(0, 7, seed=5), np.array([0.6, 2.0])
    used = np.arange(N) != 4
    added = np.eye(N) * np.linspace(0.0, 1.0, N)
    for gain in (condition(prepare(one, used), np.zeros((2, N)), s).gain for one in (m, other)):
        found = joseph(m, gain, s, np.array([added, added]))
        for k in range(2):
            joint = joint_covariance(m, s[k])
            joint[:N, :N] += added
            error = np.hstack([gain[k], -np.eye(M)])
            expected = error @ joint @ error.T
            np.testing.assert_allclose(found[k], expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())
    own = condition(prepare(m, used), np.zeros((2, N)), s)
    np.testing.assert_allclose(joseph(m, own.gain, s), own.covariance, rtol=1e-9)


def test_fewer_rows_than_free_states_are_refused() -> None:
    with pytest.raises(InputError, match="3 free states: expected as many rows in use at least, got 2"):
        prepare(model(3, 1), np.arange(N) < 2)
