"""Swept meshes: geometry, surfaces, sectors, and the shipped vehicle against the Fourier model."""

from functools import cache, partial

import numpy as np
import pytest
from solid_bodies import METAL, harmonic_field, sector_stiffness, tube

from builder.aero.mapping_report import MappingTolerances, check_mapping, mapping_report
from builder.aero.pressure_map import pressure_map
from builder.aero.surface.mesh import mesh_of_grid
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import harmonic_response
from builder.structure.mapped_structure import TOLERANCES_OF_CHECK
from builder.structure.solid.elements import boundary_facets, face_keys
from builder.structure.solid.gauge_rows import gauge_rows, gauges_at
from builder.structure.solid.mesh_checks import check_mesh
from builder.structure.solid.mesh_choice import COARSEST
from builder.structure.solid.nodal_loads import (
    pressure_load,
    surface_nodes,
    surface_points,
    triangulated_surface,
    vector_area,
)
from builder.structure.solid.solid_mesh import EXTERNAL, HEXAHEDRON, INTERNAL, SUPPORT
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.swept_mesh import (
    BORE,
    REGION,
    RESOLUTIONS,
    SweptResolution,
    SweptSector,
    full_mesh,
    section_wall,
    swept_wall,
)
from builder.structure.wall import Wall
from builder.vehicle.shape.geometry import (
    BodyOfRevolution,
    Segment,
    SegmentMaker,
    chain_pieces,
    chain_segments,
    surface_grid,
)
from builder.vehicle.shape.profile_entries import PowerLaw, spherical_cap, with_end_angles
from builder.vehicle.shape.sectioned_body import SectionedBody
from strainfmu.errors import InputError

WALL = Wall(0.004, 0.10, METAL)
PAPER_DOFS = 461_664  # displacement components of the source's finite elements


def spherical_cap_from(radius: float, x: float, start: float) -> Segment:
    return spherical_cap(radius, np.deg2rad(9.0))


def power_law_from(exponent: float, x: float, start: float) -> Segment:
    curve = PowerLaw(
        start_x=0.0,
        end_x=0.1,
        start_radius=0.0,
        start_angle=0.0,
        end_angle=0.0,
        base_radius=0.05,
        exponent=exponent,
    )
    return with_end_angles(curve)


def nine_degrees(end: float, x: float, radius: float) -> Segment:
    angle = np.deg2rad(9.0)
    return Segment(start_x=x, end_x=end, start_radius=radius, start_angle=angle, end_angle=angle)


@cache
def body() -> BodyOfRevolution:
    five, one = np.deg2rad([5.0, 1.0])
    return chain_segments([(1.75, five, five), (3.6, one, one)])


@cache
def sector(resolution: str) -> SweptSector:
    return swept_wall(body(), WALL, resolution)


def test_nodes_lie_on_the_true_surfaces() -> None:
    """Outside on the body, the cut at the apex apart; inside a wall's thickness along the normal below it."""
    outside = surface_points(sector("coarse"), EXTERNAL)
    behind = outside[:, 0] > 0.025 * WALL.solid_tip_length
    radius = np.hypot(*outside[:, 1:].T)
    np.testing.assert_allclose(radius[behind], body().radius(outside[behind, 0]), rtol=1e-12)
    inside = surface_points(sector("coarse"), INTERNAL)
    cone = inside[inside[:, 0] < 1.7]
    depth = cone[:, 0] * np.sin(np.deg2rad(5.0)) - np.hypot(*cone[:, 1:].T) * np.cos(np.deg2rad(5.0))
    np.testing.assert_allclose(depth, WALL.thickness, rtol=1e-9)
    base = surface_points(sector("coarse"), SUPPORT)
    np.testing.assert_allclose(base[:, 0], 3.6, rtol=1e-14)


def test_named_surfaces_are_the_whole_boundary() -> None:
    mesh = full_mesh(sector("coarse"))
    boundary, _ = boundary_facets(HEXAHEDRON, mesh.element)
    named = np.concatenate(list(mesh.surface.values()))
    assert sorted(mesh.surface) == sorted([EXTERNAL, INTERNAL, SUPPORT, BORE])
    keys = [np.unique(face_keys(HEXAHEDRON, facet), axis=0) for facet in (boundary, named)]
    assert len(named) == len(boundary)
    np.testing.assert_array_equal(*keys)
    area = vector_area(HEXAHEDRON, mesh.node[named])
    assert np.abs(area.sum(axis=(0, 1))).max() < 1e-12 * np.abs(area).sum()


