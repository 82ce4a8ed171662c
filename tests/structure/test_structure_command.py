"""``strainfmu structure`` and maps built on the three-dimensional model, as a user runs them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cad_files import write_step, write_stl
from fmpy import read_model_description

from builder.campaign.snapshots import load_snapshots
from builder.pipeline.map_files import run_build
from builder.reporting import Silent
from builder.structure.fourier.model import StructuralModel, structural_model
from builder.structure.mapped_structure import MappedStructure, mapped_structure
from builder.structure.solid.case import solid_case
from builder.structure.solid.gmsh_session import load_gmsh
from builder.structure.solid.mesh_choice import MeshChoice
from builder.structure.solid.mesh_export import write_mesh
from builder.structure.solid.mesh_report import exact_wall
from builder.structure.solid.model import solve_solid_structure
from builder.structure.solid.reference_loads import largest_amplitude, reference_pressures
from builder.structure.solid.swept_mesh import full_mesh, swept_wall
from builder.structure.structure_file import SCHEMA, SCHEMA_VERSION, Structure, load_structure
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.map_needs import used_layouts
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.inverse_map import load_inverse_map
from strainfmu.files import content_hash_of

Run = Callable[..., tuple[int, str, str]]

OGIVE = Path(__file__).parent.parent / "acceptance" / "ogive" / "ogive.toml"
ROWS = """rows = [
    { roll_angle_deg = 0.0, directions = ["axial", "hoop"], x_m = [0.35, 0.6] },
    { roll_angle_deg = 97.0, directions = ["axial", "hoop"], x_m = [0.6] },
]"""
OUTER = ("97.0, directions", '97.0, surface = "outer", directions')
PRESSURE = "internal_pressure_Pa = 3000.0"
SMALL = (
    ("start_half_angle_deg = 16.0", "start_half_angle_deg = 20.0"),
    ("end_x_m = 1.0", "end_x_m = 0.4"),
    ("end_x_m = 2.5", "end_x_m = 0.8"),
    ("wall_thickness_mm = 3.0", "wall_thickness_mm = 6.0"),
    ('file = "gauges.csv"', ROWS),
)
FREE_FLIGHT = (
    (PRESSURE, f'{PRESSURE}\nsupport = "free_flight"'),
    ("poisson_ratio", "density_kg_per_m3 = 2700.0\npoisson_ratio"),
)


def write_vehicle(path: Path, *changes: tuple[str, str]) -> Path:
    """Write the ogive's file with texts replaced once each, its tables beside it."""
    text = OGIVE.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    for table in ("gauges.csv", "manoeuvre.csv"):
        shutil.copy(OGIVE.parent / table, path.parent / table)
    return path


