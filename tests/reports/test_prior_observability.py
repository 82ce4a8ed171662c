"""Classes of symmetry and observability, against constructed pressures and snapshots flown one by one."""

from dataclasses import replace

import numpy as np
import pytest
from ensembles import listed_ensemble
from report_case import CASE_1, CASE_2, ReportCase, case_of

from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.model import gauge_noise
from builder.inverse.solution import Problem
from builder.reports.findings.prior_observability import (
    PriorObservability,
    mirror_operators,
    prior_observability,
    symmetric_part,
)
from builder.reports.page.page_tables import percent
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.observability import SYMMETRIES
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import MapEntry, Noise
from builder.vehicle.shape.geometry import SurfaceGrid
from builder.vehicle.shape.shape_entries import ReferenceQuantities

Parts = tuple[Vehicle, Snapshots, StructuralModel]

N_ROLL, STATIONS = 24, 21
GRID = SurfaceGrid(
    x=np.linspace(0.0, 2.0, STATIONS), radius=np.full(STATIONS, 0.1), angle=np.zeros(STATIONS), n_roll=N_ROLL
)
ODD_GRID = replace(GRID, n_roll=25)
ODD_ODD = [str(one) for one in SYMMETRIES].index("odd in y, odd in z")
EVEN_ODD = [str(one) for one in SYMMETRIES].index("even in y, odd in z")


def constructed(correlated: bool, grid: SurfaceGrid = GRID) -> tuple[PriorObservability, float]:
    """cos(phi) of 300 Pa and sin(2 phi) of 100 Pa over gauges that feel 1, cos, sin; fraction of the second."""
    phi = np.tile(grid.roll_angle, STATIONS)
    random = np.random.default_rng(5)
    first = random.normal(size=40)
    second = first if correlated else random.normal(size=40)
    first, second = first - first.mean(), second - second.mean()
    if not correlated:
        second -= first * (first @ second) / (first @ first)
    pressure = 5e3 + np.outer(300.0 * first, np.cos(phi)) + np.outer(100.0 * second, np.sin(2.0 * phi))
    area = mesh_of_grid(grid).node_area
    at = np.radians([0.0, 90.0, 180.0, 270.0])
    strain_operator = 1e-9 * (1.0 + np.cos(phi - at[:, None])) * area
    noise = (gauge_noise(np.diag(np.full(4, 1e-12) ** 2)),)
    entry = MapEntry(case=2, gamma=1.0)
    problem = Problem(
        ensemble=listed_ensemble(pressure),
        errors=(),
        strain_operator=strain_operator,
        load_operator=np.ones((5, len(phi))),
        node_area=area,
        noise=noise,
        entry=entry,
        tolerances=Noise(std_um_per_m=1.0),
        reference=ReferenceQuantities(1.0, 1.0, 0.0),
        inside="ambient",
    )
    # Both waves have a mean square of 1/2 over the area.
    fraction = (100.0**2 * second @ second) / (300.0**2 * first @ first + 100.0**2 * second @ second)
    return prior_observability(problem, problem.solution, grid), fraction


@pytest.mark.parametrize("grid", [GRID, ODD_GRID], ids=["24 roll angles", "25 roll angles"])
def test_blind_share_of_a_constructed_case(grid: SurfaceGrid) -> None:
    """sin(2 phi) is odd in y and z: its fraction by the amplitudes; uncorrelated, none of it is removed."""
    observed, fraction = constructed(correlated=False, grid=grid)
    assert observed.class_fraction[ODD_ODD] == pytest.approx(fraction, rel=1e-9)
    assert observed.class_fraction[EVEN_ODD] == pytest.approx(1.0 - fraction, rel=1e-9)
    assert observed.class_fraction.sum() == pytest.approx(1.0, rel=1e-12)
    assert observed.class_strain[ODD_ODD] < 1e-12 * observed.class_strain[EVEN_ODD]
    assert observed.class_removed[ODD_ODD] == pytest.approx(0.0, abs=1e-6)
    assert observed.class_removed[EVEN_ODD] > 0.999
    assert observed.removed == pytest.approx(1.0 - fraction, abs=1e-3)
    assert observed.mode_classes[0, EVEN_ODD] == pytest.approx(1.0, abs=1e-9)
    assert observed.mode_classes[1, ODD_ODD] == pytest.approx(1.0, abs=1e-9)
    empty = np.isnan(observed.class_removed)
    assert empty.sum() == 2  # the classes that hold nothing


@pytest.mark.fast
def test_what_is_not_removed_is_zero_without_a_sign() -> None:
    """Of a class that no gauge observes round-off removes -1e-16: on a page that was -0.0 %."""
    found, _ = constructed(correlated=False)
    assert found.class_removed[ODD_ODD] == 0.0
    assert percent(found.class_removed[ODD_ODD]) == "0.0 %"
    assert percent(-1e-9) == "0.0 %"
    assert percent(-0.01) == "-1.0 %"


def test_blind_pressure_is_inferred_from_what_flies_with_it() -> None:
    """One amplitude for both waves: the unobserved one is known as well as the observed one."""
    observed, fraction = constructed(correlated=True)
    assert observed.class_fraction[ODD_ODD] == pytest.approx(fraction, rel=1e-9)
    assert observed.class_strain[ODD_ODD] < 1e-12 * observed.class_strain[EVEN_ODD]
    assert observed.class_removed[ODD_ODD] == pytest.approx(observed.class_removed[EVEN_ODD], rel=1e-9)
    assert observed.class_removed[ODD_ODD] > 0.999


