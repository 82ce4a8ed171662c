"""Influence matrices: the strain of gauges per force at the nodes of a surface, in place of a mesh of ours."""

import csv
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from nastran_files import op2_of_rods, write_gauges
from state_estimates import state_gain

from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.reporting import Silent
from builder.structure.external.external_structure import (
    check_equilibrium,
    external_structure,
    lateral_lines,
    structure_of_influence,
    thinned,
    written_influence,
)
from builder.structure.external.influence_file import Influence, read_influence, write_influence
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.mapped_structure import mapped_structure
from builder.structure.solid.case import SolidCase, structure_case
from builder.structure.solid.mesh_choice import MeshChoice
from builder.structure.solid.solid_model import solve_solid_structure
from builder.structure.structure_file import Structure, load_structure, save_structure
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.reference.gain import load_covariance

LAYOUT = "configuration_1"


@pytest.fixture(scope="module")
def plain(vehicle: Vehicle) -> Vehicle:
    """The shipped vehicle with its 27 gauges, exactly placed."""
    noise = vehicle.noise.model_copy(
        update={
            "gauge_position_mm": 0.0,
            "gauge_orientation_deg": 0.0,
            "layout_roll_deg": 0.0,
            "wall_thickness_percent": 0.0,
            "of_layout": None,
        }
    )
    gauges = vehicle.gauges.model_copy(update={"layout": LAYOUT})
    return vehicle.model_copy(update={"noise": noise, "gauges": gauges})


@pytest.fixture(scope="module")
def case(plain: Vehicle) -> SolidCase:
    return structure_case(plain, [LAYOUT], MeshChoice(resolution="coarse"))


@pytest.fixture(scope="module")
def built_in(case: SolidCase) -> Structure:
    return solve_solid_structure(case, Silent())


@pytest.fixture(scope="module")
def matrix(case: SolidCase, tmp_path_factory: pytest.TempPathFactory) -> Influence:
    return written_influence(case, LAYOUT, tmp_path_factory.mktemp("influence") / "z.h5")


@pytest.fixture(scope="module")
def found(plain: Vehicle, case: SolidCase, matrix: Influence) -> Structure:
    return structure_of_influence(matrix.path, None, plain, case.layouts)


@pytest.mark.slow
def test_its_own_matrix_gives_the_built_in_strain_and_map(
    plain: Vehicle, snapshots: Snapshots, built_in: Structure, found: Structure, tmp_path: Path
) -> None:
    """Strain per pressure and the map's gain within 1e-10, through the file of the structure."""
    scale = np.abs(built_in.strain_operator).max()
    np.testing.assert_allclose(found.strain_operator, built_in.strain_operator, rtol=0.0, atol=1e-10 * scale)
    save_structure(found, tmp_path / "structure.h5")
    read = load_structure(tmp_path / "structure.h5")
    assert read.check is not None
    assert found.check is not None
    np.testing.assert_array_equal(read.check.strain_operator, found.check.strain_operator)
    # The error of the mesh is known of both and not the same: the built-in one is measured on the Fourier model.
    unchecked = [mapped_structure(replace(one, check=None), snapshots) for one in (read, built_in)]
    maps = [build_inverse_map(plain, snapshots, replace(one, is_external=True)) for one in unchecked]
    gain, expected = (one.load_per_state @ state_gain(one) for one in maps)
    np.testing.assert_allclose(gain, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())
    np.testing.assert_allclose(load_covariance(maps[0]), load_covariance(maps[1]), rtol=1e-9)


def test_a_clamped_body_is_in_equilibrium(matrix: Influence, case: SolidCase) -> None:
    """Every axial gauge: a straight line, its zero within 3 % of the length, compression on the pushed side."""
    found = lateral_lines(matrix.node, matrix.strain_per_force, case.layouts[LAYOUT])
    assert len(found) >= 16
    assert found[:, 0].min() > 0.98
    assert np.abs(found[:, 1]).max() < 0.03
    assert (found[:, 2] < 0.0).all()