def small(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write a short, thick-walled vehicle: an ogive of 0.4 m, a cylinder of 0.4 m, radius 71 mm, wall 6 mm."""
    return write_vehicle(folder / "small.toml", *SMALL, *changes)


def solved(path: Path, **options: object) -> Structure:
    """Solve the vehicle of a file on the coarse swept mesh."""
    vehicle = load_vehicle(path)
    choice = MeshChoice(resolution="coarse")
    return solve_solid_structure(solid_case(vehicle, used_layouts(vehicle), choice, **options), Silent())  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def clamped(tmp_path_factory: pytest.TempPathFactory) -> Structure:
    """The small vehicle with its third row of gauges outside."""
    return solved(small(tmp_path_factory.mktemp("small"), OUTER))


def uniform_strain(structure: Structure) -> dict[str, float]:
    """Return the strain of each gauge of the layout in use per uniform pressure [1/Pa]."""
    gauges = structure.gauges_of("table")
    strain = structure.strain_operator[gauges].sum(axis=1)
    return dict(zip((structure.gauge_names[i] for i in gauges), strain.tolist(), strict=True))


def lame_strain(vehicle: Vehicle, r: float, axial_share: float) -> tuple[float, float]:
    """Return axial and hoop strain [1/Pa] of a long tube under outer pressure.

    The axial force is ``axial_share`` of that of a closed end, -p pi b^2. Source: Lame's solution (Timoshenko and
    Goodier, Theory of Elasticity, section 28).
    """
    wall, b = wall_of(vehicle), vehicle.body().base_radius
    a, nu = b - wall.thickness, wall.material.poisson_ratio
    mean = -(b**2) / (b**2 - a**2)
    radial, hoop, axial = mean * (1.0 - (a / r) ** 2), mean * (1.0 + (a / r) ** 2), axial_share * mean
    modulus = wall.material.youngs_modulus
    return (axial - nu * (radial + hoop)) / modulus, (hoop - nu * (radial + axial)) / modulus


def test_uniform_pressure_is_lames_on_both_faces(clamped: Structure, tmp_path: Path) -> None:
    """In the middle of the cylinder, ten sqrt(R t) from its ends. Found: within 0.03 %."""
    vehicle = load_vehicle(small(tmp_path, OUTER))
    b = vehicle.body().base_radius
    strain = uniform_strain(clamped)
    inside = strain["axial_0deg_2"], strain["hoop_0deg_2"]
    outside = strain["axial_97deg_1_outer"], strain["hoop_97deg_1_outer"]
    np.testing.assert_allclose(inside, lame_strain(vehicle, b - 6e-3, 1.0), rtol=2e-3)
    np.testing.assert_allclose(outside, lame_strain(vehicle, b, 1.0), rtol=2e-3)
    assert abs(inside[1] / outside[1] - 1.0) > 0.03  # the faces differ by more than the tolerance
    place = clamped.gauge_names.index("hoop_97deg_1_outer")
    assert np.hypot(*clamped.gauge_position[place, 1:]) == pytest.approx(b, abs=1e-12)
    assert clamped.gauge_surface[place] == "external"


def test_free_flight_carries_what_the_mass_behind_needs(tmp_path: Path) -> None:
    """The nose's force accelerates the whole body; the wall at x carries the mass aft of x."""
    path = small(tmp_path, *FREE_FLIGHT)
    vehicle = load_vehicle(path)
    body, wall = vehicle.body(), wall_of(vehicle)
    b, a = body.base_radius, body.base_radius - wall.thickness
    share = np.pi * (b**2 - a**2) * (body.length - 0.6) / exact_wall(body, wall)["volume"]
    structure = solved(path)
    strain = uniform_strain(structure)
    found = strain["axial_0deg_2"], strain["hoop_0deg_2"]
    np.testing.assert_allclose(found, lame_strain(vehicle, a, float(share)), rtol=3e-3)
    assert structure.statistics["solver"] != "cyclic"


def test_stiff_foundation_is_a_clamp(clamped: Structure, tmp_path: Path) -> None:
    """Springs of 1e16 N/m3 on the ring. Soft ones, 1e11 N/m3, tilt and let the base widen: far from it uniform
    pressure gives the same strain (St. Venant), because the axial force is the same.
    """
    entries = 'support = "elastic_foundation"\nfoundation_{}_N_per_m3 = {}\nfoundation_{}_N_per_m3 = {}'
    by_stiffness = {}
    for stiffness in ("1e16", "1e11"):
        change = (PRESSURE, f"{PRESSURE}\n{entries.format('normal', stiffness, 'tangential', stiffness)}")
        by_stiffness[stiffness] = solved(small(tmp_path, OUTER, change))
    z, size = clamped.strain_operator, np.abs(clamped.strain_operator).max()
    assert np.abs(by_stiffness["1e16"].strain_operator - z).max() < 1e-4 * size
    assert np.abs(by_stiffness["1e11"].strain_operator - z).max() > 1e-2 * size
    soft = uniform_strain(by_stiffness["1e11"])
    np.testing.assert_allclose(list(soft.values()), list(uniform_strain(clamped).values()), rtol=2e-3)


def test_gauge_length_is_an_average(clamped: Structure, tmp_path: Path) -> None:
    """Under cos(2 phi) a hoop gauge of length l at radius r reads the point's strain times sin(l/r) / (l/r)."""
    long = ("97.0, directions", '97.0, surface = "outer", length_mm = 40.0, directions')
    structure = solved(small(tmp_path, long))
    wave = reference_pressures(structure.point, 0.8).reshape(-1, 5, 2, 2)[:, 2, 0]
    place = structure.gauge_names.index("hoop_97deg_1_outer")
    ratio = np.hypot(*(structure.strain_operator[place] @ wave)) / np.hypot(
        *(clamped.strain_operator[place] @ wave)
    )
    angle = 0.040 / np.hypot(*structure.gauge_position[place, 1:])
    assert structure.gauge_length[place] == pytest.approx(0.040)
    assert ratio == pytest.approx(np.sin(angle) / angle, abs=2e-3)  # 0.947; a point has 1