@pytest.mark.parametrize("grid", [GRID, ODD_GRID], ids=["24 roll angles", "25 roll angles"])
def test_parts_add_up_and_have_their_symmetry(grid: SurfaceGrid) -> None:
    field = np.random.default_rng(1).normal(size=(grid.n_nodes, 3))
    mirrors = mirror_operators(grid)
    assert mirrors is not None
    parts = [symmetric_part(field, mirrors, one.even_in_y, one.even_in_z) for one in SYMMETRIES]
    np.testing.assert_allclose(sum(parts), field, atol=1e-14)
    for one, part in zip(SYMMETRIES, parts, strict=True):
        for mirror, even in zip(mirrors, (one.even_in_y, one.even_in_z), strict=True):
            np.testing.assert_allclose(mirror @ part, part if even else -part, atol=1e-14)


@pytest.mark.parametrize("n_roll", [3, 24, 25])
def test_mirrors_of_waves(n_roll: int) -> None:
    """cos and sin of every harmonic that the nodes carry: mirrored in y phi becomes -phi, in z pi - phi."""
    grid = replace(GRID, n_roll=n_roll)
    mirrors = mirror_operators(grid)
    assert mirrors is not None
    phi = np.tile(grid.roll_angle, STATIONS)
    for m in range((n_roll - 1) // 2 + 1):
        for wave in (np.cos, np.sin):
            np.testing.assert_allclose(mirrors[0] @ wave(m * phi), wave(-m * phi), atol=1e-13)
            np.testing.assert_allclose(mirrors[1] @ wave(m * phi), wave(m * (np.pi - phi)), atol=1e-12)


def test_mirrors_of_a_free_mesh_are_those_of_the_grid() -> None:
    """A mesh whose nodes mirror onto nodes: the closest point is the node, to 1e-9."""
    of_grid, of_mesh = mirror_operators(GRID), mirror_operators(mesh_of_grid(GRID))
    assert of_grid is not None
    assert of_mesh is not None
    field = np.random.default_rng(2).normal(size=GRID.n_nodes)
    for grid, mesh in zip(of_grid, of_mesh, strict=True):
        np.testing.assert_allclose(mesh @ field, grid @ field, atol=1e-9)


def test_a_body_without_symmetry_has_no_classes(case_1: ReportCase) -> None:
    """A bent surface: fractions are not given, the rest is."""
    case = case_1
    mesh = mesh_of_grid(case.structure.surface)
    bent = replace(mesh, point=mesh.point + np.outer(0.1 * mesh.point[:, 0] ** 2, [0.0, 1.0, 1.0]))
    assert mirror_operators(bent) is None
    observed = prior_observability(case.problem, case.solution, bent)
    assert np.isnan(observed.class_fraction).all()
    assert 0.0 < observed.removed <= 1.0


def test_removed_variance_is_that_of_snapshots_flown_one_by_one(case: ReportCase) -> None:
    """Fields estimated from each snapshot's strain, and the noise's part: mean square error over area.

    To 1e-5: modes below 3e-4 of the first are left out of a rolled ensemble.
    """
    problem, solution = case.problem, case.solution
    observed = prior_observability(problem, solution, case.structure.surface)
    ensemble = problem.ensemble
    pressure = np.concatenate(list(ensemble.members()))
    # Of listed flows the unbiased variance; a rolled ensemble's is the mean over all roll angles.
    weight = ensemble.member_weight * (1.0 if ensemble.grid is not None else len(pressure) / (len(pressure) - 1))
    strain = ensemble.responses(problem.strain_operator)
    states = strain @ solution.solved.strain_gain.T + solution.solved.state_offset
    error = solution.mean + states @ solution.field_modes.T - pressure
    area = problem.node_area / problem.node_area.sum()
    of_strain = solution.field_modes @ solution.solved.strain_gain
    of_noise = sum(np.sum(term.by_gain(of_strain) ** 2, axis=1) for term in problem.noise)
    left = weight @ error**2 + of_noise
    before = weight @ (pressure - solution.mean) ** 2
    assert observed.removed == pytest.approx(1.0 - left @ area / (before @ area), rel=1e-5)
    per_node = 1.0 - left / before
    np.testing.assert_allclose(observed.node_removed, per_node, rtol=1e-4, atol=1e-5)


def test_no_linear_map_is_better_than_the_best(parts: Parts) -> None:
    """At gamma = 1 and with all modes the map is the best one; with four modes it is not, for any mode kept."""
    for entry in (CASE_1, CASE_2):
        best = case_of(parts, MapEntry(case=2, gamma=1.0, form=entry.form, symmetry=entry.symmetry))
        observed = prior_observability(best.problem, best.solution, best.structure.surface)
        assert observed.removed == pytest.approx(observed.removed_at_best, rel=1e-9)
        np.testing.assert_allclose(observed.mode_removed, observed.mode_removed_at_best, rtol=1e-6, atol=1e-8)
        case = case_of(parts, entry)
        other = prior_observability(case.problem, case.solution, case.structure.surface)
        assert other.removed_at_best == pytest.approx(observed.removed, rel=1e-9)
        assert other.removed < other.removed_at_best
        assert (other.mode_removed <= other.mode_removed_at_best + 1e-9).all()
