"""Inverse map for one set of valid gauges: the matrices and alarm levels of a step, computed once per set."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY, chi_square_limit
from strainfmu.estimator.linear.isolation import ambiguous_groups, correlations, inverse_root, outlier_threshold
from strainfmu.estimator.linear.map_parts import MapParts
from strainfmu.estimator.linear.masks import MIN_INFORMATION, information_left, masked_gain, masked_whitening
from strainfmu.estimator.map.further_errors import further_variance
from strainfmu.estimator.map.load_errors import load_error_covariance

CACHED_MASKS = 32
"""Sets of missing gauges whose matrices are kept, the one unused for longest dropped first."""


@dataclass(frozen=True, eq=False)
class MaskedMap:
    """An inverse map for the gauges that are valid, ready for the loop; columns of the others are zero.

    Attributes
    ----------
    valid : (n_d,) gauges in use.
    load_gain : (5, n_d) loads per strain [N, N m].
    further_gain : (m, n_d) the same of the further loads.
    further_variance : (m,) of their errors [(N, N m)^2].
    load_covariance : (5, 5) [(N, N m)^2].
    loads_std : (5,) roots of its diagonal.
    whitening : (n_d, n_d) W [1/(m/m)].
    z_whitening : (n_d, n_d) z of the whitened residual [1].
    degrees_of_freedom : of the residual.
    chi_square_limit : its alarm level.
    outlier_threshold : alarm level of the largest |z|.
    ambiguous_groups : gauges, by index, that cannot be distinguished.
    """

    valid: BoolArray
    load_gain: FloatArray
    further_gain: FloatArray
    further_variance: FloatArray
    load_covariance: FloatArray
    loads_std: FloatArray
    whitening: FloatArray
    z_whitening: FloatArray
    degrees_of_freedom: int
    chi_square_limit: float
    outlier_threshold: float
    ambiguous_groups: tuple[tuple[int, ...], ...]


class MaskedMaps:
    """The maps of the gauges in use, each computed when it is first asked for."""

    def __init__(self, parts: MapParts) -> None:
        """Prepare the map of all gauges."""
        self.complete = complete_map(parts)
        self._parts = parts
        self._kept: OrderedDict[bytes, MaskedMap | None] = OrderedDict()

    def of(self, used: BoolArray) -> MaskedMap | None:
        """Return the map for the gauges ``used`` (n_d,); None if they do not identify the state."""
        if used.all():
            return self.complete
        key = used.tobytes()
        if key not in self._kept:
            self._kept[key] = masked_map(self._parts, used.copy())
            if len(self._kept) > CACHED_MASKS:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]


def complete_map(parts: MapParts) -> MaskedMap:
    """Return the matrices for all gauges."""
    everything = np.ones(parts.inverse_map.n_gauges, dtype=bool)
    return _ready(parts, everything, parts.load_gain, parts.load_covariance.copy())


def masked_map(parts: MapParts, valid: BoolArray) -> MaskedMap | None:
    """Return the matrices for the gauges ``valid`` (n_d,); None if they do not identify the state.

    In Case 2 the prior identifies the state, with any gauge at all; without gauges there is no estimate.
    """
    if not valid.any():
        return None
    if parts.inverse_map.case == 1:
        fraction = information_left(parts.gain_whitening, parts.noise_whitening, ~valid)
        if fraction < MIN_INFORMATION:
            return None
    gain = masked_gain(parts.load_gain, parts.gain_whitening, ~valid)
    return _ready(parts, valid, gain, load_error_covariance(parts.error_model, gain))


def _ready(parts: MapParts, valid: BoolArray, load_gain: FloatArray, load_covariance: FloatArray) -> MaskedMap:
    """Add the statistics of health to the gain for the gauges ``valid``."""
    whitening = masked_whitening(parts.residual_whitening, ~valid)
    freedom = parts.inverse_map.residual_degrees_of_freedom - int(np.sum(~valid))
    precision = whitening.T @ whitening
    further = masked_gain(parts.further.gain, parts.gain_whitening, ~valid)
    # Less than this is round-off: no other gauge checks this one.
    floor = MIN_INFORMATION * np.sum(parts.noise_whitening**2, axis=0)
    ready = MaskedMap(
        valid=valid,
        load_gain=load_gain,
        further_gain=further,
        further_variance=further_variance(parts.further, parts.inverse_map, parts.error_model.noise_root, further),
        load_covariance=load_covariance,
        loads_std=np.sqrt(np.diag(load_covariance)),
        whitening=whitening,
        z_whitening=inverse_root(np.diag(precision), floor)[:, None] * whitening.T,
        degrees_of_freedom=freedom,
        chi_square_limit=chi_square_limit(freedom) if freedom > 0 else np.inf,
        outlier_threshold=outlier_threshold(int(valid.sum()), FALSE_ALARM_PROBABILITY),
        ambiguous_groups=ambiguous_groups(correlations(precision, floor)),
    )
    for array in (valid, ready.loads_std, load_covariance):  # handed out with every estimate
        array.flags.writeable = False
    return ready
