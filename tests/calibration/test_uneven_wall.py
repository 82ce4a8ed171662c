"""A tube whose wall is thicker on one side, against beam theory."""

import numpy as np
import pytest

from builder.structure.as_built.response_tables import side_phases
from builder.structure.as_built.wall_changes import WAVES, rolled_quarter, times_cosine, times_waves
from builder.structure.as_built.wall_regions import WallRegions, thickened
from builder.structure.as_built.wall_states import LOW, ChangedStrain, WallStates, wall_states
from builder.structure.fourier.inner_surface import PlacedGauges
from builder.structure.fourier.meridian_mesh import tube_mesh
from builder.structure.loads.applied import Load, SectionLoad, SurfacePressure, Weight
from builder.structure.loads.gauge_strain import nodal_force
from builder.structure.loads.loaded_structure import INNER, LoadProperties
from builder.structure.wall import Material, Wall
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

LENGTH, RADIUS, THICKNESS = 2.0, 0.1, 0.002
WALL = Wall(THICKNESS, 1e-6, Material(110e9, 0.3))
ONE = WallRegions(end=np.array([-1.0, LENGTH]))


@pytest.fixture(scope="module")
def states() -> WallStates:
    ends = np.array([0.0, LENGTH])
    mesh = tube_mesh(ends, np.full(2, RADIUS - THICKNESS), np.full(2, RADIUS), element_length=0.05)
    gauge = PlacedGauges(
        x=np.array([1.0]), roll_angle=np.zeros(1), meridional=np.ones(1), circumferential=np.zeros(1)
    )
    return wall_states(
        mesh=mesh,
        wall=WALL,
        regions=ONE,
        gauges=gauge,
        along=np.array([1e-3]),
        properties=LoadProperties(density=4430.0, expansion=9e-6),
        max_harmonic=4,
        changed_harmonic=4,
    )


def changed_strain(states: WallStates, load: Load) -> ChangedStrain:
    """Return the strain of one load on changed walls, (.., 2, n_m, n_s, 3)."""
    force = [states.rows.split(nodal_force(states.forces[0], load))]
    return states.changes.strain(lambda n: states.rows.of_harmonic(force, n), 2, 5)


def axial_change(states: WallStates, load: Load, roll: float) -> float:
    """Return the change of axial strain per amplitude of a wall thicker at roll angle 0."""
    amplitude = changed_strain(states, load).uneven[0, 0]
    found = 0.0
    for (cosine, sine, factor), part in zip(side_phases(np.array([roll]), 5, 1), amplitude, strict=True):
        found += float(factor[0] * (part[0, :, 0, 0] @ cosine[:, 0] + part[1, :, 0, 0] @ sine[:, 0]))
    return found


# The bore is a circle that is shifted by -w t: area centre and second moment are those of an eccentric annulus.
BORE = RADIUS - THICKNESS
CENTRE = BORE**2 * THICKNESS / (RADIUS**2 - BORE**2)
STIFFNESS = WALL.material.youngs_modulus * 0.25 * np.pi * (RADIUS**4 - BORE**4)


def test_axial_force_bends_towards_the_thin_side(states: WallStates) -> None:
    force = 1000.0
    pulled = SectionLoad(station=0.0, force=(-force, 0.0, 0.0))
    for roll in (0.0, 1.0, 0.5 * np.pi, np.pi):
        expected = -force * CENTRE * BORE * np.cos(roll) / STIFFNESS
        assert axial_change(states, pulled, roll) == pytest.approx(expected, rel=2e-3, abs=1e-12)


def test_bending_moves_the_neutral_axis(states: WallStates) -> None:
    moment = 50.0
    bent = SectionLoad(station=0.0, moment=(0.0, moment, 0.0))
    # The wall ovalises too, as cos 2 phi; the mean over a quarter turn holds nothing of that.
    found = np.mean([axial_change(states, bent, roll) for roll in (0.0, 0.5 * np.pi)])
    assert found == pytest.approx(moment * (CENTRE + 0.5 * THICKNESS) / STIFFNESS, rel=2e-3)


def test_a_thicker_region_is_an_even_change(states: WallStates) -> None:
    """A thinner and a thicker wall strain under an axial force as 1 / t does."""
    load = SectionLoad(station=0.0, force=(-1e3, 0.0, 0.0))
    changed = changed_strain(states, load)
    nominal = states.nominal.strain(states.rows.split(nodal_force(states.forces[0], load)))
    even, first, second = (float(one[0, 0, 0, 0]) for one in (nominal, changed.wall[0], changed.wall_twice[0]))
    thin, thick = (even + size * (first + size * second) for size in (-0.04, 0.04))
    outer = RADIUS**2
    area = [outer - (RADIUS - factor * THICKNESS) ** 2 for factor in (0.96, 1.0, 1.04)]
    assert thin / even == pytest.approx(area[1] / area[0], rel=1e-4)
    assert thick / even == pytest.approx(area[1] / area[2], rel=1e-4)


