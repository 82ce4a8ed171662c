"""Element strains of OP2 and punch files as the strains of gauges.

``pynastran_strains.op2`` was written by pyNastran 1.4.1: subcases 1, 2 and 7 of rods, plates, plies and solids.
Component k of element e in subcase s is 1e-6 (100 e + 10 k + s), plus 1e-7 for each in the number of node or ply.
"""

import contextlib
import csv
from math import pi
from pathlib import Path

import numpy as np
import pytest
from nastran_files import PLATE, ROD, op2_of_rods, punch_block, write_gauges

from builder.structure.external.influence_file import read_influence
from builder.structure.external.nastran.op2 import read_op2_strains
from builder.structure.external.nastran.results import (
    NastranPoint,
    NastranStrains,
    read_nastran_gauges,
    read_nastran_results,
)
from builder.structure.external.strain_table import read_strain_table
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

FOREIGN = Path(__file__).parent / "pynastran_strains.op2"
SINGLE = 1e-7
"""Of single precision."""


def point(
    element: int,
    side: str = "",
    degrees: float | None = None,
    node: int | None = None,
    direction: tuple[float, float, float] | None = None,
) -> NastranPoint:
    return NastranPoint(
        column="g",
        element=element,
        node=node,
        side=side,
        angle=None if degrees is None else degrees * pi / 180.0,
        direction=None if direction is None else np.array(direction),
        body_direction=np.array([0.0, 0.0, 1.0]),
    )


def component(element: int, subcase: int, k: int, within: int = 0) -> float:
    return 1e-6 * (100 * element + 10 * k + subcase) + 1e-7 * within


@pytest.mark.fast
@pytest.mark.parametrize(
    ("at", "expected"),
    [
        (point(2), component(2, 7, 0)),
        (point(12, "z1", 0.0), component(12, 7, 0)),
        (point(12, "z2", 90.0), component(12, 7, 9)),
        (point(21, "z1", 45.0), 0.5 * sum(component(21, 7, k) for k in range(3))),
        (point(32, "z2", 0.0), component(32, 7, 8)),
        (point(32, "z1", 0.0, node=103), component(32, 7, 0, 103)),
        (point(51, "ply 2", -45.0), 0.5 * (2 * component(51, 7, 0, 2) + 1e-5 - component(51, 7, 2, 2))),
        (point(52, "ply 1", 0.0), component(52, 7, 0, 1)),
        (point(41), component(41, 7, 2)),
        (
            point(42, node=3, direction=(0.0, 2.0, 2.0)),
            0.5 * sum(component(42, 7, k, 3) for k in (1, 2, 4)),
        ),
        (point(42, direction=(1.0, 0.0, 1.0)), 0.5 * sum(component(42, 7, k) for k in (0, 2, 5))),
    ],
)
def test_strains_of_a_file_of_another_program(at: NastranPoint, expected: float) -> None:
    assert read_nastran_results([FOREIGN]).strain(7, at) == pytest.approx(expected, rel=SINGLE)


