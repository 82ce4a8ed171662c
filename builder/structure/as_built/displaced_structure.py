"""Strain of a vehicle as built on a structure of any make: a mesh, sections, or a matrix of another code.

Gauges are what may differ: gains, and by the strain of displaced gauges, where the structure has them, places,
directions, transverse sensitivity and the roll of the layout; and Young's modulus of the whole. The wall is as in
the model. What its tolerance changes of the strain of a gauge counts as a gain of that gauge.

    reading = (1 + common) (1 + gain) / (1 + E) (strain + shifts and turns) + zero.

What gauges as built read on a structure of any shape: by the strain of displaced ones.

Shifts and turns of gauges act to first order, the wall's thickness inversely.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import (
    AsBuilt,
    BuiltStructure,
    Counts,
    Key,
    as_built_std,
    derivative_keys,
    parameter_derivatives,
)
from builder.structure.as_built.gauge_strain_terms import gain_of, rows_of, turn_of
from builder.structure.as_built_kinds import AS_BUILT, IN_NOISE
from builder.structure.external.external_structure import influence_of
from builder.structure.fourier.fourier_model import refuse_beyond_fourier
from builder.structure.loads.applied import ApparentStrain, Load
from builder.structure.loads.gauge_strain import nodal_force
from builder.structure.loads.influence_structure import InfluenceStructure
from builder.structure.mapped_structure import MappedStructure
from builder.structure.solid.gauge_layouts import (
    AFT,
    AROUND,
    BACK,
    DISPLACED,
    FORE,
    STEP,
    TURNED_AROUND,
    TURNED_BACK,
    displaced_name,
)
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.map_options import Calibration, Noise
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import ZERO

WAYS = 5
"""Gauges in place, what they read more per metre aft, per metre around, per radian turned, and strain across."""

KNOWN = (
    "gauge_gain",
    "common_gain",
    "axial_shift",
    "circumferential_shift",
    "orientation",
    "row_orientation",
    "transverse_sensitivity",
    "layout_roll",
    "wall_thickness",
)
"""Kinds that these act by; the pressure's and the readings' own come besides."""


def ways_of(in_place: FloatArray, moved: Callable[[str], FloatArray] | None) -> FloatArray:
    """Return the parts (n_w, n_d, ..) of :data:`WAYS` from the strain ``in_place`` (n_d, ..) of gauges in place.

    ``moved`` returns the strain of gauges displaced in a way; None where no gauge is.
    """
    parts = np.zeros((WAYS, *in_place.shape))
    parts[0] = in_place
    if moved is not None:
        parts[1] = (moved(AFT) - moved(FORE)) / (2.0 * STEP)
        parts[2] = (moved(AROUND) - moved(BACK)) / (2.0 * STEP)
        parts[3] = moved(TURNED_AROUND) - moved(TURNED_BACK)
        parts[4] = moved(TURNED_AROUND) + moved(TURNED_BACK) - in_place  # normals at right angles add up alike
    return parts


@dataclass(frozen=True, eq=False)
class DisplacedGauges:
    """Gauges at ``position`` (n_d, 3) [m] of a structure of any shape."""

    position: FloatArray

    @cached_property
    def radius(self) -> FloatArray:
        """(n_d,) distance of the gauges from the axis [m]."""
        return np.hypot(self.position[:, 1], self.position[:, 2])

    @cached_property
    def roll_angle(self) -> FloatArray:
        """(n_d,) [rad]."""
        return np.arctan2(self.position[:, 1], self.position[:, 2])

    @cached_property
    def row(self) -> IntArray:
        """(n_d,) number of the row of each gauge: those at one roll angle."""
        return rows_of(self.roll_angle)

    def as_built(self, parts: FloatArray, as_built: AsBuilt) -> FloatArray:
        """Return (.., n_d) what gauges ``as_built`` read, from ``parts`` (n_w, .., n_d), see :data:`WAYS`.

        Of v vehicles at once, ``parts`` are (n_w, 1, n_d) or (n_w, n_d).
        """
        around = as_built.circumferential_shift + as_built.layout_roll * self.radius
        turn = turn_of(as_built, self.row)
        moved = parts[0] + as_built.axial_shift * parts[1] + around * parts[2] + turn * parts[3]
        moved = moved + as_built.transverse_sensitivity * parts[4]
        return np.asarray(gain_of(as_built) / (1.0 + as_built.of_all("wall_thickness")) * moved)


def refuse_others(noise: Noise) -> None:
    """Refuse errors that displaced gauges do not show."""
    for kind in IN_NOISE:
        if kind in AS_BUILT and kind.name not in KNOWN and kind.std(noise) > 0.0:
            raise InputError(f"noise.{kind.entry}: expected 0 but for a body of revolution that is clamped aft")


GAINS = ("gauge_gain", "common_gain", "youngs_modulus")
"""Kinds that need no displaced gauges."""


class DisplacedResponse(NamedTuple):
    """What loads strain: ``parts`` (n_w, .., n_d) of :data:`WAYS`, and ``constant`` (.., n_d), which no parameter
    changes [m/m]."""

    parts: FloatArray
    constant: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class DisplacedStructure(BuiltStructure):
    """What may differ from the drawing, on a structure of any make.

    Attributes
    ----------
    layout : name of the layout.
    mapped : the map's structure: strain per pressure.
    loaded : forces on the outer surface; rows of the layout in use, then of its displaced gauges.
    """

    layout: str
    mapped: MappedStructure
    loaded: InfluenceStructure
    joint_stations: tuple[float, ...] = ()
    _responses: dict[Load, DisplacedResponse] = field(default_factory=dict)

    has_moduli = False
    weightless = "forces on the outer surface alone are known of this structure"

    @property
    def surface(self) -> SurfaceGrid | SurfaceMesh:
        """The pressure nodes."""
        return self.mapped.surface

    @property
    def gauges(self) -> GaugeLayout:
        """Names, positions and directions by the drawing."""
        return self.mapped.layouts[self.layout]

    @property
    def mesh_error(self) -> FloatArray | None:
        """(n_d, n_p) of the strain operator [1/Pa]; None where it is not known."""
        return self.mapped.error_operator(self.layout)

    @property
    def counts(self) -> Counts:
        """Numbers of what has parameters of its own."""
        return Counts(gauge=len(self.gauges.names), row=int(self._displaced.row.max()) + 1)

    @property
    def at_break(self) -> BoolArray:
        """(n_d,) none: the strain of gauges that are moved is known."""
        return np.zeros(self.n_gauges, dtype=bool)

    @property
    def outer_span(self) -> tuple[float, float]:
        """First and last station of the outer surface [m]."""
        return self.loaded.outer_span

    @property
    def solved_keys(self) -> list[Key]:
        """Keys of all that may differ on this structure."""
        varied = GAINS + (KNOWN if self._is_moved else ())
        return [key for key in derivative_keys(self.counts) if key[0] in varied and key[0] != "wall_thickness"]

    @property
    def solved(self) -> AsBuilt:
        """The vehicle of the file."""
        return self.exactly_built()

    def prior(self, entry: Calibration) -> AsBuilt:
        """Return the standard deviations before a test; the wall's thickness is part of each gauge's gain."""
        std, varied = as_built_std(entry, self.counts), {kind for kind, _ in self.solved_keys}
        fixed = {kind.name: 0.0 for kind in AS_BUILT if kind.name not in varied | {ZERO}}
        return std.changed(gauge_gain=np.hypot(std.gauge_gain, std.wall_thickness), **fixed)

    def strain_operator(self, parameters: AsBuilt) -> FloatArray:
        """Return Z_p (n_d, n_p) [1/Pa]: reading, without zeros, per pressure at every node of ``surface``."""
        return self._read(self._of_pressure, parameters).T

    def operator_slopes(
        self, parameters: AsBuilt, keys: Sequence[Key], gauges: slice = slice(None)
    ) -> dict[Key, FloatArray]:
        """Return the derivatives (n_d, n_p) of :meth:`strain_operator` by ``keys``, of some ``gauges``
        [1/Pa per unit]."""
        slopes = parameter_derivatives(self.strain_operator, parameters, keys)
        return {key: slope[gauges] for key, slope in slopes.items()}

    def response(self, load: Load) -> DisplacedResponse:
        """Return what ``load`` strains, kept for the next time."""
        none = np.zeros(self.n_gauges)
        if isinstance(load, ApparentStrain):
            return DisplacedResponse(ways_of(none, None), none + load.strain)
        if load not in self._responses:
            in_place, *displaced = self.loaded.strain(nodal_force(self.loaded, load)).reshape(-1, self.n_gauges)
            by_way = dict(zip(DISPLACED, displaced, strict=False))
            self._responses[load] = DisplacedResponse(
                ways_of(in_place, by_way.__getitem__ if by_way else None), none
            )
        return self._responses[load]

    def responses(self, loads: Sequence[Load]) -> DisplacedResponse:
        """Return the responses of loads as one, with the readings (n_loads, n_d) of every load."""
        responses = [self.response(load) for load in loads]
        return DisplacedResponse(
            np.stack([response.parts for response in responses], axis=1),
            np.stack([response.constant for response in responses]),
        )

    nominal_response = responses

    def response_strain(self, parameters: AsBuilt, response: DisplacedResponse) -> FloatArray:
        """Return the readings (n_d,) [m/m] under the load of ``response``, (n_loads, n_d) under several."""
        return self._read(response.parts, parameters) + response.constant

    def response_slopes(
        self, parameters: AsBuilt, response: DisplacedResponse, keys: Sequence[Key]
    ) -> tuple[FloatArray, dict[Key, FloatArray]]:
        """Return the readings (n_d, n_loads) [m/m] under the loads of ``response``, and their derivatives by
        ``keys``."""

        def strain(as_built: AsBuilt) -> FloatArray:
            return self._read(response.parts, as_built).T

        return self.response_strain(parameters, response).T, parameter_derivatives(strain, parameters, keys)

    @property
    def _is_moved(self) -> bool:
        return len(self.loaded.gauge_position) > self.n_gauges

    @cached_property
    def _displaced(self) -> DisplacedGauges:
        return DisplacedGauges(self.gauges.position)

    @cached_property
    def _of_pressure(self) -> FloatArray:
        """(n_w, n_p, n_d) strain per pressure [1/Pa]."""

        def moved(how: str) -> FloatArray:
            return self.mapped.strain_operator(displaced_name(self.layout, how))

        in_place = self.mapped.strain_operator(self.layout)
        return ways_of(in_place, moved if self._is_moved else None).transpose(0, 2, 1)

    def _read(self, parts: FloatArray, as_built: AsBuilt) -> FloatArray:
        return self._displaced.as_built(parts, as_built) / (1.0 + as_built.youngs_modulus)


AnyAsBuilt = AsBuiltStructure | DisplacedStructure
"""A structure with what may differ from its drawing: the semi-analytic model's, or of any other make."""


