"""What can be wrong with imported results: one line each, nothing on standard error, no half-read data."""

import base64
import re
import struct
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
from imported_case import CONDITION, case_text, imported_ratio, manifest_text

from builder.aero.cfd.formats.cart3d import write_cart3d
from builder.aero.cfd.manifest import load_manifest
from builder.aero.cfd.surface_field import read_field
from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.snapshots import Snapshots
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.errors import InputError

Spoil = Callable[[Path], None]

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.0, 0, 1]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


def refused(capfd: pytest.CaptureFixture[str], action: Callable[[], object], *words: str) -> None:
    """Check that ``action`` raises one line that holds ``words`` and prints nothing."""
    with pytest.raises(InputError) as caught:
        action()
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message
    assert capfd.readouterr() == ("", "")


def write_vtu(path: Path, **options: object) -> None:
    """Write two triangles with the node array p = 1..5."""
    mesh = meshio.Mesh(POINTS, [("triangle", TRIANGLES)], point_data={"p": np.arange(1.0, 6.0)})
    mesh.write(path, **options)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.vtu", b"", ("a.vtu", "empty")),
        ("a.vtu", b"solid nothing of the kind", ("no VTK header",)),
        ("a.vtu", b"<VTKFile type='ImageData'></VTKFile>", ("'ImageData'", "PolyData or UnstructuredGrid")),
        ("a.vtu", b"<VTKFile type='UnstructuredGrid'><Unstruct></VTKFile>", ("damaged", "XML")),
        ("a.vtk", b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 1 1 1\n", ()),
        ("a.plt", b"TITLE", ("'.plt' found", ".triq", ".csv")),
        ("a.triq", b"3 1 1\n0 0 0\n1 0 0\n0 1 0\n1 2 3\n1\n1 2\n", ("15 numbers", "16")),
        ("a.triq", b"3 1 1\n0 0 0\n1 0 0\n0 1 0\n1 2 4\n1\n1 2 3\n", ("triangle 1", "vertex 4", "1 to 3")),
        ("a.triq", b"3 1 1\n0 0 0\n1 0 0\n0 1 x\n1 2 3\n1\n1 2 3\n", ("line 4", "'x' found")),
        ("a.triq", b"3 1 1\n0 0 0\n1 0 0\n0 1 0\n1 2 3\n1\n1 nan 3\n", ("line 7", "'nan' found")),
        ("a.triq", b"3 1\n0 0 0\n", ("line 1", "'3 1' found", "nScalars")),
        ("a.triq", struct.pack("<5i", 12, 3, 1, 1, 12), ("binary", "ASCII")),
        ("a.csv", b"x,y,z\n0,0,0\n", ("0 columns",)),
        ("a.csv", b"x,y,p\n0,0,1\n", ("no column 'z'", "x, y, p")),
        (
            "a.csv",
            b"node,  x-coordinate,y-coordinate,z-coordinate,  p\n1,0,0,0,1\n",
            ("no column 'x'", "node, x-co"),
        ),
        ("a.csv", b'"Pressure (Pa)","X (m)","Y (m)","Z (m)"\n1,0,0,0\n', ("there are: Pressure (Pa), X (m)",)),
        (
            "a.csv",
            b"\n[Name]\nwall\n\n[Data]\nX [ m ], Y [ m ], Z [ m ], P [ Pa ]\n0,0,0,1\n",
            ("are: X [ m ], Y",),
        ),
        ("a.csv", b"# p  FACE_DATA 1\n#  x  y  z  p\n0 0 0 1\n", ("are: x, y, z, p",)),
        ("a.csv", b'VARIABLES = "X" "Y" "Z" "Cp"\nZONE I=1\n0. 0 0 1\n', ("are: X, Y, Z, Cp",)),
        ("a.csv", b"a;b;c;p in Pa\n0,5;0;0;1,5\n", ("are: a, b, c, p in Pa",)),
        ("a.csv", b"root:secret:0:0\nbin:x:1:1\n", ("there are: none of them",)),
        ("a.csv", b"x,y,z,p\n0,0,0,1\n0,0,zero,1\n", ("line 3", "column 'z'", "'zero' found")),
        ("a.csv", b"x,y,z,p\n0,0,0,1\n0,0,0\n", ("line 3", "3 columns", "4")),
        ("a.csv", b"x,y,z,p\n0,0,0,nan\n", ("line 2", "column 'p'", "'nan' found", "finite")),
        ("a.csv", b"x,y,z,p\n", ("no line of numbers",)),
        ("a.csv", b"x,y,z,p,T\n0,0,0,1,2\n", ("2 columns could be meant", "p, T")),
        ("a.csv", b"x_mm,y_mm,z_mm,p\n0,0,0,1\n", ("x_mm", "another length_unit")),
        ("a.csv", b"x,y,z,p,p\n0,0,0,1,2\n", ("'p' occurs twice",)),
    ],
)
def test_damaged_files(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, content: bytes, words: tuple[str, ...]
) -> None:
    (tmp_path / name).write_bytes(content)
    refused(capfd, lambda: read_field(tmp_path / name, None, None, 1.0), name, *words)


