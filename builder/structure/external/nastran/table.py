"""Strains of gauges by subcase, for the tables of load cases and of unit forces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from builder.structure.external.load_cases import strain_columns
from builder.structure.external.nastran.gauges import NastranPoint, read_nastran_gauges
from builder.structure.external.nastran.results import NastranResults, read_nastran_results
from builder.structure.solid.gauge_rows import Gauges
from builder.vehicle.file import Vehicle


@dataclass(frozen=True, eq=False)
class NastranStrains:
    """Strains of gauges in Nastran's results.

    Attributes
    ----------
    results : element strains.
    points : of each gauge's column the points whose mean it reads.
    """

    results: NastranResults
    points: Mapping[str, list[NastranPoint]]

    @property
    def column(self) -> tuple[str, ...]:
        """Names of the gauges' columns."""
        return tuple(self.points)

    def row(self, subcase: int) -> list[float]:
        """Return the strain of each column [m/m].

        Raises
        ------
        InputError
            The results do not hold it.
        """
        return [
            float(np.mean([self.results.strain(subcase, point) for point in points]))
            for points in self.points.values()
        ]


def nastran_strains(vehicle: Vehicle, layouts: Mapping[str, Gauges]) -> NastranStrains | None:
    """Return the strains in the files that the vehicle file names, None where it names none.

    Raises
    ------
    InputError
        A file is missing or wrong.
    """
    entry = vehicle.structure
    if entry.nastran_gauges is None:
        return None
    columns = strain_columns(layouts, vehicle.gauges.layout)
    directions = {
        name: gauges.direction[k] for layout, gauges in layouts.items() for k, name in enumerate(columns[layout])
    }
    points = read_nastran_gauges(vehicle.beside(entry.nastran_gauges), directions)
    return NastranStrains(read_nastran_results([vehicle.beside(name) for name in entry.nastran_results]), points)
