"""Gauge strain under known loads on the Fourier model, against beams, tubes and rings."""

from dataclasses import replace

import numpy as np
import pytest
from tube_loads import AREA, INERTIA, LENGTH, METAL, NU, PROPERTIES, RHO, ROLL, A, B, E, X, read, tube

from builder.structure.fourier.inner_surface import PlacedGauges
from builder.structure.fourier.meridian_mesh import tube_mesh
from builder.structure.loads.applied import (
    Acceleration,
    ApparentStrain,
    DistributedForce,
    Load,
    PadForce,
    PadPressure,
    PointForce,
    SectionLoad,
    SurfaceForce,
    SurfacePressure,
    Weight,
)
from builder.structure.loads.fourier import FourierStructure, fourier_structure
from builder.structure.loads.gauge_strain import gauge_strain, load_resultant
from builder.structure.loads.loaded_structure import OUTER, LoadProperties, PointMass
from builder.structure.loads.temperature import TemperatureField, uniform_temperature
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module")
def cantilever() -> FourierStructure:
    return tube()


@pytest.fixture(scope="module")
def free_tube() -> FourierStructure:
    return tube(front="free", aft="free")


def bending(moment: np.ndarray, roll_angle: float) -> np.ndarray:
    """Return (3, 4) axial strain of a beam whose fibre at ``roll_angle`` is in tension under moments (3,)."""
    return np.outer(moment, np.cos(ROLL - roll_angle)) * A / (E * INERTIA)


@pytest.mark.parametrize("roll_angle", [0.0, 0.5, 1.5 * np.pi])
def test_tip_force(cantilever: FourierStructure, roll_angle: float) -> None:
    """A force on the free nose towards phi puts the fibre at phi under compression, M = F x."""
    force = 2e3 * np.array([0.0, np.sin(roll_angle), np.cos(roll_angle)])
    found = read(cantilever, SectionLoad(station=0.0, force=tuple(force)))
    expected = bending(-2e3 * X, roll_angle)
    np.testing.assert_allclose(found[..., 0], expected, atol=0.005 * np.abs(expected).max())
    np.testing.assert_allclose(found[..., 1], -NU * expected, atol=0.005 * np.abs(expected).max())


def test_point_and_pad_force_bend_as_a_beam_far_away(cantilever: FourierStructure) -> None:
    """Forces at x = 0.1 m: M = F (x - 0.1 m), at the last station within 0.5 % (Saint-Venant: 12 radii away)."""
    force = (0.0, 0.0, -1.5e3)
    expected = bending(1.5e3 * (X - 0.1), 0.0)[-1]
    pad = {"station": 0.1, "roll_angle": 0.0, "half_length": 0.05, "half_angle": 0.5}
    for load in (
        PointForce(station=0.1, roll_angle=0.0, force=force),
        PadForce(**pad, force=force),
        PadPressure(**pad, push=1.5e3),
    ):
        found = read(cantilever, load)[-1, :, 0]
        np.testing.assert_allclose(found, expected, atol=0.005 * np.abs(expected).max())


def test_a_pad_that_does_not_push_strains_nothing(cantilever: FourierStructure) -> None:
    """As in the zero readings of a ground test."""
    pad = {"station": 0.5, "roll_angle": 0.0, "half_length": 0.1, "half_angle": 0.6}
    for load in (PadForce(**pad, force=(0.0, 0.0, 0.0)), PadPressure(**pad, push=0.0)):
        assert not read(cantilever, load).any()


