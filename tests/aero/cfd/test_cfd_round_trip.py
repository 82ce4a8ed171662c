"""A snapshot written for another program, read back on another mesh: the loads must be the same.

Truth: the snapshot's own coefficients on its own mesh. Measured on the 97 x 60 mesh: forces within 0.06 %, within
0.09 % from values in cells; moments within 0.04 % of the scale.
"""

import json
from math import degrees
from pathlib import Path

import meshio
import numpy as np
import pytest
from imported_case import (
    CONDITION,
    SYMMETRIC,
    TOLERANCE,
    case_text,
    coefficient_error,
    imported_ratio,
    manifest_text,
    table_on,
)
from sweeps import sweep

from builder.campaign.field_export import export_snapshots
from builder.campaign.snapshots import Snapshots
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition


def assert_same_loads(ratio: np.ndarray, grid: SurfaceGrid, snapshots: Snapshots, number: int = 0) -> None:
    error, scale = coefficient_error(ratio, grid, snapshots, number)
    assert (np.abs(error) <= TOLERANCE * scale).all(), error / scale


@pytest.mark.parametrize("file_format", ["vtu", "triq", "csv"])
def test_export_and_import(
    snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path, file_format: str
) -> None:
    files = export_snapshots(snapshots, tmp_path, file_format)
    assert {file.name for file in tmp_path.iterdir()} == {file.name for file in files}
    engine = table_on(files[-1], other_grid)
    assert engine.name == "table"
    for number, condition in enumerate(engine.conditions()):
        assert condition.as_tuple() == pytest.approx(snapshots.condition[number], rel=1e-11)
        flow = engine.solve(engine.flow_key(snapshots.conditions()[number]))
        assert_same_loads(engine.pressure_ratio(flow, condition), other_grid, snapshots, number)


def test_points_without_normals(snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path) -> None:
    """At the slope break each place holds two pressures; without normals neither may be used there."""
    export_snapshots(snapshots, tmp_path, "csv")
    for file in tmp_path.glob("*.csv"):
        table = np.genfromtxt(file, delimiter=",", names=True)
        names = ["x_m", "y_m", "z_m", "p_Pa"]
        np.savetxt(file, np.stack([table[n] for n in names], 1), "%.12g", ",", header=",".join(names), comments="")
    assert_same_loads(imported_ratio(tmp_path / "manifest.toml", other_grid, CONDITION), other_grid, snapshots)


@pytest.mark.parametrize("suffix", [".toml", ".csv"])
def test_two_codes_in_one_manifest(
    snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path, suffix: str
) -> None:
    """p in Pa with x aft in m; and Cp with x forward in mm, in a table of decimal commas.

    The second code's origin lies at x = 2 m, but at the nose where the manifest's columns hold no translation.
    """
    mesh, (first, second) = snapshots.surface, snapshots.conditions()
    one = np.column_stack([mesh.point, mesh.node_normal, snapshots.pressure[0]])
    names = ["x", "y", "z", "normal_x", "normal_y", "normal_z"]
    np.savetxt(tmp_path / "one.csv", one, "%.12g", ",", header=",".join([*names, "Pressure"]), comments="")
    turn, origin = np.array([-1.0, -1.0, 1.0]), np.array([2.0 if suffix == ".toml" else 0.0, 0.0, 0.0])
    cp = (snapshots.pressure[1] / second.ambient_pressure - 1.0) / (0.7 * second.mach_number**2)
    two = np.column_stack([cp, 1e3 * (mesh.point - origin) * turn, mesh.node_normal * turn])
    rows = [";".join(f"{value:.12g}" for value in row).replace(".", ",") for row in two]
    (tmp_path / "two.csv").write_text("\n".join([";".join(["cp_wall", *names]), *rows]))
    angle, path = degrees(second.angle_of_attack), tmp_path / f"m{suffix}"
    if suffix == ".toml":
        case = case_text("two.csv", angle_of_attack_deg=angle, sideslip_angle_deg=0.0)
        case += "quantity = 'Cp'\narray = 'cp_wall'\nlength_unit = 'mm'\naxes = 'forward port up'\n"
        path.write_text(manifest_text(case_text("one.csv") + case + "translation_m = [2.0, 0.0, 0.0]\n"))
    else:
        head = (
            "file,mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km,quantity,unit,array,length_unit"
        )
        lines = [f"{head},axes", "one.csv,5,6,5,20,p,Pa,Pressure,m,aft starboard up"]
        lines += [f"two.csv,5,{angle!r},0,20,Cp,,cp_wall,mm,forward port up"]
        path.write_text("\n".join(lines))
    engine = table_on(path, other_grid)
    assert engine.conditions()[0] == first
    assert len(engine.inputs()["written"]) == 1
    for number, condition in enumerate(engine.conditions()):
        ratio = engine.pressure_ratio(engine.solve(engine.flow_key(condition)), condition)
        assert_same_loads(ratio, other_grid, snapshots, number)


def quads(snapshots: Snapshots) -> tuple[np.ndarray, np.ndarray]:
    """Return the quadrilaterals (m, 4) of the snapshots' grid between stations apart, and p at their middles."""
    grid = snapshots.grid
    assert grid is not None
    number = np.arange(grid.n_nodes).reshape(len(grid.x), grid.n_roll)
    after = np.roll(number, -1, axis=1)
    apart = np.diff(grid.x) > 0.0
    corner = np.stack([number[:-1], number[1:], after[1:], after[:-1]], axis=2)[apart].reshape(-1, 4)
    return corner, snapshots.pressure[0][corner].mean(axis=1)


