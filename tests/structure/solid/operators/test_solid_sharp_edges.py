"""Surfaces split at sharp edges: a column of the load per side."""

import numpy as np
import pytest
from solid_bodies import cube

from builder.aero.mapping_report import mapping_report
from builder.aero.pressure_map import pressure_map
from builder.structure.solid.nodal_loads import pressure_load, split_surface, triangulated_surface
from builder.structure.solid.solid_mesh import EXTERNAL, SolidMesh

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module", params=["hexahedron20", "tetrahedron10"])
def block(request: pytest.FixtureRequest) -> SolidMesh:
    """Return the unit cube with all six sides external."""
    mesh = cube(request.param, 3)
    mesh.surface[EXTERNAL] = np.concatenate(list(mesh.surface.values()))
    return mesh


def test_every_side_has_its_own_nodes(block: SolidMesh) -> None:
    surface, column = split_surface(block, EXTERNAL)
    facet = block.named_surface(EXTERNAL)
    np.testing.assert_array_equal(surface.point[column], block.node[facet])
    normal = np.abs(surface.node_normal)
    np.testing.assert_allclose(normal.max(axis=1), 1.0, atol=1e-12)
    assert surface.n_nodes == 6 * (surface.n_nodes // 6)
    assert surface.n_nodes > len(np.unique(facet))


def test_load_of_one_side_is_that_side_alone(block: SolidMesh) -> None:
    """Pressure 1 on the nodes of the side z = 1 presses with 1 N along -z; unsplit, the edges press the sides."""
    surface, column = split_surface(block, EXTERNAL)
    top = surface.node_normal[:, 2] > 0.5
    force = (pressure_load(block, EXTERNAL, column) @ top.astype(float)).reshape(-1, 3).sum(axis=0)
    np.testing.assert_allclose(force, [0.0, 0.0, -1.0], atol=1e-12)
    whole = pressure_load(block, EXTERNAL)
    split = pressure_load(block, EXTERNAL, column)
    np.testing.assert_allclose(whole @ np.ones(whole.shape[1]), split @ np.ones(split.shape[1]), atol=1e-14)


def test_split_target_takes_its_pressure_without_loss(block: SolidMesh) -> None:
    """Another triangulation of the cube with a pressure per side: every node fits, force to rounding."""
    other = cube("tetrahedron10", 4)
    other.surface[EXTERNAL] = np.concatenate(list(other.surface.values()))
    source = split_surface(other, EXTERNAL)[0]
    pressure = source.node_normal @ np.array([3.0, 2.0, 1.0]) + 4.0
    for target, lost in ((split_surface(block, EXTERNAL)[0], 0.0), (triangulated_surface(block, EXTERNAL), 0.02)):
        report = mapping_report(pressure_map(source, target), source, target, pressure)
        assert report.unfitted_fraction == 0.0
        assert (
            report.force_residual_relative == pytest.approx(lost, abs=1e-12)
            or report.force_residual_relative > lost
        )
