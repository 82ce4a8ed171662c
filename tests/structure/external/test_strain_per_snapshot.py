"""Strains of another structural code under our pressures, in place of any model of ours."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from inverse_case import snapshots_at
from nastran_files import op2_of_rods, write_gauges
from state_estimates import state_gain, state_offset

from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.surface.mesh import mesh_load_operator, mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.structure.external.external_structure import external_structure
from builder.structure.external.load_export import (
    LoadCases,
    export_loads,
    load_cases,
    strain_template,
    subcase_table,
)
from builder.structure.external.strain_per_snapshot import smallest_operator, structure_of_strains
from builder.structure.external.strain_table import read_strain_table
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.mapped_structure import MappedStructure, mapped_structure
from builder.structure.solid.case import structure_case
from builder.structure.solid.gauge_rows import Gauges
from builder.vehicle.file import Vehicle
from builder.vehicle.map_needs import used_layouts
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.reference.gain import load_covariance

PLACED = {"gauge_position_mm": 0.0, "gauge_orientation_deg": 0.0, "layout_roll_deg": 0.0}
"""Errors that need the strain of displaced gauges."""


@pytest.fixture(scope="module")
def listed(vehicle: Vehicle) -> Vehicle:
    """The shipped vehicle with a map of the listed conditions."""
    entry = vehicle.map.model_copy(update={"symmetry": "listed"})
    noise = vehicle.noise.model_copy(update={**PLACED, "wall_thickness_percent": 0.0})
    return vehicle.model_copy(update={"map": entry, "noise": noise})


@pytest.fixture(scope="module")
def newtonian(listed: Vehicle, structure: StructuralModel) -> Snapshots:
    """The conditions of the vehicle file, by local inclination: no flow to solve."""
    engine = NewtonianEngine(mesh_of_grid(structure.surface))
    return snapshots_at(engine, listed, listed.flight_conditions())


@pytest.fixture(scope="module")
def layouts(listed: Vehicle) -> dict[str, Gauges]:
    return dict(structure_case(listed, used_layouts(listed)).layouts)


@pytest.fixture(scope="module")
def cases(listed: Vehicle, newtonian: Snapshots) -> LoadCases:
    return load_cases(listed, newtonian)


@pytest.fixture(scope="module")
def strain(listed: Vehicle, structure: StructuralModel, cases: LoadCases) -> np.ndarray:
    """What the built-in model finds under the load cases."""
    return cases.pressure @ structure.strain_operator(listed.gauges.layout).T


@pytest.fixture(scope="module")
def table(
    tmp_path_factory: pytest.TempPathFactory,
    listed: Vehicle,
    cases: LoadCases,
    layouts: dict[str, Gauges],
    strain: np.ndarray,
) -> Path:
    path = tmp_path_factory.mktemp("strains") / "strains.csv"
    path.write_text(strain_template(cases, layouts, listed.gauges.layout, strain))
    return path


def mapped(path: Path, vehicle: Vehicle, snapshots: Snapshots, layouts: dict[str, Gauges]) -> MappedStructure:
    return mapped_structure(structure_of_strains(path, vehicle, snapshots, layouts), snapshots)


def same_map(found: InverseMap, expected: InverseMap, tolerance: float) -> None:
    """Compare what an estimator uses, each over its largest entry."""
    gain, offset = expected.load_per_state @ state_gain(expected), expected.load_per_state @ state_offset(expected)
    pairs = (
        (found.load_per_state @ state_gain(found), gain),
        (found.load_per_state @ state_offset(found), offset),
        (load_covariance(found), load_covariance(expected)),
        (found.noise_covariance, expected.noise_covariance),
        (found.mean_strain, expected.mean_strain),
        (found.strain_range, expected.strain_range),
    )
    for one, other in pairs:
        np.testing.assert_allclose(one, other, rtol=0.0, atol=tolerance * np.abs(other).max())


@pytest.mark.fast
def test_strains_of_the_built_in_model_come_back(
    listed: Vehicle,
    newtonian: Snapshots,
    layouts: dict[str, Gauges],
    table: Path,
    cases: LoadCases,
    strain: np.ndarray,
) -> None:
    """The error of the route itself is round-off: below 1e-12 of the largest strain."""
    found = structure_of_strains(table, listed, newtonian, layouts)
    error = cases.pressure @ found.strain_operator.T - strain
    assert np.abs(error).max() <= 1e-12 * np.abs(strain).max()


@pytest.mark.slow
@pytest.mark.parametrize("internal", ["ambient", 3000.0])
def test_the_map_is_that_of_the_built_in_route(
    listed: Vehicle,
    snapshots: Snapshots,
    layouts: dict[str, Gauges],
    structure: StructuralModel,
    tmp_path: Path,
    internal: str | float,
) -> None:
    """Also with a fixed pressure inside, which acts on its own: through the uniform case."""
    entry = listed.structure.model_copy(update={"internal_pressure_Pa": internal})
    vehicle = listed.model_copy(update={"structure": entry})
    cases = load_cases(vehicle, snapshots)
    strain = cases.pressure @ structure.strain_operator(vehicle.gauges.layout).T
    path = tmp_path / "strains.csv"
    path.write_text(strain_template(cases, layouts, vehicle.gauges.layout, strain))
    found = build_inverse_map(vehicle, snapshots, mapped(path, vehicle, snapshots, layouts))
    same_map(found, build_inverse_map(vehicle, snapshots, structure), 1e-9)


def test_microstrain_and_hdf5_give_the_same(
    listed: Vehicle,
    newtonian: Snapshots,
    layouts: dict[str, Gauges],
    table: Path,
    cases: LoadCases,
    strain: np.ndarray,
    tmp_path: Path,
) -> None:
    csv, h5 = tmp_path / "micro.csv", tmp_path / "strains.h5"
    csv.write_text(strain_template(cases, layouts, listed.gauges.layout, 1e6 * strain, "um/m"))
    read = read_strain_table(table)
    with h5py.File(h5, "w") as file:
        for name in ("case", "load_id", "column"):
            file[name] = list(getattr(read, name))
        file["strain"] = 1e6 * strain
        file["strain"].attrs["unit"] = "um/m"
    expected = structure_of_strains(table, listed, newtonian, layouts).strain_operator
    for path in (csv, h5):
        found = structure_of_strains(path, listed, newtonian, layouts).strain_operator
        np.testing.assert_allclose(cases.pressure @ found.T, cases.pressure @ expected.T, rtol=1e-9, atol=1e-16)


def test_exported_forces_are_those_of_the_pressure(
    listed: Vehicle, layouts: dict[str, Gauges], cases: LoadCases, tmp_path: Path
) -> None:
    few = LoadCases(
        surface=cases.surface,
        names=("case_0007", "uniform"),
        conditions=cases.conditions[6:7],
        pressure=cases.pressure[[6, -1]],
    )
    files = export_loads(few, layouts, listed.gauges.layout, tmp_path / "loads")
    assert [path.name for path in files][-2:] == ["gauges.csv", "strains.csv"]
    force = np.loadtxt(tmp_path / "loads" / "case_0007.csv", delimiter=",", skiprows=1)
    loads = mesh_load_operator(cases.surface, 0.0)[:3] @ few.pressure[0]
    np.testing.assert_allclose(force[:, [1, 3, 2]].sum(axis=0), loads, rtol=1e-9, atol=1e-9 * np.abs(loads).max())
    point = np.loadtxt(tmp_path / "loads" / "nodes.csv", delimiter=",", skiprows=1)[:, 1:]
    np.testing.assert_allclose(point, cases.surface.point, rtol=1e-11, atol=1e-12)
    header = (tmp_path / "loads" / "strains.csv").read_text().splitlines()[0]
    assert header.startswith("case,load_id,mach_number")
    assert header.endswith(",".join(layouts["configuration_2"].name[-2:]))
    with pytest.raises(InputError, match=r"strains\.csv: expected a folder without it"):
        export_loads(few, layouts, listed.gauges.layout, tmp_path / "loads")


def cards(text: str, name: str) -> np.ndarray:
    """Return the fields of all cards of one name in large format, four of 16 columns a line, empty ones as 0."""
    lines = [line for line in text.splitlines() if not line.startswith("$")]
    found = []
    for first, more in zip(lines[0::2], lines[1::2], strict=True):
        assert (first[:8], first[72:], more[:8]) == (f"{name}*".ljust(8), "*", "*".ljust(8))
        fields = [first[8 + 16 * k : 24 + 16 * k] for k in range(4)]
        fields += [more[8 + 16 * k : 24 + 16 * k] for k in range(3)]
        found.append([float(one) if one.strip() else 0.0 for one in fields])
    return np.array(found)


def test_nastran_runs_the_cases_and_its_results_come_back(
    listed: Vehicle,
    newtonian: Snapshots,
    layouts: dict[str, Gauges],
    cases: LoadCases,
    strain: np.ndarray,
    tmp_path: Path,
) -> None:
    """Cards hold nodes and forces; the table written beside them takes the strains of an OP2 file by subcase."""
    layout = listed.gauges.layout
    few = LoadCases(
        surface=cases.surface,
        names=("case_0007", "uniform"),
        conditions=cases.conditions[6:7],
        pressure=cases.pressure[[6, -1]],
    )
    export_loads(few, layouts, layout, tmp_path / "few", "bdf")
    grid = cards((tmp_path / "few" / "nodes.bdf").read_text(), "GRID")
    np.testing.assert_array_equal(grid[:, 0], 1 + np.arange(len(cases.surface.point)))
    np.testing.assert_allclose(grid[:, 2:5], cases.surface.point, rtol=1e-9, atol=1e-15)
    force = cards((tmp_path / "few" / "uniform.bdf").read_text(), "FORCE")
    assert set(force[:, 0]) == {2.0}
    assert set(force[:, 3]) == {1.0}
    loads = mesh_load_operator(cases.surface, 0.0)[:3] @ few.pressure[1]
    np.testing.assert_allclose(force[:, [4, 6, 5]].sum(axis=0), loads, rtol=1e-8, atol=1e-8 * np.abs(loads).max())
    assert "SUBCASE 2\n  LABEL = uniform\n  LOAD = 2\n" in (tmp_path / "few" / "case_control.bdf").read_text()

    table, names = tmp_path / "strains.csv", layouts[layout].name
    table.write_text(subcase_table(cases))
    elements = list(range(1, 1 + len(names)))
    (tmp_path / "run.op2").write_bytes(op2_of_rods(dict(enumerate(strain, 1)), elements, 8))
    write_gauges(tmp_path / "gauges_nastran.csv", names, elements)
    section = listed.structure.model_copy(
        update={
            "model": "solid",
            "strain_per_snapshot": "strains.csv",
            "nastran_results": ["run.op2"],
            "nastran_gauges": "gauges_nastran.csv",
        }
    )
    vehicle = listed.model_copy(update={"structure": section})
    vehicle._folder = tmp_path
    found = external_structure(vehicle, newtonian)
    assert np.abs(cases.pressure @ found.strain_operator.T - strain).max() <= 1e-12 * np.abs(strain).max()


def changed(text: str, row: int, column: int, value: str) -> str:
    lines = [line.split(",") for line in text.splitlines()]
    lines[row][column] = value
    return "\n".join(",".join(line) for line in lines) + "\n"


WRONG = {
    "no number": (lambda text: changed(text, 3, 8, "n/a"), r"line 4, column 'axial_180deg_2': expected a number"),
    "unit": (lambda text: changed(text, 2, 6, "strain units"), r"line 3: strain_unit: expected m/m, um/m"),
    "unit 1e6": (
        lambda text: text.replace("m/m", "1e6"),
        r"strain_unit: expected m/m, um/m, mm/m or percent, got '1e6'",
    ),
    "unit of 1e6": (lambda text: changed(text, 4, 9, "0.4"), r"expected a strain of at most 0.05 m/m"),
    "other load": (lambda text: changed(text, 5, 1, "abc"), r"case_0005: expected a load_id of these snapshots"),
    "row missing": (lambda text: "\n".join(text.splitlines()[:-1]), r"expected a row of uniform"),
    "column missing": (
        lambda text: text.replace("hoop_0deg_9", "hoop", 1),
        r"expected columns of gauges of configuration_2, got 'hoop'",
    ),
    "empty line ahead": (lambda text: "\n" + changed(text, 3, 8, "n/a"), r"line 5, column 'axial_180deg_2'"),
    "short row": (lambda text: text.rsplit(",", 1)[0], r"line 92: expected 61 values, got 60"),
    "case twice": (
        lambda text: changed(text, 5, 0, "case_0004"),
        r"expected each case once, got 'case_0004' again",
    ),
}


@pytest.mark.fast
@pytest.mark.parametrize("fault", WRONG)
def test_a_wrong_table_is_refused_in_one_line(
    listed: Vehicle, newtonian: Snapshots, layouts: dict[str, Gauges], table: Path, tmp_path: Path, fault: str
) -> None:
    edit, message = WRONG[fault]
    path = tmp_path / "wrong.csv"
    path.write_text(edit(table.read_text()))
    with pytest.raises(InputError, match=message) as caught:
        structure_of_strains(path, listed, newtonian, layouts)
    assert "\n" not in str(caught.value)


@pytest.mark.fast
@pytest.mark.parametrize("factor", [-1.0, 1e-3, 3.0])
def test_a_case_out_of_line_is_refused(
    listed: Vehicle,
    newtonian: Snapshots,
    layouts: dict[str, Gauges],
    cases: LoadCases,
    strain: np.ndarray,
    tmp_path: Path,
    factor: float,
) -> None:
    odd = strain.copy()
    odd[40] *= factor
    path = tmp_path / "odd.csv"
    path.write_text(strain_template(cases, layouts, listed.gauges.layout, odd))
    with pytest.raises(InputError, match=r"odd\.csv: case_0041: expected the strain that the other cases predict"):
        structure_of_strains(path, listed, newtonian, layouts)


def test_a_structure_that_is_not_linear_is_refused(cases: LoadCases, strain: np.ndarray) -> None:
    """A load that is twice another must have twice its strain."""
    pressure, doubled = np.vstack([cases.pressure, 2.0 * cases.pressure[3]]), np.vstack([strain, 1.9 * strain[3]])
    with pytest.raises(InputError, match="is the analysis linear"):
        smallest_operator(pressure, doubled, (*cases.names, "twice"))


def test_every_roll_angle_needs_more_than_listed_conditions(
    vehicle: Vehicle, newtonian: Snapshots, layouts: dict[str, Gauges], table: Path
) -> None:
    with pytest.raises(InputError, match=r"map\.symmetry: expected 'listed'"):
        structure_of_strains(table, vehicle, newtonian, layouts)
