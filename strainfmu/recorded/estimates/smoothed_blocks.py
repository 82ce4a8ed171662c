"""Blocks of recorded samples smoothed over time, in numpy: a filter forwards, and its laws backwards.

Smoothing looks one whole block ahead.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from strainfmu.errors import InputError
from strainfmu.estimator.estimates.load_estimate import LoadEstimates, series_of
from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.flight_track import FilteredStep
from strainfmu.estimator.filter.kalman import Law
from strainfmu.estimator.filter.linear_filter import LinearFilter, LinearStep
from strainfmu.estimator.filter.settings import LARGEST, FilterSettings
from strainfmu.estimator.filter.smoothing import smoothed
from strainfmu.estimator.linear.estimator import Estimator as LinearEstimator
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.flight_estimate import FlightEstimates, joined
from strainfmu.estimator.manifold.flight_health import gauge_threshold
from strainfmu.interface.input_names import given_flow
from strainfmu.recorded.columns.columns import StrainBlock
from strainfmu.recorded.columns.sensor_readings import rows_of_map
from strainfmu.recorded.estimates.block_estimates import BlockEstimates, BlockEstimator, outside_ranges
from strainfmu.recorded.estimates.map_blocks import MapBlocks, further_values

Step = TypeVar("Step", FilteredStep, LinearStep)

FIRST_STEP = 1.0
"""Time step of the first sample [s]; before it nothing is known, so that it does not matter."""


class SmoothedBlocks(BlockEstimator, Protocol[Step]):
    """A :class:`BlockEstimator` whose estimates follow from the laws of a filter and of later samples."""

    def steps(self, block: StrainBlock, last: float) -> list[Step]:
        """Return the steps of a block; ``last`` as of :meth:`BlockEstimator.estimate`."""

    def of_laws(self, steps: Sequence[Step], laws: Sequence[Law]) -> BlockEstimates:
        """Return the estimates of ``steps`` by smoothed ``laws`` of their states."""


class SmoothedFlight(MapBlocks):
    """A nonlinear map, smoothed."""

    def __init__(self, static: MapBlocks, settings: FilterSettings) -> None:
        super().__init__(static.estimator)
        self.settings = settings
        of_map = static.estimator
        self._numpy = ManifoldEstimator(of_map.inverse_map, of_map.settings, of_map.zeros)
        self._filter = FlightFilter(self._numpy, settings)

    def steps(self, block: StrainBlock, last: float) -> list[FilteredStep]:
        """Return the steps of a block."""
        found, readings = [], rows_of_map(block, self._numpy.inverse_map.sensors, self.readings)
        for row, seconds in enumerate(_time_steps(block, last)):
            flow = given_flow({name: float(values[row]) for name, values in block.flow.items()})
            flow["dynamic_pressure"] = float(block.dynamic_pressure[row])
            parameters = {name: values[row] for name, values in block.parameters.items()}
            warm = None if block.temperature is None else block.temperature[row]
            std = given_flow({name: float(values[row]) for name, values in block.parameters_std.items()})
            step = self._filter.recorded(
                seconds, readings[row], flow, temperature=warm, parameters=parameters, parameters_std=std
            )
            found.append(_lean(step))
        return found

    def of_laws(self, steps: Sequence[FilteredStep], laws: Sequence[Law]) -> BlockEstimates:
        """Return the estimates of ``steps`` by smoothed ``laws``."""
        found = joined([self._filter.smoothed(step, law) for step, law in zip(steps, laws, strict=True)])
        limit = gauge_threshold(self._numpy.manifold, self._numpy.settings.alarm_scale)
        return _block(self, found, np.full(len(found), limit))


class SmoothedMap(MapBlocks):
    """A linear map, smoothed."""

    def __init__(self, static: MapBlocks, settings: FilterSettings) -> None:
        super().__init__(static.estimator)
        self.settings = settings
        of_map = static.estimator
        self._numpy = LinearEstimator(of_map.inverse_map, of_map.settings, of_map.zeros)
        self._filter = LinearFilter(self._numpy, settings)

    def steps(self, block: StrainBlock, last: float) -> list[LinearStep]:
        """Return the steps of a block."""
        rows = rows_of_map(block, self._numpy.inverse_map.sensors, self.readings)
        static = self._numpy.estimate(
            rows,
            block.dynamic_pressure,
            temperature=block.temperature,
            parameters=dict(block.parameters),
            **given_flow(block.flow),
        )
        if not isinstance(static, LoadEstimates):
            raise TypeError("strain: expected (n, n_d) values")
        found = []
        for row, seconds in enumerate(_time_steps(block, last)):
            pressure = float(block.dynamic_pressure[row])
            warm = None if block.temperature is None else block.temperature[row]
            found.append(_lean(self._filter.stepped(seconds, static[row], rows[row], pressure, warm)))
        return found

    def of_laws(self, steps: Sequence[LinearStep], laws: Sequence[Law]) -> BlockEstimates:
        """Return the estimates of ``steps`` by smoothed ``laws``."""
        found = series_of([self._filter.with_law(step, law) for step, law in zip(steps, laws, strict=True)])
        limits = [np.nan if one is None else one for one in (self._residual_limit(step) for step in steps)]
        return _block(self, found, np.array(limits, dtype=float))

    def _residual_limit(self, step: LinearStep) -> float | None:
        """Return the detection threshold of the largest |z|, which moves with that of chi-square."""
        held, masked = self._numpy.inverse_map, self._numpy.masked_map(step.static.valid)
        if masked is None:
            return None
        moved = step.static.chi_square_limit / (held.chi_square_scale * masked.chi_square_limit)
        return float(masked.outlier_threshold * np.sqrt(held.outlier_scale * moved))


def _block(of: MapBlocks, found: Any, residual_limit: np.ndarray) -> BlockEstimates:
    """Return the numpy estimates ``found`` of a block."""
    further = further_values(found, of.has_loads)
    if isinstance(found, FlightEstimates):
        air = found.air_data
        flags = [air.is_identified, found.navigation_used, found.is_linear[:, None]]
        further = np.hstack([air.value, air.std, *flags, further]).astype(float)
    return BlockEstimates(
        coefficients=found.coefficients,
        coefficients_std=found.coefficients_std,
        chi_square=np.asarray(found.chi_square),
        chi_square_limit=np.asarray(found.chi_square_limit),
        degrees_of_freedom=np.asarray(found.degrees_of_freedom, dtype=float),
        health=np.asarray(found.health, dtype=float),
        gauges_used=found.valid.sum(axis=1).astype(float),
        valid=found.valid,
        suspects=list(found.suspects),
        suspect_count=np.array([float(len(one)) for one in found.suspects]),
        envelope_score=found.envelope_score,
        worst=np.argmax(np.abs(found.standardised_residual), axis=1),
        make_residual=lambda: (found.standardised_residual, residual_limit),
        outside=outside_ranges(of.parameter_names, found.parameter_score),
        further=further,
        estimates=None,
    )


def _time_steps(block: StrainBlock, last: float) -> list[float]:
    """Return the steps [s]; after the longest one of a filter nothing is left of what it knew."""
    before = np.append(last if np.isfinite(last) else block.time[0] - FIRST_STEP, block.time[:-1])
    return [min(float(one), LARGEST) for one in block.time - before]


def _lean(step: Step) -> Step:
    """Return ``step`` without the cross covariances, which smoothing does not need and which fill the memory."""
    before, after = (replace(law, cross=law.cross[:, :0].copy()) for law in (step.before, step.after))
    return replace(step, before=before, after=after)


def with_filter(source: Path, static: BlockEstimator, time_constant: float | None, smooth: bool) -> BlockEstimator:
    """Return ``static``, the estimator ``source``, with a filter of ``time_constant`` [s]; None leaves it as it
    is.

    Raises
    ------
    InputError
        It is an FMU or a map that cannot be filtered, or there is nothing to smooth.
    """
    if time_constant is None:
        if smooth:
            raise InputError("--smooth: expected --filter SECONDS beside it, got none")
        return static
    settings = FilterSettings(time_constant=time_constant)
    if not isinstance(static, MapBlocks):
        raise InputError(f"{source}: --filter: expected an inverse map, got an FMU")
    if not smooth:
        return MapBlocks(static.estimator.filter(time_constant))
    return (SmoothedFlight if static.estimator.is_nonlinear else SmoothedMap)(static, settings)


def filter_attributes(estimator: BlockEstimator) -> dict[str, float]:
    """Return what the output says of the filter of ``estimator``: time constant [s], smoothed or not; {} of
    none."""
    if isinstance(estimator, SmoothedFlight | SmoothedMap):
        return {"filter_time_constant": estimator.settings.time_constant, "smoothed": True}
    if not isinstance(estimator, MapBlocks) or estimator.estimator.filter_time_constant == 0.0:
        return {}
    return {"filter_time_constant": estimator.estimator.filter_time_constant, "smoothed": False}


def estimated_blocks(
    blocks: Iterable[tuple[StrainBlock, int]], estimator: BlockEstimator
) -> Iterator[tuple[StrainBlock, int, BlockEstimates]]:
    """Return each block with its position and its estimates."""
    if isinstance(estimator, SmoothedFlight):
        yield from _smoothed_blocks(blocks, estimator)
        return
    if isinstance(estimator, SmoothedMap):
        yield from _smoothed_blocks(blocks, estimator)
        return
    last = float("nan")
    for block, done in blocks:
        yield block, done, estimator.estimate(block, last)
        last = float(block.time[-1])


def _smoothed_blocks(
    blocks: Iterable[tuple[StrainBlock, int]], estimator: SmoothedBlocks[Step]
) -> Iterator[tuple[StrainBlock, int, BlockEstimates]]:
    before: StrainBlock | None = None
    position, last = 0, float("nan")
    known: list[Step] = []
    for block, done in blocks:
        steps: list[Step] = list(estimator.steps(block, last))
        if before is not None:
            yield before, position, estimator.of_laws(known, smoothed([*known, *steps])[: len(known)])
        before, position, last = block, done, float(block.time[-1])
        known = steps
    if before is not None:
        yield before, position, estimator.of_laws(known, smoothed(known))
