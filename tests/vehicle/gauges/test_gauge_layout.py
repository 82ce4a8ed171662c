"""Gauge layouts: rows laid on the inner surface, and tables of positions."""

from math import cos, radians, sin, tan
from pathlib import Path

import numpy as np
import pytest

from builder.structure.fourier.fourier_model import place_layouts
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.gauge_checks import check_gauges
from builder.structure.gauge_placement import gauge_layout
from builder.structure.wall import wall_of
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.gauges.gauge_entries import GaugeLayoutEntry, GaugeRow
from builder.vehicle.gauges.layout import GaugeLayout, read_layout
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

HEADER = "name,x_m,y_m,z_m,direction_x,direction_y,direction_z\n"
FIVE, ONE = radians(5.0), radians(1.0)


@pytest.fixture(scope="module")
def shipped() -> Vehicle:
    return load_vehicle(IC3X)


@pytest.fixture(scope="module")
def inner_mesh(shipped: Vehicle) -> MeridianMesh:
    return shell_mesh(shipped.body(), wall_of(shipped), 0.036)


def layout_named(name: str, vehicle: Vehicle, mesh: MeridianMesh) -> GaugeLayout:
    return gauge_layout(vehicle.gauges.layouts[name], Path(), name, mesh)


def with_layout(vehicle: Vehicle, entry: GaugeLayoutEntry) -> Vehicle:
    """Return the vehicle with one layout, ``here``."""
    gauges = vehicle.gauges.model_copy(update={"layout": "here", "layouts": {"here": entry}})
    noise = vehicle.noise.model_copy(update={"of_layout": None})
    return vehicle.model_copy(update={"gauges": gauges, "noise": noise})


def from_table(vehicle: Vehicle, folder: Path, *lines: str) -> Vehicle:
    """Return the vehicle with a table of gauges as its layout."""
    path = folder / "gauges.csv"
    path.write_text(HEADER + "".join(f"{line}\n" for line in lines), encoding="utf-8")
    return with_layout(vehicle, GaugeLayoutEntry(file=str(path)))


def inner_radius(x: float) -> float:
    """Inner radius [m] ahead of the slope break: the cone's less the wall along its normal."""
    return x * tan(FIVE) - 0.004 / cos(FIVE)


def test_rows_lie_on_the_inner_surface(shipped: Vehicle, inner_mesh: MeridianMesh) -> None:
    """Cone's radius less 4 mm along the normal; axial gauges along the meridian, hoop ones across it."""
    layout = layout_named("configuration_1", shipped, inner_mesh)
    assert len(layout.names) == len(set(layout.names)) == 27
    i = layout.names.index("axial_180deg_1")
    np.testing.assert_allclose(layout.position[i], [0.35, 0.0, -inner_radius(0.35)], atol=1e-9)
    np.testing.assert_allclose(layout.direction[i], [cos(FIVE), 0.0, -sin(FIVE)], atol=1e-9)
    i = layout.names.index("hoop_180deg_9")
    radius = 1.75 * tan(FIVE) + 1.55 * tan(ONE) - 0.004 / cos(ONE)
    np.testing.assert_allclose(layout.position[i], [3.30, 0.0, -radius], atol=1e-9)
    np.testing.assert_allclose(layout.direction[i], [0.0, -1.0, 0.0], atol=1e-12)
    i = layout.names.index("axial_90deg_2")
    np.testing.assert_allclose(layout.position[i, :2], [0.71875, inner_radius(0.71875)], atol=1e-9)
    assert np.sum(np.abs(layout.direction[:, 0]) < 1e-12) == 9


def test_table_gives_the_same_gauges(shipped: Vehicle, inner_mesh: MeridianMesh, tmp_path: Path) -> None:
    rows = layout_named("configuration_2", shipped, inner_mesh)
    lines = [
        ",".join([name, *(repr(float(v)) for v in (*position, *(3.0 * direction)))])
        for name, position, direction in zip(rows.names, rows.position, rows.direction, strict=True)
    ]
    vehicle = from_table(shipped, tmp_path, *lines)
    found, placed = place_layouts(vehicle, inner_mesh, ["here"])
    assert found["here"].names == rows.names
    _, of_rows = place_layouts(shipped, inner_mesh, ["configuration_2"])
    for entry in ("x", "roll_angle", "meridional", "circumferential"):
        np.testing.assert_allclose(
            getattr(placed["here"], entry), getattr(of_rows["configuration_2"], entry), atol=1e-12
        )