def test_command_says_what_it_did(run: Run, tmp_path: Path) -> None:
    path, output = small(tmp_path), tmp_path / "structure.h5"
    code, out, err = run("structure", path, "-o", output, "--resolution", "coarse")
    assert (code, err) == (0, "")
    for words in (
        "displacement components",
        "scaled Jacobian, minimum",
        "bending of the wall kept (locking check): cos(0 phi) 100.00 %",
        "solver cyclic, licence BSD-3-Clause",
        "layout table: 6 gauges",
        "against the Fourier model",
        "sigma",
        "Strain per pressure",
        "GiB",
        f"{output}: written",
    ):
        assert words in out
    structure = load_structure(output)
    assert structure.model == "swept_hexahedra"
    assert "seconds" not in str(structure.statistics)
    # The Fourier model is the check: 0.3 % of the strain is what the coarse mesh is known to lose here.
    strain = largest_amplitude(structure.strain_operator @ reference_pressures(structure.point, 0.8))
    assert np.all(structure.mesh_error < 0.01 * strain)
    assert np.all(structure.mesh_error > 0.0)
    np.testing.assert_allclose(np.linalg.norm(structure.normal, axis=1), 1.0, atol=1e-12)
    assert structure.surface.area.sum() == pytest.approx(
        exact_wall(load_vehicle(path).body(), wall_of(load_vehicle(path)))["external"], rel=2e-3
    )


def test_full_mesh_gives_the_same(run: Run, tmp_path: Path) -> None:
    """Sector by sector against one factorisation of the whole: 1e-8 of the largest entry. Found: 1e-12."""
    path = small(tmp_path)
    by_sectors = solved(path)
    code, out, _ = run(
        "structure", path, "-o", tmp_path / "whole.h5", "--resolution", "coarse", "--solver", "superlu"
    )
    assert code == 0
    assert "solver superlu, licence BSD-3-Clause" in out
    whole = load_structure(tmp_path / "whole.h5")
    np.testing.assert_array_equal(whole.point, by_sectors.point)
    size = np.abs(by_sectors.strain_operator).max()
    np.testing.assert_allclose(whole.strain_operator, by_sectors.strain_operator, rtol=0.0, atol=1e-8 * size)


@pytest.mark.slow
def test_nothing_is_computed_twice(run: Run, tmp_path: Path) -> None:
    path, output = small(tmp_path), tmp_path / "structure.h5"

    def made(to: Path) -> tuple[str, str]:
        code, out, err = run("structure", path, "-o", to, "--resolution", "coarse")
        assert (code, err) == (0, "")
        return out, content_hash_of(to, SCHEMA, SCHEMA_VERSION)

    _, first = made(output)
    before = output.stat().st_mtime_ns
    out, again = made(output)
    assert f"{output}: up to date, not computed again" in out
    assert "Strain per pressure" not in out
    assert (again, output.stat().st_mtime_ns) == (first, before)
    small(tmp_path, ("x_m = [0.35, 0.6]", "x_m = [0.35, 0.5]"))
    out, other_gauges = made(output)
    assert "mesh: the same as before, its checks are not repeated" in out
    assert "Locking check " not in out
    assert other_gauges != first
    assert made(tmp_path / "afresh.h5")[1] == other_gauges
    small(tmp_path, ("wall_thickness_mm = 6.0", "wall_thickness_mm = 6.5"))
    out, _ = made(output)
    assert "the same as before" not in out
    assert "Locking check " in out


def test_brought_mesh(run: Run, clamped: Structure, tmp_path: Path) -> None:
    """The swept mesh in mm through a .vtu: wrong unit and locking are refused, with both allowed it is solved."""
    pytest.importorskip("meshio")
    path, mesh_file, output = small(tmp_path, OUTER), tmp_path / "wall.vtu", tmp_path / "structure.h5"
    vehicle = load_vehicle(path)
    mesh = full_mesh(swept_wall(vehicle.body(), wall_of(vehicle), "coarse"))
    write_mesh(mesh_file, replace(mesh, node=1e3 * mesh.node), with_surfaces=True)
    arguments = ("structure", path, "-o", output, "--resolution", "coarse", "--model", mesh_file)
    code, _, err = run(*arguments)
    assert code == 2
    assert "read it with the unit mm" in err
    # Its facets are 30 mm long where sqrt(R t) is 21 mm; read from a file they are integrated in full and lock.
    code, _, err = run(*arguments, "--mesh-unit", "0.001")
    assert code == 2
    assert "locking: hexahedron20 (full quadrature)" in err
    assert not output.exists()
    code, out, _ = run(*arguments, "--mesh-unit", "0.001", "--allow-locking")
    assert code == 0
    assert "warning: locking" in out
    structure = load_structure(output)
    assert structure.model == "imported"
    # Uniform pressure bends no wall: the same strain whichever way stiffness is integrated, found to 0.1 %.
    np.testing.assert_allclose(
        list(uniform_strain(structure).values()), list(uniform_strain(clamped).values()), rtol=0.01
    )


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


