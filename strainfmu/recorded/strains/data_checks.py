"""What is checked of a whole recording while it is estimated: faults and level of strains, gaps of the flow."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.recorded.columns.column_names import STATIC_PRESSURE
from strainfmu.recorded.columns.columns import ColumnPlan, StrainBlock
from strainfmu.recorded.columns.flight_pressure import flown_pressure, pressure_sources
from strainfmu.recorded.columns.strain_level import LevelCheck, LevelReference
from strainfmu.recorded.strains.strain_faults import StrainFaults

_SLOW = 0.5
"""Part of the rows with a value of a quantity below which it is taken for a slower channel."""


class DataChecks:
    """Checks of the blocks of one file.

    Parameters
    ----------
    plan : its columns.
    gauge_names : n_d names.
    reference : strains that the estimator expects.
    zero : (n_d,) or one zero that it subtracts [m/m].
    accepts_level, accepts_held : whether strains of another level, and rows that do not change, are estimated.
    is_joined : whether slower channels have been brought to the times of the strains.
    """

    def __init__(
        self,
        plan: ColumnPlan,
        gauge_names: tuple[str, ...],
        reference: LevelReference,
        *,
        zero: FloatArray | float = 0.0,
        accepts_level: bool = False,
        accepts_held: bool = False,
        is_joined: bool = False,
    ) -> None:
        self._path, self._zero, self._is_joined = plan.path, zero, is_joined
        self.excluded = [name for name, column in zip(gauge_names, plan.strain, strict=True) if column is None]
        """Gauges that are left out throughout."""
        self._faults = StrainFaults(plan.path, gauge_names, reference, zero=zero, accepts_held=accepts_held)
        factor = float(np.nanmedian(plan.strain_factor))
        self._level = LevelCheck(plan.path, reference, factor, not accepts_level, _pressure_column(plan))
        self._rows, self._known = 0, Counter[str]()

    @property
    def missing(self) -> Counter[str]:
        """Number of strains without a value, by gauge, of those that are not left out."""
        return Counter({name: k for name, k in self._faults.missing.items() if name not in self.excluded})

    def without_faults(self, blocks: Iterable[tuple[StrainBlock, int]]) -> Iterator[tuple[StrainBlock, int]]:
        """Yield ``blocks`` as :meth:`StrainFaults.without` does.

        Raises
        ------
        InputError
            The level of the strains is far above the map's.
        """
        for block, done in self._faults.without(blocks):
            self._level.add(block.strain - self._zero, flown_pressure(block.dynamic_pressure, block.flow))
            self._rows += len(block.time)
            for name, values in {DYNAMIC_PRESSURE: block.dynamic_pressure, **block.flow}.items():
                self._known[name] += int(np.isfinite(values).sum())
            yield block, done

    def notes(self) -> list[str]:
        """Return what is to be said of the whole file.

        Raises
        ------
        InputError
            The level of the strains is far below the map's.
        """
        notes = [f"{self._path}: left out by --exclude: {', '.join(self.excluded)}"] if self.excluded else []
        return [*notes, *self._level.notes(), *self._faults.notes(), *self._gaps()]

    def _gaps(self) -> list[str]:
        """Return a note on quantities of the flow that have a value in few rows, as slower channels do."""
        if self._is_joined:
            return []
        slow = {name: known for name, known in self._known.items() if 1 < known < _SLOW * self._rows}
        if not slow:
            return []
        shown = ", ".join(f"{name} ({known})" for name, known in slow.items())
        return [
            f"{self._path}: values in few of {self._rows} rows: {shown}; the others have none. --channels "
            "channels.toml interpolates slower channels at the times of the strains"
        ]


def _pressure_column(plan: ColumnPlan) -> tuple[str, float] | None:
    """Return the quantity that q_inf comes from, and the factor of its unit to Pa; None of an altitude."""
    if np.isfinite(plan.fixed_pressure):
        return "--dynamic-pressure", 1.0
    name = DYNAMIC_PRESSURE if DYNAMIC_PRESSURE in plan.flow else STATIC_PRESSURE
    if name == STATIC_PRESSURE and STATIC_PRESSURE not in pressure_sources(plan.flow):
        return None
    return name, plan.flow[name][1]
