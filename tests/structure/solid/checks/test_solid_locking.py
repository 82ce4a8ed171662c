"""The locking check: closed forms against an independent model, quadratic elements pass, linear ones do not."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from sweeps import sweep

from builder.structure.fourier.fourier_elasticity import assemble_stiffness, factor_harmonic
from builder.structure.fourier.meridian_mesh import tube_mesh
from builder.structure.fourier.strain_operator import pressure_load, strain_rows
from builder.structure.solid.checks import (
    LockingWarning,
    WallElements,
    check_locking,
    inner_hoop_strain,
    locking_ratios,
)
from builder.structure.wall import Material
from strainfmu.errors import InputError

METAL = Material(70e9, 0.33)
RADIUS, SIZE = 0.13, 0.0065


def wall(element_type: str, thickness: float = 0.006, layers: int = 1, size: float = SIZE) -> WallElements:
    """Elements of a wall of this radius and metal."""
    return WallElements(
        element_type=element_type, size=size, layers=layers, radius=RADIUS, thickness=thickness, material=METAL
    )


@pytest.mark.parametrize("harmonic", [0, 2, 4])
@pytest.mark.parametrize("thickness", [0.003, 0.012, 0.05])
def test_closed_form_agrees_with_the_fourier_model(harmonic: int, thickness: float) -> None:
    """Semi-analytic elements of another discretisation, six layers; 1e-4."""
    a = RADIUS - thickness
    mesh = tube_mesh(
        x=np.array([0.0, 0.04]),
        inner_radius=np.array([a, a]),
        outer_radius=np.array([RADIUS] * 2),
        element_length=0.02,
        n_layers=6,
        front="guided",
        aft="guided",
    )
    load = pressure_load(mesh, np.array([0.0, 0.04])).toarray().sum(axis=1, keepdims=True)
    displacement = factor_harmonic(mesh, assemble_stiffness(mesh, METAL), harmonic).solve(load)
    hoop = (strain_rows(mesh, np.array([0.02]), harmonic) @ displacement)[0, 1, 0]
    assert inner_hoop_strain(a, RADIUS, harmonic, METAL) == pytest.approx(hoop, rel=1e-4)


def test_thin_ring_limit() -> None:
    """Inextensional bending p R^2 t / [2 D (n^2 - 1)], D = E t^3 / [12 (1 - nu^2)]; to t/R."""
    radius, thickness = 1.0, 1e-3
    rigidity = 70e9 * thickness**3 / (12.0 * (1.0 - 0.33**2))
    for n in (2, 3, 4):
        found = inner_hoop_strain(radius - 0.5 * thickness, radius + 0.5 * thickness, n, METAL)
        assert found == pytest.approx(radius**2 * thickness / (2.0 * rigidity * (n**2 - 1)), rel=2e-3)


@pytest.mark.parametrize("thickness", sweep([0.003, 0.006, 0.012], [0.003]))
@pytest.mark.parametrize("element_type", ["tetrahedron10", "hexahedron20"])
def test_quadratic_elements_pass(element_type: str, thickness: float) -> None:
    """One layer, 6.5 mm round the axis: within 0.5 %, n = 4 on the thick wall 1.1 %."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ratios = check_locking(wall(element_type, thickness))
    assert ratios[0] == pytest.approx(1.0, abs=5e-4)
    assert ratios[2] == pytest.approx(1.0, abs=5e-3)
    assert ratios[4] == pytest.approx(1.0, abs=1.1e-2)


LINEAR = (
    ("tetrahedron4", 0.003, 1, 0.119),
    ("tetrahedron4", 0.006, 1, 0.202),
    ("tetrahedron4", 0.012, 1, 0.239),
    ("tetrahedron4", 0.006, 2, 0.353),
    ("tetrahedron4", 0.006, 3, 0.410),
    ("hexahedron8", 0.006, 1, 0.587),
    ("hexahedron8", 0.006, 3, 0.707),
)


@pytest.mark.parametrize(
    ("element_type", "thickness", "layers", "measured"), sweep(LINEAR, [LINEAR[0], LINEAR[3], LINEAR[5]])
)
def test_linear_elements_lose_the_bending(
    element_type: str, thickness: float, layers: int, measured: float
) -> None:
    """Ratios at n = 2 against those of another program of the same elements (its mesh and patch differ): 5 %."""
    ratios = locking_ratios(wall(element_type, thickness, layers))
    assert ratios[0] == pytest.approx(1.0, abs=0.01)
    assert ratios[2] == pytest.approx(measured, rel=0.05)
    assert ratios[4] == pytest.approx(ratios[2], rel=0.05)


def test_long_elements_lock_unless_integrated_for_a_thin_wall() -> None:
    """Elements longer than sqrt(R t) = 26 mm: full quadrature locks, that of swept meshes does not."""
    elements = WallElements(
        element_type="hexahedron20",
        size=0.03,
        layers=1,
        radius=0.165,
        thickness=0.004,
        material=Material(110e9, 0.31),
    )
    full, swept = locking_ratios(elements), locking_ratios(replace(elements, quadrature="thin_wall"))
    assert full[0] == pytest.approx(1.0, abs=1e-4)
    assert full[2] < 0.93
    assert swept[2] == pytest.approx(1.0, abs=1e-3)
    assert swept[4] == pytest.approx(1.0, abs=5e-3)


def test_linear_tetrahedra_are_refused_unless_allowed() -> None:
    elements = wall("tetrahedron4")
    with pytest.raises(
        InputError,
        match=r"tetrahedron4 \(full quadrature\), 6.5 mm round the axis.*% of the hoop strain under cos\(",
    ):
        check_locking(elements)
    with pytest.warns(LockingWarning, match="tetrahedron4"):
        ratios = check_locking(elements, allow_locking=True)
    assert ratios[2] < 0.25


def test_coarse_quadratic_elements_give_a_warning() -> None:
    """Seven elements per wave of n = 4."""
    with pytest.warns(LockingWarning, match=r"under cos\(4 phi\)"):
        ratios = check_locking(wall("hexahedron20", 0.012, size=0.029))
    assert 0.9 < ratios[4] < 0.98


def test_impossible_rings_are_refused() -> None:
    sound = wall("hexahedron20")
    for wrong in ({"size": 0.0}, {"layers": 0}, {"thickness": 0.13}, {"size": float("nan")}):
        with pytest.raises(InputError, match="locking check: element size"):
            locking_ratios(replace(sound, **wrong))
    with pytest.raises(InputError, match="harmonic 1 found"):
        inner_hoop_strain(0.1, 0.12, 1, METAL)
