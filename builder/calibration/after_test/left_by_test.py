"""What a ground test left unknown, as errors in proportion to strain of the map.

The strain of a flow is wrong by J d: d is the error of the parameters, of the covariance after the test, J the
derivatives of the strain in that flow. It follows the flow, as the error of a vehicle does. A map knows errors
that all gauges have in common, and errors of each gauge on its own. So the directions of d that strain most, over
all flows and gauges, become common errors; what they leave becomes errors of each gauge, one for each pattern over
the flows. The mean variance of every gauge is kept, covariances as far as the common errors hold them. The gain
of the nonlinear estimator does not know the common errors, as it does not know errors of wall and layout before a
test: a gain that corrects them has a fifth more error in C_N.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array

from builder.inverse.ensemble import Ensemble
from builder.inverse.noise.error_list import IN_COMMON_AFTER_TEST, OF_EACH_AFTER_TEST
from builder.inverse.noise.hardware_errors import HardwareError
from builder.inverse.noise.model import NoiseTerm
from builder.structure.as_built.as_built_vehicle import AsBuilt, Key, places_of, slices, uncertain_keys
from builder.structure.as_built.displaced_structure import AnyAsBuilt
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.estimator.signal_names import ZERO

COMMON = 20
"""Errors that all gauges have in common. With 6 the part of C_A's variance that a test leaves came out half as
large as it is; with 20 what it leaves of every coefficient is right within 9 %."""

PATTERNS = 5
"""Patterns over the flows of the error that each gauge has on its own."""

BLOCK = 16
"""Gauges whose operators by all keys are in memory at once."""

NEGLIGIBLE = 1e-12
"""Variance relative to the largest below which a column of a covariance is left out."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Remaining:
    """What of the hardware is not known.

    Attributes
    ----------
    parameters : the vehicle as built.
    covariance : (n, n) of its vector.
    """

    parameters: AsBuilt
    covariance: FloatArray

    @property
    def uncertain(self) -> list[Key]:
        """Keys of the parameters that strain in flight depends on and that are not known exactly."""
        return uncertain_keys(self.parameters.of_vector(np.sqrt(np.diag(self.covariance))), in_flight=True)


@dataclass(frozen=True, eq=False, kw_only=True)
class LeftByTest:
    """The same as the map holds it: errors that follow strain, and the term of the zeros."""

    errors: tuple[HardwareError, ...] = ()
    zeros: tuple[NoiseTerm, ...] = ()


def left_by_test(structure: AnyAsBuilt, remaining: Remaining, ensemble: Ensemble) -> LeftByTest:
    """Return what a test left, for the flows of ``ensemble``; nothing where everything is known."""
    if not remaining.covariance.any():
        return LeftByTest()
    where = slices(structure.counts)
    zero = remaining.covariance[where[ZERO], where[ZERO]]
    return LeftByTest(
        errors=tuple(_errors(structure, remaining, ensemble)),
        zeros=(NoiseTerm("zeros after the ground test", _factor(zero), hardware=True),),
    )


def _errors(structure: AnyAsBuilt, remaining: Remaining, ensemble: Ensemble) -> list[HardwareError]:
    keys, blocks = remaining.uncertain, blocks_of(structure.n_gauges)
    place = places_of(keys, structure.counts)
    slopes = np.concatenate([_strain_slopes(structure, remaining.parameters, keys, ensemble, b) for b in blocks])
    product = np.array([slope.T @ (ensemble.member_weight[:, None] * slope) for slope in slopes])
    common = _strongest(remaining.covariance, place, product)[place]
    covariance = remaining.covariance[place[:, :, None], place[:, None, :]]
    patterns = _patterns(covariance - common @ np.swapaxes(common, 1, 2), product)
    errors = np.concatenate([common, patterns], axis=2)  # n_d, n_keys, n in the parameters
    strains = np.ascontiguousarray((slopes @ errors).transpose(2, 1, 0))
    return [
        HardwareError(
            name=IN_COMMON_AFTER_TEST if is_common else OF_EACH_AFTER_TEST,
            strain=strain,
            common=is_common,
            with_rest=True,
        )
        for strain, is_common in zip(strains, np.arange(len(strains)) < common.shape[2], strict=True)
    ]


def blocks_of(n_gauges: int) -> list[slice]:
    """Return the gauges in blocks of :data:`BLOCK`."""
    return [slice(first, min(first + BLOCK, n_gauges)) for first in range(0, n_gauges, BLOCK)]


def _strain_slopes(
    structure: AnyAsBuilt, parameters: AsBuilt, keys: list[Key], ensemble: Ensemble, gauges: slice
) -> FloatArray:
    """Return (n, n_flows, n_keys) derivatives of the strain of n ``gauges`` by ``keys`` in every flow."""
    slopes = np.concatenate(list(structure.operator_slopes(parameters, keys, gauges).values()))
    return ensemble.responses(slopes).reshape(len(ensemble.member_weight), len(keys), -1).transpose(2, 0, 1)


def _strongest(covariance: FloatArray, place: IntArray, product: FloatArray) -> FloatArray:
    """Return (n, COMMON) independent changes of the vector, of one standard deviation each, that strain most.

    That is by mean squares over flows and gauges: the sum over the gauges of ``product`` (n_d, n_keys, n_keys) at
    their ``place`` (n_d, n_keys), where few entries are not zero.
    """
    factor, shape = _factor(covariance), product.shape
    rows, columns = (np.broadcast_to(index, shape).ravel() for index in (place[:, :, None], place[:, None, :]))
    strained = csr_array((product.ravel(), (rows, columns)), shape=covariance.shape) @ factor
    r = factor.shape[1]
    _, vector = eigh(factor.T @ strained, subset_by_index=[max(r - COMMON, 0), r - 1])
    return np.asarray(factor @ vector[:, ::-1])


def _patterns(covariance: FloatArray, product: FloatArray) -> FloatArray:
    """Return (n_d, n_keys, PATTERNS) independent changes of each gauge's parameters, the strongest first.

    The last ones stand for all that are weaker: the mean variance of every gauge is kept.
    """
    patterns = np.zeros((*covariance.shape[:2], PATTERNS))
    for gauge, (of_gauge, square) in enumerate(zip(covariance, product, strict=True)):
        root = _factor(of_gauge)
        value, vector = np.linalg.eigh(root.T @ square @ root)
        value, vector = np.maximum(value[::-1], 0.0), vector[:, ::-1]
        count = min(PATTERNS, len(value))
        size = np.sqrt(value.sum() / max(float(value[:count].sum()), 1e-300))
        patterns[gauge, :, :count] = size * (root @ vector[:, :count])
    return patterns


def _factor(covariance: FloatArray) -> FloatArray:
    """Return the columns (n, k) whose product with their transpose is ``covariance``, negligible ones left out."""
    value, vector = np.linalg.eigh(covariance)
    counts = value > NEGLIGIBLE * max(float(value[-1]), 0.0)
    if not counts.any():
        return np.zeros((len(covariance), 1))
    return np.asarray(vector[:, counts] * np.sqrt(value[counts]))