def test_columns_may_be_in_any_order(tmp_path: Path) -> None:
    path = tmp_path / "gauges.csv"
    path.write_text("x_m,name,z_m,y_m,direction_z,direction_y,direction_x\n1,a,3,2,6,5,4\n", encoding="utf-8")
    layout = read_layout(path)
    assert layout.names == ("a",)
    np.testing.assert_array_equal(layout.position, [[1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(layout.direction, [[4.0, 5.0, 6.0]])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", r"expected the columns name, x_m, y_m, z_m, .*, got nothing"),
        ("name,x_m,y_m\na,1,2\n", r"expected the columns name, x_m, y_m, z_m, .*, got name, x_m, y_m"),
        (HEADER.replace("x_m", "x_mm", 1), r"expected the columns .*, got name, x_mm, "),
        ("root:secret:/root\n", r"expected the columns .*, got none of them$"),
        (HEADER, "holds no gauges"),
        (HEADER + "a,1,0,0.1,1,0,0\nb,one,0,0.1,1,0,0\n", r"line 3, column x_m: 'one' found, must be a number"),
        (HEADER + "a,1,0\n", r"line 2: expected 7 values, got 3"),
        (HEADER + "a,1e300,0,0.1,1,0,0\n", r"line 2, column x_m: expected -1000 .. 1000, got '1e300'"),
        (HEADER + "a,1,0,0.1,1e300,0,0\n", r"line 2, column direction_x: expected -1e\+06 .. 1e\+06, got '1e300'"),
        (HEADER + "a,1,0,0.1,1,0,0\n" * 4097, r"expected at most 4096 gauges, got 4097"),
        (HEADER + "a,1,0,nan,1,0,0\n", r"line 2, column z_m: 'nan' found, must be finite"),
        (HEADER + "a,1,0,0.1,1,0,0\na,2,0,0.1,1,0,0\n", "gauge name 'a' occurs twice"),
        (HEADER + ",1,0,0.1,1,0,0\n", "gauge name '' is empty"),
    ],
)
def test_faulty_table_is_refused(content: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "gauges.csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=words) as error:
        read_layout(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_table_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none.csv: no such file"):
        read_layout(tmp_path / "none.csv")
    with pytest.raises(InputError, match="cannot be read"):
        read_layout(tmp_path)
    path = tmp_path / "latin.csv"
    path.write_bytes(HEADER.encode() + "Flügel,1,0,0.1,1,0,0\n".encode("latin-1"))
    with pytest.raises(InputError, match="not a CSV file: expected text in UTF-8"):
        read_layout(path)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            f"g1,1.0,0,{inner_radius(1.0) + 1e-3 / cos(FIVE)},1,0,{tan(FIVE)}",
            r"g1: position is 1.00 mm outside the inner surface",
        ),
        (
            f"g1,1.0,0,{inner_radius(1.0) - 1e-3 / cos(FIVE)},1,0,{tan(FIVE)}",
            r"g1: position is 1.00 mm inside the inner surface",
        ),
        (f"g1,1.0,0,{inner_radius(1.0)},0,0,1", r"g1: direction leans 85.0 deg out of the inner surface"),
        (f"g1,1.0,0,{inner_radius(1.0)},0,0,0", r"g1: direction has no length"),
        ("g1,0.05,0,0.001,1,0,0", r"g1: x = 0.05 m is ahead of the hollow part"),
        ("g1,3.7,0,0.18,1,0,0", r"g1: x = 3.7 m is aft of the base"),
    ],
)
def test_gauge_off_the_surface_is_named(line: str, words: str, shipped: Vehicle, tmp_path: Path) -> None:
    vehicle = from_table(shipped, tmp_path, line)
    with pytest.raises(InputError, match=words):
        check_gauges(vehicle)


def test_gauge_on_the_surface_is_taken(shipped: Vehicle, tmp_path: Path) -> None:
    line = f"g1,1.0,{inner_radius(1.0)},0,1,{tan(FIVE)},0"
    assert check_gauges(from_table(shipped, tmp_path, line)) == {"here": 1}


def test_station_without_a_hollow_is_refused(shipped: Vehicle) -> None:
    row = GaugeRow(roll_angle_deg=0.0, directions=["axial"], x_m=[1.0, 0.05])
    with pytest.raises(
        InputError,
        match=r"gauges.layouts.here.rows.1: station 0.05 m found, the inner surface reaches from 0.1 to 3.6 m",
    ):
        check_gauges(with_layout(shipped, GaugeLayoutEntry(rows=[row])))


def test_row_given_twice_is_refused(shipped: Vehicle) -> None:
    """Under another name of the same roll angle too; the other surface and another station are other gauges."""
    row = GaugeRow(roll_angle_deg=0.0, directions=["axial"], x_m=[1.0])
    for again in (row, row.model_copy(update={"roll_angle_deg": 360.0})):
        with pytest.raises(
            ValueError, match=r"rows\.2: expected each gauge once, got the axial one at 1 m of rows\.1"
        ):
            GaugeLayoutEntry(rows=[row, again])
    twice = row.model_copy(update={"directions": ["axial", "axial"]})
    with pytest.raises(ValueError, match=r"rows\.1: expected each gauge once"):
        GaugeLayoutEntry(rows=[twice])
    others = [{"surface": "outer"}, {"x_m": [1.1]}, {"directions": ["hoop"]}, {"roll_angle_deg": 180.0}]
    GaugeLayoutEntry(rows=[row, *(row.model_copy(update=other) for other in others)])
    assert check_gauges(with_layout(shipped, GaugeLayoutEntry(rows=[row])))["here"] == 1


def test_a_spreadsheets_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    table = tmp_path / "gauges.csv"
    table.write_text(
        "name,x_m,y_m,z_m,direction_x,direction_y,direction_z\na,1,0,0.1,1,0,0\n", encoding="utf-8-sig"
    )
    assert read_layout(table).names == ("a",)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            "name,x_m,y_m,z_m,direction_x,direction_y,direction_z\na,1,0,0.1,1,0,0,9\n",
            "line 2: expected 7 values, got 8",
        ),
        (
            "name,x_m,x_m,y_m,z_m,direction_x,direction_y,direction_z\na,1,1,0,0.1,1,0,0\n",
            "got name, x_m, x_m",
        ),
    ],
)
def test_what_does_not_fit_the_header_is_refused(tmp_path: Path, content: str, words: str) -> None:
    table = tmp_path / "gauges.csv"
    table.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_layout(table)
