"""Observability by a layout, against closed forms on a cylinder, and on the shipped vehicle's layouts."""

from math import pi, sqrt

import numpy as np
import pytest

from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.structure.fourier.fourier_model import StructuralModel, structural_model
from builder.structure.observability import (
    SYMMETRIES,
    SmoothResponse,
    Symmetry,
    angle_from_meridian,
    direction_names,
    smooth_response,
    symmetry_responses,
    wave_names,
    wave_response,
)
from builder.structure.solid.cyclic import CyclicSolver, cyclic_problem, pressure_operator, sector_rows
from builder.structure.solid.gauge_rows import gauges_at
from builder.structure.solid.nodal_loads import triangulated_surface
from builder.structure.solid.supports import Clamped
from builder.structure.solid.swept_mesh import REGION, SweptResolution, SweptSector, full_mesh, swept_wall
from builder.structure.wall import wall_of
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.model_entries import Resolution
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

LENGTH, RADIUS = 3.0, 0.2
AREA = 2.0 * pi * RADIUS * LENGTH
LAYOUTS = ["configuration_1", "configuration_2", "configuration_45"]


def cylinder(n_x: int = 61, n_roll: int = 48) -> SurfaceMesh:
    """A cylinder from x = 0.5 m on; its triangles are flat, so its area is short by 0.07 % with 48 roll angles."""
    x = 0.5 + LENGTH * (0.5 - 0.5 * np.cos(pi * np.linspace(0.0, 1.0, n_x)))  # uneven on purpose
    return mesh_of_grid(SurfaceGrid(x=x, radius=np.full(n_x, RADIUS), angle=np.zeros(n_x), n_roll=n_roll))


def roll_of(mesh: SurfaceMesh) -> FloatArray:
    return np.arctan2(mesh.point[:, 1], mesh.point[:, 2])


def scaled_x(mesh: SurfaceMesh) -> FloatArray:
    return 2.0 * (mesh.point[:, 0] - 0.5) / LENGTH - 1.0


def test_gauge_that_reads_cos_2_phi_alone() -> None:
    """Strain = c times the integral of cos(2 phi) p: greatest for p = sqrt(2) cos(2 phi), c A/sqrt(2).

    Tolerance 0.2 %: lumped areas. The other waves, and all other symmetries, are rounding.
    """
    mesh, c = cylinder(), 3e-9
    z = (c * np.cos(2.0 * roll_of(mesh)) * mesh.node_area)[None, :]
    response = smooth_response(z, mesh.point, mesh.node_area)
    expected = c * AREA / sqrt(2.0)
    waves = dict(zip(wave_names(), wave_response(response)[0], strict=True))
    assert waves.pop("cos 2") == pytest.approx(expected, rel=2e-3)
    assert max(waves.values()) < 1e-12 * expected
    assert response.singular_values() == pytest.approx([expected], rel=2e-3)
    for found in symmetry_responses(response):
        even = found.symmetry == Symmetry(even_in_y=True, even_in_z=True)
        assert found.blind != even
        assert found.norm == pytest.approx(expected if even else 0.0, rel=2e-3, abs=1e-12 * expected)


def test_singular_values_of_orthogonal_gauges() -> None:
    """Each gauge weighs pressure with its own P_k(x) cos or sin(m phi): root of the mean square of that, times A.

    The mean square of P_k is 1/(2 k + 1), of a wave 1/2. Tolerance 0.3 %: lumped areas.
    """
    mesh = cylinder(81)
    phi, x = roll_of(mesh), scaled_x(mesh)
    weight = np.stack([np.ones_like(x), 2.0 * x * np.sin(phi), 5.0 * (1.5 * x**2 - 0.5) * np.cos(4.0 * phi)])
    response = smooth_response(weight * mesh.node_area, mesh.point, mesh.node_area)
    expected = np.array([1.0, 2.0 * sqrt(1.0 / 6.0), 5.0 * sqrt(1.0 / 10.0)]) * AREA
    np.testing.assert_allclose(response.singular_values(), np.sort(expected)[::-1], rtol=3e-3)
    np.testing.assert_allclose(
        [response.at_gauges(np.array([i])).singular_values()[0] for i in range(3)], expected, rtol=3e-3
    )