FAULTS: dict[str, tuple[Callable[[Influence], tuple[np.ndarray, np.ndarray]], str]] = {
    "axes swapped": (
        lambda one: (one.node[:, [2, 1, 0]], one.strain_per_force),
        "equilibrium: expected axial strain linear",
    ),
    "nodes in another order": (
        lambda one: (one.node, np.roll(one.strain_per_force, len(one.node) // 3, axis=1)),
        "equilibrium: expected axial strain linear",
    ),
    "another length": (
        lambda one: (one.node * np.array([1.2, 1.0, 1.0]), one.strain_per_force),
        "the zero .* of the length aft of it",
    ),
    "sign": (lambda one: (one.node, -one.strain_per_force), "expected compression on the side"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_matrix_out_of_equilibrium_is_refused(matrix: Influence, case: SolidCase, fault: str) -> None:
    change, message = FAULTS[fault]
    node, strain = change(matrix)
    with pytest.raises(InputError, match=message):
        check_equilibrium(matrix.path, node, strain, case.layouts[LAYOUT])


@pytest.mark.fast
def test_forces_on_fewer_nodes_keep_force_and_moment(structure: StructuralModel) -> None:
    """Of random forces: the sum exactly, the moment within 2 % of |r| |f|."""
    random, surface = np.random.default_rng(3), mesh_of_grid(structure.surface)
    thin = thinned(surface)
    force = random.normal(size=(surface.n_nodes, 3))
    carried = thin.spread.T @ force
    assert thin.n_nodes < 0.4 * surface.n_nodes
    assert np.count_nonzero(np.abs(carried).sum(axis=1)) <= thin.n_nodes
    np.testing.assert_allclose(carried.sum(axis=0), force.sum(axis=0), atol=1e-9)
    moment = np.cross(surface.point, carried).sum(axis=0) - np.cross(surface.point, force).sum(axis=0)
    assert np.linalg.norm(moment) < 0.02 * np.sum(np.linalg.norm(np.cross(surface.point, force), axis=1))


@pytest.mark.slow
@pytest.mark.parametrize(("size", "tolerance"), [(8, 1e-10), (4, 1e-6)])
def test_an_op2_file_gives_the_map_of_the_same_matrix(
    plain: Vehicle,
    snapshots: Snapshots,
    case: SolidCase,
    matrix: Influence,
    tmp_path: Path,
    size: int,
    tolerance: float,
) -> None:
    """A subcase per unit force, a rod per gauge: within 1e-10 in double precision; 1e-6 in single (3e-8 found)."""
    n = len(matrix.node)
    elements = list(range(1, 1 + len(matrix.column)))
    strain = matrix.strain_per_force.transpose(1, 2, 0).reshape(3 * n, -1)
    (tmp_path / "z.op2").write_bytes(op2_of_rods(dict(enumerate(1e3 * strain, 1)), elements, size))
    write_gauges(tmp_path / "gauges_nastran.csv", matrix.column, elements)
    with (tmp_path / "z.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["node", "x_m", "y_m", "z_m", "direction", "force_N", "subcase"])
        for node, place in enumerate(matrix.node.tolist()):
            for axis in range(3):
                writer.writerow([node, *map(repr, place), "xyz"[axis], "1000", 3 * node + axis + 1])
    np.savetxt(tmp_path / "facets.csv", matrix.facet, "%d", ",", header=",".join("abcdefgh"), comments="")
    entries = {
        "influence": "z.csv",
        "influence_facets": "facets.csv",
        "nastran_results": ["z.op2"],
        "nastran_gauges": "gauges_nastran.csv",
    }
    section = plain.structure.model_copy(update={**entries, "model": "solid"})
    vehicle = plain.model_copy(update={"structure": section})
    vehicle._folder = tmp_path
    read = external_structure(vehicle, snapshots)
    same = replace(matrix, path=tmp_path / "z.h5", split=True)  # as matrices of CSV files are taken
    write_influence(same)
    held = structure_of_influence(same.path, None, plain, case.layouts)
    scale = np.abs(held.strain_operator).max()
    np.testing.assert_allclose(read.strain_operator, held.strain_operator, rtol=0.0, atol=tolerance * scale)
    expected = build_inverse_map(plain, snapshots, mapped_structure(held, snapshots))
    made = build_inverse_map(plain, snapshots, mapped_structure(read, snapshots))
    for quantity in (state_gain, load_covariance):
        one, other = quantity(made), quantity(expected)
        np.testing.assert_allclose(one, other, rtol=0.0, atol=tolerance * np.abs(other).max())


@pytest.mark.slow
def test_the_number_of_nodes_is_judged_in_sigma(plain: Vehicle, snapshots: Snapshots, found: Structure) -> None:
    """On the coarse mesh's nodes a fraction of a sigma, which the map says."""
    held = build_inverse_map(plain, snapshots, mapped_structure(found, snapshots)).provenance["mesh_error"]
    assert "of its" in held["against"]
    assert 0.0 < held["rms_sigma"] < held["largest_sigma"]


def test_a_csv_file_says_the_same(matrix: Influence, tmp_path: Path) -> None:
    """Forces of 100 N, strains in um/m, nodes numbered as the code likes."""
    few = 40
    path, facets = tmp_path / "z.csv", tmp_path / "facets.csv"
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        names = ["node", "x_m", "y_m", "z_m", "direction", "force_N", "strain_unit", *matrix.column]
        writer.writerow(names)
        for node in range(few):
            for axis in range(3):
                place = [repr(float(one)) for one in matrix.node[node]]
                strain = [repr(float(1e8 * one)) for one in matrix.strain_per_force[:, node, axis]]
                writer.writerow([f"N{7 * node}", *place, "xyz"[axis], "100", "um/m", *strain])
    facets.write_text("node_1,node_2,node_3\nN0,N7,N14\nN14,N7,N21\n")
    read = read_influence(path, facets)
    np.testing.assert_array_equal(read.facet, [[0, 1, 2], [2, 1, 3]])
    np.testing.assert_allclose(read.strain_per_force, matrix.strain_per_force[:, :few], rtol=1e-12)
    np.testing.assert_array_equal(read.node, matrix.node[:few])


def test_wrong_files_are_refused_in_one_line(matrix: Influence, tmp_path: Path) -> None:
    def changed(name: str, value: object, unit: str | None = None) -> Path:
        path = tmp_path / f"changed_{len(list(tmp_path.iterdir()))}.h5"
        shutil.copy(matrix.path, path)
        with h5py.File(path, "r+") as file:
            del file[name]
            if value is not None:
                file[name] = value
            if unit is not None:
                file[name].attrs["unit"] = unit
        return path

    strain = matrix.strain_per_force.copy()
    strain[0, 5, 1] = np.nan
    for path, message in (
        (changed("facet", None), "expected a dataset 'facet'"),
        (changed("facet", matrix.facet + 1), "facet: expected nodes 0 to"),
        (changed("facet", matrix.facet[:, :5]), "expected rows of 3, 4, 6 or 8 nodes"),
        (changed("strain_per_force", strain), "expected a finite number"),
        (changed("strain_per_force", strain[:, :-1]), "strain_per_force: expected shape"),
        (changed("node", 1e3 * matrix.node), "expected metres"),
        (changed("node", matrix.node, "mm"), "node: expected unit m, got 'mm'"),
        (changed("column", ["same"] * len(matrix.column)), "expected each column once"),
        (tmp_path / "none.h5", "damaged, or not an HDF5 file"),
        (tmp_path / "z.txt", r"expected a file \.h5 or \.csv"),
    ):
        with pytest.raises(InputError, match=message) as caught:
            read_influence(path)
        assert "\n" not in str(caught.value)