def refuse_untestable(vehicle: Vehicle) -> None:
    """Refuse a vehicle whose readings in a ground test no model predicts."""
    entry = vehicle.structure
    if entry.model != "solid":
        refuse_beyond_fourier(vehicle, [vehicle.gauges.layout])
    elif entry.strain_per_snapshot is not None:
        raise InputError(f"structure.strain_per_snapshot: expected structure.influence; {WITHOUT_MODEL}")
    elif entry.support == "free_flight":
        raise InputError(f"structure.support: expected a body that is held with a solid model; {WITHOUT_MODEL}")


WITHOUT_MODEL = "`strainfmu equations` needs no model"


def displaced_structure(vehicle: Vehicle, mapped: MappedStructure) -> DisplacedStructure:
    """Return the structure of ``vehicle`` with what may differ from its drawing.

    Parameters
    ----------
    vehicle : of a solid model or of a matrix of another code.
    mapped : the map's structure.

    Raises
    ------
    InputError
        The structure has no support, strains of the snapshots alone, or a file is missing or wrong.
    """
    refuse_untestable(vehicle)
    layout = vehicle.gauges.layout
    influence, columns = influence_of(vehicle)
    moved = [displaced_name(layout, how) for how in DISPLACED]
    layouts = [layout, *(moved if all(name in columns and name in mapped.operators for name in moved) else [])]
    if layout not in mapped.layouts or mapped.layouts[layout].names != columns[layout]:
        raise InputError(f"structure: expected the gauges of layout '{layout}', got others; build it again")
    rows: IntArray = np.array(
        [influence.column.index(name) for name_of_layout in layouts for name in columns[name_of_layout]]
    )
    position = np.tile(mapped.layouts[layout].position, (len(layouts), 1))
    loaded = InfluenceStructure(
        node=influence.node,
        facet=influence.facet,
        gauge_position=position,
        strain_per_force=influence.strain_per_force[rows],
    )
    return DisplacedStructure(layout=layout, mapped=mapped, loaded=loaded)