def test_influence_is_what_the_gauge_weighs_pressure_with() -> None:
    mesh = cylinder(81)
    phi, x = roll_of(mesh), scaled_x(mesh)
    weight = 1.0 + 4.0 * x**3 * np.cos(3.0 * phi) - 2.0 * np.sin(phi)
    response = smooth_response((weight * mesh.node_area)[None], mesh.point, mesh.node_area)
    place, roll = np.array([0.5, 1.1, 3.5]), np.array([0.0, 0.4, 4.0])
    at = 2.0 * (place - 0.5) / LENGTH - 1.0
    expected = 1.0 + 4.0 * at[:, None] ** 3 * np.cos(3.0 * roll) - 2.0 * np.sin(roll)
    np.testing.assert_allclose(response.influence(place, roll)[0], expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("symmetry", SYMMETRIES, ids=str)
def test_classes_are_those_of_mirrored_pressures(symmetry: Symmetry) -> None:
    """A gauge that reads a pressure's value at one point and, mirrored, at three others with the class's signs."""
    mesh = cylinder(61, 48)
    point = mesh.point
    node = int(np.argmin(np.linalg.norm(point - [2.0, RADIUS * np.sin(0.52), RADIUS * np.cos(0.52)], axis=1)))
    z = np.zeros((1, len(point)))
    for sign_y in (1, -1):
        for sign_z in (1, -1):
            image = point[node] * [1, sign_y, sign_z]
            other = int(np.argmin(np.linalg.norm(point - image, axis=1)))
            sign = (1 if symmetry.even_in_y else sign_y) * (1 if symmetry.even_in_z else sign_z)
            z[0, other] = 1e-9 * sign
    for found in symmetry_responses(smooth_response(z, point, mesh.node_area)):
        assert found.rank == (1 if found.symmetry == symmetry else 0)


def test_rank_counts_what_is_above_the_threshold() -> None:
    """Four gauges under even pressure, of strength 1, 0.5, 0.02 and 0.002 of the first."""
    mesh = cylinder()
    phi = roll_of(mesh)
    waves = np.stack([np.cos(m * phi) for m in (2, 4, 6, 8)]) * mesh.node_area
    response = smooth_response(waves * np.array([[1.0], [0.5], [0.02], [0.002]]), mesh.point, mesh.node_area)
    even = symmetry_responses(response)[0]
    assert even.rank == 3
    np.testing.assert_allclose(even.singular_values[1:4] / even.norm, [0.5, 0.02, 0.002], rtol=1e-6)
    assert symmetry_responses(response, threshold=0.1)[0].rank == 2


def test_waves_and_singular_values_do_not_depend_on_the_mesh() -> None:
    """The columns of Z_p shrink with the nodes' areas; from 48 to 96 stations results move by under 0.5 %."""

    def found(n_x: int, n_roll: int) -> tuple[FloatArray, FloatArray]:
        mesh = cylinder(n_x, n_roll)
        roll, x = roll_of(mesh), scaled_x(mesh)
        away = [(x - c) ** 2 / 0.02 + 4.0 * np.sin(0.5 * (roll - c)) ** 2 for c in (0.1, 0.5)]
        weight = np.exp(-np.stack(away))
        response = smooth_response(weight * mesh.node_area, mesh.point, mesh.node_area)
        return response.singular_values(), wave_response(response)

    for coarse, fine in zip(found(81, 48), found(161, 72), strict=True):
        np.testing.assert_allclose(coarse, fine, rtol=5e-3)


@pytest.fixture(scope="module")
def fourier() -> StructuralModel:
    """The shipped vehicle by the Fourier model, coarse, with all its layouts."""
    resolution = Resolution(
        radial_cells=8,
        circumferential_cells=8,
        surface_stations=80,
        surface_roll_angles=48,
        harmonics=10,
        element_length_mm=30.0,
        wall_layers=1,
    )
    return structural_model(load_vehicle(IC3X), resolution, LAYOUTS)


def response_of(model: StructuralModel, layout: str) -> SmoothResponse:
    mesh = mesh_of_grid(model.surface)
    return smooth_response(model.strain_operator(layout), mesh.point, mesh.node_area)


@pytest.mark.parametrize(
    ("layout", "blind"), [("configuration_1", True), ("configuration_2", True), ("configuration_45", False)]
)
def test_rows_at_right_angles_are_blind_to_doubly_odd_pressure(
    fourier: StructuralModel, layout: str, blind: bool
) -> None:
    """Axial and hoop gauges at 0, 90, 180, 270 deg lie where sin(2 phi), sin(4 phi), ... strain nothing.

    Exact on a body of revolution: 1e-12 of the greatest. Hoop gauges at 45 deg see such pressure like any other.
    """
    found = {str(one.symmetry): one for one in symmetry_responses(response_of(fourier, layout))}
    doubly_odd = found.pop("odd in y, odd in z")
    strongest = max(one.norm for one in found.values())
    assert doubly_odd.blind == blind
    assert not any(one.blind for one in found.values())
    if blind:
        assert doubly_odd.norm < 1e-12 * strongest
    else:
        assert doubly_odd.norm > 0.5 * strongest
        assert doubly_odd.rank >= 4


def test_swept_mesh_is_as_blind(fourier: StructuralModel) -> None:
    """Gauges on the line between two sectors take the mean of both, so the mesh keeps the symmetry: 1e-9.

    That is round-off times the condition of the stiffness; one side's strain alone would leave 2e-3.
    """
    vehicle, layout = load_vehicle(IC3X), fourier.layouts["configuration_2"]
    sector = swept_wall(vehicle.body(), wall_of(vehicle), "coarse")
    found = {str(one.symmetry): one for one in symmetry_responses(response_on_mesh(vehicle, sector, layout))}
    doubly_odd = found.pop("odd in y, odd in z")
    assert doubly_odd.norm < 1e-9 * max(one.norm for one in found.values())


def response_on_mesh(vehicle: Vehicle, sector: SweptSector, layout: GaugeLayout) -> SmoothResponse:
    problem = cyclic_problem(sector, {REGION: wall_of(vehicle).material}, [Clamped("support")])
    rows = sector_rows(sector, gauges_at(layout.position, layout.direction, layout.names))
    z = CyclicSolver(problem).strain_operator(rows, pressure_operator(sector, "external"))
    mesh = triangulated_surface(full_mesh(sector), "external")
    return smooth_response(z, mesh.point, mesh.node_area)


def test_three_dimensional_mesh_sees_what_the_fourier_model_sees(
    fourier: StructuralModel,
) -> None:
    """Another model on quadratic facets, 24 elements round the axis: 2 % of the greatest wave response.

    Dividing columns by the root of the nodal area instead would be 1.7 times too much here.
    """
    vehicle, layout = load_vehicle(IC3X), fourier.layouts["configuration_2"]
    sector = swept_wall(vehicle.body(), wall_of(vehicle), SweptResolution(0.04, 1, 24))
    solid = response_on_mesh(vehicle, sector, layout)
    flat = response_of(fourier, "configuration_2")
    expected = wave_response(flat)
    np.testing.assert_allclose(wave_response(solid), expected, rtol=0.0, atol=0.02 * expected.max())
    np.testing.assert_allclose(solid.singular_values()[:10], flat.singular_values()[:10], rtol=0.02)


def test_angles_from_the_meridian() -> None:
    """At roll angle 120 deg on a cone of 10 deg: axial, against it, hoop both ways, and 30 deg to either side."""
    roll, lean = np.deg2rad(120.0), np.deg2rad(10.0)
    out = np.array([0.0, np.sin(roll), np.cos(roll)])
    aft = np.cos(lean) * np.array([1.0, 0.0, 0.0]) + np.sin(lean) * out
    across = np.array([0.0, np.cos(roll), -np.sin(roll)])
    slanted = np.cos(pi / 6.0) * aft + 0.5 * across
    other = np.cos(pi / 6.0) * aft - 0.5 * across
    direction = np.stack([aft, -2.0 * aft, across, -across, slanted, -slanted, other])
    position = np.tile(0.1 * out + [1.0, 0.0, 0.0], (len(direction), 1))
    found = np.degrees(angle_from_meridian(position, direction))
    np.testing.assert_allclose(found, [0.0, 0.0, 90.0, 90.0, 30.0, 30.0, -30.0], atol=1e-6)
    names = ["axial", "axial", "hoop", "hoop", "30.0 deg", "30.0 deg", "-30.0 deg"]
    assert direction_names(position, direction) == names


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("nan", "strain operator: holds a value that is not finite"),
        ("area", "areas must be at least 0"),
        ("shape", "found, must be n_d x n_p, n_p x 3 and n_p"),
    ],
)
def test_bad_input_is_refused(change: str, message: str) -> None:
    mesh = cylinder(31, 24)
    z, area = np.ones((2, mesh.n_nodes)), mesh.node_area.copy()
    if change == "nan":
        z[1, 3] = np.nan
    elif change == "area":
        area[0] = -1.0
    else:
        z = z[:, :-1]
    with pytest.raises(InputError, match=message):
        smooth_response(z, mesh.point, area)


@pytest.mark.parametrize(("n_x", "n_roll"), [(12, 48), (61, 12)])
def test_a_surface_too_coarse_is_refused(n_x: int, n_roll: int) -> None:
    """12 stations do not carry degree 20, 12 roll angles not harmonic 8."""
    mesh = cylinder(n_x, n_roll)
    with pytest.raises(InputError, match="do not distinguish pressures of degree 20 in x and harmonic 8"):
        smooth_response(np.ones((1, mesh.n_nodes)), mesh.point, mesh.node_area)
