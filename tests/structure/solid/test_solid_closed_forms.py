"""Strains on the inner surface against closed forms of elasticity and of thin shells, within 1 %.

The formulas are those of the tests of the Fourier model; meshes and gauges are three-dimensional.
"""

import numpy as np
import pytest
from solid_bodies import METAL, cube, harmonic_field, tube

from builder.structure.solid.checks import inner_hoop_strain
from builder.structure.solid.gauge_rows import gauge_rows, gauges_at
from builder.structure.solid.nodal_loads import surface_nodes
from builder.structure.solid.solid_mesh import EXTERNAL
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.swept_mesh import REGION, SweptResolution, SweptSector, full_mesh, swept_wall
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import chain_segments

pytestmark = pytest.mark.fast

E, NU = METAL.youngs_modulus, METAL.poisson_ratio
PRESSURE = 1e5


def inner_strain(
    sector: SweptSector,
    harmonic: int,
    x: np.ndarray,
    radius: np.ndarray | float,
    angle: float = 0.0,
    roll: float = 0.0,
) -> np.ndarray:
    """Return (2, n) meridional and hoop strain at ``roll`` under PRESSURE cos(m phi) all over."""
    n_p = len(surface_nodes(sector, EXTERNAL))
    field = harmonic_field(sector, harmonic, np.full(n_p, PRESSURE))
    out = np.array([0.0, np.sin(roll), np.cos(roll)])
    position = np.outer(x, [1.0, 0.0, 0.0]) + np.multiply.outer(np.broadcast_to(radius, x.shape), out)
    along = np.cos(angle) * np.array([1.0, 0.0, 0.0]) + np.sin(angle) * out
    around = np.array([0.0, np.cos(roll), -np.sin(roll)])
    gauges = gauges_at(np.tile(position, (2, 1)), np.repeat([along, around], len(x), axis=0))
    return np.asarray(gauge_rows(full_mesh(sector), gauges) @ field).reshape(2, -1)


@pytest.mark.parametrize(("thickness", "layers"), [(0.004, 1), (0.05, 3)])
def test_lame_cylinder(thickness: float, layers: int) -> None:
    """Open cylinder under external pressure, hoop and axial (Timoshenko and Goodier, section 28)."""
    b = 0.13
    a = b - thickness
    sector = tube(
        length=0.3,
        inner_radius=a,
        outer_radius=b,
        element_length=0.06,
        n_sectors=24,
        n_layers=layers,
        front="guided",
        aft="free",
    )
    axial, hoop = inner_strain(sector, 0, np.array([0.11, 0.157]), a, roll=0.37)
    scale = 2.0 * PRESSURE * b**2 / (E * (b**2 - a**2))
    np.testing.assert_allclose(hoop, -scale, rtol=0.01)
    np.testing.assert_allclose(axial, NU * scale, rtol=0.01)


def test_cantilever_tube() -> None:
    """Beam under p1 cos(phi), resultant pi b p1 per length, clamped aft: top fibre in tension."""
    length, b = 4.0, 0.10
    a = b - 0.004
    x = np.linspace(1.0, 3.0, 5)
    axial, hoop = inner_strain(tube(length, a, b, 0.08, 24), 1, x, a)
    inertia = np.pi * (b**4 - a**4) / 4.0
    expected = 0.5 * np.pi * b * PRESSURE * x**2 * a / (E * inertia)
    np.testing.assert_allclose(axial, expected, rtol=0.01)
    np.testing.assert_allclose(hoop[-1], -NU * expected[-1], rtol=0.02)


@pytest.mark.parametrize("harmonic", [2, 3])
@pytest.mark.parametrize(("thickness", "layers"), [(0.004, 1), (0.03, 2)])
def test_ring_in_plane_strain(harmonic: int, thickness: float, layers: int) -> None:
    """Ovalisation, both ends guided, against Michell's stress function (Timoshenko and Goodier, section 43)."""
    b = 0.13
    a = b - thickness
    sector = tube(
        length=0.04,
        inner_radius=a,
        outer_radius=b,
        element_length=0.02,
        n_sectors=32,
        n_layers=layers,
        front="guided",
        aft="guided",
    )
    roll = 0.2
    _, hoop = inner_strain(sector, harmonic, np.array([0.013, 0.029]), a, roll=roll)
    expected = PRESSURE * inner_hoop_strain(a, b, harmonic, METAL) * np.cos(harmonic * roll)
    np.testing.assert_allclose(hoop, expected, rtol=0.01)


