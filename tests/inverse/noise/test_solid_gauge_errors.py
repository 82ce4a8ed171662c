"""Position and orientation errors of gauges on the three-dimensional model, against the Fourier model's."""

from dataclasses import replace

import numpy as np
import pytest
from inverse_case import Case

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.noise.hardware_errors import strain_derivatives
from builder.inverse.noise.model import NoiseTerm
from builder.inverse.problem import inverse_problem
from builder.reporting import Silent
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import harmonic_response
from builder.structure.mapped_structure import MappedStructure, mapped_structure
from builder.structure.solid.case import structure_case
from builder.structure.solid.gauge_layouts import displaced_gauges
from builder.structure.solid.gauge_rows import gauges_at
from builder.structure.solid.mesh_choice import MeshChoice
from builder.structure.solid.solid_model import solve_solid_structure
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import Noise
from strainfmu.errors import InputError
from strainfmu.estimator.reference.gain import load_covariance

LAYOUT = "configuration_1"
PLAIN = Noise(std_um_per_m=0.4).without_hardware_errors()
ERRORS = PLAIN.model_copy(update={"gauge_position_mm": 2.0, "gauge_orientation_deg": 1.0})
NAMES = ("gauge position, axial", "gauge position, circumferential", "gauge orientation")


@pytest.fixture(scope="module")
def uncertain(vehicle: Vehicle) -> Vehicle:
    """The shipped vehicle with its 27 gauges, placed within 2 mm and 1 degree."""
    gauges = vehicle.gauges.model_copy(update={"layout": LAYOUT})
    return vehicle.model_copy(update={"noise": ERRORS, "gauges": gauges})


@pytest.fixture(scope="module")
def solid(uncertain: Vehicle, snapshots: Snapshots) -> MappedStructure:
    case = structure_case(uncertain, [LAYOUT], MeshChoice(resolution="coarse"))
    return mapped_structure(solve_solid_structure(case, Silent()), snapshots)


def terms_of(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel | MappedStructure
) -> dict[str, NoiseTerm]:
    return {term.name: term for term in inverse_problem(vehicle, snapshots, structure).noise}


def test_both_models_give_the_same_terms(
    uncertain: Vehicle, snapshots: Snapshots, structure: StructuralModel, solid: MappedStructure
) -> None:
    """Each gauge's standard deviation within 5 % of the largest, root mean squares within 3 %.

    The Fourier model's mesh is refined to 20 mm here; the solid one is its coarsest.
    """
    fine = uncertain.resolution.map.model_copy(update={"element_length_mm": 20.0, "wall_layers": 2})
    refined = uncertain.model_copy(update={"resolution": uncertain.resolution.model_copy(update={"map": fine})})
    mesh = shell_mesh(refined.body(), wall_of(refined), 0.02, 2)
    placed = structure.placed[LAYOUT]
    response = harmonic_response(mesh, wall_of(refined).material, placed.x, structure.surface.x, 10)
    fourier = replace(structure, response=response, placed={LAYOUT: placed})
    expected, found = terms_of(refined, snapshots, fourier), terms_of(uncertain, snapshots, solid)
    assert [name for name in found if not name.startswith("mesh")] == ["gauge noise", *NAMES]
    assert list(expected) == ["gauge noise", *NAMES]
    for name in NAMES:
        std = np.diag(expected[name].strain)
        np.testing.assert_allclose(np.diag(found[name].strain), std, rtol=0.0, atol=0.05 * std.max(), err_msg=name)
        assert np.linalg.norm(found[name].strain) == pytest.approx(np.linalg.norm(std), rel=0.03)


def test_the_map_counts_them_and_knows_less(
    uncertain: Vehicle, snapshots: Snapshots, solid: MappedStructure
) -> None:
    """Listed with their fractions; no sigma of a load is smaller than without."""
    without = uncertain.model_copy(update={"noise": PLAIN})
    plain, counted = (build_inverse_map(one, snapshots, solid) for one in (without, uncertain))
    names = [term["name"] for term in counted.provenance["noise_terms"]]
    assert [name for name in names if not name.startswith("mesh")] == ["gauge noise", *NAMES, "truncated modes"]
    assert np.all(np.diag(load_covariance(counted)) > np.diag(load_covariance(plain)))