def test_air_load_of_the_tip_is_complete() -> None:
    """Uniform pressure pushes aft with p pi (R^2 - bore^2); the tip's nodes have columns, the cut's among them."""
    mesh = full_mesh(sector("medium"))
    load = pressure_load(mesh, EXTERNAL)
    place = surface_points(mesh, EXTERNAL)
    force = (load @ np.ones(load.shape[1])).reshape(-1, 3).sum(axis=0)
    bore = np.hypot(*place[:, 1:].T).min()
    expected = np.pi * (body().radius(3.6) ** 2 - bore**2)
    assert bore < 2e-5
    np.testing.assert_allclose(force, [expected, 0.0, 0.0], rtol=1e-6, atol=1e-14)
    ahead = np.asarray(np.abs(load).sum(axis=0))[place[:, 0] < WALL.solid_tip_length]
    assert len(ahead) > 1000
    assert ahead.min() > 0.0


def test_paper_resolution_has_the_papers_size() -> None:
    fine = sector("paper")
    assert PAPER_DOFS <= fine.n_sectors * fine.n_dof < 1.05 * PAPER_DOFS


def test_sector_blocks_are_those_of_the_whole_stiffness() -> None:
    one = tube(0.2, 0.12, 0.13, 0.05, 8)
    blocks = sector_stiffness(one, {REGION: METAL})
    field = np.random.default_rng(0).normal(size=(8, one.n_dof))
    shifted = [np.roll(field, step, axis=0).T for step in (0, -1, 1)]
    in_frames = blocks.within @ shifted[0] + blocks.after @ shifted[1] + blocks.before @ shifted[2]
    turns = np.stack([one.rotation(s) for s in range(8)])

    def to_body(vector: np.ndarray) -> np.ndarray:
        return np.einsum("sij,snj->sni", turns, vector.reshape(8, -1, 3)).ravel()

    whole = assemble_stiffness(full_mesh(one), {REGION: METAL}) @ to_body(field)
    np.testing.assert_allclose(to_body(in_frames.T), whole, atol=1e-12 * np.abs(whole).max())


