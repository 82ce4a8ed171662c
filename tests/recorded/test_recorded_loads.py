"""Loads in newtons in every output, loads beside the five; a gauge that stands still; a flight and its page."""

import csv
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import h5py
import numpy as np
import pytest
from other_load_maps import with_further
from recorded_case import NAMES, read_csv, samples, write_csv, write_flight
from synthetic_vehicle import SyntheticFiles, synthetic_inverse_map

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.recorded.outputs import OUTPUT_SUFFIXES
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.summary import MAX_BINS
from strainfmu.recorded.table import BLOCK_ROWS

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]
Flight = tuple[Path, np.ndarray, np.ndarray, np.ndarray]

LIBRARY = {".parquet": "pyarrow", ".mf4": "asammdf"}


def table(path: Path) -> dict[str, tuple[np.ndarray, str]]:
    """Return values and unit of the columns of numbers, read as anybody would."""
    if path.suffix == ".csv":
        rows = list(csv.DictReader(path.open(encoding="utf-8")))
        names = [name for name in rows[0] if name.endswith("]")]
        columns = {name.rpartition(" [")[0]: np.array([float(row[name]) for row in rows]) for name in names}
        units = [name.rpartition(" [")[2][:-1] for name in names]
        return dict(zip(columns, zip(columns.values(), units, strict=True), strict=True))
    if path.suffix in (".h5", ".hdf5"):
        with h5py.File(path) as file:
            return {name: (item[()], item.attrs.get("unit")) for name, item in file.items()}
    if path.suffix == ".parquet":
        import pyarrow.parquet

        read = pyarrow.parquet.read_table(path)
        fields = {
            name: (read.schema.field(name).metadata or {}).get(b"unit", b"").decode() for name in read.column_names
        }
        return {name: (np.array(read[name].to_pylist()), unit) for name, unit in fields.items()}
    import asammdf

    with asammdf.MDF(path) as file:
        signals = {signal.name: (signal.samples, signal.unit) for signal in file.iter_channels()}
        return {**signals, "time": (file.get_master(0), "s")}


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """Return a file, and its time (n,) [s], strains (n, n_d) and q_inf (n,) [Pa]; samples without a value."""
    time, strain, pressure = samples(BLOCK_ROWS + 300)
    strain[7, 2], pressure[9] = np.nan, np.nan
    path = tmp_path_factory.mktemp("flight") / "d.csv"
    return write_csv(path, ["time", *NAMES, "dynamic_pressure"], time, strain, pressure), time, strain, pressure


