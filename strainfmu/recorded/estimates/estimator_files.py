"""The estimator of recorded samples that a file holds: an inverse map or an estimator FMU."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from strainfmu.cosim.estimators.source import is_fmu
from strainfmu.cosim.estimators.zeros_file import load_zeros
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.recorded.estimates.block_estimates import BlockEstimator
from strainfmu.recorded.estimates.fmu_blocks import opened_fmu
from strainfmu.recorded.estimates.map_blocks import MapBlocks


@contextmanager
def open_block_estimator(source: Path, zeros: Path | None = None) -> Iterator[BlockEstimator]:
    """Load an estimator FMU or an inverse map, with the ``zeros`` of its gauges (zeros.toml); free it at the end.

    Raises
    ------
    InputError
        The file is missing, damaged, or neither.
    StrainfmuError
        The FMU cannot be loaded on this machine.
    """
    if is_fmu(source):
        with opened_fmu(source, zeros) as found:
            yield found
        return
    inverse_map = load_inverse_map(source)
    known = None if zeros is None else load_zeros(zeros, inverse_map.gauge_names[: inverse_map.n_strain_gauges])
    yield MapBlocks(Estimator(inverse_map, zeros=known))
