"""The level of the strains: another unit is refused and named, a flight as the map expects it is not."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_case import NAMES, samples, write_csv
from synthetic_vehicle import SyntheticFiles

from strainfmu.errors import InputError
from strainfmu.recorded import strain_level
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.strain_level import LevelCheck, LevelReference, level_of, likely_units

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]
FACTORS = {"um/m": 1e-6, "mm/m": 1e-3, "percent": 1e-2, "m/m": 1.0}


def flight_in(path: Path, true_unit: str, stated: str | None) -> Path:
    """Write strains that are in one unit under the heading of another, None for no unit."""
    time, strain, pressure = samples(60)
    bracket = "" if stated is None else f" [{stated}]"
    headings = ["time", *(f"{name}{bracket}" for name in NAMES), "dynamic_pressure"]
    return write_csv(path, headings, time, strain / FACTORS[true_unit], pressure)


@pytest.mark.parametrize("kind", ["map_1", "estimator_1"])
@pytest.mark.parametrize(
    ("true_unit", "stated"),
    [
        ("um/m", None),
        ("mm/m", None),
        ("percent", None),
        ("um/m", "mm/m"),
        ("um/m", "percent"),
        ("mm/m", "um/m"),
        ("m/m", "um/m"),
        ("m/m", "mm/m"),
    ],
)
def test_another_unit_is_refused_and_named(
    kind: str, true_unit: str, stated: str | None, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    data = flight_in(tmp_path / "d.csv", true_unit, stated)
    with pytest.raises(InputError) as error:
        estimate_file(getattr(synthetic, kind), data, tmp_path / "o.csv")
    named = re.search(r"likely in (.+?),", str(error.value))
    assert named is not None
    assert true_unit in named[1].split(" or ")
    assert "\n" not in str(error.value)
    assert [item.name for item in tmp_path.iterdir()] == ["d.csv"]


@pytest.mark.parametrize("unit", FACTORS)
def test_the_right_unit_is_taken(unit: str, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    data = flight_in(tmp_path / "d.csv", unit, unit)
    assert estimate_file(synthetic.map_1, data, tmp_path / "o.csv").notes == []


def test_the_refusal_can_be_overridden(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    data = flight_in(tmp_path / "d.csv", "mm/m", "um/m")
    arguments = ("estimate", synthetic.map_1, data, "-o", tmp_path / "o.csv")
    code, _, errors = run(*arguments)
    assert code == 2
    assert f"strainfmu: {data}: strains are 0.002 times the map's, " in errors
    assert (
        "likely in mm/m, not um/m; state the unit, as in 'strain[1] [mm/m]', or give --accept-strain-level"
        in errors
    )
    assert not (tmp_path / "o.csv").exists()
    code, printed, errors = run(*arguments, "--accept-strain-level")
    assert (code, errors) == (0, "")
    assert "likely in mm/m, not um/m\n" in printed


REFERENCE = LevelReference(
    strain_range=np.full(4, 3e-4), noise_std=np.array([1e-6, 1e-6, 1e-6, 1e-3]), dynamic_pressure=1e5
)


def notes(
    strain: np.ndarray,
    pressure: float,
    reference: LevelReference = REFERENCE,
    stated: tuple[str, float] | None = ("dynamic_pressure", 1.0),
) -> list[str]:
    check = LevelCheck(Path("d.csv"), reference, 1.0, source=stated)
    level = level_of(np.atleast_2d(strain))
    check.refuse_high(level, pressure)
    return check.notes(level, pressure)


def test_a_gauge_is_seen_from_ten_times_its_noise_on() -> None:
    strain_range, noise = np.array([9.9e-6, 1.01e-5, 1e-9, 0.0, 5e-4]), np.array([1e-6, 1e-6, 0.0, 0.0, 1e-4])
    found = LevelReference(strain_range=strain_range, noise_std=noise, dynamic_pressure=1e5)
    assert found.observed.tolist() == [False, True, True, False, False]
    assert found.ratio(3.0 * strain_range + [1.0, 0.0, 0.0, 1.0, 1.0]) == pytest.approx(3.0)


def test_what_flights_do_is_no_unit() -> None:
    """On the ground, at a low or a high dynamic pressure, with a broken gauge, without a dynamic pressure."""
    level = np.full(4, 2e-4)
    assert notes(level, 1e5) == []
    assert notes(1e-3 * level, 1e2) == []  # a thousandth of the dynamic pressure
    assert notes(1e-3 * level, 0.0) == []
    assert notes(1e-3 * level, np.nan) == []
    assert notes(8.0 * level, 8e5) == []
    assert notes(level * [1.0, 1.0, 1e2, 1.0], 1e5) == []
    assert notes(level * [1.0, 1.0, np.nan, 1e3], 1e5) == []
    assert notes(np.full(4, np.nan), 1e5) == []
    assert notes(0.0 * level, 1e5) == ["d.csv: half of the gauges or more read 0 throughout"]
    spikes = np.tile(level, (1000, 1))
    spikes[::300] = 0.09
    assert notes(spikes, 1e5) == []
    assert notes(0.016 * level, 1e5) == []  # no incidence
    noisy = LevelReference(strain_range=np.full(4, 3e-4), noise_std=np.full(4, 1e-3), dynamic_pressure=1e5)
    assert notes(1e-3 * level, 1e5, noisy) == []  # no gauge sees more than its noise


@pytest.mark.parametrize(
    ("name", "factor", "found", "ratio", "unit", "way"),
    [
        ("dynamic_pressure", 1.0, 90.0, "0.0009", "kPa", "state the unit, as in 'dynamic_pressure [kPa]'"),
        ("dynamic_pressure", 1.0, 0.9, "9e-06", "bar", "state the unit, as in 'dynamic_pressure [bar]'"),
        ("static_pressure", 1.0, 13.0, "0.0001", "psi", "state the unit, as in 'static_pressure [psi]'"),
        ("dynamic_pressure", 1e3, 9e7, "9e+02", "Pa", "state the unit, as in 'dynamic_pressure [Pa]'"),
        ("--dynamic-pressure", 1.0, 90.0, "0.0009", "kPa", "give it in Pa"),
    ],
)
def test_a_dynamic_pressure_in_another_unit_is_said(
    name: str, factor: float, found: float, ratio: str, unit: str, way: str
) -> None:
    """Strains as at 1e5 Pa, of a map that covers 5e3 to 1e6 Pa."""
    held = replace(REFERENCE, pressure_range=(5e3, 1e6))
    (line,) = notes(np.full(4, 1e-4), found, held, (name, factor))
    assert line == (
        f"d.csv: {name}: q_inf is {found:.4g} Pa at most, {ratio} times what the map covers, 5000 to 1e+06 Pa, "
        f"and strains do not fit it: likely in {unit}; {way}"
    )
    assert notes(np.full(4, 1e-4), found, held, None) == []  # by an altitude, which has no such unit
    assert "times the nominal one, 1e+05 Pa" in notes(np.full(4, 1e-4), found, stated=(name, factor))[0]


def test_a_file_in_kilopascals_is_named(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    time, strain, pressure = samples(20)
    data = write_csv(tmp_path / "d.csv", ["time", *NAMES, "dynamic_pressure"], time, strain, 1e-3 * pressure)
    _, printed, _ = run("estimate", synthetic.map_1, data, "-o", tmp_path / "o.csv")
    assert (
        "dynamic_pressure: q_inf is 90.02 Pa at most, 0.0009 times the nominal one, 9.58e+04 Pa, and strains"
        in printed
    )
    assert re.search(r"likely in .*kPa.*; state the unit, as in", printed)


@pytest.mark.parametrize("kind", ["map_1", "estimator_1"])
def test_a_slower_pressure_is_noted_with_the_way_to_interpolate_it(
    kind: str, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    time, strain, pressure = samples(40)
    pressure[np.arange(40) % 5 > 0] = np.nan
    data = write_csv(tmp_path / "d.csv", ["time", *NAMES, "dynamic_pressure"], time, strain, pressure)
    (note,) = estimate_file(getattr(synthetic, kind), data, tmp_path / "o.csv").notes
    assert note.startswith(
        f"{data}: values in few of 40 rows: dynamic_pressure (8); the others have none. --channels"
    )
    assert "channels.toml interpolates" in note
    pressure[np.arange(40) % 5 != 1] = 9e4  # single gaps are none
    write_csv(data, ["time", *NAMES, "dynamic_pressure"], time, strain, pressure)
    assert estimate_file(getattr(synthetic, kind), data, tmp_path / "o.csv").notes == []


def test_a_level_that_no_unit_explains() -> None:
    assert likely_units(1e-9, 1.0) == ()
    assert likely_units(np.inf, 1.0) == ()
    assert likely_units(0.5e6, 1.0) == ("um/m",)
    assert likely_units(600.0, 1.0) == ("mm/m",)
    assert likely_units(200.0, 1.0) == ("mm/m", "percent")
    assert likely_units(36.0, 1.0) == ("percent", "mm/m")


def test_a_level_that_comes_again_is_not_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A flight that repeats its largest strains takes no quantile of each block; a higher level counts."""
    size = np.linspace(0.0, 1.0, 4000)[:, None] * np.array([1.0, 2.0, 3.0])
    level = strain_level.level_of(size)
    np.testing.assert_allclose(level, np.quantile(size, 0.99, axis=0), rtol=1e-12)
    raised = strain_level.raised_level(level, 1.2 * size)
    np.testing.assert_allclose(raised, 1.2 * level, rtol=1e-12)
    monkeypatch.delattr(np, "quantile")
    np.testing.assert_array_equal(strain_level.raised_level(level, 1.0005 * size), level)
