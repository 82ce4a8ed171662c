"""Growth of cost with the number of gauges: exponents, table, figure, and the vehicles that are measured."""

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import builder
from builder.campaign.snapshots import save_snapshots
from builder.pipeline.gauge_growth import (
    COUNTS,
    GaugeRow,
    growth_csv,
    growth_figure,
    slopes,
    with_gauges,
)
from builder.vehicle.file import IC3X
from strainfmu.errors import InputError

NAMES = ("build", "load", "linear", "nonlinear", "one_lost", "third_lost", "reading", "file")


VEHICLES = Path(IC3X).parent
COARSE = Path(__file__).parents[2] / "docs" / "gallery_src" / "coarse.toml"


def rows_of_powers(powers: Sequence[float]) -> list[GaugeRow]:
    """Rows whose costs grow as n to known powers."""
    return [
        GaugeRow(gauges=n, **{name: 1e-6 * n**power for name, power in zip(NAMES, powers, strict=True)})
        for n in COUNTS[:4]
    ]


def test_the_exponents_are_those_of_the_costs() -> None:
    powers = (1.0, 2.0, 1.5, 2.0, 1.0, 3.0, 2.0, 0.5)
    exponents = slopes(rows_of_powers(powers))
    np.testing.assert_allclose([exponents[name] for name in NAMES], powers, rtol=1e-9)
    assert slopes(rows_of_powers(powers)[:1]) == {}


def test_what_is_not_measured_of_many_gauges_has_the_exponent_of_the_others() -> None:
    rows = rows_of_powers((1.0, 2.0, 1.5, 2.0, 1.0, 3.0, 2.0, 0.5))
    rows.append(replace(rows[-1], gauges=2048, nonlinear=float("nan")))
    assert slopes(rows)["nonlinear"] == pytest.approx(2.0, rel=1e-9)
    assert with_gauges(IC3X, 2048).map.estimator == "linear"


def test_the_table_is_read_back_and_the_figure_names_the_exponents() -> None:
    rows = rows_of_powers((1.0, 2.0, 1.5, 2.0, 1.0, 3.0, 2.0, 0.5))
    table = list(csv.DictReader(io.StringIO(growth_csv(rows))))
    assert [int(row["gauges [1]"]) for row in table] == list(COUNTS[:4])
    assert float(table[1]["linear [s]"]) == pytest.approx(rows[1].linear, rel=5e-3)
    assert "file [MB]" in table[0]
    labels = [text.get_text() for text in growth_figure(rows).legends[0].get_texts()]
    assert "step, linear: n^1.5" in labels


@pytest.mark.parametrize("count", COUNTS[:2])
def test_a_vehicle_has_the_gauges_asked_for_over_the_length_of_its_own(count: int) -> None:
    layout = with_gauges(IC3X, count).gauges.layouts["configuration_2"]
    stations = [x for row in layout.rows for x in row.stations]
    assert len(stations) == count
    assert (min(stations), max(stations)) == pytest.approx((0.35, 3.30))


def test_gauges_of_a_file_are_refused() -> None:
    with pytest.raises(InputError, match="expected rows of gauges"):
        with_gauges(VEHICLES / "finned_body.toml", 56)


@pytest.mark.slow
@pytest.mark.drawn
def test_the_command_measures_and_writes(tmp_path: Path, run: Callable[..., tuple[int, str, str]]) -> None:
    snapshots, growth = tmp_path / "snapshots.h5", tmp_path / "growth.csv"
    save_snapshots(builder.take_snapshots(COARSE), snapshots)
    options = ("--snapshots", snapshots, "--growth", growth, "--most", 56)
    code, printed, errors = run("bench", "--gauges", COARSE, *options)
    assert code == 0, errors
    assert f"{growth}, {growth.with_suffix('.png')}: written" in printed
    (row,) = csv.DictReader(io.StringIO(growth.read_text()))
    assert all(float(value) > 0.0 for value in row.values())
    assert growth.with_suffix(".png").stat().st_size > 10_000
    code, _, errors = run("bench", "--gauges", COARSE)
    assert code == 2
    assert "--snapshots FILE is missing" in errors
