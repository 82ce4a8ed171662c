"""Surfaces that change with a parameter of the flow, against rotations and against the surface of each file."""

from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest
from finned_body import (
    CHECK,
    SURFACE,
    finned_mesh,
    surface_triangles,
)
from random_map import random_map

from builder.aero.cfd.formats.stl import write_stl
from builder.aero.cfd.formats.surface_files import read_surface
from builder.aero.cfd.manifest import load_manifest
from builder.aero.deflections import Deflection, deflections_of
from builder.aero.engine import Engine
from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.engines.registry import make_engine
from builder.aero.load_groups import six_loads
from builder.aero.surface.edges import FEATURE_ANGLE, split_at_edges
from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.campaign_run import run_campaign, vehicle_campaign
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import load_snapshots
from builder.inverse.envelope import parameter_ranges
from builder.reporting import Silent
from builder.structure.solid.case import structure_case
from builder.structure.solid.mesh_files import read_mesh
from builder.vehicle.file import VEHICLES, Vehicle, load_vehicle
from builder.vehicle.flight_conditions import ConditionSet
from strainfmu.errors import FlowReachError, InputError
from strainfmu.estimator.valid_ranges import valid_ranges
from strainfmu.flight_condition import FlightCondition
from tests.aero.triangulated_shapes import box

FINNED = VEHICLES / "finned_body.toml"


@pytest.fixture(scope="module")
def finned() -> Vehicle:
    return load_vehicle(FINNED)


@pytest.fixture(scope="module")
def engine(finned: Vehicle) -> Engine:
    return make_engine(finned, None, finned.resolution.map)


