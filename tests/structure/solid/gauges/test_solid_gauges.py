"""Gauge rows: exact strains, recovery, gauge length, rosettes and what is refused."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from solid_bodies import cube, swept_tube, tube

from builder.structure.solid.checks import ring_mesh
from builder.structure.solid.elements import CurvedFacets, foot_point
from builder.structure.solid.gauge_rows import Gauges, gauge_rows, gauges_at, refuse_twins
from builder.structure.solid.solid_mesh import EXTERNAL, INTERNAL, SolidMesh
from builder.structure.solid.swept_mesh import full_mesh
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

RADIUS = 0.12
POINT = np.array([0.07, 0.0, RADIUS])


@pytest.fixture(scope="module")
def mesh() -> SolidMesh:
    return swept_tube()


def rosette(length: float = 0.0) -> Gauges:
    """Three gauges at 0, 45 and 90 degrees from +x, anticlockwise seen from the bore."""
    angle = np.deg2rad([0.0, 45.0, 90.0])
    around = np.cross([0.0, 0.0, -1.0], [1.0, 0.0, 0.0])
    direction = np.outer(np.cos(angle), [1.0, 0.0, 0.0]) + np.outer(np.sin(angle), around)
    return gauges_at(np.tile(POINT, (3, 1)), direction, length=length)


def strain(mesh: SolidMesh, gauges: Gauges, field: np.ndarray) -> np.ndarray:
    return np.asarray(gauge_rows(mesh, gauges) @ field.ravel())


@pytest.mark.parametrize("element_type", ["hexahedron20", "tetrahedron10", "hexahedron8", "tetrahedron4"])
def test_uniform_strain_is_read_exactly(element_type: str) -> None:
    """e^T sym(grad u) e of a linear displacement on a plane, anywhere and in any direction."""
    mesh = cube(element_type, 3, shake=0.2)
    slope = np.random.default_rng(0).normal(size=(3, 3))
    angle = np.linspace(0.1, 3.0, 7)
    direction = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(7)])
    position = np.column_stack([np.linspace(0.05, 0.95, 7), np.linspace(0.9, 0.1, 7), np.ones(7)])
    found = strain(mesh, gauges_at(position, direction, surface="z1"), mesh.node @ slope.T)
    np.testing.assert_allclose(found, np.einsum("ni,ij,nj->n", direction, slope, direction), rtol=1e-10)


def test_rigid_motion_is_not_read(mesh: SolidMesh) -> None:
    gauges = rosette(length=0.01)
    turn = np.cross([0.3, -0.2, 0.5], mesh.node) + np.array([1.0, 2.0, 3.0])
    assert np.abs(strain(mesh, gauges, turn)).max() < 1e-12


def test_hoop_and_axial_strain_of_a_tube(mesh: SolidMesh) -> None:
    """u = a r e_r + c x^2 e_x: hoop strain a, axial strain 2 c x; between nodes, on both surfaces."""
    field = np.column_stack([0.3 * mesh.node[:, 0] ** 2, mesh.node[:, 1:] * 0.7])
    for surface, radius in ((INTERNAL, 0.12), (EXTERNAL, 0.13)):
        roll, x = np.array([0.1, 1.3, -2.0]), np.array([0.031, 0.1, 0.177])
        radial = np.column_stack([np.zeros(3), np.sin(roll), np.cos(roll)])
        around = np.column_stack([np.zeros(3), np.cos(roll), -np.sin(roll)])
        position = radius * radial + np.outer(x, [1.0, 0.0, 0.0])
        hoop = strain(mesh, gauges_at(position, around, surface=surface), field)
        axial = strain(mesh, gauges_at(position, np.tile([5.0, 0.0, 0.0], (3, 1)), surface=surface), field)
        np.testing.assert_allclose(hoop, 0.7, rtol=1e-4)
        np.testing.assert_allclose(axial, 0.6 * x, rtol=1e-8)


def order_of_convergence(meshes: list[SolidMesh], size: list[float]) -> float:
    """Observed order of the largest strain error of an interpolated field at fixed places of a ring of gauges."""
    roll = np.linspace(0.0, 1.0, 8)
    around = np.column_stack([np.zeros(8), np.cos(roll), -np.sin(roll)])
    position = np.column_stack([np.full(8, 0.09), RADIUS * np.sin(roll), RADIUS * np.cos(roll)])
    error = []
    for mesh in meshes:
        phi = np.arctan2(mesh.node[:, 1], mesh.node[:, 2])
        wave = np.sin(3.0 * phi) * np.cos(9.0 * mesh.node[:, 0])
        field = wave[:, None] * np.column_stack([0.0 * phi, np.cos(phi), -np.sin(phi)])
        exact = 3.0 * np.cos(3.0 * roll) * np.cos(9.0 * 0.09) / RADIUS
        error.append(np.abs(strain(mesh, gauges_at(position, around), field) - exact).max())
    return float(np.polyfit(np.log(size), np.log(error), 1)[0])


@pytest.mark.parametrize("element_type", ["hexahedron20", "tetrahedron10"])
def test_recovered_strain_is_of_third_order(element_type: str) -> None:
    """The facet's own derivative would be of second order."""
    counts = [16, 24, 36]
    meshes = [ring_mesh(element_type, RADIUS, 0.13, 0.2, (n // 4, n, 1)) for n in counts]
    assert order_of_convergence(meshes, [1.0 / n for n in counts]) > 2.7


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_gauge_on_the_line_between_facets_takes_both_sides(mesh: SolidMesh, side: float) -> None:
    """At phi = 0, between two sectors, a field and its mirror image read alike: round-off.

    A hair's breadth to either side one facet alone counts, and they differ.
    """
    field = np.random.default_rng(1).normal(size=(mesh.n_nodes, 3))
    order = np.lexsort(np.rint(1e9 * mesh.node).T)
    mirrored = np.lexsort(np.rint(1e9 * mesh.node * [1.0, -1.0, 1.0]).T)
    image = np.empty_like(field)
    image[order] = field[mirrored] * [1.0, -1.0, 1.0]
    for direction in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
        on_line = gauges_at(POINT[None], np.array([direction]))
        assert strain(mesh, on_line, image)[0] == pytest.approx(strain(mesh, on_line, field)[0], rel=1e-9)
        beside = replace(on_line, position=POINT[None] + [0.0, side * 1e-6, 0.0])
        assert strain(mesh, beside, image)[0] != pytest.approx(strain(mesh, beside, field)[0], rel=1e-3)


def test_gauge_length_averages_strain(mesh: SolidMesh) -> None:
    """Axial strain 3 c x^2 over x0 +- L/2 is c (3 x0^2 + L^2/4); u is cubic, strain recovered exactly."""
    field = np.zeros((mesh.n_nodes, 3))
    field[:, 0] = mesh.node[:, 0] ** 3
    at, length = 0.1, 0.03
    gauge = gauges_at(np.array([[at, 0.0, RADIUS]]), np.array([[1.0, 0.0, 0.0]]), length=length)
    assert strain(mesh, gauge, field)[0] == pytest.approx(3.0 * at**2 + length**2 / 4.0, rel=1e-6)


def test_gauge_length_follows_a_curved_surface(mesh: SolidMesh) -> None:
    """Hoop strain cos(2 phi) averaged over an arc of 0.03 m; the arc is met to (L/R)^2/24."""
    phi = np.arctan2(mesh.node[:, 1], mesh.node[:, 2])
    fine = full_mesh(tube(0.2, RADIUS, 0.13, 0.05, 48))
    phi = np.arctan2(fine.node[:, 1], fine.node[:, 2])
    field = (0.5 * RADIUS * np.sin(2.0 * phi))[:, None] * np.column_stack([0.0 * phi, np.cos(phi), -np.sin(phi)])
    gauge = gauges_at(POINT[None], np.array([[0.0, 1.0, 0.0]]), length=0.03)
    expected = np.sin(0.03 / RADIUS) / (0.03 / RADIUS)
    assert strain(fine, gauge, field)[0] == pytest.approx(expected, rel=5e-4)


def test_rosette_reads_the_strain_tensor(mesh: SolidMesh) -> None:
    """45 deg is anticlockwise seen from outside the material, here from the bore: from +x towards +y at phi = 0.

    With u = g y e_x the shear strain e_xy is g / 2, so e_45 = g / 2.
    """
    field = np.zeros((mesh.n_nodes, 3))
    field[:, 0] = 0.4 * mesh.node[:, 1]
    gauges = rosette()
    e_0, e_45, e_90 = strain(mesh, gauges, field)
    normal_into_bore = np.array([0.0, 0.0, -1.0])
    sign = float(np.cross(normal_into_bore, [1.0, 0.0, 0.0])[1])
    np.testing.assert_allclose([e_0, e_90], 0.0, atol=1e-4)
    assert e_45 == pytest.approx(sign * 0.2, rel=5e-3)  # 12 elements round


def test_patch_ends_at_a_sharp_edge() -> None:
    """Two plates at an angle: strain jumps at the edge, and gauges beside it read their own side."""
    mesh = cube("hexahedron20", 4)
    x, y, z = mesh.node.T
    roof = SolidMesh(
        element_type=mesh.element_type,
        node=np.column_stack([x, y, z - 0.2 * np.abs(x - 0.5)]),
        element=mesh.element,
        region=mesh.region,
        region_names=mesh.region_names,
        surface=mesh.surface,
    )
    field = np.zeros((mesh.n_nodes, 3))
    field[:, 1] = np.where(x > 0.5, 2.0, 1.0) * y
    field[np.abs(x - 0.5) < 1e-9, 1] = 0.0
    position = np.array([[0.4, 0.5, 0.98], [0.6, 0.5, 0.98]])
    found = strain(roof, gauges_at(position, np.tile([0.0, 1.0, 0.0], (2, 1)), surface="z1"), field)
    mirrored = field * np.where(x > 0.5, 0.5, 1.0)[:, None]
    same = strain(roof, gauges_at(position, np.tile([0.0, 1.0, 0.0], (2, 1)), surface="z1"), mirrored)
    assert found[0] == pytest.approx(same[0], rel=1e-12)
    assert found[1] == pytest.approx(2.0 * same[1], rel=1e-12)


@pytest.mark.parametrize("element_type", ["hexahedron20", "tetrahedron10"])
def test_foot_of_the_normal_is_found(element_type: str) -> None:
    """Lifting a point of a curved facet along its normal brings the foot back to it."""
    mesh = ring_mesh(element_type, RADIUS, 0.13, 0.2, (3, 12, 1))
    facets = CurvedFacets(element_type, mesh.node[mesh.surface[INTERNAL]])
    on_surface = foot_point(facets, np.array([0.083, 0.05, 0.108]))
    lifted = foot_point(facets, on_surface.point + 4e-4 * on_surface.normal)
    np.testing.assert_allclose(lifted.point, on_surface.point, atol=1e-11)
    assert lifted.height == pytest.approx(4e-4, rel=1e-9)
    assert lifted.beyond_edge < 1e-11


def moved(*by: float) -> Callable[[Gauges], Gauges]:
    return lambda gauges: replace(gauges, position=gauges.position + np.array(by))


def turned(direction: list[float]) -> Callable[[Gauges], Gauges]:
    return lambda gauges: replace(gauges, direction=np.array([direction]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            moved(0.0, 0.0, -0.001),
            r"g7: position is 1.00 mm off surface 'internal', away from the material, at",
        ),
        (
            moved(0.0, 0.0, 0.002),
            r"g7: position is 2.00 mm off surface 'internal', into the material, at most",
        ),
        (
            moved(0.0, 0.0, 0.01),
            r"10.00 mm off surface 'internal', into the material and on surface 'external'",
        ),
        (
            moved(0.15, 0.0, 0.0),
            r"g7: position is 20.00 mm beyond the edge of surface 'internal', at most 0.5",
        ),
        (moved(np.nan, 0.0, 0.0), r"g7: a coordinate or direction is not finite"),
        (turned([0.0, 0.0, 0.0]), r"g7: direction has no length"),
        (turned([1.0, 0.0, 0.1]), r"g7: direction leans 5.7 deg out of surface 'internal', at most 5 deg"),
        (lambda g: replace(g, length=np.array([-0.1])), r"g7: gauge length -0.1 m must be at least 0"),
        (lambda g: replace(g, length=np.zeros(2)), r"gauge lengths \(2,\) must be \(1,\)"),
        (
            lambda g: replace(g, direction=np.ones((2, 3))),
            r"positions \(1, 3\) and directions \(2, 3\) must be \(1",
        ),
        (lambda g: replace(g, length=np.array([0.2])), r"g7: its length of 200 mm reaches beyond the edge"),
        (
            lambda g: replace(g, surface=("skin",)),
            r"no surface 'skin', found \['external', 'internal', 'support'\]",
        ),
    ],
)
def test_gauge_that_does_not_fit_is_refused(
    mesh: SolidMesh, change: Callable[[Gauges], Gauges], message: str
) -> None:
    gauge = gauges_at(POINT[None], np.array([[1.0, 0.0, 0.0]]), ["g7"])
    with pytest.raises(InputError, match=message):
        gauge_rows(mesh, change(gauge))


def test_gauge_that_misses_by_little_is_moved(mesh: SolidMesh) -> None:
    """0.4 mm off and 4 deg out of the plane: as one that fits."""
    field = np.column_stack([0.3 * mesh.node[:, 0] ** 2, mesh.node[:, 1:]])
    near = gauges_at(POINT[None] + [0.0, 0.0, 4e-4], np.array([[1.0, 0.0, 0.07]]))
    there = gauges_at(POINT[None], np.array([[1.0, 0.0, 0.0]]))
    # The mesh's normal is not exactly radial, so the foot moves by microns.
    np.testing.assert_allclose(strain(mesh, near, field), strain(mesh, there, field), rtol=1e-5)


def test_twins_and_nothing_are_refused(mesh: SolidMesh) -> None:
    twice = gauges_at(np.array([POINT, POINT]), np.array([[1.0, 0.0, 0.0], [-2.0, 0.0, 0.0]]), ["a", "b"])
    with pytest.raises(InputError, match="b: same position and direction as a"):
        refuse_twins(twice)
    with pytest.raises(InputError, match="no gauges: at least one is needed"):
        gauge_rows(mesh, gauges_at(np.zeros((0, 3)), np.zeros((0, 3))))
