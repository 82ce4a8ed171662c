"""The marching solver against another program: OpenFOAM's rhoCentralFoam on cones at incidence."""

from math import radians
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from openfoam.body_case import BodyCase, solve_case, spread_stations
from openfoam.case_files import SOLVER, is_available
from openfoam.elliptic_cone import FLOWS, difference
from openfoam.sphere_cone import ALONG_AXIS, compare

from builder.aero.euler.bodies.solver import solve_flow
from builder.aero.euler.planes import marching_grid_of
from builder.vehicle.file import VEHICLES, load_vehicle
from builder.vehicle.shape.geometry import chain_segments

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not is_available(), reason=f"{SOLVER} is not installed: see docs/evidence/openfoam.md"),
]

MACH_NUMBER, INCIDENCE = 5.0, radians(10.0)
LARGEST_RMS = 0.03
"""rms difference of p/p_inf round the body over the mean of p/p_inf round the body."""
CONICAL_FROM = 0.5
"""Share of the length aft of which the cut-off tip, at 3 %, is forgotten."""


def test_cone_at_incidence_agrees_with_openfoam(tmp_path: Path) -> None:
    """10 deg cone, M 5, a_T 10 deg: every plane of the conical part within 3 % rms of the marching solver."""
    body = chain_segments([(1.0, radians(10.0), radians(10.0))])
    case = BodyCase(
        body=body,
        mach_number=MACH_NUMBER,
        incidence=INCIDENCE,
        stations=spread_stations(body, first=0.03, growth=0.05, largest=1.0),
        n_circumferential=36,
        n_radial=32,
        clustering=1.5,
        outer_angles=(radians(24.2), radians(17.8), radians(15.2)),
    )
    assert case.n_cells >= 60_000
    theirs = solve_case(case, tmp_path)

    solve_flow(body, MACH_NUMBER, INCIDENCE)  # compiles
    start = process_time()
    ours = solve_flow(body, MACH_NUMBER, INCIDENCE)
    our_seconds = process_time() - start

    expected = np.interp(case.roll_angle, ours.roll_angle, ours.pieces[0][1][-1])
    found = theirs.pressure[theirs.x > CONICAL_FROM * body.length]
    rms = np.sqrt(np.mean((found - expected) ** 2, axis=1)) / np.mean(expected)
    print(f"\n{case.n_cells} cells, rms difference of p/p_inf: last plane {rms[-1]:.2%}, largest {rms.max():.2%}")
    print(f"largest change over the last fifth of the iterations {theirs.unrest.max():.2%}")
    print(
        f"CPU time per flow: {SOLVER} {theirs.cpu_seconds:.0f} s, ours {our_seconds:.2f} s, "
        f"ratio {theirs.cpu_seconds / our_seconds:.0f}"
    )
    assert rms.max() < LARGEST_RMS


@pytest.mark.parametrize("name", ["flat, 4 deg", "upright, 2 deg"])
def test_elliptic_cone_agrees_with_openfoam(name: str, tmp_path: Path) -> None:
    """The shipped 2:1 cone at M 6: C_A, C_N and, round the body, pressure on the grids of its file within 2 %."""
    case, vehicle = FLOWS[name], load_vehicle(VEHICLES / "elliptic_cone.toml")
    theirs = solve_case(case, tmp_path)
    for resolution in (vehicle.resolution.map, vehicle.resolution.truth):
        found = difference(case, theirs, case.marched(marching_grid_of(resolution)))
        print(f"\n{name}, {resolution.radial_cells} x {resolution.circumferential_cells} cells: {found}")
        np.testing.assert_allclose(found.ours, found.theirs, rtol=0.02)
        assert found.rms < 0.02


def test_sphere_cone_agrees_with_openfoam(tmp_path: Path) -> None:
    """Sphere and cone of 9 deg at M 6: wall pressure from stagnation point to five nose radii within 3 % rms."""
    found = compare(ALONG_AXIS, tmp_path)
    error = found.theirs / found.ours - 1.0
    on_sphere, on_cone = (np.sqrt(np.mean(part**2)) for part in np.split(error, [ALONG_AXIS.n_sphere]))
    print(f"\nrms difference of p/p_inf: sphere {on_sphere:.2%}, cone {on_cone:.2%}")
    assert max(on_sphere, on_cone) < 0.03
