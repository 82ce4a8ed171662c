"""Error of strain by the mesh: measured in sigma, held by the noise, said where it is too large."""

import numpy as np
import pytest

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.inverse.noise.hardware_errors import mesh_error_notes
from builder.inverse.problem import inverse_problem
from builder.structure.fourier.fourier_model import StructuralModel, structural_model, with_mesh_error
from builder.structure.mapped_structure import MappedStructure
from builder.vehicle.file import Vehicle


@pytest.fixture(scope="module")
def checked(vehicle: Vehicle, structure: StructuralModel) -> StructuralModel:
    return with_mesh_error(structure, vehicle, vehicle.resolution.map)


def test_it_is_of_the_size_of_the_true_error(vehicle: Vehicle, checked: StructuralModel) -> None:
    """Against elements an eighth as long: the estimate is at least the true error, and at most six times it."""
    layout = vehicle.gauges.layout
    fine = vehicle.resolution.map.model_copy(update={"element_length_mm": 5.0, "wall_layers": 2})
    exact = structural_model(vehicle, fine, [layout]).strain_operator(layout)
    estimate = checked.error_operator(layout)
    assert estimate is not None
    x = np.repeat(checked.surface.x / checked.surface.x[-1], checked.surface.n_roll)
    roll = np.tile(checked.surface.roll_angle, len(checked.surface.x))
    loads = np.stack([x ** (k % 2) * np.cos(k // 2 * roll) for k in range(8)])
    true, found = (np.linalg.norm(loads @ z.T) for z in (exact - checked.strain_operator(layout), estimate))
    assert true < found < 6.0 * true


def test_the_noise_holds_it(vehicle: Vehicle, snapshots: Snapshots, checked: StructuralModel) -> None:
    """Its variance is that of the difference, half of it common to all gauges."""
    problem = inverse_problem(vehicle, snapshots, checked)
    terms = {term.name: term for term in problem.noise}
    each, common = terms["mesh, of each gauge"], terms["mesh, in common"]
    assert not each.hardware
    assert problem.mesh is not None
    weight, error = problem.ensemble.member_weight, checked.error_operator(vehicle.gauges.layout)
    assert error is not None
    by_operator = problem.ensemble.responses(error)
    np.testing.assert_allclose(problem.mesh.strain, by_operator, rtol=0.0, atol=1e-13 * np.abs(by_operator).max())
    square = np.average(problem.mesh.strain**2, axis=0, weights=weight)
    for term in (each, common):
        np.testing.assert_allclose(np.diag(term.covariance), 0.5 * square, rtol=1e-6)


def test_above_one_sigma_the_map_says_so(vehicle: Vehicle, snapshots: Snapshots, checked: StructuralModel) -> None:
    layout = vehicle.gauges.layout
    error = checked.error_operator(layout)
    assert error is not None
    rough = MappedStructure(
        surface=checked.surface,
        description="rough",
        layouts=checked.layouts,
        operators={name: checked.strain_operator(name) for name in checked.layouts},
        error_operators={layout: 10.0 * error},
        checked_against="a rough mesh",
        is_external=True,
    )
    plain = vehicle.model_copy(update={"noise": vehicle.noise.without_hardware_errors()})
    found = build_inverse_map(plain, snapshots, rough).provenance
    assert found["mesh_error"]["rms_sigma"] > 1.0
    assert not found["mesh_error"]["sigmas_trusted"]
    notes = mesh_error_notes(found)
    assert "against a rough mesh" in notes[0]
    assert notes[1].startswith("warning: the mesh's error is above 1 sigma")


@pytest.mark.fast
def test_nothing_is_said_of_what_is_not_known() -> None:
    assert mesh_error_notes({}) == []
