"""``strainfmu bench --worst`` steps both estimators, with and without the filter, through every event."""

from collections.abc import Callable
from pathlib import Path

import pytest
from flight_fmu import whole_map
from scaled_maps import whole_scaled_map

from strainfmu.cli.main import main
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.fmu.checks.worst_step import AT_RANDOM, EVENTS

WITHOUT_PRESSURE = "no dynamic pressure, Mach number, static pressure or altitude given"


def small_map() -> InverseMap:
    return whole_scaled_map(1, seed=1, n=9, n_states=3)


@pytest.mark.parametrize(
    ("make", "columns"),
    [
        (small_map, ["linear", "linear, filter"]),
        pytest.param(
            whole_map,
            ["linear", "linear, filter", "nonlinear", "nonlinear, filter"],
            marks=pytest.mark.slow,
        ),
    ],
    ids=["linear", "nonlinear"],
)
def test_every_event_is_stepped(
    make: Callable[[], InverseMap],
    columns: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("strainfmu.fmu.checks.worst_step.REPEATS", 3)
    monkeypatch.setenv("COLUMNS", "250")  # one row of the table is one line
    save_inverse_map(make(), tmp_path / "map.h5")
    with pytest.raises(SystemExit) as left:
        main(["bench", str(tmp_path), "--worst", "--random-steps", "300"])
    assert left.value.code == 0
    rows = [
        [cell.strip() for cell in line.strip("│┃").split(line[0])]
        for line in capsys.readouterr().out.splitlines()
        if line[:1] in "│┃"
    ]
    heading, *costs = (row for row in rows if row[0])
    assert heading[1:] == columns
    assert [row[0] for row in costs] == [*EVENTS, AT_RANDOM]
    for event, *times in costs:
        for column, pair in zip(columns, times, strict=True):
            if event == WITHOUT_PRESSURE and column.startswith("linear"):
                assert pair == ""  # it has no estimate then
                continue
            median, *rare, largest = (float(number.replace(",", "")) for number in pair.split(" to "))
            assert len(rare) == (event == AT_RANDOM)
            assert 0.0 < median <= largest
            assert all(median <= one <= largest for one in rare)