@pytest.mark.parametrize("harmonic", [2, 3])
def test_thin_ring(harmonic: int) -> None:
    """Inextensional bending p R^2 t/(2 D (n^2 - 1)), D = E t^3/(12 (1 - nu^2)); membrane strain left out."""
    radius, thickness = 0.5, 0.001
    a, b = radius - 0.5 * thickness, radius + 0.5 * thickness
    sector = tube(
        length=0.05,
        inner_radius=a,
        outer_radius=b,
        element_length=0.025,
        n_sectors=48,
        n_layers=1,
        front="guided",
        aft="guided",
    )
    _, hoop = inner_strain(sector, harmonic, np.array([0.02]), a)
    rigidity = E * thickness**3 / (12.0 * (1.0 - NU**2))
    expected = PRESSURE * radius**2 * thickness / (2.0 * rigidity * (harmonic**2 - 1.0))
    np.testing.assert_allclose(hoop, expected, rtol=0.01)


def test_clamped_edge_of_long_cylinder() -> None:
    """Edge bending, no axial force (Timoshenko and Woinowsky-Krieger, section 115); 1 % of the peaks."""
    length, radius, thickness = 0.15, 0.5, 0.001
    a, b = radius - 0.5 * thickness, radius + 0.5 * thickness
    beta = (3.0 * (1.0 - NU**2)) ** 0.25 / np.sqrt(radius * thickness)
    from_clamp = np.linspace(2.0 * thickness, 5.0 / beta, 40)
    axial, hoop = inner_strain(tube(length, a, b, 0.001, 24), 0, length - from_clamp, a)
    s = beta * from_clamp
    w_far = PRESSURE * b * radius / (E * thickness)
    w = w_far * (1.0 - np.exp(-s) * (np.cos(s) + np.sin(s)))
    curvature = 2.0 * beta**2 * w_far * np.exp(-s) * (np.cos(s) - np.sin(s))
    assert np.abs(hoop + w / radius).max() < 0.01 * np.abs(w / radius).max()
    expected = NU * w / radius - 0.5 * thickness * curvature
    assert np.abs(axial - expected).max() < 0.01 * thickness * beta**2 * w_far


def test_cone_as_membrane() -> None:
    """Closed cone, external pressure: N_s = -p s tan(a)/2, N_phi = -p s tan(a), s on the middle surface."""
    angle, thickness = np.deg2rad(10.0), 0.001
    cone = chain_segments([(2.0, angle, angle)])
    sector = swept_wall(cone, Wall(thickness, 0.1, METAL), SweptResolution(0.02, 1, 24))
    x = np.linspace(0.8, 1.6, 9)
    inner = x * np.tan(angle) - thickness / np.cos(angle)
    meridional, hoop = inner_strain(sector, 0, x, inner, angle)
    radius = inner + 0.5 * thickness / np.cos(angle)
    n_s, n_phi = -0.5 * PRESSURE * radius / np.cos(angle), -PRESSURE * radius / np.cos(angle)
    np.testing.assert_allclose(meridional, (n_s - NU * n_phi) / (E * thickness), rtol=0.01)
    np.testing.assert_allclose(hoop, (n_phi - NU * n_s) / (E * thickness), rtol=0.01)


def test_quadrature_of_thin_walls_does_not_lock() -> None:
    """Ring under cos(2 phi), 16 elements round it: three points round lose half of the strain, two 2 %."""
    b, a = 0.13, 0.126
    sector = tube(
        length=0.04,
        inner_radius=a,
        outer_radius=b,
        element_length=0.02,
        n_sectors=16,
        n_layers=1,
        front="guided",
        aft="guided",
    )
    exact = inner_hoop_strain(a, b, 2, METAL)
    gauge = gauges_at(np.array([[0.02, 0.0, a]]), np.array([[0.0, 1.0, 0.0]]))
    rows = gauge_rows(full_mesh(sector), gauge)
    ones = np.ones(len(surface_nodes(sector, EXTERNAL)))
    full, thin = ((rows @ harmonic_field(sector, 2, ones, METAL, how))[0] / exact for how in ("full", "thin_wall"))
    assert full < 0.7
    assert thin == pytest.approx(1.0, abs=0.03)


def test_quadratures_agree_on_straight_elements() -> None:
    """On a parallelepiped the energy of quadratic displacement is integrated exactly by either."""
    block = cube("hexahedron20", 1)
    x, y, z = block.node.T
    field = np.column_stack([x**2, y * z, z**2]).ravel()
    energy = [field @ (assemble_stiffness(block, {REGION: METAL}, how) @ field) for how in ("full", "thin_wall")]
    assert energy[0] == pytest.approx(energy[1], rel=1e-12)
