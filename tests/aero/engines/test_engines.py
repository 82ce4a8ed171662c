"""Engines of a vehicle, and the messages where one cannot be made."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from builder.aero.cfd.units import METRES
from builder.aero.engines.euler import EulerEngine
from builder.aero.engines.newtonian import LEEWARD, STAGNATION
from builder.aero.engines.registry import ENGINES, make_engine
from builder.campaign.snapshots import load_snapshots
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.model_entries import Aerodynamics
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load_vehicle(IC3X)


def with_entries(vehicle: Vehicle, **entries: str) -> Vehicle:
    return vehicle.model_copy(update={"aerodynamics": Aerodynamics(**entries)})


def test_default_is_the_euler_solver_on_the_vehicles_cells(vehicle: Vehicle) -> None:
    engine = make_engine(vehicle, None, vehicle.resolution.map)
    assert isinstance(engine, EulerEngine)
    assert (engine.marching_grid.n_radial, engine.marching_grid.n_circumferential) == (24, 36)
    assert engine.surface.n_nodes == engine.grid.n_nodes == 120 * 72


def test_every_engine_says_its_name(vehicle: Vehicle) -> None:
    """The names at the user's edge are the engines' own: the journal and the file carry them."""
    assert set(ENGINES) == {"euler", "newtonian", "table"}
    for name in ("euler", "newtonian"):
        assert make_engine(vehicle, name, vehicle.resolution.map).name == name


def test_newtonian_on_the_vehicles_own_surface(vehicle: Vehicle, tmp_path: Path, run: Run) -> None:
    """The nodes are those of the structure; two conditions through the command, reused the second time."""
    engine = make_engine(vehicle, "newtonian", vehicle.resolution.map)
    assert engine.surface.n_nodes == 120 * 72
    conditions, output = tmp_path / "set.csv", tmp_path / "snapshots.h5"
    conditions.write_text("mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km\n6,4,0,20\n6,0,4,20\n")
    arguments = ("snapshots", IC3X, "--engine", "newtonian", "--set", conditions, "-o", output)
    code, printed, _ = run(*arguments)
    assert code == 0
    assert "2 solved now, 0 reused" in " ".join(printed.split())
    snapshots = load_snapshots(output)
    assert snapshots.engine == "newtonian"
    assert snapshots.grid is not None
    # Upwash lifts as much as the same wind from starboard pushes to port.
    coefficients = snapshots.coefficients()
    assert coefficients[0, 1] == pytest.approx(-coefficients[1, 2], rel=1e-9)
    _, printed, _ = run(*arguments)
    assert "up to date, not written again" in " ".join(printed.split())


def test_wrong_entries_of_the_newtonian_engine(vehicle: Vehicle) -> None:
    for entries, words in (({"surface": "none.stl"}, r"none\.stl"),):
        with pytest.raises(InputError, match=words):
            make_engine(with_entries(vehicle, **entries), "newtonian", vehicle.resolution.map)


def test_words_of_the_vehicle_file_are_those_of_the_engines() -> None:
    fields = Aerodynamics.model_fields
    for entry, words in (
        ("surface_length_unit", tuple(METRES)),
        ("stagnation", STAGNATION),
        ("leeward", LEEWARD),
    ):
        found = [one for part in (fields[entry].annotation,) for one in _words(part)]
        assert tuple(found) == words


def _words(annotation: Any) -> list[str]:
    """Return the words of a literal, also of an optional one."""
    parts = get_args(annotation)
    return [word for part in parts for word in ([part] if isinstance(part, str) else _words(part))]


def test_unknown_engine(vehicle: Vehicle) -> None:
    with pytest.raises(InputError, match="engine: 'su2' found, must be one of euler, newtonian, table"):
        make_engine(vehicle, "su2", vehicle.resolution.map)


def test_table_without_manifest(vehicle: Vehicle) -> None:
    with pytest.raises(InputError, match=r"aerodynamics\.manifest: entry is missing"):
        make_engine(vehicle, "table", vehicle.resolution.map)
    with pytest.raises(InputError, match=r"none\.toml"):
        make_engine(with_entries(vehicle, engine="table", manifest="none.toml"), None, vehicle.resolution.map)


def test_levels_belong_to_the_euler_engine(vehicle: Vehicle) -> None:
    with pytest.raises(InputError, match="--grid: 'fine' found, the table engine has no cells"):
        make_engine(vehicle, "table", vehicle.resolution.map, "fine")
    with pytest.raises(InputError, match="--grid: 'finest' found, must be one of coarse, medium, fine"):
        make_engine(vehicle, "euler", vehicle.resolution.map, "finest")


def test_levels_change_the_cells_alone(vehicle: Vehicle) -> None:
    plain, coarse = (make_engine(vehicle, "euler", vehicle.resolution.map, level) for level in (None, "coarse"))
    assert plain.inputs()["marching_grid"] != coarse.inputs()["marching_grid"]
    np.testing.assert_array_equal(plain.surface.point, coarse.surface.point)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--engine", "su2"), "engine: 'su2' found"),
        (("--grid", "finest"), "--grid: 'finest' found"),
        (("--workers", "-1"), "--workers"),
        (("--set", "P3"), "P3: no such file; a set of conditions is P1, P2 or a CSV file"),
    ],
)
def test_wrong_options_are_one_line(arguments: tuple[str, ...], words: str, tmp_path: Path, run: Run) -> None:
    code, _, message = run("snapshots", IC3X, "-o", tmp_path / "out" / "snapshots.h5", *arguments)
    assert code == 2
    assert message.count("\n") == 1
    assert words in message
    assert not (tmp_path / "out").exists()


def test_output_that_is_a_folder_is_refused(tmp_path: Path, run: Run) -> None:
    code, _, message = run("snapshots", IC3X, "-o", tmp_path)
    assert (code, message) == (2, f"strainfmu: {tmp_path}: is a folder, must be a file\n")