def test_values_in_triangles(snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path) -> None:
    pressure = snapshots.pressure[0][snapshots.triangle].mean(axis=1)
    cells = [("triangle", snapshots.triangle)]
    meshio.Mesh(snapshots.point, cells, cell_data={"p": [pressure]}).write(tmp_path / "field.vtu")
    (tmp_path / "m.toml").write_text(manifest_text())
    assert_same_loads(imported_ratio(tmp_path / "m.toml", other_grid, CONDITION), other_grid, snapshots)


def test_values_in_quads_in_millimetres_and_flight_axes(
    snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path
) -> None:
    """x forward, y starboard, z down, from a point 2 m aft of the tip; kPa; normals into the body."""
    corner, pressure = quads(snapshots)
    point = 1e3 * (snapshots.point - np.array([2.0, 0.0, 0.0])) * np.array([-1.0, 1.0, -1.0])
    mesh = meshio.Mesh(point, [("quad", corner[:, ::-1])], cell_data={"wall_pressure": [1e-3 * pressure]})
    mesh.write(tmp_path / "field.vtk", binary=False)
    text = manifest_text(
        case_text("field.vtk"),
        unit="kPa",
        length_unit="mm",
        axes="forward starboard down",
        translation_m=[2.0, 0.0, 0.0],
        array="wall_pressure",
    )
    (tmp_path / "m.toml").write_text(text)
    assert_same_loads(imported_ratio(tmp_path / "m.toml", other_grid, CONDITION), other_grid, snapshots)


def test_rotation_and_free_stream_unit(snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path) -> None:
    """Axes turned by 30 deg about y; the pressure over rho_inf a_inf^2, so that p_inf reads 1/1.4."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    value = snapshots.pressure[0] / (1.4 * CONDITION.ambient_pressure)
    mesh = meshio.Mesh(snapshots.point @ rotation, [("triangle", snapshots.triangle)], point_data={"p": value})
    mesh.write(tmp_path / "field.vtu")
    text = manifest_text(unit="rho_inf a_inf^2", rotation=json.dumps(rotation.tolist())).replace('"[', "[")
    (tmp_path / "m.toml").write_text(text.replace(']"', "]"))
    assert_same_loads(imported_ratio(tmp_path / "m.toml", other_grid, CONDITION), other_grid, snapshots)


@pytest.mark.parametrize("where", sweep(["node", "cell", "points"], ["node"]))
def test_half_model(snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path, where: str) -> None:
    grid = snapshots.grid
    assert grid is not None
    half = snapshots.triangle[(snapshots.point[snapshots.triangle][:, :, 1] > -1e-9).all(axis=1)]
    assert 2 * len(half) == len(snapshots.triangle)
    pressure = snapshots.pressure[1]
    file = "field.csv" if where == "points" else "field.vtu"
    if where == "points":
        used = np.unique(half)
        table = np.column_stack([snapshots.point, snapshots.surface.node_normal, pressure])[used]
        header = "x,y,z,normal_x,normal_y,normal_z,p"
        np.savetxt(tmp_path / file, table, "%.10g", ",", header=header, comments="")
    else:
        at_nodes = {"p": pressure} if where == "node" else {}
        in_cells = {"p": [pressure[half].mean(axis=1)]} if where == "cell" else {}
        mesh = meshio.Mesh(snapshots.point, [("triangle", half)], point_data=at_nodes, cell_data=in_cells)
        mesh.write(tmp_path / file)
    angle = degrees(SYMMETRIC.angle_of_attack)
    case = case_text(file, angle_of_attack_deg=angle, sideslip_angle_deg=0.0)
    (tmp_path / "m.toml").write_text(manifest_text(case, mirrored=True))
    assert_same_loads(imported_ratio(tmp_path / "m.toml", other_grid, SYMMETRIC), other_grid, snapshots, 1)


def test_manifest_as_table(snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path) -> None:
    export_snapshots(snapshots, tmp_path, "csv")
    (tmp_path / "m.csv").write_text(
        "file,mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km,quantity,length_unit,array\n"
        "case_0001.csv,5,6,5,20,Cp,m,Cp\n"
    )
    toml = imported_ratio(tmp_path / "manifest.toml", other_grid, CONDITION)
    table = imported_ratio(tmp_path / "m.csv", other_grid, CONDITION)
    np.testing.assert_allclose(table, toml, rtol=1e-9)


def test_a_changed_file_makes_its_own_flow_stale(
    snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path
) -> None:
    manifest = export_snapshots(snapshots, tmp_path, "triq")[-1]
    before = table_on(manifest, other_grid)
    file = tmp_path / "case_0002.triq"
    file.write_text(file.read_text() + "\n")
    after = table_on(manifest, other_grid)
    assert after.inputs() == before.inputs()
    assert json.loads(json.dumps(after.inputs())) == after.inputs()
    assert after.flow_key(CONDITION) == before.flow_key(CONDITION)
    assert after.flow_key(SYMMETRIC) != before.flow_key(SYMMETRIC)
    with pytest.raises(InputError, match=r"case_0002\.triq: changed since"):
        before.solve(before.flow_key(SYMMETRIC))


def test_a_condition_that_is_not_there(
    snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path, zero_incidence: FlightCondition
) -> None:
    engine = table_on(export_snapshots(snapshots, tmp_path, "triq")[-1], other_grid)
    with pytest.raises(InputError, match=r"no case at M 5, angle of attack 0 deg.*nearest are: M 5, angle"):
        engine.flow_key(zero_incidence)
