"""Errors of a vehicle that the calibration takes for zero: a taper and a second harmonic of the wall.

The taper is the difference between two structures that are solved for it, so that it shares no table with the
model; the second harmonic is the independent model's, to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from builder.structure.as_built.structure import AsBuiltStructure, as_built_structure
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.as_built.wall_regions import wall_regions
from builder.structure.loads.applied import Load
from builder.structure.loads.loaded_structure import LoadProperties
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from strainfmu.arrays import FloatArray

TAPER = 0.02
"""Relative thickness by which each region of the wall is thicker at its aft end, and thinner at its fore end."""

SECOND_HARMONIC = 0.01
"""Standard deviation of the cosine and the sine of twice the roll angle in each region's relative thickness."""

OUTSIDE = ("taper", "second harmonic")


@dataclass(frozen=True, eq=False, kw_only=True)
class OutsideStructures:
    """Structures of the independent model whose difference is the taper: the wall of the drawing, and tapered."""

    even: AsBuiltStructure
    tapered: AsBuiltStructure


def outside_structures(vehicle: Vehicle, properties: LoadProperties, max_harmonic: int) -> OutsideStructures:
    """Solve the structures of the independent model."""
    n_r = len(wall_regions(vehicle))

    def solved(taper: float) -> AsBuiltStructure:
        return as_built_structure(
            vehicle,
            vehicle.gauges.layout,
            vehicle.resolution.truth,
            properties,
            np.zeros(n_r),
            max_harmonic,
            known_taper=np.full(n_r, taper),
        )

    return OutsideStructures(even=solved(0.0), tapered=solved(TAPER))


@dataclass(frozen=True, eq=False, kw_only=True)
class OutsideVehicle:
    """A vehicle with one error of :data:`OUTSIDE` in addition to the errors of its parameters.

    Attributes
    ----------
    truth : without that error.
    structures : without taper and with it.
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

    def reading(self, parameters: AsBuilt, loads: Sequence[Load]) -> FloatArray:
        """Return what every gauge reads, zeros included, (n_d,) [m/m]."""
        return self._summed(parameters, lambda one, built: one.load_strain(built, loads)) + parameters.zero

    def strain_operator(self, parameters: AsBuilt) -> FloatArray:
        """Return Z_p (n_d, n_p) [1/Pa] on the nodes of the truth."""
        return self._summed(parameters, lambda one, built: one.strain_operator(built))

    def _summed(
        self, parameters: AsBuilt, strain: Callable[[AsBuiltStructure, AsBuilt], FloatArray]
    ) -> FloatArray:
        """Return ``strain`` of the structure and parameters without the error, plus what the error changes."""
        if self.kind != "taper":
            cosine, sine = self.wave
            uneven = parameters.changed(wall_second_cosine=cosine, wall_second_sine=sine)
            return strain(self.truth, uneven)
        none = np.zeros(parameters.n_regions)
        even = parameters.changed(wall_thickness=none, wall_cosine=none, wall_sine=none)
        tapered, plain = self.structures.tapered, self.structures.even
        change = strain(tapered, even.changed(wall_taper=tapered.solved.wall_taper)) - strain(plain, even)
        return strain(self.truth, parameters) + change


def outside_vehicle(
    truth: AsBuiltStructure, structures: OutsideStructures, kind: str, random: np.random.Generator
) -> OutsideVehicle:
    """Return the vehicle of ``truth`` with an error of ``kind``; a second harmonic is drawn."""
    wave = SECOND_HARMONIC * random.standard_normal((2, truth.n_regions))
    return OutsideVehicle(truth=truth, structures=structures, kind=kind, wave=wave)
