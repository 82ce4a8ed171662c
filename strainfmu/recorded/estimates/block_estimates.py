"""Estimates of a block of recorded samples, whatever makes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.estimator.air_data import NAVIGATION
from strainfmu.estimator.air_inputs import ALTITUDE, DYNAMIC_PRESSURE, MACH_NUMBER, Q_SOURCE, QSource
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.map.flow_parameters import PARAMETER_TOLERANCE
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.recorded.columns.column_names import STATIC_PRESSURE
from strainfmu.recorded.columns.columns import StrainBlock
from strainfmu.recorded.columns.strain_level import LevelReference

USED_PREFIX = "navigation_used."
"""Of the columns that say whether a quantity of navigation is used."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BlockEstimates:
    """Estimates of n samples; NaN where there is none.

    Attributes
    ----------
    coefficients, coefficients_std : (n, 5) C_A, C_N, C_Y, M_P, M_Y and their standard deviations [1].
    chi_square, chi_square_limit, degrees_of_freedom : (n,) [1]; an FMU does not state the last.
    health : (n,) numbers of :class:`~strainfmu.estimator.health.HealthState`, NaN for a step that the FMU refused.
    gauges_used : (n,).
    valid : (n, n_d) gauges that gave a usable strain.
    suspects : n tuples of gauges, by index; of an ambiguous group an FMU names the first alone.
    worst : (n,) gauge with the largest |z| in samples whose health is not OK; -1 where that is not known.
    suspect_count : (n,) number of gauges under suspicion.
    envelope_score : (n,) standard deviations by which the coefficients leave the envelope of the map, 0 inside.
    make_residual : returns (n, n_d) z of each gauge [1], and (n,) the alarm level of the largest |z|; None of an
        FMU.
    estimates : n estimates by a map, for their pressure; None of an FMU.
    outside : (n,) whether a flow parameter leaves its range, by its name.
    contradicted : (n,) whether an input contradicts the loads, by its name; none of an FMU.
    other_values : (n, n_f) what this kind of estimator has in addition, see ``BlockEstimator.other_columns``.
    """

    coefficients: FloatArray
    coefficients_std: FloatArray
    chi_square: FloatArray
    chi_square_limit: FloatArray
    degrees_of_freedom: FloatArray
    health: FloatArray
    gauges_used: FloatArray
    valid: BoolArray
    suspects: Sequence[tuple[int, ...]]
    suspect_count: FloatArray
    envelope_score: FloatArray
    worst: IntArray
    make_residual: Callable[[], tuple[FloatArray, FloatArray]] | None = None
    outside: Mapping[str, BoolArray] = field(default_factory=dict)
    contradicted: Mapping[str, BoolArray] = field(default_factory=dict)
    other_values: FloatArray | None = None
    estimates: Estimate | None = None


class BlockEstimator(Protocol):
    """An estimator of blocks.

    Attributes
    ----------
    inputs : quantities other than strain and q_inf that it takes, of ``FLOW_NAMES``.
    reference : the level of strains that it expects.
    zero : (n_d,) zero offsets that it subtracts from strain [m/m].
    has_residuals : whether it gives the z of each gauge.
    envelope_score_limit : score above which the coefficients are outside, NaN where it is not known.
    other_columns : names and units of its own columns of the output, of ``other_values``.
    inverse_map : the map, None of an FMU.
    gauge_names, row_names : strain gauges; the same, then auxiliary sensors.
    readings : unit of each auxiliary sensor, and of thrust, by its name.
    sensor_names : temperature sensors that it takes.
    parameter_names : flow parameters that it takes.
    sharpening : the ones whose standard deviation it takes.
    """

    gauge_names: tuple[str, ...]
    row_names: tuple[str, ...]
    readings: Mapping[str, str]
    sensor_names: tuple[str, ...]
    parameter_names: tuple[str, ...]
    sharpening: tuple[str, ...]
    other_columns: tuple[tuple[str, str], ...]
    inputs: tuple[str, ...]
    reference: LevelReference
    zero: FloatArray
    has_residuals: bool
    envelope_score_limit: float
    inverse_map: InverseMap | None

    def estimate(self, block: StrainBlock, last: float) -> BlockEstimates:
        """Return the estimates of a block; ``last`` is the time before its first sample [s], NaN at the start."""


def dropped_navigation(
    block: StrainBlock, found: BlockEstimates, columns: Sequence[tuple[str, str]]
) -> dict[str, BoolArray]:
    """Return (n,) whether each quantity of navigation is given and not used, by its name.

    A computed dynamic pressure is none.

    ``columns`` are the ``other_columns`` of the estimator, which say what is used; {} of one that takes none.
    """
    names = [name for name, _ in columns]
    if found.other_values is None or USED_PREFIX + NAVIGATION[0] not in names:
        return {}
    unknown = np.full(len(block.time), np.nan)
    flow = {DYNAMIC_PRESSURE: block.dynamic_pressure, **block.flow}
    given = {name: ~np.isnan(flow.get(name, unknown)) for name in NAVIGATION}
    given[STATIC_PRESSURE] |= ~np.isnan(flow.get(ALTITUDE, unknown))
    source = np.nan_to_num(flow.get(Q_SOURCE, unknown))
    given[DYNAMIC_PRESSURE] &= np.where(source < 0.5, ~given[MACH_NUMBER], np.round(source) == QSource.INDEPENDENT)
    used = {name: found.other_values[:, names.index(USED_PREFIX + name)] > 0.0 for name in NAVIGATION}
    return {name: given[name] & ~used[name] for name in NAVIGATION}


def outside_ranges(names: Sequence[str], score: FloatArray) -> dict[str, BoolArray]:
    """Return (n,) whether each parameter leaves its range, by their ``score`` (n, n_p)."""
    return {name: one > PARAMETER_TOLERANCE for name, one in zip(names, score.T, strict=True)}
