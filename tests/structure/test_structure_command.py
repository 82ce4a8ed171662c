"""``strainfmu structure`` on the swept mesh, as a user runs it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_ogive import FREE_FLIGHT, OUTER, PRESSURE, small, solved

from builder.structure.solid.checks import largest_amplitude, reference_pressures
from builder.structure.solid.mesh_checks import exact_wall
from builder.structure.solid.mesh_files import write_mesh
from builder.structure.solid.swept_mesh import full_mesh, swept_wall
from builder.structure.structure_file import SCHEMA, SCHEMA_VERSION, Structure, load_structure
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle, load_vehicle
from strainfmu.files import content_hash_of

Run = Callable[..., tuple[int, str, str]]


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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_full_mesh_gives_the_same(run: Run, clamped: Structure, tmp_path: Path) -> None:
    """Sector by sector against one factorisation of the whole: 1e-8 of the largest entry. Found: 1e-12.

    The factorisation takes the time: the command has no mesh with fewer elements than the coarse one.
    """
    path = small(tmp_path, OUTER)
    code, out, _ = run(
        "structure", path, "-o", tmp_path / "whole.h5", "--resolution", "coarse", "--solver", "superlu"
    )
    assert code == 0
    assert "solver superlu, licence BSD-3-Clause" in out
    whole = load_structure(tmp_path / "whole.h5")
    np.testing.assert_array_equal(whole.point, clamped.point)
    size = np.abs(clamped.strain_operator).max()
    np.testing.assert_allclose(whole.strain_operator, clamped.strain_operator, rtol=0.0, atol=1e-8 * size)


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


@pytest.mark.slow
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