@pytest.mark.parametrize("suffix", OUTPUT_SUFFIXES)
@pytest.mark.parametrize("columns", ["plain", "all"])
def test_loads_in_every_output_are_the_estimators(
    columns: str, suffix: str, flight: Flight, synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    pytest.importorskip(LIBRARY.get(suffix, "csv"))
    data, time, strain, pressure = flight
    code, _, errors = run("estimate", synthetic.map_1, data, "-o", tmp_path / f"o{suffix}", "--columns", columns)
    assert (code, errors) == (0, "")
    read = table(tmp_path / f"o{suffix}")
    np.testing.assert_array_equal(read["time"][0], time)
    names = [*LOADS, *(f"sigma.{name}" for name in LOADS)]
    assert [name for name in read if name in names] == names
    assert [read[name][1] for name in names] == 2 * [load.unit.replace(".", " ") for load in LOADS.values()]
    estimator = Estimator(synthetic_inverse_map(1))
    for row in (*range(12), *range(BLOCK_ROWS - 4, len(time), 37)):
        estimate = estimator.estimate(strain[row], pressure[row])
        written = [read[name][0][row] for name in names]
        np.testing.assert_allclose(written, [*estimate.loads, *estimate.loads_std], rtol=1e-12)
    assert np.isnan(read["C_N"][0][9]), "coefficients need a dynamic pressure, loads do not"
    assert np.isfinite(read["sigma.moment.pitch"][0][7])


def test_pandas_reads_them_in_two_lines(flight: Flight, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    for suffix in (".csv", ".parquet"):
        estimate_file(synthetic.map_1, flight[0], tmp_path / f"o{suffix}", columns="plain")
    read = pandas.read_csv(tmp_path / "o.csv"), pandas.read_parquet(tmp_path / "o.parquet")
    np.testing.assert_array_equal(read[0]["force.normal [N]"], read[1]["force.normal"])
    assert read[0]["health"].equals(read[1]["health"])


def dead_flight(path: Path, kind: str) -> Path:
    """Write a flight of which gauge 3 always reads the same, or from sample 1000 on."""
    time, strain, pressure = samples(3000)
    strain[1000 if kind == "from a sample on" else 0 :, 3] = 0.0 if kind == "zero" else 31.25e-6
    return write_csv(path, ["time", *NAMES, "dynamic_pressure"], time, strain, pressure)


@pytest.mark.parametrize("kind", ["constant", "zero", "from a sample on"])
def test_a_gauge_that_stands_still_is_named_and_left_out_on_demand(
    kind: str, synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    data = dead_flight(tmp_path / "d.csv", kind)
    arguments = ("estimate", synthetic.map_1, data, "-o", tmp_path / "o.csv")
    code, out, _ = run(*arguments)
    assert code == 0
    assert "gauges that stand still while others change, of 3000 rows: 'G3' in " in out
    assert "--exclude G3, or --exclude auto, leaves them out" in out
    code, out, _ = run(*arguments, "--exclude", "auto")
    assert code == 0
    assert ": left out there by --exclude auto" in out
    rows = list(csv.DictReader((tmp_path / "o.csv").open()))
    assert [row["health"] for row in rows[1100:]].count("DEGRADED") >= 1899, "of 1900, as with --exclude G3"
    found = np.array([float(row["force.normal [N]"]) for row in rows])
    _, strain, pressure = samples(3000)
    strain[:, 3] = np.nan
    estimator = Estimator(synthetic_inverse_map(1))
    for row in range(1000, 3000, 311):
        assert found[row] == pytest.approx(estimator.estimate(strain[row], pressure[row]).loads[1], rel=1e-9)


def test_the_course_of_a_flight_is_bounded(flight: Flight, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    summary = estimate_file(synthetic.map_1, flight[0], tmp_path / "o.csv")
    history, read = summary.history, table(tmp_path / "o.csv")
    for name, peak in history.peaks.items():
        row = int(np.nanargmax(np.abs(read[name][0])))
        assert (peak.value, peak.sigma) == (read[name][0][row], read[f"sigma.{name}"][0][row])
        assert peak.time == pytest.approx(read["time"][0][row])
    assert [(period.state, period.samples) for period in history.periods] == [("NO_COEFFICIENTS", 1)]
    assert history.bins["time"].shape[1] <= 2 * MAX_BINS
    assert np.nanmin(history.bins["time"][0]) == 0.0
    figure = summary.plot()
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert labels[:5] == [f"{load.label} [{load.unit.replace('.', ' ')}]" for load in LOADS.values()]
    assert labels[-1] == "health"


@pytest.mark.parametrize("suffix", [".html", ".pdf"])
def test_the_page_of_a_flight_answers_whether_its_loads_may_be_used(
    suffix: str, synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    pytest.importorskip("reportlab")
    time, strain, pressure = samples(3000)
    pressure[500:600] = np.nan
    rows = np.r_[0:1200, 1500:3000]
    data = write_csv(
        tmp_path / "d.csv", ["time", *NAMES, "dynamic_pressure"], time[rows], strain[rows], pressure[rows]
    )
    page = tmp_path / f"page{suffix}"
    code, out, errors = run("estimate", synthetic.map_1, data, "-o", tmp_path / "o.h5", "--report", page)
    assert (code, errors) == (0, "")
    assert str(page) in out
    if suffix == ".pdf":
        assert page.read_bytes().startswith(b"%PDF")
        return
    text = page.read_text(encoding="utf-8")
    for part in (
        *("Loads are usable in part", "2600 of 2700 samples (96.3 %)", "NO_COEFFICIENTS", "from 0.5 to 0.599 s"),
        *("Normal force", "Gaps: 1, the longest of 0.301 s", "<svg" if "<svg" in text else "<img"),
        sha256(data.read_bytes()).hexdigest()[:12],
    ):
        assert part in text, part


def test_a_page_of_another_kind_is_refused_first(
    flight: Flight, synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    code, _, errors = run("estimate", synthetic.map_1, flight[0], "-o", tmp_path / "o.h5", "--report", "page.txt")
    assert code == 2
    assert errors.endswith("page.txt: --report: expected one of .html, .pdf, got '.txt'\n")
    assert list(tmp_path.iterdir()) == []


def test_loads_beside_the_five_are_columns_with_deviations(tmp_path: Path) -> None:
    held = with_further(synthetic_inverse_map(1))
    save_inverse_map(held, tmp_path / "map.h5")
    _, strain, pressure = samples(20)
    estimate_file(tmp_path / "map.h5", write_flight(tmp_path / "d.csv"), tmp_path / "o.csv")
    found, expected = read_csv(tmp_path / "o.csv"), Estimator(held).estimate(strain, pressure)
    for name, values in {
        "M_R [1]": expected.M_R,
        "sigma.M_R [1]": expected.sigma.M_R,
        "rolling_moment [N m]": expected.rolling_moment,
        "section.axial[1] [N]": expected.section_loads.axial[:, 0],
        "section.torsion[1] [N m]": expected.section_loads.torsion[:, 0],
        "sigma.section.pitch[1] [N m]": expected.section_loads.std[:, 0, 3],
    }.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-9, err_msg=name)


def test_a_map_without_them_has_no_such_columns(tmp_path: Path) -> None:
    save_inverse_map(synthetic_inverse_map(1), tmp_path / "map.h5")
    estimate_file(tmp_path / "map.h5", write_flight(tmp_path / "d.csv"), tmp_path / "o.csv")
    assert not any("M_R" in name or "section" in name for name in read_csv(tmp_path / "o.csv"))