@pytest.mark.parametrize(
    ("at", "message"),
    [
        (point(99), "element 99: expected its strain, got none"),
        (point(2, "ply 1", 0.0), "element 2: expected plies, got none"),
        (point(51, "z1", 0.0), "expected side 'ply N' of its plies, got 'z1'"),
        (point(51, "ply 9", 0.0), "expected ply 9 once, got it 0 times"),
        (point(12, "z1"), "expected angle_deg from the plate's x axis"),
        (point(12, "", 0.0), "side: expected z1 or z2 of a plate, got ''"),
        (point(12, "z1", 0.0, node=5), "node 5: expected its strain, got strain at the centre alone"),
        (point(32, "z1", 0.0, node=5), "node 5: expected its strain, got strain at nodes 101, 102, 103, 104"),
        (point(42), "expected direction_x, direction_y, direction_z in coordinate system 5"),
        (point(2, "z1"), "side: expected none for a rod"),
        (point(12, "z1", 0.0, direction=(1.0, 0.0, 0.0)), "direction: expected none for a plate"),
        (point(41, "", 10.0), "angle_deg: expected none for a solid"),
    ],
)
def test_what_a_file_does_not_hold_is_named(at: NastranPoint, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_nastran_results([FOREIGN]).strain(2, at)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("size", [4, 8])
def test_single_and_double_precision_of_both_byte_orders(tmp_path: Path, size: int, order: str) -> None:
    """Words of 8 bytes keep every digit."""
    strain = {3: np.array([1e-4 / 3.0, -2e-5]), 4: np.array([5e-6, 1e-30])}
    path = tmp_path / "rods.op2"
    path.write_bytes(op2_of_rods(strain, [11, 12_345_678], size, order))
    results = read_nastran_results([path])
    for subcase, values in strain.items():
        found = [results.strain(subcase, point(element)) for element in (11, 12_345_678)]
        np.testing.assert_allclose(found, values, rtol=0.0 if size == 8 else SINGLE)


def test_wrong_op2_files_are_refused_in_one_line(tmp_path: Path) -> None:
    whole = op2_of_rods({1: np.array([1e-4])}, [7])
    for content, message in (
        (b"", "not an OP2 file, or empty"),
        (b"not an OP2 file at all", "not an OP2 file"),
        (whole[:-9], "cut short"),
        (whole[: len(whole) // 2], "cut short"),
        (whole[:-24], "its last table has no end"),
        (whole[:40] + b"\x07" + whole[41:], "damaged"),
        (op2_of_rods({1: np.array([1e-4])}, [7], table="OES1X1"), "expected element strains, got none"),
        (op2_of_rods({1: np.array([1e-4])}, [7], table="OSTR2"), "expected strains per subcase"),
        (op2_of_rods({1: np.array([1e-4])}, [7], sort=1), "expected real strains per subcase"),
        (op2_of_rods({1: np.array([1e-4])}, [7], approach=2), "expected linear statics"),
    ):
        path = tmp_path / "wrong.op2"
        path.write_bytes(content)
        with pytest.raises(InputError, match=message) as caught:
            read_nastran_results([path])
        assert "\n" not in str(caught.value)
    path.write_bytes(whole)
    results = read_nastran_results([path])
    with pytest.raises(InputError, match="subcase 2, gauge 'g': expected strains of this subcase, got 1"):
        results.strain(2, point(7))
    other = tmp_path / "again.op2"
    other.write_bytes(whole)
    with pytest.raises(InputError, match="expected its strain once, got it 2 times"):
        read_nastran_results([path, other]).strain(1, point(7))


@pytest.mark.fast
def test_a_punch_file_says_the_same_as_an_op2_file(tmp_path: Path) -> None:
    """Rods, plates and plies of the file of another program, seven digits of text; stresses are passed over."""
    text = ""
    for block in read_op2_strains(FOREIGN):
        if block.layout is not None and block.layout.points == 1:
            whole = block.layout.integers
            rows = [[int(v) if k in whole else v for k, v in enumerate(row.tolist())] for row in block.words]
            text += punch_block(block.subcase, block.element_type, rows)
            text += punch_block(block.subcase, block.element_type, [[rows[0][0], 1.0]], what="STRESSES")
    path = tmp_path / "strains.pch"
    path.write_text(text)
    punch, op2 = read_nastran_results([path]), read_nastran_results([FOREIGN])
    for subcase in (1, 2, 7):
        for at in (point(1), point(11, "z2", 30.0), point(21, "z1", 77.0), point(51, "ply 2", 20.0)):
            assert punch.strain(subcase, at) == pytest.approx(op2.strain(subcase, at), rel=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (punch_block(1, PLATE, [[5, 1.0, 2.0]]), "element 5: expected 16 values of a CQUAD4, got 2"),
        (
            punch_block(1, ROD, [[5, 1.0, 2.0, 3.0, 4.0]]).replace("REAL OUTPUT", "MAGNITUDE-PHASE OUTPUT"),
            "expected real output",
        ),
        (punch_block(1, ROD, [[5, 1.0, 2.0, 3.0, 4.0]]).replace(" 3.000000E+00", "3.000000-101"), ""),
        (punch_block(1, ROD, [[5, 1.0, 2.0, 3.0, 4.0]]).replace("$SUBCASE", "$NOTHING"), "SUBCASE ID"),
        (
            punch_block(1, ROD, [[5, 1.0, 2.0, 3.0, 4.0]]).replace("2.000000E+00", "2.00,0000+00"),
            "expected a number",
        ),
        (punch_block(1, 39, [[5, 1.0]]), r"a type of element that is not read \(39\)"),
    ],
)
def test_wrong_punch_files_are_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "wrong.pch"
    path.write_text(text)
    if not message:
        assert read_nastran_results([path]).strain(1, point(5)) == 1.0
        return
    with pytest.raises(InputError, match=message) as caught:
        read_nastran_results([path]).strain(1, point(5))
    assert "\n" not in str(caught.value)


def test_a_punch_file_that_is_cut_gives_no_other_number(tmp_path: Path) -> None:
    """Wherever it ends: 2.000000E-06 cut to 2.000000E-0 is a number too."""
    path, text = tmp_path / "cut.pch", punch_block(1, ROD, [[5, 1e-6, 2e-6, 3e-6, 4e-6]])
    found = set()
    for end in range(len(text)):
        path.write_text(text[:end])
        with contextlib.suppress(InputError):
            results = read_nastran_results([path])
            rows = results.blocks[1][0].words
            found.add(tuple(np.ravel(rows)[1:].tolist()))
    assert found <= {(1e-6, 2e-6, 3e-6, 4e-6)}


def test_strain_and_curvature_of_the_middle_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "middle.pch"
    path.write_text(punch_block(1, PLATE, [[5, 0.0, *[1e-4] * 7, -1.0, *[1e-2] * 7]]))
    with pytest.raises(InputError, match=r"got strain and curvature: STRAIN\(FIBER\)"):
        read_nastran_results([path]).strain(1, point(5, "z1", 0.0))


def test_the_table_of_gauges(tmp_path: Path) -> None:
    """Rows of one column are averaged; every wrong entry is named."""
    directions = {"a": np.array([1.0, 0.0, 0.0]), "b": np.array([0.0, 1.0, 0.0])}
    path = tmp_path / "gauges.csv"
    path.write_text("column,element,node,side,angle_deg\na,1,,,\na,2,,,\nb,12,,Z2,90\n")
    strains = NastranStrains(read_nastran_results([FOREIGN]), read_nastran_gauges(path, directions))
    assert strains.column == ("a", "b")
    expected = [0.5 * (component(1, 2, 0) + component(2, 2, 0)), component(12, 2, 9)]
    np.testing.assert_allclose(strains.row(2), expected, rtol=SINGLE)
    for text, message in (
        ("column\na\n", "expected a column 'element'"),
        ("column,element,fibre\na,1,z1\n", "expected columns column, element, node"),
        ("column,element\nc,1\n", "line 2: column: expected a gauge of the vehicle file, got 'c'"),
        ("column,element\na,-1\n", "line 2, element: expected a number of the Nastran model, got '-1'"),
        ("column,element,side\na,1,top\n", "side: expected z1, z2, 'ply N' or nothing, got 'top'"),
        ("column,element,angle_deg\na,1,flat\n", "angle_deg: expected a number, got 'flat'"),
        ("column,element,direction_x,direction_y,direction_z\na,1,0,0,0\n", "expected a vector"),
        ("column,element\na\n", "line 2: expected 2 values, got 1"),
        ("column,element\n", "expected a row per gauge, got none"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            read_nastran_gauges(path, directions)


def of_rods(folder: Path, strain: FloatArray, columns: tuple[str, ...], size: int) -> NastranStrains:
    """Return strains (n, k) [m/m] of n subcases, by way of an OP2 file."""
    elements = list(range(101, 101 + len(columns)))
    path = folder / f"rods_{size}.op2"
    path.write_bytes(op2_of_rods(dict(enumerate(strain, 1)), elements, size))
    gauges = write_gauges(folder / "gauges_nastran.csv", columns, elements)
    directions = {name: np.array([1.0, 0.0, 0.0]) for name in columns}
    return NastranStrains(read_nastran_results([path]), read_nastran_gauges(gauges, directions))


@pytest.mark.parametrize(("size", "tolerance"), [(8, 1e-15), (4, SINGLE)])
def test_both_tables_take_their_strains_from_subcases(tmp_path: Path, size: int, tolerance: float) -> None:
    """An influence matrix and a table of load cases: as if the strains stood in the CSV file."""
    generator = np.random.default_rng(5)
    columns, node = ("a", "b", "c"), generator.normal(size=(4, 3))
    strain = 1e-5 * generator.normal(size=(12, 3))
    results = of_rods(tmp_path, strain, columns, size)
    facets = tmp_path / "facets.csv"
    facets.write_text("node_1,node_2,node_3\n1,2,3\n1,3,4\n")
    places = [["node", "x_m", "y_m", "z_m", "direction", "force_N"]]
    places += [[str(k // 3 + 1), *map(repr, node[k // 3].tolist()), "xyz"[k % 3], "100"] for k in range(12)]
    cases = [["case", "load_id"], *([f"case_{k}", f"id{k}"] for k in range(12))]

    def both(name: str, rows: list[list[str]]) -> tuple[Path, Path]:
        named, held = tmp_path / f"{name}_named.csv", tmp_path / f"{name}_held.csv"
        subcase = [["subcase"], *([str(k + 1)] for k in range(12))]
        values = [["strain_unit", *columns], *(["m/m", *map(repr, row)] for row in strain.tolist())]
        for path, further in ((named, subcase), (held, values)):
            with path.open("w", newline="") as stream:
                csv.writer(stream).writerows([*a, *b] for a, b in zip(rows, further, strict=True))
        return named, held

    named, held = both("influence", places)
    found, expected = read_influence(named, facets, results), read_influence(held, facets)
    assert found.column == expected.column
    np.testing.assert_allclose(found.strain_per_force, expected.strain_per_force, rtol=tolerance)
    named, held = both("cases", cases)
    np.testing.assert_allclose(
        read_strain_table(named, results).strain, read_strain_table(held).strain, rtol=tolerance
    )
    with pytest.raises(InputError, match=r"column 'subcase': expected structure\.nastran_results with it"):
        read_strain_table(named)
    with pytest.raises(InputError, match="expected a column 'subcase', got case, load_id, strain_unit"):
        read_strain_table(held, results)
    with pytest.raises(InputError, match=r"nastran_results: expected a \.csv with a column 'subcase'"):
        read_influence(tmp_path / "z.h5", None, results)
    named.write_text(named.read_text().replace("case_3,id3,4", "case_3,id3,44"))
    with pytest.raises(InputError, match="subcase 44, gauge 'a': expected strains of this subcase, got 1, 2, 3"):
        read_strain_table(named, results)
