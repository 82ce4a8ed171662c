"""What further parameters of the flow say of estimates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.flow_parameters import LARGEST_SCORE as LARGEST_SCORE
from strainfmu.estimator.map.flow_parameters import PARAMETER_TOLERANCE, FlowParameters
from strainfmu.estimator.map.flow_parameters import flow_parameters as flow_parameters

if TYPE_CHECKING:
    from strainfmu.estimator.estimates.load_estimate import LoadEstimates


def write_parameters(series: LoadEstimates, known: FlowParameters, score: FloatArray) -> BoolArray:
    """Write into ``series`` what the further parameters of k samples say by their ``score`` (k, n_p); return (k,)
    whether one leaves its range."""
    series.parameter_score[:] = score
    outside = np.any(score > PARAMETER_TOLERANCE, axis=1)
    for row in np.flatnonzero(outside):
        series.outside_parameters[row] = known.outside(score[row])
    return np.asarray(outside)
