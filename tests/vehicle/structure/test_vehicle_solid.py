"""What the vehicle file says of the solid model: supports, and gauges outside and of a length."""

from math import cos, radians, sin, tan
from pathlib import Path

import pytest
from changed_vehicle import load_changed

from builder.structure.gauge_checks import check_gauges
from builder.structure.solid.case import structure_case
from builder.structure.solid.supports import Clamped, Foundation, support_of
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError


def solid(folder: Path, *changes: tuple[str, str]) -> Vehicle:
    return load_changed(folder, ('model = "fourier"', 'model = "solid"'), *changes)


def test_old_files_stay_valid(tmp_path: Path) -> None:
    """Without the entries of the solid model: the Fourier model, clamped, gauges as points inside."""
    vehicle = load_changed(
        tmp_path,
        ('model = "fourier" ', "#"),
        ('resolution = "medium" ', "#"),
        ('support = "clamped_aft" ', "#"),
    )
    assert vehicle.structure.model == "fourier"
    assert support_of(vehicle) == Clamped("support")
    case = structure_case(vehicle, ["configuration_1"])
    assert case.record["mesh"]["resolution"] == "medium"
    assert set(case.layouts["configuration_1"].surface) == {"internal"}
    assert not case.layouts["configuration_1"].length.any()


def test_supports_of_the_solid_model(tmp_path: Path) -> None:
    springs = "foundation_normal_N_per_m3 = 1e11\nfoundation_tangential_N_per_m3 = 5e10"
    held = solid(tmp_path, ('support = "clamped_aft"', f'support = "elastic_foundation"\n{springs}'))
    assert support_of(held) == Foundation("support", 1e11, 5e10)
    free = solid(
        tmp_path,
        ('support = "clamped_aft"', 'support = "free_flight"'),
    )
    assert support_of(free) is None
    assert structure_case(free, []).matter.density == 4430.0


def test_gauges_outside_and_of_a_length(tmp_path: Path) -> None:
    """The first row of configuration_1 outside: on the cone's surface, axial ones along its meridian."""
    row = "{ roll_angle_deg = 180.0,"
    vehicle = solid(tmp_path, (row, f'{row} surface = "outer", length_mm = 3.0,'))
    assert check_gauges(vehicle)["configuration_1"] == 27
    gauges = structure_case(vehicle, ["configuration_1"]).layouts["configuration_1"]
    i = gauges.name.index("axial_180deg_1_outer")
    assert gauges.position[i] == pytest.approx([0.35, 0.0, -0.35 * tan(radians(5.0))], abs=1e-12)
    assert gauges.direction[i] == pytest.approx([cos(radians(5.0)), 0.0, -sin(radians(5.0))], abs=1e-12)
    i = gauges.name.index("hoop_180deg_1_outer")
    assert gauges.direction[i] == pytest.approx([0.0, -1.0, 0.0], abs=1e-12)
    assert (gauges.surface.count("external"), gauges.length.max()) == (18, 3e-3)
    assert gauges.surface[gauges.name.index("axial_90deg_1")] == "internal"


def test_table_outside(tmp_path: Path) -> None:
    """Beside file, surface and length are those of all its gauges."""
    radius = 0.5 * tan(radians(5.0))
    table = f"name,x_m,y_m,z_m,direction_x,direction_y,direction_z\none,0.5,0,{radius},0,1,0\n"
    (tmp_path / "gauges.csv").write_text(table, encoding="utf-8")
    entry = '[gauges.layouts.table]\nfile = "gauges.csv"\nsurface = "outer"\nlength_mm = 3.0\n'
    vehicle = solid(tmp_path, ("# Snapshots: all", f"{entry}\n# Snapshots: all"))
    assert check_gauges(vehicle)["table"] == 1
    gauges = structure_case(vehicle, ["table"]).layouts["table"]
    assert (gauges.name, gauges.surface, gauges.length.tolist()) == (("one",), ("external",), [3e-3])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            (("{ roll_angle_deg = 180.0,", '{ roll_angle_deg = 180.0, surface = "outer",'),),
            "layouts.configuration_1.rows.1.surface: 'outer' found",
        ),
        (
            (("{ roll_angle_deg = 180.0,", "{ roll_angle_deg = 180.0, length_mm = 3.0,"),),
            "layouts.configuration_1.rows.1.length_mm: 3 found",
        ),
    ],
)
def test_what_the_fourier_model_cannot_do(
    tmp_path: Path, changes: tuple[tuple[str, str], ...], words: str
) -> None:
    """Refused with the model that can; that model takes it."""
    with pytest.raises(InputError, match=f"{words}, the Fourier model cannot do that, structure.model = 'solid'"):
        check_gauges(load_changed(tmp_path, *changes))
    assert check_gauges(solid(tmp_path, *changes))["configuration_1"] == 27


def test_gauge_off_its_surface_is_refused_by_the_solid_model(tmp_path: Path) -> None:
    table = "name,x_m,y_m,z_m,direction_x,direction_y,direction_z\none,0.5,0,0.06,0,1,0\n"
    (tmp_path / "gauges.csv").write_text(table, encoding="utf-8")
    entry = '[gauges.layouts.table]\nfile = "gauges.csv"\n'
    with pytest.raises(InputError, match=r"one: position is .* mm off surface 'internal'"):
        check_gauges(solid(tmp_path, ("# Snapshots: all", f"{entry}\n# Snapshots: all")))
