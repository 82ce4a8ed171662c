"""Recordings in parts: the loads and the summary of one piece, whoever estimates the parts, and in which order."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas
import pytest
from recorded_case import NAMES, samples
from synthetic_vehicle import N_GAUGES, SyntheticFiles

import builder
import strainfmu
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.recorded.summary import EstimationSummary
from strainfmu.recorded.table import PIECE_ROWS

N = 2 * PIECE_ROWS + 1000
FILTER = 2.0
COUNTED = ("samples", "first", "last", "missing_pressure", "refused", "results", "health", "blamed", "unused")


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight of three parts with every fault: rows held across a border, one railed, one dead gauge, a gap."""
    path = tmp_path_factory.mktemp("flight") / "flight 1.h5"
    _, strain, pressure = (np.resize(part, (N, *part.shape[1:])) for part in samples(500))
    strain = strain + 1e-7 * np.random.default_rng(1).standard_normal((N, N_GAUGES))
    strain[PIECE_ROWS - 40 : PIECE_ROWS + 40] = strain[PIECE_ROWS]
    strain[PIECE_ROWS + 2000 : PIECE_ROWS + 2060, 1] = 0.04
    strain[2 * PIECE_ROWS - 100 :, 2] = strain[0, 2]
    strain[5000:5100, 0] = np.nan
    time = 1e-3 * np.arange(N) + np.where(np.arange(N) >= PIECE_ROWS, 3.0, 0.0)
    with h5py.File(path, "w") as file:
        file["strain"], file["time"], file["dynamic_pressure"] = strain, time, pressure
        file["gauge_names"] = NAMES
    return path


def in_parts(source: Path, data: Path, output: Path, **options: Any) -> tuple[pandas.DataFrame, EstimationSummary]:
    options = {"workers": 1, "part_rows": PIECE_ROWS, **options}
    summary = builder.estimate_recordings(source, data, output, **options)
    return pandas.read_parquet(output), summary


def in_one(source: Path, data: Path, output: Path, **options: Any) -> tuple[pandas.DataFrame, EstimationSummary]:
    summary = strainfmu.estimate(source, data, output, **options)
    assert isinstance(summary, EstimationSummary)
    return pandas.read_parquet(output), summary


