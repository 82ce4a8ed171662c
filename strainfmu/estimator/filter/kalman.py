"""The Kalman filter with errors that are considered and not estimated (Schmidt), in Joseph form.

The state s of a stationary process has a normal law. A measurement reads z = H s + G g + e: e is white, g holds
errors of unit variance that last from step to step. They count in the gain and in the covariance, by their cross
covariance C with s, but no measurement changes what is known of them: errors that cannot be told from the state
are never averaged away. Without memory of g, C = 0, the formulas are those of the Kalman filter with the noise G
G' + cov(e).

Source: Jazwinski, Stochastic Processes and Filtering Theory, section 8.4; Joseph form: Bucy & Joseph 1968.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Law:
    """Law of n states and k considered errors.

    Attributes
    ----------
    mean : (n,).
    covariance : (n, n).
    cross : (n, k) covariance of the states' errors with the considered ones.
    """

    mean: FloatArray
    covariance: FloatArray
    cross: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Transition:
    """A step of a stationary process about its mean.

    Attributes
    ----------
    matrix : (n, n) F.
    mean : (n,) of the stationary law.
    covariance : (n, n) P of the stationary law; the noise of the step is P - F P F'.
    considered : correlation of the considered errors over the step [1].
    """

    matrix: FloatArray
    mean: FloatArray
    covariance: FloatArray
    considered: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurement:
    """m rows of a measurement about the point where it was linearised.

    Attributes
    ----------
    innovation : (m,) z less its prediction at the mean of the law.
    jacobian : (m, n) H.
    considered : (m, k) G.
    noise : (m, m) covariance of e.
    """

    innovation: FloatArray
    jacobian: FloatArray
    considered: FloatArray
    noise: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Update:
    """A law after a measurement.

    Attributes
    ----------
    law : of the states.
    chi_square : normalised innovation squared, of mean m.
    weighted : (m,) S^-1 times the innovation, S its covariance.
    precision : (m,) diagonal of S^-1.
    """

    law: Law
    chi_square: float
    weighted: FloatArray
    precision: FloatArray


def stationary_law(transition: Transition, n_considered: int) -> Law:
    """Return the law of a process of which nothing has been measured."""
    n = len(transition.mean)
    return Law(mean=transition.mean, covariance=transition.covariance, cross=np.zeros((n, n_considered)))


def predicted(law: Law, step: Transition) -> Law:
    """Return ``law`` after ``step``."""
    forget = step.covariance - step.matrix @ step.covariance @ step.matrix.T
    covariance = step.matrix @ law.covariance @ step.matrix.T + forget
    return Law(
        mean=step.mean + step.matrix @ (law.mean - step.mean),
        covariance=0.5 * (covariance + covariance.T),
        cross=step.considered * (step.matrix @ law.cross),
    )


def gain(law: Law, rows: Measurement) -> tuple[FloatArray, FloatArray]:
    """Return the gain K (n, m), and S^-1 (m, m)."""
    to_rows = law.covariance @ rows.jacobian.T + law.cross @ rows.considered.T
    mixed = rows.jacobian @ law.cross @ rows.considered.T
    spread = rows.jacobian @ law.covariance @ rows.jacobian.T + mixed + mixed.T
    spread += rows.considered @ rows.considered.T + rows.noise
    size = 1.0 / np.sqrt(np.diagonal(spread))
    # Strains and navigation have units of their own: equal diagonals keep the digits.
    scaled = spread * size[:, None] * size
    lower = np.linalg.inv(np.linalg.cholesky(scaled)) * size
    # Of a solution the errors are those of a spread that differs in its last digits; of the inverse they are not.
    return np.linalg.solve(scaled, (to_rows * size).T).T * size, lower.T @ lower


def measured(law: Law, rows: Measurement) -> Update:
    """Return ``law`` after the measurement ``rows``."""
    k, inverse = gain(law, rows)
    kept = np.eye(len(law.mean)) - k @ rows.jacobian
    of_considered = k @ rows.considered
    mixed = kept @ law.cross @ of_considered.T
    covariance = kept @ law.covariance @ kept.T - mixed - mixed.T
    covariance += of_considered @ of_considered.T + k @ rows.noise @ k.T
    weighted = inverse @ rows.innovation
    return Update(
        law=Law(
            mean=law.mean + k @ rows.innovation,
            covariance=0.5 * (covariance + covariance.T),
            cross=kept @ law.cross - of_considered,
        ),
        chi_square=float(rows.innovation @ weighted),
        weighted=weighted,
        precision=np.diagonal(inverse).copy(),
    )


def given(law: Law, first: int, value: FloatArray) -> tuple[FloatArray, float]:
    """Return the mean (n,) of the states if the first have ``value`` (first,), and its square distance."""
    apart = value - law.mean[:first]
    weight = np.linalg.solve(law.covariance[:first, :first], apart)
    mean = law.mean + law.covariance[:, :first] @ weight
    mean[:first] = value
    return mean, float(apart @ weight)
