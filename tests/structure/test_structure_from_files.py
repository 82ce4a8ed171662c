"""``strainfmu structure`` on meshes and drawings of other programs, through to an FMU."""

from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cad_files import write_step, write_stl
from fmpy import read_model_description
from installed_gmsh import gmsh_or_skip
from small_ogive import small
from sweeps import SLOW

from builder.structure.solid.checks import largest_amplitude, reference_pressures
from builder.structure.solid.mesh_checks import exact_wall
from builder.structure.solid.mesh_files import write_mesh
from builder.structure.solid.swept_mesh import full_mesh, swept_wall
from builder.structure.structure_file import load_structure
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle, load_vehicle
from strainfmu.estimator.map.inverse_map import load_inverse_map

Run = Callable[..., tuple[int, str, str]]


def chain_to_an_fmu(run: Run, path: Path, folder: Path, *options: object) -> dict[str, Any]:
    """Run ``structure``, ``build`` and ``export`` as a user does; return the provenance of the map."""
    commands = (
        ("snapshots", path, "-o", folder / "snapshots.h5", "--engine", "newtonian"),
        ("structure", path, "-o", folder / "structure.h5", "--resolution", "coarse", *options),
        ("build", path, "-o", folder),
        ("export", folder / "map.h5", "-o", folder / "estimator.fmu", "--platforms", "linux64"),
    )
    for command in commands:
        code, _, err = run(*command)
        assert (code, err) == (0, ""), command
    assert read_model_description(str(folder / "estimator.fmu")).coSimulation is not None
    return load_inverse_map(folder / "map.h5").provenance


def wall_file(vehicle: Vehicle, path: Path) -> Path:
    """Write the vehicle's wall as a mesh in mm."""
    mesh = full_mesh(swept_wall(vehicle.body(), wall_of(vehicle), "coarse"))
    write_mesh(path, replace(mesh, node=1e3 * mesh.node), with_surfaces=True)
    return path


# The vehicle has few gauges; every kind of FMU takes the absolute form. Alarm levels need flows of a third model.
PLAIN_MAP = ("modes = 4", 'modes = 3\nform = "absolute"\nalarm_levels = "nominal"')


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_an_imported_mesh_reaches_an_fmu(run: Run, tmp_path: Path) -> None:
    """Two commands from the mesh to the map, whose provenance names the file, and one to the FMU.

    It takes seconds: a mesh from a file has no sectors and is factorised whole.
    """
    pytest.importorskip("meshio")
    path, folder = small(tmp_path, PLAIN_MAP), tmp_path / "results"
    mesh = wall_file(load_vehicle(path), tmp_path / "wall.vtu")
    found = chain_to_an_fmu(run, path, folder, "--model", mesh, "--mesh-unit", "0.001", "--allow-locking")
    assert found["structural_model"].startswith("imported")
    assert found["structure"]["model"] == "imported"
    assert found["structure"]["file_name"] == "wall.vtu"
    assert found["structure"]["file"] == sha256(mesh.read_bytes()).hexdigest()
    assert found["structure"]["unit"] == 0.001
    assert found["flow"]["options"] == {"engine": "newtonian"}


@pytest.mark.slow
def test_a_step_file_reaches_an_fmu(run: Run, tmp_path: Path) -> None:
    gmsh_or_skip()
    path, folder, cad = small(tmp_path, PLAIN_MAP), tmp_path / "results", tmp_path / "wall.step"
    vehicle = load_vehicle(path)
    write_step(vehicle.body(), wall_of(vehicle), cad)
    found = chain_to_an_fmu(run, path, folder, "--model", cad)
    assert found["structure"]["model"] == "gmsh_tetrahedra"
    assert found["structure"]["file_name"] == "wall.step"
    assert found["structure"]["resolution"] == "coarse"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        pytest.param(
            ("wall_thickness_mm = 6.0", "wall_thickness_mm = 5.0"),
            "wall thickness of the mesh: expected 5 mm, got 6 mm",
            marks=SLOW,
        ),
        (("end_x_m = 0.8", "end_x_m = 0.81"), "length of the mesh: expected 0.81 m, got 0.8 m"),
        pytest.param(
            ("start_half_angle_deg = 20.0", "start_half_angle_deg = 21.0"),
            "outer radius of the mesh at x = 0.4",
            marks=SLOW,
        ),
    ],
)
def test_a_mesh_of_another_body_is_named_as_such(
    run: Run, tmp_path: Path, change: tuple[str, str], words: str
) -> None:
    """Which quantity, expected and found, in one line before anything is solved.

    The other quantities by themselves: ``solid/checks/test_solid_layers.py``.
    """
    pytest.importorskip("meshio")
    mesh = wall_file(load_vehicle(small(tmp_path)), tmp_path / "wall.vtu")
    changed, output = small(tmp_path, change), tmp_path / "structure.h5"
    code, _, err = run("structure", changed, "-o", output, "--model", mesh, "--mesh-unit", "0.001")
    assert code == 2
    assert f"wall.vtu: {words}" in err
    assert err.count("\n") == 1
    assert not output.exists()


@pytest.mark.slow
def test_tetrahedra(run: Run, tmp_path: Path) -> None:
    """Edges of 0.9 sqrt(R t): a few per cent of bending are lost, reported as a warning and as mesh error."""
    gmsh_or_skip()
    output = tmp_path / "structure.h5"
    code, out, err = run("structure", small(tmp_path), "-o", output, "--resolution", "coarse", "--model", "gmsh")
    assert (code, err) == (0, "")
    assert "warning: locking: tetrahedron10" in out
    structure = load_structure(output)
    assert structure.model == "gmsh_tetrahedra"
    assert structure.statistics["solver"] != "cyclic"
    strain = largest_amplitude(structure.strain_operator @ reference_pressures(structure.point, 0.8))
    assert np.all(structure.mesh_error < 0.15 * strain)


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["step", "stl"])
def test_cad_file(run: Run, tmp_path: Path, ending: str) -> None:
    """The wall drawn by a CAD system, in millimetres: surfaces by position, 10 % of the largest strain.

    Triangles of an STL file are chords of its curves. The cavity's front counts as internal in both.
    """
    gmsh_or_skip()
    path, output = small(tmp_path), tmp_path / "structure.h5"
    vehicle, cad = load_vehicle(path), tmp_path / f"wall.{ending}"
    if ending == "step":
        write_step(vehicle.body(), wall_of(vehicle), cad)
    else:
        write_stl(vehicle.body(), wall_of(vehicle), cad, 4.0)
    unit = () if ending == "step" else ("--mesh-unit", "0.001")
    code, _, err = run("structure", path, "-o", output, "--resolution", "coarse", "--model", cad, *unit)
    assert (code, err) == (0, "")
    structure = load_structure(output)
    assert structure.model == "gmsh_tetrahedra"
    value = {what: number for what, number, _ in structure.settings["mesh_report"]}
    exact = exact_wall(vehicle.body(), wall_of(vehicle))
    assert value["volume"] == pytest.approx(exact["volume"], rel=5e-3)
    for name in ("external", "internal", "support"):
        assert value[f"surface {name}, area"] == pytest.approx(exact[name], rel=0.01)
    strain = largest_amplitude(structure.strain_operator @ reference_pressures(structure.point, 0.8))
    assert np.all(structure.mesh_error < 0.1 * strain)