@pytest.mark.parametrize("options", [{}, {"exclude": ["auto"], "residuals": True, "columns": "plain"}])
def test_parts_are_the_whole_to_the_bit(
    options: dict[str, Any], flight: Path, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    whole, of_whole = in_one(synthetic.map_1, flight, tmp_path / "one.parquet", **options)
    parts, of_parts = in_parts(synthetic.map_1, flight, tmp_path / "parts.parquet", **options)
    assert set(parts.pop("recording")) == {flight.name}
    pandas.testing.assert_frame_equal(parts, whole, check_exact=True)
    assert {name: getattr(of_parts, name) for name in COUNTED} == {
        name: getattr(of_whole, name) for name in COUNTED
    }
    assert of_parts.notes == of_whole.notes
    assert any("3.001 s behind row" in note for note in of_parts.notes)
    assert of_parts.faults.held.rows == 79
    assert not list(tmp_path.glob("*.unfinished"))


@pytest.mark.parametrize("smooth", [False, True])
def test_a_filter_is_led_in(smooth: bool, flight: Path, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """Windows begin elsewhere: loads differ by a part of their noise, and sigma by as much."""
    options = {"filter_seconds": FILTER, "smooth": smooth, "columns": "plain"}
    whole, _ = in_one(synthetic.map_1, flight, tmp_path / "one.parquet", **options)
    parts, _ = in_parts(synthetic.map_1, flight, tmp_path / "parts.parquet", **options)
    for name in COEFFICIENT_NAMES:
        apart = np.abs(whole[name] - parts[name]) / whole[f"sigma.{name}"]
        assert apart[: PIECE_ROWS - 2000].max() == 0.0
        assert apart.max() < 0.3


def test_an_interrupted_run_goes_on(flight: Path, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    output, work = tmp_path / "loads.parquet", tmp_path / "loads.parquet.unfinished"

    class Interrupts:
        """A reporter of which the user stops the work behind the second part."""

        def stage(self, title: str) -> Any:
            from contextlib import nullcontext

            def progress(done: int, total: int) -> None:
                if done == 2:
                    raise KeyboardInterrupt

            return nullcontext(progress)

        def note(self, text: str) -> None:
            """Nobody reads it."""

    with pytest.raises(KeyboardInterrupt):
        in_parts(synthetic.map_1, flight, output, progress=Interrupts())
    assert not output.exists()
    done = {path.name: path.stat().st_mtime_ns for path in work.glob("recording=*/part-*")}
    assert len(done) == 2
    sorted(work.rglob("*.json"))[-1].write_text("{")  # damaged: made again
    del done[max(done)]
    went_on, _ = in_parts(synthetic.map_1, flight, output)
    times = {path.name: path.stat().st_mtime_ns for path in output.glob("recording=*/part-*")}
    assert {name: times[name] for name in done} == done
    at_once, _ = in_parts(synthetic.map_1, flight, tmp_path / "once.parquet")
    pandas.testing.assert_frame_equal(went_on, at_once, check_exact=True)


def test_dates_count_from_the_first_row(flight: Path, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    with h5py.File(flight) as file:
        columns = dict(zip(NAMES, file["strain"][()].T, strict=True))
        columns["dynamic_pressure"] = file["dynamic_pressure"][()]
    stamps = np.datetime64("2026-03-04T05:06:07") + np.arange(N) * np.timedelta64(1, "ms")
    path = tmp_path / "dated.parquet"
    pandas.DataFrame({"time": stamps, **columns}).to_parquet(path, row_group_size=7000)
    parts, _ = in_parts(synthetic.map_1, path, tmp_path / "loads.parquet")
    np.testing.assert_allclose(parts["time"], 1e-3 * np.arange(N), atol=1e-9)
    whole, _ = in_one(synthetic.map_1, path, tmp_path / "one.parquet")
    np.testing.assert_array_equal(parts["C_N"], whole["C_N"])


def test_a_folder_on_two_workers_is_one_data_set(
    flight: Path, synthetic: SyntheticFiles, run: Any, tmp_path: Path
) -> None:
    folder = tmp_path / "flights"
    folder.mkdir()
    with h5py.File(flight) as file:
        strain, pressure = file["strain"][:300], file["dynamic_pressure"][:300]
    table = np.column_stack([1e-3 * np.arange(300), strain, pressure])
    heading = ",".join(["time", *NAMES, "dynamic_pressure"])
    np.savetxt(folder / "short.csv", table, delimiter=",", header=heading, comments="")
    lengths = {"flight 1.h5": PIECE_ROWS + 1000, "flight 2.h5": PIECE_ROWS + 200}
    for shorter, rows in lengths.items():
        with h5py.File(flight) as file, h5py.File(folder / shorter, "w") as written:
            written["gauge_names"] = NAMES
            for name in ("strain", "time", "dynamic_pressure"):
                written[name] = file[name][:rows]
    (folder / "2025").mkdir()
    output = tmp_path / "loads.parquet"
    code, shown, errors = run(
        "estimate", str(synthetic.map_1), str(folder), "-o", str(output), "--workers", "2", "--part-rows", "16000"
    )
    assert code == 0, errors
    text = " ".join(shown.split())
    assert f"written, {sum(lengths.values()) + 300} samples" in text
    assert text.count("3.001 s behind row") == 1  # what holds for both stands once
    assert " and 1 more: " in text
    assert "folders in it are passed over: 2025" in text
    on_two = pandas.read_parquet(output)
    on_one, _ = in_parts(synthetic.map_1, folder, tmp_path / "one.parquet")
    pandas.testing.assert_frame_equal(on_two, on_one, check_exact=True)
    assert set(on_two["recording"]) == {*lengths, "short.csv"}


def test_what_is_refused_leaves_nothing(flight: Path, synthetic: SyntheticFiles, run: Any, tmp_path: Path) -> None:
    (tmp_path / "there.parquet").mkdir()
    (tmp_path / "empty").mkdir()
    weak = tmp_path / "weak.h5"
    with h5py.File(flight) as file, h5py.File(weak, "w") as written:
        written["strain"], written["time"] = 1e-6 * file["strain"][()], file["time"][()]
        written["dynamic_pressure"], written["gauge_names"] = file["dynamic_pressure"][()], NAMES
    for arguments, line in {
        (synthetic.map_1, flight, "a.csv"): "expected a folder X.parquet",
        (synthetic.map_1, flight, "there.parquet"): "expected a data set of loads, or nothing",
        (synthetic.map_1, tmp_path / "empty", "a.parquet"): "expected recordings",
        (synthetic.estimator_1, flight, "a.parquet"): "expected an inverse map",
        (synthetic.map_1, flight, "a.parquet", "--report", "a.html"): "--report: expected none with parts",
        (synthetic.map_1, weak, "a.parquet"): "strains are 2e-06 times the map's",
    }.items():
        source, data, name, *more = arguments
        words = [str(source), str(data), "-o", str(tmp_path / name), *map(str, more), "--workers", "1"]
        code, _, errors = run("estimate", *words, "--part-rows", "16000")
        assert code == 2
        assert line in " ".join(errors.split())
    assert {path.name for path in tmp_path.iterdir()} == {"there.parquet", "empty", "weak.h5"}
