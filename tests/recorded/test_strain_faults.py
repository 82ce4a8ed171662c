"""Strains that no gauge has measured are left out and named in the file: held rows, zeros, railed channels."""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from flight_fmu import random_flight, whole_map
from recorded_case import NAMES, read_csv, samples, write_csv
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.errors import InputError
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.recorded.checks import HELD, SHORTEST_HELD, DataChecks, common_step
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.samples import Samples
from strainfmu.recorded.selection import Selection
from strainfmu.recorded.strain_level import LevelReference
from strainfmu.recorded.table import BLOCK_ROWS, Table

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]
HEADINGS = ["time", *NAMES, "dynamic_pressure"]
INVALID, DEGRADED = float(HealthState.INVALID), float(HealthState.DEGRADED)


def faults_in(path: Path) -> list[str]:
    """Return the column of faults of a CSV file of estimates."""
    return [row["strain_faults"] for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines())]


@pytest.mark.parametrize("source", ["map_1", "estimator_1"])
@pytest.mark.parametrize("held", [SHORTEST_HELD, SHORTEST_HELD + 1, 30])
def test_rows_that_the_recorder_holds_have_no_result(
    source: str, held: int, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    """``held`` equal rows in all, the first of which was measured."""
    time, strain, pressure = samples(60)
    strain[:, 1] = np.nan  # a lost gauge repeats nothing
    strain[20 : 20 + held] = strain[20]
    data = write_csv(tmp_path / "d.csv", HEADINGS, time, strain, pressure)
    summary = estimate_file(getattr(synthetic, source), data, tmp_path / "o.csv")
    is_held = np.zeros(60, dtype=bool)
    if held > SHORTEST_HELD:
        is_held[21 : 20 + held] = True
        assert summary.notes[-1].startswith(
            f"{data}: no gauge changes in {held - 1} rows, to the last bit, the first"
        )
        assert (
            "at 0.021 s: the recorder holds its last values, which are left out; --accept-held"
            in summary.notes[-1]
        )
    else:
        assert summary.notes == []
    found = read_csv(tmp_path / "o.csv")
    assert faults_in(tmp_path / "o.csv") == [HELD if one else "" for one in is_held]
    np.testing.assert_array_equal(found["health.state [1]"] == INVALID, is_held)
    np.testing.assert_array_equal(np.isnan(found["C_N [1]"]), is_held)
    assert summary.faults.missing == {"G1": 60}  # what is held is not missing


def test_held_rows_are_estimated_on_demand(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    time, strain, pressure = samples(30)
    strain[:] = strain[0]
    data, out = write_csv(tmp_path / "d.csv", HEADINGS, time, strain, pressure), tmp_path / "o.csv"
    code, printed, _ = run("estimate", synthetic.map_1, data, "-o", out, "--accept-held", "--columns", "all")
    assert code == 0
    assert "no gauge changes in 30 rows" in printed  # nothing shows that the first is new
    assert "estimated all the same" in printed
    assert set(read_csv(out)["health.state [1]"]) == {float(HealthState.OK)}
    assert set(faults_in(out)) == {HELD}


def test_rows_of_zeros_have_no_result_at_a_dynamic_pressure(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """Every single one; at rest they are a reading as others are."""
    time, strain, pressure = samples(40)
    strain[[3, 4, 30]] = 0.0
    strain[30, 2] = np.nan
    pressure[4] = 0.0
    data = write_csv(tmp_path / "d.csv", HEADINGS, time, strain, pressure)
    for source in (synthetic.map_1, synthetic.estimator_1):
        notes = estimate_file(source, data, tmp_path / "o.csv").notes
        assert notes == [f"{data}: all gauges read exactly zero in 2 rows, the first at 0.003 s: left out"]
        state = read_csv(tmp_path / "o.csv")["health.state [1]"]
        assert state[[3, 4, 30]].tolist() == [INVALID, HealthState.NO_COEFFICIENTS, INVALID]
        assert np.isin(np.delete(state, [3, 4, 30]), [HealthState.OK, HealthState.SUSPECT]).all()


@pytest.mark.parametrize("rail", [32767.0, 9999.0, -400.0])
@pytest.mark.parametrize("source", ["map_1", "estimator_1"])
def test_a_railed_channel_is_named_and_left_out(
    source: str, rail: float, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    """Full scale of an amplifier, far beyond the 100 um/m of the map or not; the estimate is that without it."""
    time, strain, pressure = samples(60)
    lost = strain.copy()
    strain[10:, 2], lost[10:, 2] = 1e-6 * rail, np.nan
    data = write_csv(tmp_path / "d.csv", HEADINGS, time, strain, pressure)
    summary = estimate_file(getattr(synthetic, source), data, tmp_path / "o.csv")
    (note,) = summary.notes
    assert note.startswith(
        f"{data}: 'G2' reads {abs(rail):g} um/m, which no flow of the map gives, in 50 rows, the"
    )
    assert "--exclude 'G2'" in note
    assert faults_in(tmp_path / "o.csv") == [""] * 10 + ["G2"] * 50
    estimate_file(
        getattr(synthetic, source), write_csv(data, HEADINGS, time, lost, pressure), tmp_path / "lost.csv"
    )
    found, expected = (read_csv(tmp_path / name) for name in ("o.csv", "lost.csv"))
    for name in ("C_N [1]", "sigma.C_N [1]", "health.state [1]", "gauges_used [1]"):
        np.testing.assert_array_equal(found[name], expected[name])
    assert (found["health.state [1]"][10:] == DEGRADED).all()


def reference(noise: float = 3e-7) -> LevelReference:
    return LevelReference(strain_range=np.full(4, 3e-4), noise_std=np.full(4, noise), dynamic_pressure=1e5)


def found_faults(
    strain: np.ndarray, rows: int, noise: float = 3e-7, q: float = 1e5
) -> tuple[list[str], DataChecks]:
    """Return the faults of ``strain`` (n, 4) [m/m] in blocks of ``rows``, and what found them."""
    wanted = Wanted(gauge_names=("a", "b", "c", "d"), reference=reference(noise))
    faults = DataChecks(Selection(table=Table(Path("d.csv"), ()), wanted=wanted), accepts_level=True)
    time = 1e-2 * np.arange(len(strain))
    whole = Samples(time, strain, {"dynamic_pressure": np.full(len(strain), q)})
    blocks = [whole[i : i + rows] for i in range(0, len(strain), rows)]
    checked = [
        faults.checked(block, following) for block, following in zip(blocks, [*blocks[1:], None], strict=True)
    ]
    return [fault for block in checked for fault in block.faults], faults


@pytest.mark.parametrize("rows", [30, 100, BLOCK_ROWS])
def test_faults_are_those_of_rows_however_they_fall_into_blocks(rows: int) -> None:
    random = np.random.default_rng(3)
    strain = 1e-4 + 1e-5 * random.normal(size=(300, 4))
    strain[90:130] = strain[90]
    strain[200:, 3] = 5e-4  # beyond the map, and constant
    expected = [HELD if 91 <= row < 130 else "d" if row >= 200 else "" for row in range(300)]
    found, faults = found_faults(strain, rows)
    assert found == expected
    assert len(faults.notes()) == 2


def test_gauges_as_quiet_as_the_resolution_may_repeat_themselves() -> None:
    """Counts of 2 um/m: with noise of 0.1 of one all four gauges may well stand still, with noise of 0.6 not."""
    random = np.random.default_rng(5)
    still = 2e-6 * np.rint(random.uniform(20, 100, size=4)) * np.ones((60, 1))
    assert set(found_faults(still, 60, noise=2e-7)[0]) == {""}
    assert set(found_faults(still, 60, noise=1.2e-6)[0]) == {HELD}
    assert set(found_faults(still + 1e-9 * random.uniform(size=4), 60, noise=2e-7)[0]) == {HELD}  # no counts


def test_a_flight_beyond_the_map_is_no_railed_channel() -> None:
    """Half of the gauges far above the map's strains, or a dynamic pressure above its nominal one."""
    strain = 1e-5 * np.random.default_rng(6).normal(size=(50, 4)) + [4e-3, 4e-3, 1e-4, 1e-4]
    assert set(found_faults(strain, 50)[0]) == {""}
    strain[:, 1] = 1e-4
    assert set(found_faults(strain, 50)[0]) == {"a"}
    assert set(found_faults(strain, 50, q=1e6)[0]) == {""}


@pytest.mark.parametrize(
    ("values", "step"),
    [
        ([3e-6, -12e-6, 45e-6, 0.0], 3e-6),
        ([12.25e-6, 17.5e-6, 3e-6], 0.25e-6),
        ([7 * 2.0**-20, 24 * 2.0**-20], 2.0**-20),
        ([5e-6], 5e-6),
        ([0.0, 0.0], 0.0),
        ([], 0.0),
    ],
)
def test_the_step_of_values_is_their_common_divisor(values: list[float], step: float) -> None:
    assert common_step(np.array(values)) == pytest.approx(step, rel=1e-6, abs=0.0)


def test_numbers_without_a_common_step_have_that_of_round_off() -> None:
    assert common_step(np.random.default_rng(1).normal(size=20)) < 1e-8


def test_excluded_gauges_need_no_column(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    """By name, by number; what the column holds does not matter, nor whether it is there."""
    time, strain, pressure = samples(20)
    lost = strain.copy()
    lost[:, [1, 4]] = np.nan
    out = tmp_path / "o.csv"
    estimate_file(synthetic.map_1, write_csv(tmp_path / "d.csv", HEADINGS, time, lost, pressure), out)
    expected = out.read_text().splitlines()
    lines = [
        line.split(",")
        for line in write_csv(tmp_path / "d.csv", HEADINGS, time, strain, pressure).read_text().splitlines()
    ]
    rows = [[*row[:5], "OVL" if k else row[5], *row[6:]] for k, row in enumerate(lines)]  # G4
    (tmp_path / "d.csv").write_text("\n".join(",".join([row[0], row[1], *row[3:]]) for row in rows) + "\n")
    code, printed, errors = run(
        "estimate",
        synthetic.map_1,
        tmp_path / "d.csv",
        "-o",
        out,
        "--exclude",
        "G1, strain[5]",
        "--columns",
        "all",
    )
    assert (code, errors) == (0, "")
    assert f"{tmp_path / 'd.csv'}: left out by --exclude: G1, G4\n" in printed
    assert "strains without a value" not in printed
    assert out.read_text().splitlines() == expected


def test_excluded_channels_by_their_names_in_a_recorder(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    time, strain, pressure = samples(20)
    headings = ["time", *(f"ch {i}" for i in range(N_GAUGES)), "dynamic_pressure"]
    data = write_csv(tmp_path / "d.csv", headings, time, strain, pressure)
    toml = "defaults.unit = 'm/m'\n"
    toml += "".join(f"[[channel]]\nname = 'ch {i}'\ngauge = 'G{i}'\n" for i in range(N_GAUGES))
    (tmp_path / "channels.toml").write_text(toml)
    summary = estimate_file(
        synthetic.map_1, data, tmp_path / "o.csv", channels=tmp_path / "channels.toml", exclude=["ch 3"]
    )
    assert f"{data}: left out by --exclude: G3" in summary.notes
    assert summary.health == {"DEGRADED": 20}
    assert summary.faults.missing == {}


@pytest.mark.parametrize(
    ("names", "line"),
    [
        (["G7"], "--exclude: no gauge 'G7' found, there are G0, G1, G2"),
        (["strain[7]"], "--exclude: no gauge 'strain[7]' found, there are G0, G1, G2"),
        (NAMES, "--exclude: expected some gauges to be left, got all 6"),
    ],
)
def test_what_cannot_be_excluded_gets_one_line(
    names: list[str], line: str, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    data = write_csv(tmp_path / "d.csv", HEADINGS, *samples(5))
    with pytest.raises(InputError) as caught:
        estimate_file(synthetic.map_1, data, tmp_path / "o.csv", exclude=names)
    assert str(caught.value).startswith(f"{data}: {line}")


@pytest.mark.parametrize("smooth", [False, True])
def test_a_gap_of_weeks_begins_again(tmp_path: Path, smooth: bool) -> None:
    """After it the filter knows what one sample says."""
    held = whole_map()
    save_inverse_map(held, tmp_path / "map.h5")
    flight = random_flight(held, 6, seed=4)
    time = np.array([0.0, 0.01, 0.02, 5e6, 5e6 + 0.01, 5e6 + 0.02])
    flow = np.array([list(one.flow.values()) for one in flight])
    strain = np.array([one.strain for one in flight])
    headings = ["time", *held.gauge_names, *flight[0].flow]
    tables = {}
    for name, rows in (("whole", slice(0, 6)), ("after", slice(3, 6))):
        data = write_csv(tmp_path / f"{name}.csv", headings, time[rows], strain[rows], flow[rows])
        out = tmp_path / f"{name}_loads.csv"
        estimate_file(tmp_path / "map.h5", data, out, filter_seconds=1.0, smooth=smooth)
        tables[name] = np.genfromtxt(out, delimiter=",", names=True, deletechars="", replace_space=" ")
    # Not to the bit: the iterations start from the last state in one of the two, from a search in the other.
    whole, after = (tables[name][-3:] for name in ("whole", "after"))
    np.testing.assert_allclose(whole["sigma.C_N [1]"], after["sigma.C_N [1]"], rtol=1e-2)
    assert np.all(np.abs(whole["C_N [1]"] - after["C_N [1]"]) < 0.01 * after["sigma.C_N [1]"])
