"""Alarm levels of a shape that is none of revolution: where they are set, on which flights, and to what."""

from __future__ import annotations

import numpy as np
import pytest
from shape_case import N_D, grid_snapshots, shape_map, shape_structure, shape_vehicle

from builder.aero.surface.mesh import SurfaceMesh
from builder.pipeline import measured_levels
from builder.pipeline.measured_levels import alarm_levels_wanted, level_conditions, with_shape_levels
from builder.reporting import Silent
from builder.structure.structure_file import MeshCheck, Structure
from builder.truth.shape import shape_flows
from builder.vehicle.file import VEHICLES, Vehicle, load_vehicle


class Noted(Silent):
    """Keeps the notes."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        self.notes.append(text)


def with_entries(vehicle: Vehicle, section: str, **entries: object) -> Vehicle:
    return vehicle.model_copy(update={section: getattr(vehicle, section).model_copy(update=entries)})


@pytest.mark.fast
def test_cheap_flows_set_levels_and_those_by_euler_do_on_request() -> None:
    finned, cone = (load_vehicle(VEHICLES / f"{name}.toml") for name in ("finned_body", "elliptic_cone"))
    reporter = Noted()
    assert alarm_levels_wanted(finned, reporter)
    assert reporter.notes == []
    assert not alarm_levels_wanted(cone, reporter)
    assert not alarm_levels_wanted(with_entries(finned, "structure", checked_by=None), reporter)
    assert [
        "from the theory, its 200 flows by euler" in reporter.notes[0],
        "there is no independent model (structure.checked_by: entry is missing)" in reporter.notes[1],
    ] == [True, True]
    assert alarm_levels_wanted(with_entries(cone, "map", alarm_levels="always"), reporter)
    assert not alarm_levels_wanted(with_entries(finned, "map", alarm_levels="nominal"), reporter)
    assert len(reporter.notes) == 2


@pytest.mark.fast
def test_levels_are_set_where_the_map_holds() -> None:
    finned = load_vehicle(VEHICLES / "finned_body.toml")
    altitude = [one.altitude for one in level_conditions(finned)]
    assert 12e3 <= min(altitude) < 13e3
    assert 29e3 < max(altitude) <= 30e3
    for low, high in ((0.0, 10.0), (35.0, 50.0)):
        altitude = [
            one.altitude for one in level_conditions(with_entries(finned, "map", valid_altitude_km=(low, high)))
        ]
        assert 1e3 * low <= min(altitude) < max(altitude) <= 1e3 * high
    absolute = with_entries(finned, "map", form="absolute")
    assert {one.altitude for one in level_conditions(absolute)} == {20e3}


def known(surface: SurfaceMesh) -> Structure:
    """Return the beam of the map as a file, checked by itself."""
    own = shape_structure(surface)
    layout, operator = own.layouts["four_rows"], own.strain_operator("four_rows")
    return Structure(
        vehicle="elliptic cone",
        model="imported",
        settings={},
        statistics={},
        gauge_names=layout.names,
        layout=("four_rows",) * N_D,
        gauge_position=layout.position,
        gauge_direction=layout.direction,
        gauge_length=np.zeros(N_D),
        gauge_surface=("internal",) * N_D,
        point=surface.point,
        triangle=surface.triangle,
        normal=surface.node_normal,
        strain_operator=operator,
        mesh_error=np.zeros(N_D),
        check=MeshCheck(
            against="itself", factor=1.0, strain_operator=operator, point=surface.point, triangle=surface.triangle
        ),
    )


def test_levels_follow_from_the_flights(monkeypatch: pytest.MonkeyPatch) -> None:
    """Flights as the map expects them leave the levels about where they are; errors that it does not know raise
    them."""
    monkeypatch.setattr(measured_levels, "SHAPE_CONDITIONS", 40)
    monkeypatch.setattr(measured_levels, "SHAPE_VEHICLES", 100)
    vehicle = with_entries(shape_vehicle(), "aerodynamics", engine="newtonian")
    vehicle = with_entries(vehicle, "resolution", truth=vehicle.resolution.map)
    flows = shape_flows(vehicle, level_conditions(vehicle), Silent(), "Flow")
    structure, made = known(grid_snapshots().surface), shape_map()
    found = with_shape_levels(vehicle, made, structure, flows, Silent())
    assert found.manifold is not None
    facts = found.provenance["flight_alarm_levels"]
    assert facts["samples"] == 4000
    assert facts["used"]
    assert 0.5 < found.manifold.chi_square_scale < 1.5
    worse = with_entries(vehicle, "noise", apparent_strain_um_per_m=0.03)
    raised = with_shape_levels(worse, made, structure, flows, Silent())
    assert raised.manifold is not None
    assert raised.manifold.chi_square_scale > 1.1 * found.manifold.chi_square_scale
    assert raised.chi_square_scale > found.chi_square_scale