# The vehicle has few gauges; every kind of FMU takes the absolute form.
PLAIN_MAP = ("modes = 4", 'modes = 3\nform = "absolute"')


def test_an_imported_mesh_reaches_an_fmu(run: Run, tmp_path: Path) -> None:
    """Two commands from the mesh to the map, whose provenance names the file, and one to the FMU."""
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
    try:
        load_gmsh()
    except StrainfmuError as error:
        pytest.skip(str(error))
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
        (
            ("wall_thickness_mm = 6.0", "wall_thickness_mm = 5.0"),
            "wall thickness of the mesh: expected 5 mm, got 6 mm",
        ),
        (("end_x_m = 0.8", "end_x_m = 0.81"), "length of the mesh: expected 0.81 m, got 0.8 m"),
        (
            ("start_half_angle_deg = 20.0", "start_half_angle_deg = 21.0"),
            "outer radius of the mesh at x = 0.4",
        ),
    ],
)
def test_a_mesh_of_another_body_is_named_as_such(
    run: Run, tmp_path: Path, change: tuple[str, str], words: str
) -> None:
    """Which quantity, expected and found, in one line before anything is solved."""
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
    try:
        load_gmsh()
    except StrainfmuError as error:
        pytest.skip(str(error))
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
    try:
        load_gmsh()
    except StrainfmuError as error:
        pytest.skip(str(error))
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


@pytest.mark.fast
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--solver", "gauss"), "solver 'gauss' found, must be one of cyclic, superlu"),
        (("--layout", "other"), "layout 'other' found, must be one of table"),
        (("--resolution", "fine"), "resolution 'fine' found, must be one of coarse, medium, paper"),
        (("--model", "nothing.msh"), "nothing.msh: no such file; a model is 'swept', 'gmsh' or a mesh file"),
        (
            ("--mesh-unit", "0.001"),
            "model 'swept' needs no unit and has named surfaces: those options are for files",
        ),
    ],
)
def test_wrong_arguments_are_one_line(run: Run, tmp_path: Path, arguments: tuple[str, ...], words: str) -> None:
    code, _, err = run("structure", small(tmp_path), "-o", tmp_path / "structure.h5", *arguments)
    assert code == 2
    assert words in err
    assert err.count("\n") == 1
    assert not (tmp_path / "structure.h5").exists()


@pytest.mark.fast
def test_free_flight_is_not_cyclic(run: Run, tmp_path: Path) -> None:
    path = small(tmp_path, *FREE_FLIGHT)
    code, _, err = run("structure", path, "-o", tmp_path / "a.h5", "--resolution", "coarse", "--solver", "cyclic")
    assert code == 2
    assert "free flight" in err


