"""Supports and free flight against closed forms and against each other."""

import numpy as np
import pytest
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu
from solid_bodies import METAL, cube, swept_tube, with_planes_of_symmetry

from builder.structure.solid.gauge_rows import gauge_rows, gauges_at
from builder.structure.solid.matter import Matter, determinate_support, free_flight
from builder.structure.solid.nodal_loads import pressure_load, surface_nodes
from builder.structure.solid.solid_mesh import EXTERNAL, SUPPORT, SolidMesh
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.supports import (
    Clamped,
    Foundation,
    Restraint,
    Support,
    free_motions,
    restrain,
    rigid_motions,
)
from builder.structure.solid.swept_mesh import REGION
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

E, NU = METAL.youngs_modulus, METAL.poisson_ratio
DENSITY = 4430.0
MATTER = Matter(material=METAL, density=DENSITY)
PLANES = ("x0", "y0", "z0")


def solve(mesh: SolidMesh, restraint: Restraint, load: np.ndarray) -> np.ndarray:
    """Return (n_nodes, 3) displacement [m] under loads (n_dof,) [N]."""
    held = restraint.held_stiffness(assemble_stiffness(mesh, {REGION: METAL}))
    factor = splu(
        csc_array(held), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return np.asarray(restraint.free @ factor.solve(restraint.free.T @ load)).reshape(-1, 3)


def pressed(mesh: SolidMesh, side: str, pressure: float = 1e6) -> np.ndarray:
    return np.asarray(pressure_load(mesh, side) @ np.full(len(surface_nodes(mesh, side)), pressure))


@pytest.mark.parametrize("element_type", ["hexahedron20", "tetrahedron10"])
def test_planes_of_symmetry_leave_uniaxial_stress(element_type: str) -> None:
    """Cube pressed on one side, three planes of symmetry: u = p (-x, nu y, nu z)/E exactly."""
    mesh = cube(element_type, 2, shake=0.2)
    u = solve(mesh, with_planes_of_symmetry(mesh, *PLANES), pressed(mesh, "x1"))
    np.testing.assert_allclose(u, 1e6 / E * mesh.node * [-1.0, NU, NU], atol=1e-11)


def test_plane_of_symmetry_may_be_inclined() -> None:
    """The same cube turned in space: displacement turns with it."""
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    mesh = cube("hexahedron20", 2)
    turned = SolidMesh(
        element_type=mesh.element_type,
        node=mesh.node @ turn.T,
        element=mesh.element,
        region=mesh.region,
        region_names=mesh.region_names,
        surface=mesh.surface,
    )
    u = solve(turned, with_planes_of_symmetry(turned, *PLANES), pressed(turned, "x1"))
    np.testing.assert_allclose(u, (1e6 / E * mesh.node * [-1.0, NU, NU]) @ turn.T, atol=1e-12)


def test_clamped_nodes_do_not_move() -> None:
    mesh = swept_tube()
    u = solve(mesh, restrain(mesh, [Clamped(SUPPORT)]), pressed(mesh, EXTERNAL))
    held = surface_nodes(mesh, SUPPORT)
    assert not u[held].any()
    assert np.linalg.norm(np.delete(u, held, axis=0), axis=1).min() > 0.0


def test_foundation_gives_way_by_pressure_over_stiffness() -> None:
    """Winkler foundation under a cube in uniaxial stress: the base moves by p/k, tangentially nothing moves."""
    mesh = cube("hexahedron20", 2)
    k = 3e12
    held = with_planes_of_symmetry(mesh, "y0", "z0", springs=Foundation("x0", normal=k))
    u = solve(mesh, held, pressed(mesh, "x1"))
    expected = 1e6 / E * mesh.node * [-1.0, NU, NU] - [1e6 / k, 0.0, 0.0]
    np.testing.assert_allclose(u, expected, atol=1e-12)


def test_stiff_foundation_is_a_clamp() -> None:
    mesh = swept_tube()
    load = pressed(mesh, EXTERNAL)
    clamped = solve(mesh, restrain(mesh, [Clamped(SUPPORT)]), load)
    resting = solve(mesh, restrain(mesh, [Foundation(SUPPORT, normal=1e18, tangential=1e18)]), load)
    assert np.abs(resting - clamped).max() < 1e-4 * np.abs(clamped).max()


@pytest.mark.parametrize(
    ("supports", "motion"),
    [
        ([], "translation along "),
        ([Foundation("x0", normal=1e9), Foundation("y0", normal=1e9)], "translation along z"),
        ([Foundation("x0", normal=1e9)], "(translation|rotation)"),
    ],
)
def test_rigid_motion_left_free_is_refused(supports: list[Support], motion: str) -> None:
    with pytest.raises(InputError, match=rf"supports: a rigid motion is left free \({motion}"):
        restrain(cube("hexahedron8", 2), supports)


def test_impossible_foundations_and_unknown_surfaces_are_refused() -> None:
    with pytest.raises(InputError, match="foundation on surface 'base': normal -1 and tangential 0 N/m3"):
        Foundation("base", normal=-1.0)
    with pytest.raises(InputError, match="one of them greater"):
        Foundation("base", normal=0.0)
    with pytest.raises(InputError, match="no surface 'base'"):
        restrain(cube("hexahedron8", 1), [Clamped("base")])


def test_free_motions_are_orthonormal_and_keep_directions() -> None:
    direction = np.array([[0.6, 0.8, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    free = free_motions(4, np.array([1, 1, 3]), direction)
    np.testing.assert_allclose((free.T @ free).toarray(), np.eye(9), atol=1e-15)
    for node, held in zip((1, 1, 3), direction, strict=True):
        assert np.abs(held @ free[3 * node : 3 * node + 3].toarray()).max() < 1e-15


@pytest.mark.parametrize("is_turned", [False, True])
def test_held_stiffness_is_the_product_with_free_motions(is_turned: bool) -> None:
    """Rows and columns are picked where free motions are unit vectors, and multiplied where they are turned."""
    mesh = cube("hexahedron20", 2)
    restraint = determinate_support(mesh) if is_turned else restrain(mesh, [Clamped("x0")])
    stiffness = assemble_stiffness(mesh, {REGION: METAL})
    expected = restraint.free.T @ (stiffness @ restraint.free)
    difference = np.abs((restraint.held_stiffness(stiffness) - expected).toarray())
    assert difference.max() < 1e-14 * np.abs(stiffness.data).max()


def test_inertia_of_a_cube() -> None:
    """Unit cube: mass rho, centre in the middle, moments of inertia rho/6."""
    flight = free_flight(cube("tetrahedron10", 2, shake=0.2), Matter(material=METAL, density=3.0))
    assert flight.mass == pytest.approx(3.0, rel=1e-12)
    np.testing.assert_allclose(flight.centre, 0.5, rtol=1e-12)
    np.testing.assert_allclose(flight.inertia, np.diag([3.0, 3.0, 3.0, 0.5, 0.5, 0.5]), atol=1e-12)


def test_inertia_of_a_tube() -> None:
    """Hollow cylinder: m = rho pi (b^2 - a^2) L, I_x = m (a^2 + b^2)/2; 12 quadratic arcs, 6e-4."""
    flight = free_flight(swept_tube(), MATTER)
    mass = DENSITY * np.pi * (0.13**2 - 0.12**2) * 0.2
    assert flight.mass == pytest.approx(mass, rel=3e-4)
    np.testing.assert_allclose(flight.centre, [0.1, 0.0, 0.0], atol=1e-12)
    roll, pitch = np.diag(flight.inertia)[[3, 4]]
    assert roll == pytest.approx(mass * (0.12**2 + 0.13**2) / 2.0, rel=6e-4)
    assert pitch == pytest.approx(mass * ((0.12**2 + 0.13**2) / 4.0 + 0.2**2 / 12.0), rel=6e-4)


def lateral(mesh: SolidMesh) -> np.ndarray:
    """A load with force and moment: pressure (1 + x/L) (1 + cos phi + sin 2 phi)."""
    place = mesh.node[surface_nodes(mesh, EXTERNAL)]
    phi = np.arctan2(place[:, 1], place[:, 2])
    pressure = 1e5 * (1.0 + place[:, 0] / 0.2) * (1.0 + np.cos(phi) + np.sin(2.0 * phi))
    return np.asarray(pressure_load(mesh, EXTERNAL) @ pressure)


def test_acceleration_is_force_over_mass_and_the_rest_is_balanced() -> None:
    mesh = swept_tube()
    flight, load = free_flight(mesh, MATTER), lateral(mesh)
    force = load.reshape(-1, 3)
    total, moment = force.sum(axis=0), np.cross(mesh.node - flight.centre, force).sum(axis=0)
    acceleration = flight.accelerations(load[:, None])[:, 0]
    scale = np.abs(acceleration).max()
    np.testing.assert_allclose(acceleration[:3], total / flight.mass, atol=1e-12 * scale)
    np.testing.assert_allclose(flight.inertia[3:, 3:] @ acceleration[3:], moment, atol=1e-12 * np.abs(load).sum())
    # Nose pressed less than tail, cos(phi) towards -z: the tail accelerates towards -z more than the nose.
    assert acceleration[2] < 0.0 < acceleration[4]
    left = rigid_motions(mesh.node).T @ flight.balanced(load[:, None])
    assert np.abs(left).max() < 1e-12 * np.abs(load).sum()


def test_three_determinate_supports_give_the_same_strain() -> None:
    """Wherever the balanced body is held, its strain is the same, to 1e-8, and no support carries force."""
    mesh = swept_tube()
    balanced = free_flight(mesh, MATTER).balanced(lateral(mesh)[:, None])[:, 0]
    roll = np.linspace(0.0, 2.5, 6)
    position = np.column_stack([np.linspace(0.05, 0.15, 6), 0.12 * np.sin(roll), 0.12 * np.cos(roll)])
    around = np.column_stack([np.zeros(6), np.cos(roll), -np.sin(roll)])
    rows = gauge_rows(mesh, gauges_at(position, around))
    far = mesh.n_nodes - 1
    strains, stiffness = [], assemble_stiffness(mesh, {REGION: METAL})
    for nodes in (None, np.array([0, 40, far]), np.array([7, far, 150])):
        u = solve(mesh, determinate_support(mesh, nodes), balanced).ravel()
        strains.append(rows @ u)
        assert np.abs(stiffness @ u - balanced).max() < 1e-8 * np.abs(balanced).max()
    for other in strains[1:]:
        np.testing.assert_allclose(other, strains[0], atol=1e-8 * np.abs(strains[0]).max())


def test_bar_in_flight_stretches_by_its_own_inertia() -> None:
    """Cube pushed at x0 with p: stress -p (1 - x), so its length shrinks by p/(2 E) (nu = 0.31 on the mean)."""
    mesh = cube("hexahedron20", 2)
    flight = free_flight(mesh, MATTER)
    load = flight.balanced(pressed(mesh, "x0")[:, None])[:, 0]
    u = solve(mesh, determinate_support(mesh), load)
    # Reciprocity with the uniaxial field: mean end-to-end shortening under a stress that varies along x only.
    ends = [u[surface_nodes(mesh, side)] for side in ("x0", "x1")]
    weight = [pressed(mesh, side, 1.0).reshape(-1, 3)[surface_nodes(mesh, side), 0] for side in ("x0", "x1")]
    shortening = weight[0] @ ends[0][:, 0] + weight[1] @ ends[1][:, 0]
    assert shortening == pytest.approx(1e6 / (2.0 * E), rel=1e-10)


def test_impossible_flights_are_refused() -> None:
    mesh = cube("hexahedron8", 2)
    with pytest.raises(InputError, match="density of the material of region 'wall' is missing"):
        free_flight(mesh, Matter(material=METAL))
    with pytest.raises(InputError, match="density 0 kg/m3 of region 'wall' must be greater than 0"):
        free_flight(mesh, Matter(material=METAL, density=0.0))
    line = np.flatnonzero((mesh.node[:, 1:] == 0.0).all(axis=1))
    with pytest.raises(InputError, match="lie on a line: they do not hold a body"):
        determinate_support(mesh, line[:3])