def test_weight_changes_with_the_wall(states: WallStates) -> None:
    even, thin, thick = states.forces
    weights = [one.resultant(nodal_force(one, Weight()))[2] for one in (thin[0], even, thick[0])]
    assert (weights[2] - weights[0]) / weights[1] == pytest.approx(0.08, rel=0.02)


def test_loads_within_the_wall_in_high_harmonics_are_refused(states: WallStates) -> None:
    force = np.zeros((2, LOW + 1, states.rows.n_nodes, 3))
    force[0, LOW, states.rows.inner[0]] = 1.0
    with pytest.raises(InputError, match=f"harmonics up to {LOW - 1} within the wall"):
        states.rows.split(force)
    assert changed_strain(states, SurfacePressure(surface=INNER, pressure=1e4)).soft[0].any()


def amplitudes(random: np.random.Generator) -> FloatArray:
    force = random.standard_normal((2, 6, 1, 3))
    force[0, 0, ..., 2] = force[1, 0, ..., :2] = force[:, 5] = 0.0
    return force


def at(force: FloatArray, roll: float) -> FloatArray:
    m = np.arange(force.shape[1])[:, None]
    c, s = np.cos(m * roll), np.sin(m * roll)
    along = (c * force[0, :, 0, :2] + s * force[1, :, 0, :2]).sum(axis=0)
    around = (s[:, 0] * force[0, :, 0, 2] - c[:, 0] * force[1, :, 0, 2]).sum()
    return np.append(along, around)


def test_products_with_a_cosine_hold_at_every_angle() -> None:
    force = amplitudes(np.random.default_rng(1))
    for roll in (0.0, 0.7, 2.9):
        np.testing.assert_allclose(at(times_cosine(force), roll), np.cos(roll) * at(force, roll), atol=1e-12)
        np.testing.assert_allclose(at(rolled_quarter(force), roll - 0.5 * np.pi), at(force, roll), atol=1e-12)


def test_waves_of_the_wall_hold_at_every_angle() -> None:
    force = amplitudes(np.random.default_rng(2))
    force[:, 3:] = 0.0  # none that would go beyond the last harmonic
    for roll in (0.0, 0.7, 2.9):
        for wave, (cosine, sine) in zip(WAVES, times_waves(force), strict=True):
            np.testing.assert_allclose(at(cosine, roll), np.cos(wave * roll) * at(force, roll), atol=1e-12)
            np.testing.assert_allclose(at(sine, roll), np.sin(wave * roll) * at(force, roll), atol=1e-12)


def test_the_outer_surface_stays(states: WallStates) -> None:
    mesh = states.forces[0].mesh
    moved = thickened(mesh, WALL, ONE, np.array([0.1]))
    np.testing.assert_array_equal(moved.node[mesh.outer_edge], mesh.node[mesh.outer_edge])
    gap = mesh.node[mesh.inner_edge, 1] - moved.node[mesh.inner_edge, 1]
    np.testing.assert_allclose(gap, 0.1 * THICKNESS, rtol=1e-9)


def test_a_wall_thicker_on_two_sides_stiffens_one_plane(states: WallStates) -> None:
    """Thickness as cos 2 phi changes the second moment of area by half as much, more in the plane of its crest.

    What strains axially as cos phi, the gauge's own place on the moved bore aside, is the bending of the plane.
    """
    moment = 50.0
    bent = SectionLoad(station=0.0, moment=(0.0, moment, 0.0))
    turned = SectionLoad(station=0.0, moment=(0.0, 0.0, moment))
    stiffer = 0.5 * WALL.material.youngs_modulus * np.pi * BORE**3 * THICKNESS  # per amplitude
    expected = moment * BORE * stiffer / STIFFNESS**2
    for load, sign in ((bent, 1.0), (turned, -1.0)):
        force = states.rows.split(nodal_force(states.forces[0], load))
        nominal = states.nominal.strain(force)[:, 1, 0, 0]
        family = int(np.abs(nominal).argmax())
        back = changed_strain(states, load).uneven[1, 0, 0, family, 1, 0, 0]  # load as n = 1, strain as m = -1
        # In the sine's family harmonic -1 is the negative of harmonic 1.
        change = (1.0 if family == 0 else -1.0) * back / nominal[family]
        assert change == pytest.approx(-sign * expected / abs(nominal[family]), rel=0.02)


def test_a_taper_is_a_region_thicker_towards_its_end(states: WallStates) -> None:
    mesh = states.forces[0].mesh
    regions = WallRegions(end=np.array([0.0, 1.0, LENGTH]))
    tapered = thickened(mesh, WALL, regions, np.zeros(2), np.array([0.1, 0.0]))
    x = mesh.node[mesh.inner_edge, 0]
    gap = mesh.node[mesh.inner_edge, 1] - tapered.node[mesh.inner_edge, 1]
    inside = (x > 0.1) & (x < 0.9)
    np.testing.assert_allclose(gap[inside], 0.1 * THICKNESS * (2.0 * x[inside] - 1.0), rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(gap[x > 1.1], 0.0, atol=1e-15)
