"""New pieces of the profile against closed forms: radii, slopes, volumes; what is refused."""

from functools import partial
from math import cos, pi, radians, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.euler.bodies.solver import solve_flow
from builder.aero.euler.planes import MarchingGrid
from builder.aero.surface.mesh import mesh_load_operator, mesh_of_grid
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.wall import Material, Wall
from builder.truth.flow_table import truth_engine
from builder.vehicle.file import IC3X, load_vehicle
from builder.vehicle.shape.geometry import BodyOfRevolution, chain_pieces, is_blunt, surface_grid
from builder.vehicle.shape.profile_entries import Piece, profile_misfits, profile_record
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

VON_KARMAN = {"kind": "von_karman", "end_x_m": 2.0, "end_radius_m": 0.2}
CAP = {"kind": "spherical_cap", "nose_radius_m": 0.05, "end_half_angle_deg": 10.0}
CONE = {"kind": "cone", "half_angle_deg": 10.0, "end_x_m": 1.0}


def body_of(*entries: dict[str, Any], folder: Path = Path()) -> BodyOfRevolution:
    adapter: TypeAdapter[Any] = TypeAdapter(Piece)
    pieces = [adapter.validate_python(entry) for entry in entries]
    return chain_pieces([partial(piece.segment, folder=folder) for piece in pieces])


def volume(body: BodyOfRevolution) -> float:
    x, weight = np.polynomial.legendre.leggauss(400)
    return float(pi * 0.5 * body.length * weight @ body.radius(0.5 * body.length * (x + 1.0)) ** 2)


@pytest.mark.parametrize(
    ("entry", "volume_over_cylinder"),
    [
        ({"kind": "power_law", "exponent": 0.75, "end_x_m": 2.0, "end_radius_m": 0.2}, 1.0 / 2.5),
        (VON_KARMAN, 0.5),
        # Of the Haack series V = pi R^2 L (1/2 + 3 C/16).
        ({"kind": "haack", "shape_factor": 1.0 / 3.0, "end_x_m": 2.0, "end_radius_m": 0.2}, 0.5 + 1.0 / 16.0),
    ],
)
def test_noses_have_their_volume_and_slope(entry: dict[str, Any], volume_over_cylinder: float) -> None:
    body = body_of(entry)
    assert volume(body) == pytest.approx(pi * 0.2**2 * 2.0 * volume_over_cylinder, rel=1e-5)
    assert body.base_radius == pytest.approx(0.2, rel=1e-14)
    x, step = np.linspace(0.05, 1.95, 39), 1e-6
    slope = (body.radius(x + step) - body.radius(x - step)) / (2.0 * step)
    np.testing.assert_allclose(np.tan(body.angle(x)), slope, rtol=1e-7, atol=1e-9)


def test_von_karman_ends_along_the_axis_and_begins_as_a_power() -> None:
    """Near the tip r = R sqrt(4/(3 pi)) (4 x/L)^(3/4) (t^3 2/3 of t = 2 sqrt(x/L))."""
    body = body_of(VON_KARMAN)
    assert body.segments[0].end_angle == pytest.approx(0.0, abs=1e-9)
    x = np.array([1e-9, 1e-7])
    np.testing.assert_allclose(body.radius(x), 0.2 * np.sqrt(2.0 / 3.0 * 8.0 / pi) * (x / 2.0) ** 0.75, rtol=1e-4)
    assert body.tip_angle == pytest.approx(pi / 2.0)
    assert not is_blunt(body)


def test_ogives_are_circles() -> None:
    length, radius = 2.0, 0.25
    tangent = body_of({"kind": "tangent_ogive", "end_x_m": length, "end_radius_m": radius})
    arc = (radius**2 + length**2) / (2.0 * radius)
    x = np.linspace(0.0, length, 9)
    np.testing.assert_allclose(tangent.radius(x), np.sqrt(arc**2 - (length - x) ** 2) + radius - arc, atol=1e-12)
    secant = body_of(
        {"kind": "secant_ogive", "end_x_m": length, "end_radius_m": radius, "arc_radius_m": 2.0 * arc}
    )
    # Centre on the normal of the chord's middle: all points are one arc radius away from it.
    chord = np.hypot(length, radius)
    offset = sqrt((2.0 * arc) ** 2 - 0.25 * chord**2)
    centre = 0.5 * np.array([length, radius]) + offset * np.array([radius, -length]) / chord
    np.testing.assert_allclose(np.hypot(x - centre[0], secant.radius(x) - centre[1]), 2.0 * arc, rtol=1e-12)
    assert secant.tip_angle < tangent.tip_angle


def test_spherical_cap_meets_its_cone_without_a_break() -> None:
    body = body_of(CAP, CONE)
    end = 0.05 * (1.0 - sin(radians(10.0)))
    x = np.linspace(0.0, end, 9)
    np.testing.assert_allclose(body.radius(x), np.sqrt(0.05**2 - (x - 0.05) ** 2), atol=1e-12)
    assert body.radius(end) == pytest.approx(0.05 * cos(radians(10.0)))
    assert len(body.slope_breaks) == 0
    assert is_blunt(body)


def test_blunt_tips_have_nodes_enough_for_their_drag() -> None:
    """Newtonian drag of a hemisphere: C_A = C_p,max/2 on its own base."""
    body = body_of({**CAP, "end_half_angle_deg": 0.0, "nose_radius_m": 0.1}, {**CONE, "half_angle_deg": 0.0})
    engine = NewtonianEngine(mesh_of_grid(surface_grid(body, 30, 48)), "classical")
    pressure = engine.solve((8.0, 0.0, 0.0)).arrays["pressure_ratio"] - 1.0
    axial = mesh_load_operator(engine.surface, 0.0)[0] @ pressure
    assert axial / (0.7 * 64.0 * pi * 0.01) == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("interpolation", ["cubic", "monotone"])