def test_axial_force_and_bending_moments(cantilever: FourierStructure) -> None:
    force = read(cantilever, SectionLoad(station=0.0, force=(5e3, 0.0, 0.0)))
    np.testing.assert_allclose(force[..., 0], -5e3 / (E * AREA), rtol=0.005)
    about_y = read(cantilever, SectionLoad(station=0.0, moment=(0.0, 800.0, 0.0)))
    np.testing.assert_allclose(
        about_y[..., 0], bending(np.full(3, -800.0), 0.0), atol=0.005 * 800 * A / (E * INERTIA)
    )
    about_z = read(cantilever, SectionLoad(station=0.0, moment=(0.0, 0.0, 800.0)))
    # A positive moment about z turns x towards y: it pulls the fibres at +y forwards.
    expected = bending(np.full(3, 800.0), 0.5 * np.pi)
    np.testing.assert_allclose(about_z[..., 0], expected, atol=0.005 * 800 * A / (E * INERTIA))


def test_torque(cantilever: FourierStructure) -> None:
    """Shear strain gamma = T r / (G J); a 45 deg gauge reads half of it, axial and hoop gauges nothing."""
    found = read(cantilever, SectionLoad(station=0.0, moment=(900.0, 0.0, 0.0)))
    shear_modulus = E / (2.0 * (1.0 + NU))
    expected = 0.5 * 900.0 * A / (shear_modulus * 2.0 * INERTIA)
    np.testing.assert_allclose(found[..., 2], expected, rtol=0.005)
    np.testing.assert_allclose(found[..., :2], 0.0, atol=1e-6 * expected)


@pytest.mark.parametrize("up", [0.0, 0.5 * np.pi, 2.0])
def test_own_weight_of_a_cantilever(cantilever: FourierStructure, up: float) -> None:
    """M = rho g A x^2 / 2, the upper fibre in tension; nose up by theta, compression rho g x sin(theta) / E."""
    level = read(cantilever, Weight(up_roll_angle=up))
    expected = bending(0.5 * RHO * 9.80665 * AREA * X**2, up)
    np.testing.assert_allclose(level[..., 0], expected, atol=0.005 * np.abs(expected).max())
    upright = read(cantilever, Weight(up_roll_angle=up, nose_elevation=0.5 * np.pi))
    column = np.broadcast_to(-RHO * 9.80665 * X[:, None] / E, (3, 4))
    np.testing.assert_allclose(upright[..., 0], column, rtol=0.005)


def test_weight_is_acceleration_upwards_and_a_distributed_force(cantilever: FourierStructure) -> None:
    weight = read(cantilever, Weight())
    np.testing.assert_allclose(read(cantilever, Acceleration(linear=(0.0, 0.0, 9.80665))), weight, rtol=1e-12)
    per_length = np.tile([0.0, 0.0, -RHO * 9.80665 * AREA], (2, 1))
    along = read(cantilever, DistributedForce(station=np.array([0.0, LENGTH]), force_per_length=per_length))
    np.testing.assert_allclose(along[..., 0], weight[..., 0], atol=0.01 * np.abs(weight[..., 0]).max())


def test_point_mass_weighs(cantilever: FourierStructure) -> None:
    mass = PointMass(station=0.2, roll_angle=1.0, mass=3.0)
    loaded = replace(cantilever, properties=replace(PROPERTIES, masses=(mass,)))
    force = PointForce(station=0.2, roll_angle=1.0, force=(0.0, 0.0, -3.0 * 9.80665))
    np.testing.assert_allclose(read(loaded, Weight()), read(cantilever, Weight(), force), rtol=1e-9)


def test_point_mass_resists_angular_acceleration(cantilever: FourierStructure) -> None:
    """Its inertia is -m alpha x r."""
    loaded = replace(
        cantilever, properties=replace(PROPERTIES, masses=(PointMass(station=0.2, roll_angle=1.0, mass=3.0),))
    )
    turning = [Acceleration(angular=(4.0, 5.0, 6.0))]
    found = load_resultant(loaded, turning) - load_resultant(cantilever, turning)
    place = np.array([0.2, B * np.sin(1.0), B * np.cos(1.0)])
    force = -3.0 * np.cross([4.0, 5.0, 6.0], place)
    np.testing.assert_allclose(found, [*force, *np.cross(place, force)], rtol=1e-6)


