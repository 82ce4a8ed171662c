"""Errors of a vehicle that the calibration has no parameter for: a taper and a second harmonic of the wall.

Each is the difference between two structures of the independent model, to first order in the error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from builder.calibration.as_built_parameters import AsBuiltParameters
from builder.calibration.as_built_structure import AsBuiltStructure, as_built_structure
from builder.calibration.wall_regions import wall_regions
from builder.structure.loads.applied import Load
from builder.structure.loads.loaded_structure import LoadProperties
from builder.vehicle.file import Vehicle
from builder.vehicle.gauge_layout import GaugeLayout
from strainfmu.arrays import FloatArray

TAPER = 0.02
"""Relative thickness by which each region of the wall is thicker at its aft end, and thinner at its fore end."""

SECOND_HARMONIC = 0.01
"""Standard deviation of the cosine and the sine of twice the roll angle in each region's relative thickness."""

OUTSIDE = ("taper", "second harmonic")


@dataclass(frozen=True, eq=False, kw_only=True)
class OutsideStructures:
    """Structures whose differences are the errors: the wall of the drawing, tapered, and with a second harmonic.

    That of the second harmonic takes ``wall_cosine`` and ``wall_sine`` for those of twice the roll angle.
    """

    even: AsBuiltStructure
    tapered: AsBuiltStructure
    twice: AsBuiltStructure


def outside_structures(vehicle: Vehicle, properties: LoadProperties, max_harmonic: int) -> OutsideStructures:
    """Solve the structures of the independent model."""
    n_r = len(wall_regions(vehicle))

    def solved(taper: float, wave: int) -> AsBuiltStructure:
        return as_built_structure(
            vehicle,
            vehicle.gauges.layout,
            vehicle.resolution.truth,
            properties,
            np.zeros(n_r),
            max_harmonic,
            known_taper=np.full(n_r, taper),
            wave=wave,
        )

    return OutsideStructures(even=solved(0.0, 1), tapered=solved(TAPER, 1), twice=solved(0.0, 2))


@dataclass(frozen=True, eq=False, kw_only=True)
class OutsideVehicle:
    """A vehicle with one error of :data:`OUTSIDE` beside those of its parameters.

    Attributes
    ----------
    truth : without that error.
    structures : which have it.
    kind : of :data:`OUTSIDE`.
    wave : (2, n_r) cosine and sine of the second harmonic [1].
    """

    truth: AsBuiltStructure
    structures: OutsideStructures
    kind: str
    wave: FloatArray

    @property
    def gauges(self) -> GaugeLayout:
        """Names, positions and directions by the drawing."""
        return self.truth.gauges

    def reading(self, parameters: AsBuiltParameters, loads: Sequence[Load]) -> FloatArray:
        """Return what every gauge reads, zeros included, (n_d,) [m/m]."""
        (one, with_error), (other, without) = self._pairs(parameters)
        change = one.load_strain(with_error, loads) - other.load_strain(without, loads)
        return self.truth.reading(parameters, loads) + change

    def strain_operator(self, parameters: AsBuiltParameters) -> FloatArray:
        """Return Z_p (n_d, n_p) [1/Pa] on the nodes of the truth."""
        (one, with_error), (other, without) = self._pairs(parameters)
        change = one.strain_operator(with_error) - other.strain_operator(without)
        return self.truth.strain_operator(parameters) + change

    def _pairs(
        self, parameters: AsBuiltParameters
    ) -> tuple[tuple[AsBuiltStructure, AsBuiltParameters], tuple[AsBuiltStructure, AsBuiltParameters]]:
        """Return structure and parameters with the error and without."""
        none = np.zeros(parameters.n_regions)
        even = replace(parameters, wall_thickness=none, wall_cosine=none, wall_sine=none)
        if self.kind == "taper":
            return (self.structures.tapered, even), (self.structures.even, even)
        uneven = replace(even, wall_cosine=self.wave[0], wall_sine=self.wave[1])
        return (self.structures.twice, uneven), (self.structures.twice, even)


def outside_vehicle(
    truth: AsBuiltStructure, structures: OutsideStructures, kind: str, random: np.random.Generator
) -> OutsideVehicle:
    """Return the vehicle of ``truth`` with an error of ``kind``; a second harmonic is drawn."""
    wave = SECOND_HARMONIC * random.standard_normal((2, truth.n_regions))
    return OutsideVehicle(truth=truth, structures=structures, kind=kind, wave=wave)