def test_table_goes_through_its_points(tmp_path: Path, interpolation: str) -> None:
    x = np.linspace(0.0, 1.5, 16)
    r = 0.2 * x - 0.05 * x**2
    rows = [f"{a!r},{b!r}" for a, b in zip(x.tolist(), r.tolist(), strict=True)]
    (tmp_path / "profile.csv").write_text("\n".join(["x_m,r_m", *rows]))
    body = body_of({"kind": "table", "file": "profile.csv", "interpolation": interpolation}, folder=tmp_path)
    np.testing.assert_allclose(body.radius(x), r, atol=1e-14)
    between = np.linspace(0.0, 1.5, 101)
    np.testing.assert_allclose(body.radius(between), 0.2 * between - 0.05 * between**2, atol=1e-4)
    assert body.length == 1.5


def test_table_joins_the_piece_before_it_within_a_micrometre() -> None:
    """Tables have 6 to 7 digits: such a point is the end of the piece before it, a farther one is not."""
    end = 0.5 * np.tan(radians(20.0))
    cone = {"kind": "cone", "half_angle_deg": 20.0, "end_x_m": 0.5}

    def joined(step: float) -> Any:
        r = [end + step, end + 0.03, end + 0.05, end + 0.06]
        return body_of(cone, {"kind": "table", "x_m": [0.5, 0.6, 0.7, 0.8], "r_m": r})

    assert joined(9e-7).radius(np.array([0.5]))[0] == pytest.approx(end, abs=1e-12)
    with pytest.raises(InputError, match="within 1 um of the end of the piece before it"):
        joined(1.1e-6)


def test_march_over_noses_of_infinite_slope_balances() -> None:
    """Wave drag of the von Karman nose is below the tangent ogive's, and near 4 (R/L)^2 of slender bodies."""
    grid = MarchingGrid(n_radial=14, n_circumferential=16)
    noses = [body_of(VON_KARMAN), body_of({**VON_KARMAN, "kind": "tangent_ogive"})]
    flows = [solve_flow(nose, 3.0, 0.0, grid) for nose in noses]
    karman, tangent = (flow.force[0] / (0.7 * 9.0 * pi * 0.04) for flow in flows)
    assert karman < tangent
    assert 0.025 < karman < 0.04
    assert flows[0].force[0] == pytest.approx(flows[0].force_from_momentum[0], rel=1e-3)


def test_wall_behind_a_blunt_tip_has_its_thickness() -> None:
    body = body_of(CAP, CONE)
    mesh = shell_mesh(body, Wall(0.003, 0.08, Material(70e9, 0.3)), 0.03)
    inner = mesh.node[mesh.inner_edge[:, 0]]
    np.testing.assert_allclose(inner[:-1, 1], body.radius(inner[:-1, 0]) - 0.003 / cos(radians(10.0)), atol=1e-9)


def test_record_tells_curves_apart() -> None:
    body, other = body_of(VON_KARMAN), body_of({**VON_KARMAN, "kind": "haack", "shape_factor": 0.001})
    assert profile_misfits(profile_record(body), body) == []
    assert profile_misfits(profile_record(body), other)[0].entry.startswith("profile.1.radius")


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([{**CONE, "end_x_m": 0.5}, VON_KARMAN], "profile segment 2: kind: expected 'von_karman' as the first"),
        ([{"kind": "tangent_ogive", "end_x_m": 0.1, "end_radius_m": 0.2}], "segment 1: end_radius_m: expected"),
        (
            [{"kind": "secant_ogive", "end_x_m": 1.0, "end_radius_m": 0.2, "arc_radius_m": 0.5}],
            "segment 1: arc_radius_m: expected more than 0.5099",
        ),
        (
            [{"kind": "table", "x_m": [0.0, 1.0, 1.0, 2.0], "r_m": [0.0, 0.1, 0.2, 0.2]}],
            "increasing stations",
        ),
        (
            [{"kind": "table", "x_m": [0.0, 1.0, 1.5, 2.0], "r_m": [0.1, 0.1, 0.2, 0.2]}],
            "expected x 0, r 0 m first",
        ),
        ([{"kind": "table", "file": "none.csv"}], "none.csv: no such file"),
    ],
)
def test_wrong_pieces_are_one_line(entries: list[dict[str, Any]], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        body_of(*entries)
    assert "\n" not in str(caught.value)


def test_every_blunt_tip_is_marched_where_the_engine_is_euler(tmp_path: Path) -> None:
    def blunted(kind: str) -> str:
        return IC3X.read_text().replace(
            '[[profile]]\nkind = "cone"\nhalf_angle_deg = 5.0',
            f'[[profile]]\n{kind}\n\n[[profile]]\nkind = "cone"\nhalf_angle_deg = 5.0',
            1,
        )

    path = tmp_path / "blunt.toml"
    paraboloid = blunted('kind = "power_law"\nend_x_m = 0.03\nend_radius_m = 0.03\nexponent = 0.5')
    path.write_text(paraboloid)
    assert truth_engine(load_vehicle(path)).name == "euler"
    path.write_text(paraboloid.replace('engine = "euler"', 'engine = "newtonian"'))
    vehicle = load_vehicle(path)
    assert is_blunt(vehicle.body())
    assert truth_engine(vehicle).name == "newtonian"
    path.write_text(blunted('kind = "spherical_cap"\nnose_radius_m = 0.03\nend_half_angle_deg = 5.0'))
    vehicle = load_vehicle(path)
    assert is_blunt(vehicle.body())
    assert truth_engine(vehicle).name == "euler"