@pytest.mark.fast
def test_missing_file(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    refused(capfd, lambda: read_field(tmp_path / "a.vtu", None, None, 1.0), "a.vtu", "no such file")


@pytest.mark.parametrize("share", [0.3, 0.9, 0.98])
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.vtu", {"binary": True}),
        ("a.vtu", {"binary": True, "compression": None}),
        ("a.vtu", {"binary": False}),
        ("a.vtk", {"binary": True}),
        ("a.vtk", {"binary": False}),
    ],
    ids=["vtu-zlib", "vtu-raw", "vtu-ascii", "vtk-binary", "vtk-ascii"],
)
def test_files_cut_short(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, options: dict[str, object], share: float
) -> None:
    write_vtu(tmp_path / name, **options)
    capfd.readouterr()
    content = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(content[: int(share * len(content))])
    refused(capfd, lambda: read_field(tmp_path / name, "p", None, 1.0), name)


def test_a_cell_that_names_a_point_beyond_the_last(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_vtu(tmp_path / "a.vtu", binary=False)
    text = (tmp_path / "a.vtu").read_text()
    found = re.search(r'Name="connectivity"[^>]*>\s*([^<]*)<', text)
    assert found
    connectivity = found.group(1)
    (tmp_path / "a.vtu").write_text(text.replace(connectivity, connectivity.replace("3", "3000000")))
    capfd.readouterr()
    refused(capfd, lambda: read_field(tmp_path / "a.vtu", None, None, 1.0), "3000000")


def test_volume_mesh(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    tetra = meshio.Mesh(POINTS, [("tetra", np.array([[0, 1, 2, 4]]))], point_data={"p": np.ones(5)})
    tetra.write(tmp_path / "a.vtu")
    refused(capfd, lambda: read_field(tmp_path / "a.vtu", "p", None, 1.0), "volume cells", "extract the surface")


def test_surface_cells_beside_volume_cells_are_taken(tmp_path: Path) -> None:
    cells = [("tetra", np.array([[0, 1, 2, 4]])), ("triangle", TRIANGLES)]
    mesh = meshio.Mesh(POINTS, cells, cell_data={"p": [np.array([9.0]), np.array([1.0, 2.0])]})
    mesh.write(tmp_path / "a.vtu")
    field = read_field(tmp_path / "a.vtu", None, None, 1.0)
    assert field.location == "cell"
    assert field.values[field.face].tolist() == [1.0, 2.0]
    assert len(field.point) == 4  # the tetrahedron's own corner is no surface point


def test_arrays(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    at_nodes = {"Pressure": np.ones(5), "Mach": np.ones(5), "Velocity": np.ones((5, 3))}
    in_cells = {"Pressure": [np.ones(2)]}
    path = tmp_path / "a.vtu"
    meshio.Mesh(POINTS, [("triangle", TRIANGLES)], point_data=at_nodes, cell_data=in_cells).write(path)
    listed = ("'Pressure' (node)", "'Mach' (node)", "'Pressure' (cell)")
    refused(capfd, lambda: read_field(path, "p", None, 1.0), "no array 'p'", *listed, "Velocity")
    refused(capfd, lambda: read_field(path, None, None, 1.0), "3 arrays could be meant", "'array'", *listed)
    refused(capfd, lambda: read_field(path, "Pressure", None, 1.0), "2 arrays", "'location'")
    assert read_field(path, "Pressure", "cell", 1.0).location == "cell"


def test_values_that_are_not_finite(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    values = np.array([1.0, np.nan, 1.0, np.inf, np.nan])
    path = tmp_path / "a.vtu"
    meshio.Mesh(POINTS, [("triangle", TRIANGLES)], point_data={"p": values}).write(path)
    refused(capfd, lambda: read_field(path, None, None, 1.0), "'p'", "2 of 4 values", "point 1 ")


CASE_COLUMNS = "file,mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km"


@pytest.mark.fast
@pytest.mark.parametrize(
    ("text", "words"),
    [
        (manifest_text(unit=None), ("unit: entry is missing", "'Pa'", "'psi'")),
        (manifest_text(unit="Torr"), ("unit", "'Torr' found", "'kPa'")),
        (manifest_text(length_unit="yd"), ("length_unit", "'yd' found", "'mm'")),
        (manifest_text(length_unit=None), ("length_unit: entry is missing", "'mm'")),
        (manifest_text(quantity="pressure"), ("quantity", "'pressure' found", "'Cp'")),
        (manifest_text(quantity="Cp"), ("unit", "'Pa' found", "has none")),
        (manifest_text(axes="aft up starboard right"), ("axes", "starboard")),
        (manifest_text(axes="aft forward up"), ("axes", "'aft forward up' found")),
        (manifest_text(scale=2.0), ("scale: unknown entry", "length_unit")),
        (manifest_text(case_text(mach="5")), ("case 1: mach: unknown entry", "mach_number")),
        (manifest_text(case_text() + case_text()), ("case 2", "M 5", "already belongs to case 1")),
        (
            manifest_text(case_text() + case_text(mach_number=6.0)),
            ("case 2", "'field.vtu' already belongs to case 1"),
        ),
        (manifest_text(case_text("none.vtu")), ("case 1", "none.vtu: no such file")),
        (manifest_text(case_text(mach_number=-1.0)), ("case 1: mach_number", "-1.0 found", "greater than 0")),
        (manifest_text(case_text(altitude_km=80.0)), ("altitude_km", "80.0 found", "71")),
        (manifest_text(case_text(altitude_km=float("nan"))), ("altitude_km", "nan found", "finite")),
        (
            manifest_text(case_text() + case_text("other.vtu", mach_number=6.0) + 'axes = "aft up port"\n'),
            ("case 2: length_unit: entry is missing", "; a case that states one of length_unit, axes, rotation"),
        ),
        (
            manifest_text(case_text() + case_text("other.vtu", mach_number=6.0) + 'unit = "kPa"\n'),
            ("case 2: quantity: entry is missing", "; a case that states one of quantity, unit, array, location"),
        ),
        (
            manifest_text(case_text() + case_text(altitude_km=25.0) + 'length_unit = "mm"\n'),
            ("case 2: file 'field.vtu' is already used by case 1, with another format",),
        ),
        (manifest_text(mirrored=True), ("sideslip_angle_deg 5 found", "half model")),
        ("quantity = ", ("not a TOML file",)),
        (manifest_text().replace("[[case]]", "rotation = [[1, 0], [0, 1]]\n[[case]]"), ("rotation", "three rows")),
        (
            manifest_text().replace(
                "[[case]]", "rotation = [[1.0,0.0,0.0],[0.0,1.0,0.0],[0.0,0.0,-1.0]]\n[[case]]"
            ),
            ("rotation", "determinant 1"),
        ),
    ],
)
def test_manifest(tmp_path: Path, capfd: pytest.CaptureFixture[str], text: str, words: tuple[str, ...]) -> None:
    (tmp_path / "field.vtu").write_bytes(b"only its presence counts here")
    (tmp_path / "m.toml").write_text(text)
    refused(capfd, lambda: load_manifest(tmp_path / "m.toml"), "m.toml", *words)


@pytest.mark.fast
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("quantity,length_unit,file\n", ("no case after the column names",)),
        ("file,mach_number\na,5,6\n", ("line 2", "3 columns found", "2")),
        (
            "quantity,length_unit,file\nCp,m,a\n,m,a\n",
            ("line 3", "column 'quantity'", "nothing found", "'Cp'", "state it in every line"),
        ),
        (
            f"quantity,length_unit,{CASE_COLUMNS}\nCp,m,field.vtu,5,6,5,20\np,m,other.vtu,6,6,5,20\n",
            ("line 3: unit: entry is missing, quantity 'p' needs one of",),
        ),
        ("quantity,length_unit,file,mach_number\nCp,m,a,fast\n", ("line 2: mach_number: 'fast' found", "number")),
    ],
)
def test_manifest_as_table(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], text: str, words: tuple[str, ...]
) -> None:
    (tmp_path / "m.csv").write_text(text)
    refused(capfd, lambda: load_manifest(tmp_path / "m.csv"), "m.csv", *words)


@pytest.mark.parametrize(
    ("change", "entries", "words"),
    [
        (lambda p: 1e-3 * p, {}, ("less than 1 % of the ambient pressure", "declared as p in Pa")),
        (lambda p: p, {"unit": "kPa"}, ("stagnation pressure at M 5", "declared as p in kPa")),
        (lambda p: p, {"quantity": "Cp", "unit": None}, ("declared as Cp", "stagnation pressure")),
        (lambda p: p - 5474.9, {}, ("below 0", "p - p_inf")),
        (lambda p: p, {"length_unit": "mm"}, ("spans 0 to 0.0036", "0 to 3.6", "length_unit")),
        (lambda p: p, {"axes": "forward starboard down"}, ("spans -3.6 to 0", "axes")),
        (lambda p: p, {"translation_m": [0.0, 0.0, 0.05]}, ("mapping", "apart")),
    ],
    ids=["kPa read as Pa", "Pa read as kPa", "p read as Cp", "gauge", "millimetres", "axes", "offset"],
)
def test_wrong_declarations(
    snapshots: Snapshots,
    other_grid: SurfaceGrid,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    change: Callable[[np.ndarray], np.ndarray],
    entries: dict[str, object],
    words: tuple[str, ...],
) -> None:
    pressure = change(snapshots.pressure[0])
    surface = snapshots.surface
    write_cart3d(
        tmp_path / "a.triq", surface.point, surface.triangle, np.ones(len(surface.triangle), np.int64), pressure
    )
    (tmp_path / "m.toml").write_text(manifest_text(case_text("a.triq"), **entries))
    refused(capfd, lambda: imported_ratio(tmp_path / "m.toml", other_grid, CONDITION), "a.triq", *words)


def test_points_off_the_surface_and_gaps(
    snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    table = np.column_stack([snapshots.point, snapshots.pressure[0]])
    (tmp_path / "m.toml").write_text(manifest_text(case_text("a.csv")))

    def import_points(points: np.ndarray) -> Callable[[], object]:
        np.savetxt(tmp_path / "a.csv", points, "%.10g", ",", header="x,y,z,p", comments="")
        return lambda: imported_ratio(tmp_path / "m.toml", other_grid, CONDITION)

    refused(capfd, import_points(table + np.array([0, 0, 0.01, 0])), "a.csv", "off the vehicle's surface", "0.0")
    refused(capfd, import_points(table[table[:, 0] < 2.0]), "a.csv", "spans 0 to 1.9", "not the whole vehicle")
    refused(
        capfd, import_points(table[(table[:, 0] < 1.0) | (table[:, 0] > 1.5)]), "do not cover the whole surface"
    )


def test_half_model_with_both_sides(
    snapshots: Snapshots, other_grid: SurfaceGrid, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    surface: SurfaceMesh = snapshots.surface
    ones = np.ones(len(surface.triangle), np.int64)
    write_cart3d(tmp_path / "a.triq", surface.point, surface.triangle, ones, snapshots.pressure[0])
    condition = type(CONDITION)(5.0, CONDITION.angle_of_attack, 0.0, 20e3)
    (tmp_path / "m.toml").write_text(manifest_text(case_text("a.triq", sideslip_angle_deg=0.0), mirrored=True))
    refused(capfd, lambda: imported_ratio(tmp_path / "m.toml", other_grid, condition), "both sides", "y from -0.1")


def test_bytes_changed_at_random(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A damaged binary file is refused or, where the damage does not show, read; it never ends the process."""
    write_vtu(tmp_path / "good.vtu", binary=True, compression=None)
    content = (tmp_path / "good.vtu").read_bytes()
    capfd.readouterr()
    random = np.random.default_rng(3)
    encoded = list(re.finditer(rb">\s*([A-Za-z0-9+/=]{12,})\s*<", content))
    assert encoded
    messages = []
    for _ in range(6):
        block = encoded[int(random.integers(len(encoded)))]
        raw = bytearray(base64.b64decode(block.group(1)))
        raw[int(random.integers(len(raw)))] ^= 0xFF
        damaged = content[: block.start(1)] + base64.b64encode(bytes(raw)) + content[block.end(1) :]
        (tmp_path / "bad.vtu").write_bytes(damaged)
        try:
            read_field(tmp_path / "bad.vtu", "p", None, 1.0)
        except InputError as error:
            messages.append(str(error))
    assert not any("\n" in message for message in messages)
    assert capfd.readouterr() == ("", "")


def test_a_file_that_ends_vtks_reader(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A cell that claims 100 million corners: the reader runs off its memory, the session goes on."""
    (tmp_path / "a.vtk").write_text(
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 double\n0 0 0\n1 0 0\n0 1 0\n"
        "CELLS 1 4\n100000000 0 1 2\nCELL_TYPES 1\n5\n"
        "POINT_DATA 3\nSCALARS p double\nLOOKUP_TABLE default\n1 2 3\n"
    )
    refused(capfd, lambda: read_field(tmp_path / "a.vtk", None, None, 1.0), "a.vtk", "damaged")
