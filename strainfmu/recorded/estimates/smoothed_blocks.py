"""Blocks of recorded samples smoothed over time: the filter goes over them from both ends.

Smoothing looks one whole block ahead.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT
from strainfmu.estimator.smoothing import Samples, Smoothed, Smoother
from strainfmu.recorded.columns.columns import StrainBlock
from strainfmu.recorded.estimates.block_estimates import BlockEstimates, BlockEstimator
from strainfmu.recorded.estimates.map_blocks import MapBlocks, air_data_values, other_values


class SmoothedBlocks(MapBlocks):
    """A map that filters over time, smoothed."""

    def __init__(self, static: MapBlocks, time_constant: float) -> None:
        super().__init__(static.estimator.filter(time_constant))
        self._smoother = Smoother(self.estimator)

    def samples(self, block: StrainBlock) -> Samples:
        """Return the samples of a block, filtered."""
        return self._smoother.samples(self.estimates(block), block.time)

    def smoothed(self, samples: Samples, later: Samples | None) -> BlockEstimates:
        """Return the estimates of the ``samples`` of a block, by the ``later`` samples of the next one too; all
        else is the filter's."""
        found, known = samples.filtered, self._smoother.smoothed(samples, later)
        of_loads = other_values(_Columns(known, found), self.has_loads)
        of_air = [air_data_values(_Columns(known, found))] if self.estimator.is_nonlinear else []
        return replace(
            self.block_estimates(found),
            coefficients=known.coefficients,
            coefficients_std=known.coefficients_std,
            other_values=np.hstack([*of_air, of_loads]),
            estimates=None,
        )


class _Columns:
    """What columns are made of: smoothed estimates, and the filter's of all else."""

    def __init__(self, known: Smoothed, found: Estimate) -> None:
        self.other_coefficients, self.other_loads = known.other_coefficients, known.other_loads
        self.other_coefficients_std, self.other_loads_std = (
            known.other_coefficients_std,
            known.other_loads_std,
        )
        self.air_data = replace(found.air_data, value=known.air, std=known.air_std)
        self.air_data_used, self.is_linear = found.air_data_used, found.is_linear
        self.parameter_score, self.load_groups = found.parameter_score, found.load_groups


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
            raise InputError("--smooth: expected with --filter, got it alone")
        return static
    if not isinstance(static, MapBlocks):
        raise InputError(f"{source}: --filter: expected an inverse map, got an FMU")
    if time_constant == 0.0:
        raise InputError("time_constant: expected the time constant of the filter [s], got 0")
    return SmoothedBlocks(static, time_constant) if smooth else MapBlocks(static.estimator.filter(time_constant))


def filter_attributes(estimator: BlockEstimator) -> dict[str, float]:
    """Return what the output says of the filter of ``estimator``: time constant [s], smoothed or not; {} of
    none."""
    if not isinstance(estimator, MapBlocks) or estimator.estimator.filter_time_constant == 0.0:
        return {}
    is_smoothed = isinstance(estimator, SmoothedBlocks)
    return {FILTER_TIME_CONSTANT: estimator.estimator.filter_time_constant, "smoothed": is_smoothed}


def estimated_blocks(
    blocks: Iterable[tuple[StrainBlock, int]], estimator: BlockEstimator
) -> Iterator[tuple[StrainBlock, int, BlockEstimates]]:
    """Return each block with its position and its estimates.

    A block is estimated in another thread while the next one is read and the one before is written. Files are read
    and written by this thread alone: a caller may hold the lock of h5py, as in a loop over the items of a file.
    """
    if isinstance(estimator, SmoothedBlocks):
        yield from _smoothed_blocks(blocks, estimator)
        return
    last = float("nan")
    before: tuple[StrainBlock, int, Future[BlockEstimates]] | None = None
    with ThreadPoolExecutor(1, "strainfmu-estimator") as worker:
        for block, done in blocks:
            here = block, done, worker.submit(estimator.estimate, block, last)
            last = float(block.time[-1])
            if before is not None:
                yield *before[:2], before[2].result()
            before = here
        if before is not None:
            yield *before[:2], before[2].result()


def _smoothed_blocks(
    blocks: Iterable[tuple[StrainBlock, int]], estimator: SmoothedBlocks
) -> Iterator[tuple[StrainBlock, int, BlockEstimates]]:
    held: tuple[StrainBlock, int, Samples] | None = None
    for block, done in blocks:
        samples = estimator.samples(block)
        if held is not None:
            yield *held[:2], estimator.smoothed(held[2], samples)
        held = block, done, samples
    if held is not None:
        yield *held[:2], estimator.smoothed(held[2], None)