def test_distributed_force_keeps_its_sum_between_the_nodes(cantilever: FourierStructure) -> None:
    ends = np.array([0.1234, 0.3456])
    load = DistributedForce(station=ends, force_per_length=np.array([[10.0, 0.0, 20.0], [20.0, 0.0, 60.0]]))
    expected = np.array([15.0, 0.0, 40.0]) * np.diff(ends)
    np.testing.assert_allclose(load_resultant(cantilever, [load])[:3], expected, rtol=1e-9, atol=1e-9)


def test_internal_pressure() -> None:
    """Lame, open ends, inner face: hoop p/E [(a^2 + b^2)/(b^2 - a^2) + nu], axial -2 nu p/E a^2/(b^2 - a^2)."""
    a, b = 0.10, 0.13
    found = read(tube(a=a, b=b), SurfacePressure(surface="inner", pressure=1e6))
    wall = b**2 - a**2
    np.testing.assert_allclose(found[..., 1], 1e6 / E * ((a**2 + b**2) / wall + NU), rtol=0.005)
    np.testing.assert_allclose(found[..., 0], -1e6 / E * NU * 2.0 * a**2 / wall, rtol=0.005)


def test_ring_between_opposite_point_forces() -> None:
    """Hoop strain on the inner face of a thin ring, tension inside positive: M = P R (1 / pi - sin(phi) / 2).

    Phi counts from a force (Timoshenko, Strength of Materials, part I, section 80).
    """
    radius, thickness, width, force = 0.5, 0.002, 0.01, 10.0
    mesh = tube_mesh(
        x=np.array([0.0, width]),
        inner_radius=np.full(2, radius - 0.5 * thickness),
        outer_radius=np.full(2, radius + 0.5 * thickness),
        element_length=0.5 * width,
        front="free",
        aft="free",
    )
    roll = np.deg2rad([90.0, 60.0, 45.0, 30.0])
    placed = PlacedGauges(
        x=np.full(4, 0.5 * width), roll_angle=roll, meridional=np.zeros(4), circumferential=np.ones(4)
    )
    ring = fourier_structure(mesh, METAL, placed, max_harmonic=60)
    pair = [
        PointForce(station=0.5 * width, roll_angle=0.0, force=(0.0, 0.0, -force)),
        PointForce(station=0.5 * width, roll_angle=np.pi, force=(0.0, 0.0, force)),
    ]
    moment = force * radius * (1.0 / np.pi - 0.5 * np.sin(roll))
    section = E * width * thickness**2 / 6.0
    expected = moment / section - 0.5 * force * np.sin(roll) / (E * width * thickness)
    np.testing.assert_allclose(gauge_strain(ring, pair), expected, atol=0.005 * np.abs(expected).max())


def test_free_beam_under_a_force_at_its_end(free_tube: FourierStructure) -> None:
    """Inertia of a rigid beam balances it: M = F x (1 - x / L)^2 but for the inertia of turning sections.

    Beams leave out terms of (R / L)^2 of a load along the body, 0.6 % here.
    """
    mass, turning = RHO * AREA * LENGTH, RHO * INERTIA  # turning: of sections, per length
    angular = 0.5 * LENGTH / (mass * LENGTH**2 / 12.0 + turning * LENGTH)
    front = 1.0 / mass + 0.5 * angular * LENGTH
    arm = X - RHO * AREA * (0.5 * front * X**2 - angular * X**3 / 6.0) - turning * angular * X
    found = read(free_tube, SectionLoad(station=0.0, force=(0.0, 0.0, 2e3)))
    expected = bending(-2e3 * arm, 0.0)
    np.testing.assert_allclose(found[..., 0], expected, atol=0.008 * np.abs(expected).max())


