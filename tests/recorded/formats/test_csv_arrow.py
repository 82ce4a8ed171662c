"""CSV by pyarrow: numbers, lines and refusals of the module csv, in bounded memory; and the texts it writes."""

import csv
import tracemalloc
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from strainfmu.errors import InputError
from strainfmu.recorded import outputs
from strainfmu.recorded.formats import text
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import open_recording

pytestmark = pytest.mark.fast

WANTED = Wanted(gauge_names=("G0", "G1"), fixed_pressure=9e4)
CELLS = (
    *("0", "-1.5e-3", "+2e-3", ".5e-3", "1.e-3", " 1e-3 ", "", "nan", "NaN", "OVL", "-ovl", "---", "inf", "1e400"),
    *(
        "0x10",
        "1_0",
        "1,5e-3",
        "1.234.567",
        "1d-3",
        "x",
        "nan(1)",
        "- 1e-3",
        "1e-3\t",
        '"1e-3"',
        "\u0661",
        "2e-3,",
    ),
)


def outcome(path: Path) -> tuple[list[list[float]], list[int]] | str:
    """Return the numbers and the counts of rows of all blocks, or the refusal."""
    try:
        with open_recording(path, WANTED) as opened:
            blocks = [*opened.blocks]
    except InputError as error:
        return str(error)
    table = np.concatenate([np.column_stack([one.time, one.strain]) for one in blocks])
    return np.nan_to_num(table, nan=-9.0).tolist(), [len(one.time) for one in blocks]


def test_pyarrow_finds_what_csv_finds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows of cells drawn at random, among them wrong ones, in pieces of some lines."""
    pytest.importorskip("pyarrow")
    monkeypatch.setattr(text, "PIECE", 120)
    rng, path, seen = np.random.default_rng(5), tmp_path / "d.csv", set[type]()
    for number in range(40):
        plain = CELLS[: 5 if number % 3 else 12] if number % 2 else CELLS
        end, between = ("\r\n", ";") if number % 5 == 0 else ("\n", ",")
        comments = ["", "note,", '"a note"'][number % 3]
        rows = [f"{k}{between}{rng.choice(plain)}{between}{rng.choice(plain)}" for k in range(1, 30)]
        rows[17] += f"{between}{comments}" if number % 4 == 0 else ""
        rows.insert(9, "" if number % 7 == 0 else f"9.5{between}0{between}0")
        head = between.join(["time", "G0", "G1"]) + f"{end}0{between}1e-3{between}1e-3{end}"
        path.write_bytes((head + end.join(rows) + end * (number % 2)).encode())
        with monkeypatch.context() as without:
            without.setattr(text, "importable", lambda _: None)
            expected = outcome(path)
        assert outcome(path) == expected, rows
        seen.add(type(expected))
    assert seen == {str, tuple}


@pytest.mark.parametrize("is_installed", [True, False])
def test_memory_does_not_grow_with_the_file(
    is_installed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if is_installed:
        pytest.importorskip("pyarrow")
    else:
        monkeypatch.setattr(text, "importable", lambda _: None)
    monkeypatch.setattr(text, "PIECE", 1 << 14)
    most = []
    for n in (3_000, 8_000):
        path = tmp_path / f"{n}.csv"
        path.write_text("time,G0,G1\n" + "".join(f"{k},{1e-3:.40f},{2e-3:.40f}\n" for k in range(n)))
        tracemalloc.start()
        with open_recording(path, WANTED) as opened:
            assert sum(len(block.time) for block in opened.blocks) == n
        most.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert most[1] < 1.2 * most[0], "of files of 0.3 and 0.7 MB"


@pytest.mark.parametrize("text_cells", [["", "G1;G2", "held"], ["", 'G,"1', "zero"]])
def test_numbers_are_written_as_csv_writes_them(
    text_cells: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Any sizes, whole numbers, both zeros, limits of exponents, none; names that need quotes."""
    pytest.importorskip("pyarrow")
    monkeypatch.setattr(outputs, "_ROWS_BY_CSV", 0)
    random = np.random.default_rng(4)
    edges = [0.0, -0.0, 1.0, -7.0, 1e-4, 9.9e-5, 1e10, 9999999999.5, 1e15, 1e16, 5e-324, 1.7e308, np.nan, np.inf]
    sizes = random.standard_normal(3000) * 10.0 ** random.integers(-20, 20, 3000)
    numbers = np.concatenate([edges, np.nextafter(edges, 1.0), np.nextafter(edges, -1.0), sizes])
    columns, texts = [numbers, random.permutation(numbers)], [text_cells[k % 3] for k in range(len(numbers))]
    expected = StringIO()
    writer = csv.writer(expected, lineterminator="\n")
    writer.writerow(["a [s]", "b [1]", "names"])
    writer.writerows(zip(*(column.tolist() for column in columns), texts, strict=True))
    with outputs.estimate_writer(tmp_path / "o.csv", [("a", "s"), ("b", "1")], ["names"]) as output:
        output.write([*columns, texts])
    assert (tmp_path / "o.csv").read_bytes() == expected.getvalue().encode()
