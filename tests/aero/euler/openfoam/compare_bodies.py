"""Print what rhoCentralFoam and the marching solver say of two bodies: see docs/evidence/openfoam.md.

From the project's root:
``PYTHONPATH=tests/aero/euler .venv/bin/python -m openfoam.compare_bodies ic3x DIRECTORY``,
or ``cone_cylinder``, with a total incidence in degrees after it if it is not to be the usual one.
"""

import sys
from dataclasses import dataclass
from math import atan, degrees, pi, radians
from pathlib import Path

import numpy as np

from builder.aero.euler.bodies.solver import FlowSolution, solve_flow
from builder.vehicle.file import IC3X, load_vehicle
from builder.vehicle.shape.geometry import BodyOfRevolution, chain_segments
from openfoam.body_case import BodyCase, Solution, loads_ahead, solve_case, spread_stations
from strainfmu.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One body, its flow, the mesh and what is printed.

    Attributes
    ----------
    mach_number, incidence : M [1], total incidence a_T [deg].
    first, growth, largest : as :func:`spread_stations` takes them.
    cells : circumferential, radial.
    outer_angles : of the mesh [deg]: leeward, side, windward.
    force_stations : where C_N and the centre of pressure of the part ahead are printed [m].
    pressure_stations : where the wall pressure is printed [m].
    """

    body: BodyOfRevolution
    mach_number: float
    incidence: float
    first: float
    growth: float
    largest: float
    cells: tuple[int, int]
    outer_angles: tuple[float, float, float]
    force_stations: tuple[float, ...]
    pressure_stations: tuple[float, ...]


def comparisons() -> dict[str, Comparison]:
    """Return the bodies by name; the cone-cylinder's unit of length is its diameter."""
    cone = atan(0.1)
    return {
        "ic3x": Comparison(
            body=load_vehicle(IC3X).body(),
            mach_number=5.0,
            incidence=8.478,
            first=0.05,
            growth=0.08,
            largest=0.09,
            cells=(36, 28),
            outer_angles=(22.4, 13.1, 9.7),
            force_stations=(1.75, 3.6),
            pressure_stations=(1.5, 2.0, 2.5, 3.0, 3.5),
        ),
        "cone_cylinder": Comparison(
            body=chain_segments([(5.0, cone, cone), (15.0, 0.0, 0.0)]),
            mach_number=4.24,
            incidence=2.0,
            first=0.15,
            growth=0.1,
            largest=0.3,
            cells=(24, 28),
            outer_angles=(18.0, 16.2, 14.7),
            force_stations=(5.0, 7.0, 9.0, 11.0, 15.0),
            pressure_stations=(4.0, 6.0, 9.0, 14.0),
        ),
    }


def on_mesh(flow: FlowSolution, case: BodyCase) -> FloatArray:
    """Return (n_x, n_phi) p/p_inf of the marching solver where ``case`` has its wall cells."""
    centre = 0.5 * (case.stations[1:] + case.stations[:-1])
    values = np.empty((len(centre), len(flow.roll_angle)))
    for stations, pressure in flow.pieces:
        here = centre > stations[0] - 1e-9
        values[here] = np.stack([np.interp(centre[here], stations, column) for column in pressure.T], axis=1)
    return np.stack([np.interp(case.roll_angle, flow.roll_angle, row) for row in values])


def print_loads(comparison: Comparison, case: BodyCase, pressures: dict[str, FloatArray]) -> None:
    """Print C_N on the base area, C_N/a_T per rad and the centre of pressure from the tip."""
    base = comparison.body.base_radius
    scale = 0.7 * comparison.mach_number**2 * pi * base**2
    for name, pressure in pressures.items():
        ahead = loads_ahead(case, pressure)
        for x in comparison.force_stations:
            force, moment = ahead[int(np.argmin(np.abs(case.stations - x)))]
            normal = force / scale
            print(
                f"{name:>9}, ahead of x = {x:5.2f}: C_N {normal:.4f}, C_N/a_T {normal / case.incidence:.3f} /rad, "
                f"c.p. at x = {moment / force:.3f} = {moment / force / (2.0 * base):.3f} diameters"
            )


def print_pressures(comparison: Comparison, case: BodyCase, pressures: dict[str, FloatArray]) -> None:
    """Print p/p_inf round the body at a few stations and the rms difference in each."""
    angles = np.radians([5.0, 30.0, 60.0, 90.0, 120.0, 150.0, 175.0])
    centre = 0.5 * (case.stations[1:] + case.stations[:-1])
    print(f"p/p_inf at {', '.join(f'{angle:.0f}' for angle in np.degrees(angles))} deg from leeward")
    for x in comparison.pressure_stations:
        i = int(np.argmin(np.abs(centre - x)))
        for name, pressure in pressures.items():
            print(f"{name:>9}, x = {centre[i]:.2f}:", np.round(np.interp(angles, case.roll_angle, pressure[i]), 3))
        theirs, ours = (pressure[i] for pressure in pressures.values())
        rms = float(np.sqrt(np.mean((theirs - ours) ** 2)) / np.mean(ours))
        print(f"rms difference over the mean {rms:.2%}")


def main(name: str, directory: str, incidence: str | None = None) -> None:
    """Run the named body in ``directory`` at its total incidence or at ``incidence`` [deg]."""
    comparison = comparisons()[name]
    body = comparison.body
    angle = radians(comparison.incidence if incidence is None else float(incidence))
    leeward, side, windward = (radians(angle) for angle in comparison.outer_angles)
    case = BodyCase(
        body=body,
        mach_number=comparison.mach_number,
        incidence=angle,
        stations=spread_stations(body, comparison.first, comparison.growth, comparison.largest),
        n_circumferential=comparison.cells[0],
        n_radial=comparison.cells[1],
        clustering=3.0,
        outer_angles=(leeward, side, windward),
    )
    theirs: Solution = solve_case(case, Path(directory))
    ours = solve_flow(body, case.mach_number, angle)
    pressures = {"OpenFOAM": theirs.pressure, "marching": on_mesh(ours, case)}
    print(f"{name} at M {case.mach_number:g}, a_T {degrees(angle):g} deg: {case.n_cells} cells")
    print(
        f"{theirs.cpu_seconds:.0f} s CPU, changed by {theirs.unrest.max():.1e} "
        "over the last fifth of the iterations"
    )
    print_loads(comparison, case, pressures)
    print_pressures(comparison, case, pressures)


if __name__ == "__main__":
    main(*sys.argv[1:])