def strain_errors(resolution: str, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return differences from the Fourier model and its strains, (harmonic, load, meridional or hoop, n)."""
    fourier = shell_mesh(body(), WALL, 0.0075, 2)
    reference = harmonic_response(fourier, METAL, x, np.array([0.0, 3.6]), 4)
    one = sector(resolution)
    five = x < 1.75 - WALL.thickness * np.sin(np.deg2rad(3.0))
    angle = np.deg2rad(np.where(five, 5.0, 1.0))
    flank = np.where(five, x * np.tan(angle), body().radius(1.75) + (x - 1.75) * np.tan(angle))
    radius = flank - WALL.thickness / np.cos(angle)
    zero = np.zeros_like(x)
    position = np.column_stack([x, zero, radius])
    along, around = np.column_stack([np.cos(angle), zero, np.sin(angle)]), np.tile([0.0, 1.0, 0.0], (len(x), 1))
    rows = gauge_rows(full_mesh(one), gauges_at(np.tile(position, (2, 1)), np.concatenate([along, around])))
    share = surface_points(one, EXTERNAL)[:, 0] / 3.6
    expected, found = np.empty((5, 2, 2, len(x))), np.empty((5, 2, 2, len(x)))
    for m in range(5):
        field = harmonic_field(one, m, np.column_stack([1.0 - share, share]))
        found[m] = (rows @ field).T.reshape(2, 2, -1)
        expected[m] = np.stack([reference.meridional[:, m].T, reference.hoop[:, m].T], axis=1)
    return found - expected, expected


def test_vehicle_agrees_with_the_fourier_model() -> None:
    """Harmonics 0 to 4 under linear loads, medium mesh, 5 cm from tip, break and clamp: 1 % rms per harmonic.

    The Fourier model has the whole tip, so this also bounds what the bore and the cut do.
    """
    x = np.concatenate([np.linspace(0.15, 1.70, 16), np.linspace(1.80, 3.55, 16)])
    error, strain = strain_errors("medium", x)
    by_load = np.sqrt((error**2).mean(axis=(2, 3)) / (strain**2).mean(axis=(2, 3)))
    assert by_load.max() < 0.01
    hoop_and_axial = np.sqrt((error**2).mean(axis=3) / (strain**2).mean(axis=3))
    assert hoop_and_axial[1:].max() < 0.01


@pytest.mark.slow
def test_paper_resolution_agrees_with_the_fourier_model() -> None:
    x = np.concatenate([np.linspace(0.15, 1.70, 16), np.linspace(1.80, 3.55, 16)])
    error, strain = strain_errors("paper", x)
    by_load = np.sqrt((error**2).mean(axis=(2, 3)) / (strain**2).mean(axis=(2, 3)))
    assert by_load.max() < 0.003


def test_bore_and_cut_of_the_tip_are_not_felt() -> None:
    """Against the Fourier model, which has the whole tip: strain from 1 mm behind it under lateral pressure."""
    x, five = np.array([0.101, 0.11, 0.15]), np.deg2rad(5.0)
    fourier = shell_mesh(body(), WALL, 0.005, 2)
    reference = harmonic_response(fourier, METAL, x, np.array([0.0, 3.6]), 1).meridional[:, 1].sum(axis=1)
    fine = swept_wall(body(), WALL, SweptResolution(0.01, 2, 24))
    radius = x * np.tan(five) - WALL.thickness / np.cos(five)
    position = np.column_stack([x, np.zeros(3), radius])
    gauges = gauges_at(position, np.tile([np.cos(five), 0.0, np.sin(five)], (3, 1)))
    ones = np.ones(len(surface_nodes(fine, EXTERNAL)))
    found = gauge_rows(full_mesh(fine), gauges) @ harmonic_field(fine, 1, ones)
    np.testing.assert_allclose(found, reference, rtol=0.005)


@pytest.mark.parametrize(
    ("tip", "solid"),
    [
        (partial(spherical_cap_from, 0.02), 0.05),
        (partial(spherical_cap_from, 0.08), 0.02),
        (partial(power_law_from, 0.3), 0.05),
        (partial(power_law_from, 0.75), 0.05),
    ],
    ids=["cap", "hollow cap", "power law 0.3", "power law 0.75"],
)
def test_blunt_tips_are_meshed_whole(tip: SegmentMaker, solid: float) -> None:
    """Pressure is carried from the body onto the coarse mesh, whose cut is a fiftieth of the tip's radius."""
    blunt = chain_pieces([tip, partial(nine_degrees, 0.4)])
    mesh = full_mesh(swept_wall(blunt, Wall(0.002, solid, METAL), "coarse"))
    check_mesh(mesh, blunt.length)
    source, target = mesh_of_grid(surface_grid(blunt, 100, 96)), triangulated_surface(mesh, EXTERNAL)
    assert np.hypot(*target.point[target.point[:, 0].argmin(), 1:]) < 0.021 * blunt.radius(solid)
    newtonian = np.maximum(-source.node_normal[:, 0], 0.0) ** 2
    report = mapping_report(pressure_map(source, target), source, target, newtonian)
    check_mapping(report, MappingTolerances())
    assert report.largest_gap_point[0] > 0.3  # the chords round the base are further off than the tip


def test_the_coarsest_mesh_of_a_wide_body_may_check_another() -> None:
    """Its 16 chords round a base of a fifth of the length lie too deep for the mesh of a map."""
    wide = chain_pieces([partial(spherical_cap_from, 0.08), partial(nine_degrees, 1.6)])
    source = mesh_of_grid(surface_grid(wide, 100, 96))
    target = triangulated_surface(full_mesh(swept_wall(wide, Wall(0.004, 0.12, METAL), COARSEST)), EXTERNAL)
    newtonian = np.maximum(-source.node_normal[:, 0], 0.0) ** 2
    report = mapping_report(pressure_map(source, target), source, target, newtonian)
    check_mapping(report, TOLERANCES_OF_CHECK)
    with pytest.raises(InputError, match=r"one of the meshes is too coarse \(structure.resolution"):
        check_mapping(report, MappingTolerances())


def test_rounded_nose_of_sections_is_meshed() -> None:
    """Sections of a flattened sphere, the first of them ahead of a fiftieth of the tip: no element is folded."""
    turn, radius = np.deg2rad(np.arange(0.0, 82.0, 9.0)), 0.03
    x = np.append(radius * (1.0 - np.cos(turn)), 0.5)
    size = np.append(radius * np.sin(turn), 0.1)
    round_nose = SectionedBody(
        station=x, half_width=1.3 * size, half_height=size, exponent=np.full_like(x, 2.0), centre_z=0.0 * x
    )
    mesh = section_wall(round_nose, Wall(0.003, 0.06, METAL), RESOLUTIONS["coarse"])
    check_mesh(mesh, round_nose.length)
    assert mesh.node[:, 0].min() < 1e-4


def test_what_cannot_be_swept_is_refused() -> None:
    with pytest.raises(InputError, match="resolution 'fine' found, must be one of coarse, medium, paper"):
        swept_wall(body(), WALL, "fine")
    with pytest.raises(InputError, match="n_sectors 4 must be at least 6"):
        swept_wall(body(), WALL, SweptResolution(0.03, 1, 4))
    with pytest.raises(InputError, match="n_layers 0 must be at least 1"):
        swept_wall(body(), WALL, SweptResolution(0.03, 0, 24))
    with pytest.raises(InputError, match="reaches the axis cannot be swept"):
        tube(0.2, 0.0, 0.13, 0.05, 12)
    with pytest.raises(InputError, match="too short: the inner radius there is"):
        swept_wall(body(), Wall(0.004, 0.04, METAL))
    assert sorted(RESOLUTIONS) == ["coarse", "medium", "paper"]
