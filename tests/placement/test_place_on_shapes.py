"""Placement on a shape that is no body of revolution: the elliptic cone with its solid wall on a coarse mesh."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from shape_case import flown, grid_conditions

from builder.inverse.build import build_inverse_map
from builder.pipeline.place_and_review import check_model, left_out, propose_gauges, structure_of, write_layout
from builder.placement.candidates import CandidateGrid
from builder.placement.design import Aim, Study, place, placement_study
from builder.placement.limits import Limits
from builder.reporting import Silent
from builder.structure.gauge_checks import check_gauges
from builder.structure.mapped_structure import MappedStructure
from builder.structure.solid import case
from builder.structure.solid.swept_mesh import RESOLUTIONS, SweptResolution
from builder.vehicle.file import VEHICLES, Vehicle, load_vehicle
from builder.vehicle.gauges.gauge_entries import GaugeLayoutEntry
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import save_inverse_map

GRID = CandidateGrid(stations=(0.6, 1.0, 1.3), roll_angles=tuple(60.0 * k for k in range(6)))

Run = Callable[..., tuple[int, str, str]]


def with_layout(vehicle: Vehicle, entry: GaugeLayoutEntry) -> Vehicle:
    gauges = vehicle.gauges.model_copy(update={"layout": "used", "layouts": {"used": entry}})
    return vehicle.model_copy(update={"gauges": gauges})


@pytest.fixture(scope="module", autouse=True)
def coarse() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(RESOLUTIONS, "coarse", SweptResolution(0.12, 1, 24))
        patch.setattr(case, "CHECK_SIZE", 1.0)
        yield


@pytest.fixture(scope="module")
def study() -> Study:
    """Candidates beside a layout of two stations, linear estimator."""
    vehicle = load_vehicle(VEHICLES / "elliptic_cone.toml")
    rows = vehicle.gauges.layouts["four_rows"].rows
    assert rows is not None
    shorter = GaugeLayoutEntry(rows=[one.model_copy(update={"count": 2}) for one in rows])
    vehicle = with_layout(vehicle, shorter)
    vehicle = vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"estimator": "linear"})})
    snapshots = flown(grid_conditions((6.0, 7.0), (-4.0, 0.0, 4.0), (-2.0, 0.0, 2.0)))
    return placement_study(vehicle, snapshots, structure_of(vehicle, snapshots, Silent()), GRID)


def test_strain_of_candidates_is_that_of_the_map(study: Study) -> None:
    """Forward solutions of the fields against Z_p by adjoint ones, at the gauges of the layout in use."""
    z_p = study.parts.structure.strain_operator("used") @ study.parts.basis.fields
    own = study.strain.strain[study.candidates.gauges_of(list(study.layout_sites))]
    np.testing.assert_allclose(own, z_p, atol=1e-8 * np.abs(z_p).max())


@pytest.mark.slow
def test_a_placed_layout_builds_a_map_and_its_fmu(study: Study, tmp_path: Path, run: Run) -> None:
    found = place(study, Limits(gauges=12), Aim(starts=2), Silent())
    write_layout(found.layout, tmp_path / "layout.csv")
    placed = with_layout(study.parts.vehicle, GaugeLayoutEntry(file=str(tmp_path / "layout.csv")))
    assert check_gauges(placed) == {"used": 12}
    snapshots = study.parts.flows.snapshots
    structure = structure_of(placed, snapshots, Silent())
    assert isinstance(structure, MappedStructure)
    built = build_inverse_map(placed, snapshots, structure)
    assert built.n_gauges == 12
    own = placement_study(placed, snapshots, structure, GRID).own_sigma
    np.testing.assert_allclose(own, found.sigmas, rtol=0.02)
    save_inverse_map(built, tmp_path / "map.h5")
    code, _, err = run("export", tmp_path / "map.h5", "-o", tmp_path / "placed.fmu")
    assert (code, err) == (0, "")
    assert (tmp_path / "placed.fmu").is_file()


def test_a_blunt_body_whose_flows_lack_a_harmonic_takes_gauges() -> None:
    """Local inclination at few angles of attack leaves waves around the body that no flow has."""
    found = propose_gauges(
        VEHICLES / "blunt_cone.toml",
        CandidateGrid(roll_angles=tuple(60.0 * k for k in range(6))),
        Limits(gauges=12),
        Aim(starts=1),
        reporter=Silent(),
    )
    assert any(one.shape[1] == 0 for one in found.study.parts.basis.along)
    assert len(found.placement.layout.names) == 12
    assert 0.0 <= found.placement.gap_percent < 15.0


def test_structures_of_another_code_are_refused(study: Study) -> None:
    vehicle = study.parts.vehicle
    entry = vehicle.structure.model_copy(update={"influence": "influence.csv"})
    with pytest.raises(
        InputError, match=r"^structure\.influence: place and review need strain at points"
    ) as caught:
        check_model(vehicle.model_copy(update={"structure": entry}))
    assert "\n" not in str(caught.value)


def test_the_error_of_the_mesh_is_named_as_left_out(study: Study) -> None:
    assert any(line.startswith("mesh: the error of strain") for line in left_out(study.parts.vehicle))
