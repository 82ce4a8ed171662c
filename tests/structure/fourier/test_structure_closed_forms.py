"""Strains on the inner surface against closed forms of elasticity and of thin shells."""

import numpy as np
import pytest

from builder.structure.fourier.fourier_elasticity import assemble_stiffness, factor_harmonic
from builder.structure.fourier.meridian_mesh import End, MeridianMesh, tube_mesh
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import pressure_load, strain_rows
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import chain_segments

pytestmark = pytest.mark.fast

E, NU = 110e9, 0.31
MATERIAL = Material(E, NU)
PRESSURE = 1e5


def strain(mesh: MeridianMesh, x: np.ndarray, harmonic: int) -> np.ndarray:
    """(3, n) amplitudes of meridional, hoop, shear strain at ``x`` under PRESSURE * cos(m phi) all over."""
    ends = mesh.node[mesh.outer_edge[[0, -1], [0, 2]], 0]
    load = PRESSURE * pressure_load(mesh, ends).toarray().sum(axis=1, keepdims=True)
    displacement = factor_harmonic(mesh, assemble_stiffness(mesh, MATERIAL), harmonic).solve(load)
    return (strain_rows(mesh, x, harmonic) @ displacement)[..., 0].T


def cylinder(length: float, a: float, b: float, h: float, layers: int, front: End, aft: End) -> MeridianMesh:
    return tube_mesh(
        x=np.array([0.0, length]),
        inner_radius=np.array([a, a]),
        outer_radius=np.array([b, b]),
        element_length=h,
        n_layers=layers,
        front=front,
        aft=aft,
    )


@pytest.mark.parametrize("thickness", [0.004, 0.05])
def test_lame_cylinder(thickness: float) -> None:
    """Open cylinder under external pressure (Timoshenko and Goodier, section 28)."""
    b = 0.13
    a = b - thickness
    x = np.array([0.11, 0.237])
    axial, hoop, shear = strain(cylinder(length=0.5, a=a, b=b, h=0.05, layers=2, front="guided", aft="free"), x, 0)
    scale = 2.0 * PRESSURE * b**2 / (E * (b**2 - a**2))
    np.testing.assert_allclose(hoop, -scale, rtol=1e-3)
    np.testing.assert_allclose(axial, NU * scale, rtol=1e-3)
    np.testing.assert_allclose(shear, 0.0, atol=1e-12 * scale)


def test_cantilever_tube() -> None:
    """Beam under the resultant pi b p_1 of p_1 cos(phi), clamped aft: top fibre in tension."""
    length, b, thickness = 4.0, 0.10, 0.004
    a = b - thickness
    x = np.linspace(1.0, 3.0, 5)
    axial, hoop, shear = strain(
        cylinder(length=length, a=a, b=b, h=0.04, layers=1, front="free", aft="clamped"), x, 1
    )
    inertia = np.pi * (b**4 - a**4) / 4.0
    expected = 0.5 * np.pi * b * PRESSURE * x**2 * a / (E * inertia)
    np.testing.assert_allclose(axial, expected, rtol=0.01)
    # Thin tube: shear stress V sin(phi) / (pi R t), V = pi b p_1 x; lateral force acts towards -z.
    shear_force = np.pi * b * PRESSURE * x
    tensor_shear = shear_force * (1.0 + NU) / E / (np.pi * 0.5 * (a + b) * thickness)
    np.testing.assert_allclose(shear, -tensor_shear, rtol=0.03)
    np.testing.assert_allclose(hoop[-1], -NU * expected[-1], rtol=0.02)


def test_solid_cantilever() -> None:
    """The same beam without a bore: the axis conditions carry bending; deflection p pi b L^4 / (8 E I)."""
    length, b = 4.0, 0.10
    mesh = cylinder(length=length, a=0.0, b=b, h=0.1, layers=2, front="free", aft="clamped")
    solver = factor_harmonic(mesh, assemble_stiffness(mesh, MATERIAL), 1)
    load = PRESSURE * pressure_load(mesh, np.array([0.0, length])).toarray().sum(axis=1)
    displacement = solver.solve(load[:, None]).reshape(-1, 3)
    expected = PRESSURE * np.pi * b * length**4 / (8.0 * E * np.pi * b**4 / 4.0)
    on_axis = displacement[mesh.axis_node[0]]
    assert -on_axis[1] == pytest.approx(expected, rel=0.01)
    assert on_axis[2] == -on_axis[1]


