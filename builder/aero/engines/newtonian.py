"""Modified Newtonian flow as an engine: pressure from local inclination, for any shape, blunt or finned.

Options, as the vehicle file names them:

``stagnation``
    ``rayleigh_pitot`` (default): C_p,max behind a normal shock, 1.81 at M 5. ``classical``: C_p,max = 2. On
    slender pointed bodies both are too low at M 5 to 7, ``classical`` by less
    (``docs/explanation/aerodynamics.md``).
``leeward``
    ``ambient`` (default), ``prandtl_meyer`` (sharp bodies) or ``matched`` (blunt bodies):
    :mod:`builder.aero.engines.local_inclination`.

Aft-facing nodes (normals within 30 deg of the axis) are the base: flow separates there, and they keep the ambient
pressure whatever ``leeward`` is. Not modelled: shadows of one part of the body on another (a fin behind a wider
body is loaded as if it were alone), interference of shocks, viscosity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, degrees, radians, sin
from typing import TYPE_CHECKING, Any

import numpy as np

from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.local_inclination import LEEWARD, STAGNATION, inclination_pressure_ratio, matching_point
from builder.aero.surface.edges import FEATURE_ANGLE, prepare_surface
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError, InputError
from strainfmu.flight_condition import FlightCondition

if TYPE_CHECKING:
    from builder.aero.deflections import Deflection

METHOD_VERSION = 1
"""Raised whenever results change, so that stored flows of an older version are solved again."""
BASE_ANGLE = radians(30.0)


@dataclass(frozen=True, eq=False)
class NewtonianEngine:
    """Pressure from the inclination of the nodes' normals to the free stream.

    Attributes
    ----------
    surface : nodes doubled at sharp edges, triangles facing outward (:func:`newtonian_engine` makes it so).
    stagnation : one of :data:`builder.aero.engines.local_inclination.STAGNATION`.
    leeward : one of :data:`builder.aero.engines.local_inclination.LEEWARD`.
    deflections : how the surface moves with each flow parameter, in the order of a condition's.

    Raises
    ------
    InputError
        An option is not one of these, or ``matched`` is requested without the stagnation pressure it starts from.
    """

    surface: SurfaceMesh
    stagnation: str = "rayleigh_pitot"
    leeward: str = "ambient"
    deflections: tuple[Deflection, ...] = ()

    def __post_init__(self) -> None:
        for name, value, allowed in (
            ("stagnation", self.stagnation, STAGNATION),
            ("leeward", self.leeward, LEEWARD),
        ):
            if value not in allowed:
                raise InputError(f"{name}: '{value}' found, must be one of {', '.join(allowed)}")
        if self.leeward == "matched" and self.stagnation != "rayleigh_pitot":
            raise InputError(f"stagnation: '{self.stagnation}' found, leeward 'matched' needs 'rayleigh_pitot'")

    @property
    def name(self) -> str:
        return "newtonian"

    def inputs(self) -> Mapping[str, Any]:
        return {
            "engine": self.name,
            "method_version": METHOD_VERSION,
            "surface": self.surface.digest(),
            "stagnation": self.stagnation,
            "leeward": self.leeward,
            **({"deflections": {d.name: d.digest() for d in self.deflections}} if self.deflections else {}),
        }

    def conditions(self) -> None:
        return None

    def flow_key(self, condition: FlightCondition) -> FlowKey:
        """Return (M, alpha [rad], beta [rad], flow parameters), rounded; altitude does not change p/p_inf."""
        values = (
            *(condition.mach_number, condition.angle_of_attack, condition.sideslip_angle),
            *condition.parameters[: len(self.deflections)],
        )
        return tuple(round(value, 9) for value in values)

    def solve(self, key: FlowKey) -> Flow:
        # Two numbers are Mach number and angle of attack, without sideslip.
        mach_number, angle_of_attack, sideslip = (*key, 0.0)[:3]
        wind = np.array(
            [cos(angle_of_attack) * cos(sideslip), -sin(sideslip), sin(angle_of_attack) * cos(sideslip)]
        )
        sine = -self._moved(key[3:]).node_normal @ wind
        if self.leeward == "matched":
            _check_blunt(mach_number, float(sine.max()))
        ratio = inclination_pressure_ratio(mach_number, sine, self.stagnation, self.leeward)
        base = self.surface.node_normal[:, 0] >= cos(BASE_ANGLE)
        return Flow(key=key, arrays={"pressure_ratio": np.where(base & (sine < 0.0), 1.0, ratio)})

    def _moved(self, parameters: tuple[float, ...]) -> SurfaceMesh:
        """Return the surface at values of the flow parameters; those that are not given leave it as it is."""
        shifts = [
            deflection.shift_at(value) for deflection, value in zip(self.deflections, parameters, strict=False)
        ]
        return SurfaceMesh(self.surface.point + sum(shifts), self.surface.triangle) if shifts else self.surface

    def pressure_ratio(self, flow: Flow, condition: FlightCondition) -> FloatArray:
        return flow.arrays["pressure_ratio"]


def newtonian_engine(
    mesh: SurfaceMesh, stagnation: str = "rayleigh_pitot", leeward: str = "ambient"
) -> tuple[NewtonianEngine, tuple[str, ...]]:
    """Return the engine of a surface from a file, and notes on what was changed on it.

    Raises
    ------
    InputError
        The surface is not closed but for its base (:func:`builder.aero.surface.edges.prepare_surface`), or an
        option is wrong.
    """
    surface, notes = prepare_surface(mesh, FEATURE_ANGLE)
    return NewtonianEngine(surface, stagnation, leeward), notes


def _check_blunt(mach_number: float, largest_sine: float) -> None:
    """Refuse ``matched`` where no part of the body is steep enough for it to start."""
    needed = matching_point(mach_number).inclination
    if largest_sine < sin(needed):
        raise FlowReachError(
            f"leeward: 'matched' needs a blunt nose, inclined by {degrees(needed):.3g} deg or more at Mach number"
            f" {mach_number:g}; the steepest node has {degrees(np.arcsin(max(largest_sine, 0.0))):.3g} deg:"
            " use 'prandtl_meyer'"
        )