def test_free_body_does_not_feel_weight(free_tube: FourierStructure) -> None:
    masses = (PointMass(station=0.4, roll_angle=1.0, mass=3.0),)
    loaded = replace(free_tube, properties=replace(PROPERTIES, masses=masses))
    size = np.abs(read(loaded, SectionLoad(station=0.0, force=(0.0, 0.0, 10.0)))).max()
    for acceleration in (Weight(up_roll_angle=0.7, nose_elevation=0.3), Acceleration(angular=(1.0, 2.0, 3.0))):
        np.testing.assert_allclose(read(loaded, acceleration), 0.0, atol=1e-7 * size)


LOADS: list[Load] = [
    PointForce(station=0.5, roll_angle=0.4, force=(100.0, 200.0, -300.0)),
    PadForce(station=0.5, roll_angle=2.0, half_length=0.1, half_angle=0.6, force=(10.0, -20.0, 30.0)),
    SectionLoad(station=0.3, force=(1.0, 2.0, 3.0), moment=(40.0, 50.0, 60.0)),
    DistributedForce(
        station=np.array([0.0, LENGTH]), force_per_length=np.array([[1.0, 2.0, 3.0], [2.0, 2.0, 2.0]])
    ),
    SurfaceForce(surface="outer", force=(1.0, 2.0, 3.0)),
]


def test_resultants(cantilever: FourierStructure) -> None:
    """Force and moment about the nose tip of what is applied."""
    y, z = B * np.sin(0.4), B * np.cos(0.4)
    point = np.cross([0.5, y, z], [100.0, 200.0, -300.0])
    np.testing.assert_allclose(load_resultant(cantilever, LOADS[:1]), [100.0, 200.0, -300.0, *point], rtol=1e-9)
    pad = load_resultant(cantilever, LOADS[1:2])
    np.testing.assert_allclose(pad[:3], [10.0, -20.0, 30.0], rtol=1e-9)
    np.testing.assert_allclose(pad[4:], [-0.5 * 30.0, -0.5 * 20.0], atol=3.0)
    section = np.array([40.0, 50.0 - 0.3 * 3.0, 60.0 + 0.3 * 2.0])
    np.testing.assert_allclose(load_resultant(cantilever, LOADS[2:3]), [1.0, 2.0, 3.0, *section], rtol=1e-9)
    # Forces of 1.5, 2 and 2.5 N/m on average; moments: integrals of -x f_z and x f_y.
    total = load_resultant(cantilever, LOADS[3:4])
    np.testing.assert_allclose(total, [3.0, 4.0, 5.0, 0.0, -14.0 / 3.0, 4.0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(load_resultant(cantilever, LOADS[4:])[:3], [1.0, 2.0, 3.0], rtol=1e-9)
    mass = RHO * AREA * LENGTH
    np.testing.assert_allclose(
        load_resultant(cantilever, [Weight(up_roll_angle=0.5 * np.pi)]),
        np.array([0.0, -9.80665, 0.0, 0.0, 0.0, -9.80665]) * mass,
        atol=1e-9 * mass,
    )


def test_push_of_a_pad_is_its_radial_resultant(cantilever: FourierStructure) -> None:
    pad = PadPressure(station=0.5, roll_angle=1.0, half_length=0.1, half_angle=0.6, push=700.0)
    found = load_resultant(cantilever, [pad])[:3]
    expected = [0.0, -700.0 * np.sin(1.0), -700.0 * np.cos(1.0)]
    np.testing.assert_allclose(found, expected, atol=0.2)


def test_a_turn_of_load_and_gauges_changes_nothing(cantilever: FourierStructure) -> None:
    """Roll by 0.8 rad of all that stands; this holds the two families of harmonics and torsion together."""
    turn = 0.8
    c, s = np.cos(turn), np.sin(turn)

    def turned(v: tuple[float, float, float]) -> tuple[float, float, float]:
        return v[0], c * v[1] + s * v[2], -s * v[1] + c * v[2]

    force = (100.0, 200.0, -300.0)
    before = [
        PointForce(station=0.9, roll_angle=0.4, force=force),
        SectionLoad(station=0.3, moment=(5.0, 6.0, 7.0)),
    ]
    after = [
        PointForce(station=0.9, roll_angle=0.4 + turn, force=turned(force)),
        SectionLoad(station=0.3, moment=turned((5.0, 6.0, 7.0))),
    ]
    placed = replace(cantilever.gauges, roll_angle=cantilever.gauges.roll_angle + turn)
    rolled = replace(cantilever, gauges=placed)
    expected = read(cantilever, *before)
    np.testing.assert_allclose(read(rolled, *after), expected, atol=1e-9 * np.abs(expected).max())


def test_loads_add_and_apparent_strain_is_added(cantilever: FourierStructure) -> None:
    alone = sum(read(cantilever, load) for load in LOADS)
    size = np.abs(alone).max()
    np.testing.assert_allclose(read(cantilever, *LOADS), alone, atol=1e-12 * size)
    zero = np.linspace(-1e-4, 1e-4, 36)
    np.testing.assert_allclose(
        read(cantilever, *LOADS, ApparentStrain(strain=zero)), alone + zero.reshape(3, 4, 3)
    )
    assert not gauge_strain(cantilever, []).any()


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (PointForce(station=2.1, roll_angle=0.0, force=(0.0, 0.0, 1.0)), "station 2.1 m is beyond"),
        (PadForce(station=3.0, roll_angle=0.0, half_length=0.1, half_angle=0.5, force=(0.0, 0.0, 1.0)), "beyond"),
        (
            PadForce(station=1.0, roll_angle=0.0, half_length=1e-4, half_angle=0.5, force=(0.0, 0.0, 1.0)),
            "too small",
        ),
        (SurfacePressure(surface="lid", pressure=1.0), "surface 'lid'"),
        (ApparentStrain(strain=np.zeros(3)), r"expected \(36,\) values"),
    ],
)
def test_refusals(cantilever: FourierStructure, load: Load, message: str) -> None:
    with pytest.raises(InputError, match=message):
        gauge_strain(cantilever, [load])