def pitched(mesh: SurfaceMesh, angle: float) -> SurfaceMesh:
    """Return ``mesh`` turned nose-up by ``angle`` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return SurfaceMesh(mesh.point @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]), mesh.triangle)


@pytest.mark.fast
def test_turned_body_has_the_pressure_of_turned_wind() -> None:
    """The whole body deflected by 6 deg is the body at 6 deg more incidence."""
    body = split_at_edges(box([0.0, -0.1, -0.05], [1.0, 0.1, 0.05], (4, 3, 2)), FEATURE_ANGLE)
    shift = pitched(body, radians(6.0)).point - body.point
    turn = Deflection(name="turn_deg", value=np.array([0.0, 6.0]), shift=np.array([np.zeros_like(shift), shift]))
    engine = NewtonianEngine(body, deflections=(turn,))
    deflected = FlightCondition(6.0, radians(3.0), 0.0, 20e3, (6.0,))
    more = FlightCondition(6.0, radians(9.0), 0.0, 20e3, (0.0,))
    ratios = [engine.pressure_ratio(engine.solve(engine.flow_key(one)), one) for one in (deflected, more)]
    np.testing.assert_allclose(ratios[0], ratios[1], rtol=1e-8)  # keys are rounded
    assert engine.inputs() != NewtonianEngine(body).inputs()


@pytest.mark.fast
def test_between_the_surfaces_nodes_move_in_lines_and_never_beyond() -> None:
    shift = np.random.default_rng(1).standard_normal((3, 5, 3))
    one = Deflection(name="flap_deg", value=np.array([-2.0, 0.0, 4.0]), shift=shift)
    np.testing.assert_allclose(one.shift_at(1.0), 0.75 * shift[1] + 0.25 * shift[2])
    for i, value in enumerate(one.value):
        np.testing.assert_allclose(one.shift_at(value), shift[i], atol=1e-15)
    with pytest.raises(FlowReachError, match=r"flap_deg: expected -2 .. 4, the values of its surfaces, got 4.5"):
        one.shift_at(4.5)


@pytest.mark.fast
def test_shipped_files_are_made_again() -> None:
    """The files beside the vehicle file are those that the script makes."""
    mesh, shipped = finned_mesh(*CHECK), read_mesh(VEHICLES / "finned_body_check.vtu", 1.0)
    np.testing.assert_allclose(shipped.node, mesh.node, atol=1e-12)
    assert np.array_equal(shipped.element, mesh.element)
    assert {name: len(facet) for name, facet in shipped.surface.items()} == {
        name: len(facet) for name, facet in mesh.surface.items()
    }
    made = surface_triangles(finned_mesh(*SURFACE, deflection=radians(4.0)))
    surface = read_surface(VEHICLES / "finned_body_roll_+4deg.stl", 1e-3)
    np.testing.assert_allclose(surface.point[surface.triangle], made, atol=1e-7)


@pytest.mark.fast
def test_turned_fins_roll_the_body(finned: Vehicle, engine: Engine) -> None:
    """Positive deflection, positive C_l; none, none; the sign turns with the deflection; other loads stay."""
    loads = six_loads(engine.surface, finned.reference.moment_station_m)
    found = []
    for value in (-4.0, 0.0, 4.0):
        condition = FlightCondition(5.5, 0.0, 0.0, 20e3, (value,))
        ratio = engine.pressure_ratio(engine.solve(engine.flow_key(condition)), condition)
        found.append(loads @ (ratio - 1.0) * condition.ambient_pressure / condition.dynamic_pressure)
    rolling = np.array(found)[:, 5] / 0.031416 / 0.2
    assert rolling[2] > 0.008
    assert abs(rolling[1]) < 1e-6
    assert rolling[0] == pytest.approx(-rolling[2], rel=0.06)
    assert np.abs(np.array(found)[:, 1:5]).max() < 1e-3 * found[1][0]


@pytest.mark.fast
def test_surfaces_must_hold_the_same_triangles(tmp_path: Path, finned: Vehicle, engine: Engine) -> None:
    mesh = read_surface(VEHICLES / "finned_body.stl")
    for name, triangle, message in (
        (
            "fewer.stl",
            mesh.triangle[:-1],
            r"fewer.stl: expected the 18\d+ triangles of shape.surface in",
        ),
        ("other.stl", np.roll(mesh.triangle, 1, axis=0), r"in their order, got others from \("),
    ):
        write_stl(tmp_path / name, mesh.point, triangle)
        with pytest.raises(InputError, match=message):
            deflections_of(with_file(finned, tmp_path / name).flow_entries(), engine.surface)
    with pytest.raises(InputError, match="no such file"):
        deflections_of(with_file(finned, tmp_path / "none.stl").flow_entries(), engine.surface)


def with_file(vehicle: Vehicle, path: Path) -> Vehicle:
    entry = vehicle.conditions.parameters["fin_roll_deg"]
    surfaces = [one.model_copy(update={"file": str(path)}) for one in entry.surfaces]
    changed = {"fin_roll_deg": entry.model_copy(update={"surfaces": surfaces})}
    conditions = vehicle.conditions.model_copy(update={"parameters": changed})
    return vehicle.model_copy(update={"conditions": conditions})


@pytest.mark.fast
def test_snapshots_hold_the_parameters(tmp_path: Path, finned: Vehicle, engine: Engine) -> None:
    conditions = tuple(finned.flight_conditions()[i] for i in (0, 1, 2, 224))
    assert len(finned.flight_conditions()) == 225
    campaign = vehicle_campaign(finned, engine, (ConditionSet("four", conditions),))
    run_campaign(campaign, tmp_path / "s.h5", Scheduling(workers=0), Silent())
    snapshots = load_snapshots(tmp_path / "s.h5")
    assert snapshots.parameter_names == ("fin_roll_deg",)
    assert tuple(snapshots.conditions()) == conditions
    ranges = parameter_ranges(snapshots.parameter_names, snapshots.conditions())
    stated = replace(random_map(), provenance={"parameters": ranges})
    assert "fin_roll_deg: -4 to 4" in [f"{one.quantity}: {one.text}" for one in valid_ranges(stated)]
    assert [one.parameters for one in conditions] == [(-4.0,), (-2.0,), (0.0,), (4.0,)]
    with pytest.raises(InputError, match="condition: shape"):
        replace(snapshots, condition=snapshots.condition[:, :4])


MANIFEST = """quantity = "p"
unit = "Pa"
length_unit = "m"
[[case]]
file = "a.csv"
mach_number = 5.0
angle_of_attack_deg = 0.0
sideslip_angle_deg = 0.0
altitude_km = 20.0
parameters = { flap_deg = 2.0, power = 0.5 }
[[case]]
file = "b.csv"
mach_number = 5.0
angle_of_attack_deg = 0.0
sideslip_angle_deg = 0.0
altitude_km = 20.0
parameters = { power = 1.0, flap_deg = 2.0 }
"""
TABLE = """file,mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km,quantity,length_unit,\
parameters.flap_deg
a.csv,5,0,0,20,Cp,m,-2
b.csv,5,0,0,20,Cp,m,3
"""


@pytest.mark.fast
def test_manifests_have_parameters(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("x,y,z,Cp\n", encoding="utf-8")
    path = tmp_path / "m.toml"
    path.write_text(MANIFEST, encoding="utf-8")
    cases = load_manifest(path, ("power", "flap_deg")).cases
    assert [case.condition.parameters for case in cases] == [(0.5, 2.0), (1.0, 2.0)]
    with pytest.raises(InputError, match="case 1: expected the parameters of the vehicle file, none, got flap"):
        load_manifest(path)
    table = tmp_path / "m.csv"
    table.write_text(TABLE, encoding="utf-8")
    assert [one.condition.parameters for one in load_manifest(table, ("flap_deg",)).cases] == [(-2.0,), (3.0,)]
    table.write_text(TABLE.replace(",3\n", ",-2\n"), encoding="utf-8")
    with pytest.raises(InputError, match=r"line 3: .*parameters -2 already belongs to line 2"):
        load_manifest(table, ("flap_deg",))


@pytest.mark.fast
def test_mesh_in_another_unit_is_named(finned: Vehicle) -> None:
    entry = finned.structure.model_copy(update={"mesh_length_unit": "mm"})
    with pytest.raises(InputError, match=r"finned_body.vtu: mesh: 0.00119602 m long in x, the vehicle 1.2 m"):
        structure_case(finned.model_copy(update={"structure": entry}), ["body"])
