"""The flow over a body of revolution with a pointed or spherical tip at incidence, on half the body.

The flow over a body of any star-shaped section, at angle of attack and sideslip, all round the body.

The tip is pointed, or on a body of revolution spherical.
"""

from dataclasses import dataclass
from math import cos, degrees, pi, sin

import numpy as np

from builder.aero.euler.bodies.body_march import march_body
from builder.aero.euler.bodies.surface_function import SurfaceFunction, body_walls, cap_of, surface_walls
from builder.aero.euler.planes import Flow, MarchingGrid
from builder.aero.euler.scheme.gas import total_enthalpy
from builder.aero.euler.scheme.grid import full_body_rays, half_body_rays
from builder.aero.euler.scheme.reconstruction import Stream
from builder.vehicle.shape.geometry import BodyOfRevolution
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError


@dataclass(frozen=True, eq=False, kw_only=True)
class FlowSolution:
    """Wall pressure of one flow, and how well it was computed.

    Attributes
    ----------
    mach_number, incidence : M [1], total incidence a_T [rad].
    roll_angle : (n_phi,) cell centres from the leeward meridian [rad], 0..pi.
    pieces : per smooth piece of the meridian (stations (n,) [m], p/p_inf (n, n_phi)).
    force : (2,) axial and normal force of p - p_inf from the wall fluxes, over p_inf [m2].
    force_from_momentum : (2,) the same from the momentum deficit of the exit plane [m2].
    mass_defect : relative imbalance of mass over the control volume.
    conical_change : change while x grows by half, at the end of the conical start, of the wall pressure relative
        to its mean or of the shock radius; behind a spherical tip the largest residual of its flow.
    n_steps : marching steps taken after the start.
    n_repairs : states that fell back to first order to stay physical, after the start.
    capped_to : station up to which a sphere stands for the tip [m], 0 where none does; forces are then those on
        the body with the sphere, whose tip lies a little behind the body's own.
    """

    mach_number: float
    incidence: float
    roll_angle: FloatArray
    pieces: tuple[tuple[FloatArray, FloatArray], ...]
    force: FloatArray
    force_from_momentum: FloatArray
    mass_defect: float
    conical_change: float
    n_steps: int
    n_repairs: int
    capped_to: float = 0.0


def free_stream_of(mach_number: float, angle_of_attack: float, sideslip_angle: float = 0.0) -> Stream:
    """Return the free stream along (cos a cos b, -sin b, sin a cos b) at angles [rad].

    Raises
    ------
    FlowReachError
        The Mach number is not greater than 1.
    """
    # One compiled version of the march serves all calls if every scalar is a float.
    mach_number, a, b = float(mach_number), float(angle_of_attack), float(sideslip_angle)
    if not mach_number > 1.0:
        raise FlowReachError(f"euler: Mach number {mach_number:g} found, must be greater than 1")
    return Stream(
        u=mach_number * cos(a) * cos(b),
        v=-mach_number * sin(b),
        w=mach_number * sin(a) * cos(b),
        enthalpy=float(total_enthalpy(mach_number)),
    )


def solve_flow(
    body: BodyOfRevolution, mach_number: float, incidence: float, grid: MarchingGrid | None = None
) -> FlowSolution:
    """Solve the inviscid flow over ``body`` at Mach number M and total incidence a_T [rad].

    Raises
    ------
    FlowReachError
        The axial Mach number falls to 1, the wall shock detaches, the flow expands to near vacuum or that over the
        tip does not settle; the message names the station and the condition.
    """
    grid = grid or MarchingGrid()
    stream = free_stream_of(mach_number, incidence)
    name = f"M {mach_number:g}, total incidence {degrees(incidence):.4g} deg"
    rays = half_body_rays(grid.n_circumferential)
    marched = march_body(body_walls(body, rays), rays, Flow(float(mach_number), stream, name), grid, cap_of(body))
    both_halves = np.array([2.0, 2.0])
    return FlowSolution(
        mach_number=float(mach_number),
        incidence=float(incidence),
        roll_angle=(np.arange(grid.n_circumferential) + 0.5) * pi / grid.n_circumferential,
        pieces=marched.pieces,
        force=both_halves * marched.force[[0, 2]],
        force_from_momentum=both_halves * marched.force_from_momentum[[0, 2]],
        mass_defect=marched.mass_defect,
        conical_change=marched.conical_change,
        n_steps=marched.n_steps,
        n_repairs=marched.n_repairs,
        capped_to=0.0 if marched.capped is None else marched.capped.end,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class FullFlowSolution:
    """Wall pressure of one flow all round a body, and how well it was computed.

    Attributes
    ----------
    mach_number, angle_of_attack, sideslip_angle : M [1], a, b [rad].
    roll_angle : (n_phi,) cell centres from +z towards +y [rad], 0..2 pi.
    pieces : per smooth piece of the surface (stations (n,) [m], p/p_inf (n, n_phi)).
    force : (3,) force of p - p_inf along x, y, z from the wall fluxes, over p_inf [m2].
    force_from_momentum : (3,) the same from the momentum deficit of the exit plane [m2].
    mass_defect, conical_change, n_steps, n_repairs : as in
        :class:`~builder.aero.euler.bodies.solver.FlowSolution`.
    """

    mach_number: float
    angle_of_attack: float
    sideslip_angle: float
    roll_angle: FloatArray
    pieces: tuple[tuple[FloatArray, FloatArray], ...]
    force: FloatArray
    force_from_momentum: FloatArray
    mass_defect: float
    conical_change: float
    n_steps: int
    n_repairs: int


def solve_full_flow(
    surface: SurfaceFunction | BodyOfRevolution,
    mach_number: float,
    angle_of_attack: float,
    sideslip_angle: float,
    grid: MarchingGrid | None = None,
) -> FullFlowSolution:
    """Solve the inviscid flow over ``surface`` in a stream along (cos a cos b, -sin b, sin a cos b).

    ``grid`` counts circumferential cells over half a turn, as for half a body: twice as many go all round.

    Raises
    ------
    InputError
        The surface's radius is not positive and finite aft of the tip.
    FlowReachError
        The axial Mach number falls to 1, the wall shock detaches, the flow expands to near vacuum or that over the
        tip does not settle; the message names the station and the condition.
    """
    grid = grid or MarchingGrid()
    stream = free_stream_of(mach_number, angle_of_attack, sideslip_angle)
    rays = full_body_rays(grid.n_circumferential)
    if isinstance(surface, BodyOfRevolution):
        walls, cap = body_walls(surface, rays), cap_of(surface)
    else:
        walls, cap = surface_walls(surface, rays), None
    name = (
        f"M {mach_number:g}, angle of attack {degrees(angle_of_attack):.4g} deg, "
        f"sideslip {degrees(sideslip_angle):.4g} deg"
    )
    marched = march_body(walls, rays, Flow(float(mach_number), stream, name), grid, cap)
    return FullFlowSolution(
        mach_number=float(mach_number),
        angle_of_attack=float(angle_of_attack),
        sideslip_angle=float(sideslip_angle),
        roll_angle=rays.step * (np.arange(rays.cell_sine.size, dtype=np.float64) + 0.5),
        pieces=marched.pieces,
        force=marched.force,
        force_from_momentum=marched.force_from_momentum,
        mass_defect=marched.mass_defect,
        conical_change=marched.conical_change,
        n_steps=marched.n_steps,
        n_repairs=marched.n_repairs,
    )