def test_what_a_load_needs_must_be_known(cantilever: FourierStructure, free_tube: FourierStructure) -> None:
    bare = replace(cantilever, properties=LoadProperties())
    with pytest.raises(InputError, match="density"):
        gauge_strain(bare, [Weight()])
    with pytest.raises(InputError, match="expansion"):
        gauge_strain(bare, [uniform_temperature(1.0)])
    floating = replace(free_tube, properties=LoadProperties())
    with pytest.raises(InputError, match="free body"):
        gauge_strain(floating, [SectionLoad(station=0.0, force=(0.0, 0.0, 1.0))])


def test_bad_values_are_refused() -> None:
    with pytest.raises(InputError, match="finite"):
        PointForce(station=np.nan, roll_angle=0.0, force=(0.0, 0.0, 1.0))
    with pytest.raises(InputError, match="half_angle"):
        PadForce(station=1.0, roll_angle=0.0, half_length=0.1, half_angle=0.0, force=(0.0, 0.0, 1.0))
    with pytest.raises(InputError, match="increase"):
        TemperatureField(station=np.array([1.0, 1.0]), inner=np.zeros((2, 1)), outer=np.zeros((2, 1)))
    with pytest.raises(InputError, match="mass"):
        PointMass(station=1.0, roll_angle=0.0, mass=0.0)


def test_forces_on_some_points_of_a_surface(cantilever: FourierStructure) -> None:
    """Forces on chosen points are forces on all of them that are zero elsewhere."""
    n = len(cantilever.surface_points(OUTER).area)
    at = np.sort(np.random.default_rng(1).choice(n, 40, replace=False))
    force = np.zeros((n, 3))
    force[at] = np.random.default_rng(2).standard_normal((40, 3))
    some, every = cantilever.spread_force(OUTER, force[at], at), cantilever.spread_force(OUTER, force)
    np.testing.assert_allclose(some, every, atol=1e-12 * np.abs(every).max())
