"""Blocks of recorded samples by a filter over time, smoothed or not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np

from strainfmu.errors import InputError
from strainfmu.estimator.estimates.load_estimate import LoadEstimates, series_of
from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.flight_track import FilteredStep
from strainfmu.estimator.filter.kalman import Law
from strainfmu.estimator.filter.linear_filter import LinearFilter, LinearStep
from strainfmu.estimator.filter.settings import LARGEST, FilterSettings
from strainfmu.estimator.filter.smoothing import smoothed
from strainfmu.interface.input_names import given_flow
from strainfmu.recorded.columns.columns import StrainBlock
from strainfmu.recorded.columns.sensor_readings import rows_of_map
from strainfmu.recorded.estimates.block_estimates import BlockEstimates, BlockEstimator
from strainfmu.recorded.estimates.map_blocks import FlightBlocks, MapBlocks, flow_of

Step = TypeVar("Step", FilteredStep, LinearStep)

FIRST_STEP = 1.0
"""Time step of the first sample [s]; before it nothing is known, so that it does not matter."""


class FilteredBlocks(BlockEstimator, Protocol[Step]):
    """A :class:`BlockEstimator` with memory.

    Attributes
    ----------
    settings : of the filter.
    smooths : whether estimates are to be smoothed.
    """

    settings: FilterSettings
    smooths: bool

    def steps(self, block: StrainBlock, last: float) -> list[Step]:
        """Return the steps of a block; ``last`` as of :meth:`BlockEstimator.estimate`."""

    def of_laws(self, steps: Sequence[Step], laws: Sequence[Law]) -> BlockEstimates:
        """Return the estimates of ``steps`` by smoothed ``laws`` of their states."""


class FilteredFlight(FlightBlocks):
    """An inverse map with tables over the flight state, filtered."""

    def __init__(self, static: FlightBlocks, settings: FilterSettings, smooths: bool) -> None:
        super().__init__(static.estimator)
        self.settings, self.smooths = settings, smooths
        self._filter = FlightFilter(static.estimator, settings)

    def estimate(self, block: StrainBlock, last: float) -> BlockEstimates:
        return self.of_steps([step.estimate[0] for step in self.steps(block, last)])

    def steps(self, block: StrainBlock, last: float) -> list[FilteredStep]:
        """Return the steps of a block."""
        found, readings = [], self.rows_of(block)
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
        return self.of_steps([self._filter.smoothed(step, law)[0] for step, law in zip(steps, laws, strict=True)])


class FilteredMap(MapBlocks):
    """A linear inverse map, filtered."""

    def __init__(self, static: MapBlocks, settings: FilterSettings, smooths: bool) -> None:
        super().__init__(static.estimator)
        self.settings, self.smooths = settings, smooths
        self._filter = LinearFilter(static.estimator, settings)

    def estimate(self, block: StrainBlock, last: float) -> BlockEstimates:
        return self.of_series(series_of([step.estimate for step in self.steps(block, last)]))

    def steps(self, block: StrainBlock, last: float) -> list[LinearStep]:
        """Return the steps of a block."""
        rows = rows_of_map(block, self.estimator.inverse_map.sensors, self.readings)
        static = self.estimator.estimate(
            rows,
            block.dynamic_pressure,
            temperature=block.temperature,
            parameters=dict(block.parameters),
            **flow_of(block),
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
        return self.of_series(
            series_of([self._filter.with_law(step, law) for step, law in zip(steps, laws, strict=True)])
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
    if isinstance(static, FlightBlocks):
        return FilteredFlight(static, settings, smooth)
    if isinstance(static, MapBlocks):
        return FilteredMap(static, settings, smooth)
    raise InputError(f"{source}: --filter: expected an inverse map, got an FMU")


def filter_attributes(estimator: BlockEstimator) -> dict[str, float]:
    """Return what the output says of the filter of ``estimator``: time constant [s], smoothed or not; {} of
    none."""
    if not isinstance(estimator, FilteredFlight | FilteredMap):
        return {}
    return {"filter_time_constant": estimator.settings.time_constant, "smoothed": estimator.smooths}


def estimated_blocks(
    blocks: Iterable[tuple[StrainBlock, int]], estimator: BlockEstimator
) -> Iterator[tuple[StrainBlock, int, BlockEstimates]]:
    """Return each block with its position and its estimates. Smoothing looks one whole block ahead."""
    if isinstance(estimator, FilteredFlight) and estimator.smooths:
        yield from _smoothed_blocks(blocks, estimator)
        return
    if isinstance(estimator, FilteredMap) and estimator.smooths:
        yield from _smoothed_blocks(blocks, estimator)
        return
    last = float("nan")
    for block, done in blocks:
        yield block, done, estimator.estimate(block, last)
        last = float(block.time[-1])


def _smoothed_blocks(
    blocks: Iterable[tuple[StrainBlock, int]], estimator: FilteredBlocks[Step]
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