@pytest.fixture(scope="module")
def both_maps(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Folders of the coarse ogive's map, built on the Fourier model and on the solid one.

    All harmonics that 36 roll angles carry, so that the two operators mean the same.
    """
    folder = tmp_path_factory.mktemp("both")
    harmonics = ("harmonics = 8", "harmonics = 17")
    solid = ("solid_tip_length_m = 0.1", 'solid_tip_length_m = 0.1\nmodel = "solid"\nresolution = "coarse"')
    fourier_file = write_vehicle(folder / "fourier.toml", harmonics)
    solid_file = write_vehicle(folder / "solid.toml", harmonics, solid)
    run_build(fourier_file, folder / "fourier", Silent())
    shutil.copytree(folder / "fourier", folder / "solid")  # the flows are the same
    run_build(solid_file, folder / "solid", Silent())
    return folder / "fourier", folder / "solid"


def both_operators(folders: tuple[Path, Path]) -> tuple[StructuralModel, MappedStructure, str]:
    vehicle = load_vehicle(folders[0].parent / "fourier.toml")
    fourier = structural_model(vehicle, vehicle.resolution.map, used_layouts(vehicle))
    snapshots = load_snapshots(folders[1] / "snapshots.h5")
    return fourier, mapped_structure(load_structure(folders[1] / "structure.h5"), snapshots), vehicle.gauges.layout


def test_operators_of_both_models_agree(both_maps: tuple[Path, Path]) -> None:
    """Z on the snapshots' nodes. Found: 4.7 % in all, 1.4 % up to harmonic 8; of the snapshots' strain 0.09 %.

    High harmonics of a single node's pressure are resolved differently by elements of 20 and of 30 mm; the
    snapshots hold little of them.
    """
    fourier, solid, layout = both_operators(both_maps)
    z, other = fourier.strain_operator(layout), solid.strain_operator(layout)
    assert np.linalg.norm(other - z) < 0.08 * np.linalg.norm(z)

    def low_harmonics(operator: np.ndarray) -> np.ndarray:
        return np.fft.rfft(fourier.surface.as_map(operator), axis=-1)[..., :9]

    assert np.linalg.norm(low_harmonics(other) - low_harmonics(z)) < 0.03 * np.linalg.norm(low_harmonics(z))
    net = load_snapshots(both_maps[0] / "snapshots.h5").pressure - 3000.0
    assert np.linalg.norm(net @ (other - z).T) < 3e-3 * np.linalg.norm(net @ z.T)


def test_maps_of_both_models_agree(both_maps: tuple[Path, Path]) -> None:
    """Load per strain, row by row. Found: 0.5 %; 2.5 % of the axial force, which the gauges hardly observe."""
    fourier, solid = (load_inverse_map(folder / "map.h5") for folder in both_maps)
    gain, other = (one.load_gain for one in (fourier, solid))
    apart = np.linalg.norm(other - gain, axis=1) / np.linalg.norm(gain, axis=1)
    assert np.all(apart < [0.04, 0.02, 0.02, 0.02, 0.02])
    assert fourier.provenance["structural_model"] == "fourier"
    assert "swept_hexahedra" in solid.provenance["structural_model"]


@pytest.mark.slow
def test_build_folder_reuses_its_structure(both_maps: tuple[Path, Path], run: Run, tmp_path: Path) -> None:
    vehicle = both_maps[0].parent / "solid.toml"
    folder = tmp_path / "again"
    shutil.copytree(both_maps[1], folder)
    code, out, _ = run("build", vehicle, "-o", folder)
    assert code == 0
    for name in ("snapshots.h5", "structure.h5", "map.h5"):
        assert f"{name}: up to date, reused" in out
    fewer = write_vehicle(tmp_path / "changed.toml", ("modes = 4", "modes = 3"))
    text = vehicle.read_text(encoding="utf-8").replace("modes = 4", "modes = 3")
    fewer.write_text(text, encoding="utf-8")
    code, out, _ = run("build", fewer, "-o", folder)
    assert code == 0
    assert "structure.h5: up to date, reused" in out
    assert "map.h5: up to date" not in out


def test_pressure_of_another_body_is_refused(both_maps: tuple[Path, Path]) -> None:
    """Snapshots in mm, and of a body 5 % shorter: neither gives a number."""
    structure = load_structure(both_maps[1] / "structure.h5")
    snapshots = load_snapshots(both_maps[1] / "snapshots.h5")
    free = replace(snapshots, station=None, radius=None, meridian_angle=None)
    with pytest.raises(InputError, match=r"structure: mapping: .*it is in mm"):
        mapped_structure(structure, replace(free, point=1e3 * free.point))
    with pytest.raises(InputError, match=r"structure: mapping: .*shapes differ"):
        mapped_structure(structure, replace(free, point=free.point * [0.95, 1.0, 1.0]))


def test_free_surface_of_snapshots(both_maps: tuple[Path, Path]) -> None:
    """Without stations and roll angles pressure is linear over triangles: the same within what 36 angles blur."""
    _, solid, layout = both_operators(both_maps)
    snapshots = load_snapshots(both_maps[1] / "snapshots.h5")
    free = replace(snapshots, station=None, radius=None, meridian_angle=None)
    mapped = mapped_structure(load_structure(both_maps[1] / "structure.h5"), free)
    net = snapshots.pressure - 3000.0
    strain = net @ solid.strain_operator(layout).T
    difference = net @ mapped.strain_operator(layout).T - strain
    assert np.linalg.norm(difference) < 0.01 * np.linalg.norm(strain)


@pytest.mark.slow
def test_demo_on_the_solid_model(both_maps: tuple[Path, Path], run: Run, tmp_path: Path) -> None:
    """The vehicle that flies stays the Fourier model: data and map come of two discretisations."""
    folder = tmp_path / "demo"
    shutil.copytree(both_maps[1], folder)
    code, out, _ = run("demo", "--vehicle", both_maps[0].parent / "solid.toml", "-o", folder)
    assert code == 0
    assert "structure.h5" in out
    assert "Structure: the vehicle that flies" in out