def test_clamped_edge_of_long_cylinder() -> None:
    """Edge bending (Timoshenko and Woinowsky-Krieger, section 115), no axial force."""
    length, radius, thickness = 0.6, 0.5, 0.001
    a, b = radius - 0.5 * thickness, radius + 0.5 * thickness
    beta = (3.0 * (1.0 - NU**2)) ** 0.25 / np.sqrt(radius * thickness)
    from_clamp = np.linspace(2.0 * thickness, 5.0 / beta, 60)
    mesh = cylinder(length=length, a=a, b=b, h=thickness, layers=1, front="free", aft="clamped")
    axial, hoop, _ = strain(mesh, length - from_clamp, 0)
    s = beta * from_clamp
    w_far = PRESSURE * b * radius / (E * thickness)
    w = w_far * (1.0 - np.exp(-s) * (np.cos(s) + np.sin(s)))
    curvature = 2.0 * beta**2 * w_far * np.exp(-s) * (np.cos(s) - np.sin(s))
    expected = NU * w / radius - 0.5 * thickness * curvature
    assert np.abs(hoop + w / radius).max() < 0.01 * np.abs(w / radius).max()
    peak = thickness * beta**2 * w_far
    assert np.abs(axial - expected).max() < 0.01 * peak


def michell_ring(a: float, b: float, n: int) -> float:
    """Inner hoop strain of a ring in plane strain under p cos(n phi) outside (T. and Goodier, sec. 43).

    Stress function (A r^n + B r^-n + C r^(n+2) + D r^(2-n)) cos(n phi).
    """
    power = np.array([n, -n, n + 2, 2 - n])

    def stress(r: float) -> np.ndarray:
        f, f1, f2 = r**power, power * r ** (power - 1.0), power * (power - 1.0) * r ** (power - 2.0)
        return np.array([f1 / r - n**2 * f / r**2, n * (f1 / r - f / r**2), f2])

    inner, outer = stress(a), stress(b)
    scale = b ** (power - 2.0)
    held = np.stack([inner[0], inner[1], outer[0], outer[1]]) / scale
    hoop_stress = inner[2] @ (np.linalg.solve(held, [0.0, 0.0, -PRESSURE, 0.0]) / scale)
    return float((1.0 - NU**2) / E * hoop_stress)


@pytest.mark.parametrize("harmonic", [2, 3])
@pytest.mark.parametrize(("thickness", "layers", "rtol"), [(0.004, 1, 1e-3), (0.004, 2, 1e-4), (0.03, 4, 1e-3)])
def test_ring_in_plane_strain(harmonic: int, thickness: float, layers: int, rtol: float) -> None:
    """Ovalisation, both ends guided: plane strain holds exactly."""
    b = 0.13
    a = b - thickness
    axial, hoop, shear = strain(
        cylinder(length=0.1, a=a, b=b, h=0.05, layers=layers, front="guided", aft="guided"),
        np.array([0.03, 0.071]),
        harmonic,
    )
    np.testing.assert_allclose(hoop, michell_ring(a, b, harmonic), rtol=rtol)
    np.testing.assert_allclose(axial, 0.0, atol=1e-9 * np.abs(hoop[0]))
    np.testing.assert_allclose(shear, 0.0, atol=1e-9 * np.abs(hoop[0]))


@pytest.mark.parametrize("harmonic", [2, 3])
def test_thin_ring(harmonic: int) -> None:
    """Inextensional bending p R^2 t / [2 D (n^2 - 1)], membrane strain left out."""
    radius, thickness = 0.5, 0.001
    a, b = radius - 0.5 * thickness, radius + 0.5 * thickness
    _, hoop, _ = strain(
        cylinder(length=0.05, a=a, b=b, h=0.025, layers=1, front="guided", aft="guided"),
        np.array([0.02]),
        harmonic,
    )
    rigidity = E * thickness**3 / (12.0 * (1.0 - NU**2))
    expected = PRESSURE * radius**2 * thickness / (2.0 * rigidity * (harmonic**2 - 1.0))
    np.testing.assert_allclose(hoop, expected, rtol=0.01)


def test_cone_as_membrane() -> None:
    """Closed cone, external pressure: N_s = -p s tan(a)/2, N_phi = -p s tan(a), s on the middle surface."""
    angle, thickness = np.deg2rad(10.0), 0.001
    cone = chain_segments([(2.0, angle, angle)])
    mesh = shell_mesh(cone, Wall(thickness, 0.1, MATERIAL), 0.01)
    x = np.linspace(0.8, 1.6, 9)
    meridional, hoop, _ = strain(mesh, x, 0)
    radius = x * np.tan(angle) - 0.5 * thickness / np.cos(angle)
    n_s, n_phi = -0.5 * PRESSURE * radius / np.cos(angle), -PRESSURE * radius / np.cos(angle)
    np.testing.assert_allclose(meridional, (n_s - NU * n_phi) / (E * thickness), rtol=0.01)
    np.testing.assert_allclose(hoop, (n_phi - NU * n_s) / (E * thickness), rtol=0.01)