def test_turned_gauges_are_the_tensor(uncertain: Vehicle, solid: MappedStructure) -> None:
    """e(45 deg) + e(-45 deg) = e_axial + e_hoop where a row has both: one strain tensor at one position.

    To 0.3 % of the largest: strain is recovered from the mesh direction by direction.
    """
    z = solid.operators
    both = z[f"{LAYOUT} (turned around)"] + z[f"{LAYOUT} (turned back)"]
    names = solid.layouts[LAYOUT].names
    axial = [names.index(f"axial_180deg_{i}") for i in range(1, 10)]
    hoop = [names.index(f"hoop_180deg_{i}") for i in range(1, 10)]
    total = z[LAYOUT][axial] + z[LAYOUT][hoop]
    np.testing.assert_allclose(both[axial], total, rtol=0.0, atol=3e-3 * np.abs(total).max())
    np.testing.assert_allclose(both[hoop], total, rtol=0.0, atol=3e-3 * np.abs(total).max())
    # What a gauge reads across is the other gauge of the two.
    key = ("transverse_sensitivity", 0)
    across = strain_derivatives(uncertain, solid, LAYOUT, [key])[key]
    np.testing.assert_allclose(across[axial], z[LAYOUT][hoop], rtol=0.0, atol=3e-3 * np.abs(total).max())
    np.testing.assert_allclose(across[hoop], z[LAYOUT][axial], rtol=0.0, atol=3e-3 * np.abs(total).max())
    # Of the two, turning the axial gauge and turning the hoop gauge change strain by opposite amounts.
    key = ("orientation", 0)
    change = strain_derivatives(uncertain, solid, LAYOUT, [key])[key]
    np.testing.assert_allclose(change[hoop], -change[axial], rtol=0.0, atol=3e-3 * np.abs(change).max())


def test_gauges_are_moved_by_a_millimetre_and_stay_on_the_surface(vehicle: Vehicle) -> None:
    """Outer surface: distances 1 mm, off it by less than 1e-6 m; directions keep their angle to the meridian."""
    body = vehicle.body()
    x, roll = np.array([0.5, 1.2, 2.5]), np.array([0.3, 2.0, 4.0])
    angle = body.angle(x)
    outwards = np.column_stack([0.0 * x, np.sin(roll), np.cos(roll)])
    position = np.column_stack([x, 0.0 * x, 0.0 * x]) + body.radius(x)[:, None] * outwards
    aft = np.column_stack([np.cos(angle), 0.0 * x, 0.0 * x]) + np.sin(angle)[:, None] * outwards
    moved = displaced_gauges("a", gauges_at(position, aft), body)
    for how in ("moved aft", "moved fore", "moved around", "moved back"):
        there = moved[f"a ({how})"]
        step = np.linalg.norm(there.position - position, axis=1)
        np.testing.assert_allclose(step, 1e-3, rtol=1e-4)
        radius = np.hypot(there.position[:, 1], there.position[:, 2])
        np.testing.assert_allclose(radius, body.radius(there.position[:, 0]), atol=1e-6)
        np.testing.assert_allclose(there.direction[:, 0], np.cos(angle), rtol=1e-12)
    turned = moved["a (turned around)"].direction
    np.testing.assert_allclose(np.sum(turned * aft, axis=1), np.cos(np.pi / 4.0) * np.sqrt(2.0), rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), np.sqrt(2.0), rtol=1e-12)


def test_a_structure_without_moved_gauges_says_so(
    uncertain: Vehicle, snapshots: Snapshots, structure: StructuralModel, case: Case
) -> None:
    operators = {LAYOUT: structure.strain_operator(LAYOUT)}
    alone = MappedStructure(
        surface=structure.surface, description="solid", layouts=structure.layouts, operators=operators
    )
    with pytest.raises(InputError, match=r"structure: layout 'configuration_1 \(moved aft\)' is missing"):
        inverse_problem(uncertain, snapshots, alone)


def test_without_such_errors_nothing_is_moved(vehicle: Vehicle) -> None:
    assert list(structure_case(vehicle, [LAYOUT]).layouts) == [LAYOUT]
    other = vehicle.model_copy(update={"noise": ERRORS})
    # The layout in use alone has errors; the one that noise is measured on has none.
    assert list(structure_case(other, [LAYOUT]).layouts) == [LAYOUT]
