"""One rule for all formats: times of each column, names that are there twice, units, missing values, cut files."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from limited_process import limited_run
from mutations import mutated
from recorded_formats import WRITERS, Columns, Group, Groups, lvm_file
from sweeps import crossed
from synthetic_vehicle import SyntheticFiles

from strainfmu.errors import InputError
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import Samples, open_recording

FAST, SLOW = 0.01 * np.arange(120), 0.05 * np.arange(24)
GAUGES = ("G0", "G1", "G2")
WANTED = Wanted(gauge_names=GAUGES)
ONE_FRAME = ("csv", "parquet")
"""Formats of one table, whose columns have all the same times."""

WITHOUT_UNITS = ("mat",)


def strain(i: int) -> np.ndarray:
    """Return a reading of gauge i [um/m]."""
    return np.asarray(10.0 * (i + 1) + np.round(5.0 * np.sin(FAST * (i + 1)), 9))


def gauges(unit: str = "um/m") -> Columns:
    return {name: (strain(i), unit) for i, name in enumerate(GAUGES)}


def pressure(time: np.ndarray) -> np.ndarray:
    return 90.0 + 2.0 * time


def toml(folder: Path, names: dict[str, str], head: str = "", unit: str = "") -> Path:
    """Write a channel file: the channel of each gauge, q as [[flow]] where ``names`` has it."""
    stated = f"unit = '{unit}'\n" if unit else ""
    entries = [
        f"[[channel]]\nname = '{name}'\ngauge = '{gauge}'\n{stated}"
        for gauge, name in names.items()
        if gauge != "q"
    ]
    if "q" in names:
        entries.append(f"[[flow]]\nname = '{names['q']}'\nquantity = 'dynamic_pressure'\nunit = 'kPa'\n")
    path = folder / "channels.toml"
    path.write_text(head + "".join(entries), encoding="utf-8")
    return path


def read(path: Path, channels: Path | None = None, wanted: Wanted = WANTED) -> tuple[Samples, list[str]]:
    """Return all samples, and all lines for the user."""
    with open_recording(path, wanted, channels) as opened:
        blocks = [*opened.blocks]
        assert len(blocks) == 1
        return blocks[0], opened.notes


OWN = {**{gauge: gauge for gauge in GAUGES}, "q": "Pdyn"}


@pytest.mark.parametrize("kind", WRITERS)
def test_every_column_has_its_own_times(kind: str, tmp_path: Path) -> None:
    """A slower column, which begins later and ends earlier; formats of one table are refused by the names."""
    late = SLOW[2:-3] + 0.002
    groups = [Group("rack", FAST, gauges()), Group("air", late, {"Pdyn": (pressure(late), "kPa")})]
    unit = "um/m" if kind in WITHOUT_UNITS else ""
    if kind == "parquet":
        pytest.skip("one table, whose columns have as many rows")
    path, channels = WRITERS[kind](tmp_path, groups), toml(tmp_path, OWN, unit=unit)
    if kind == "csv":
        with pytest.raises(InputError, match="'Time 1 - rack' and 'Time 2 - air': expected one time"):
            read(path, channels)
        return
    block, lines = read(path, channels)
    np.testing.assert_allclose(block.time, FAST, atol=1e-9)
    np.testing.assert_allclose(block.strain, 1e-6 * np.column_stack([strain(i) for i in range(3)]), atol=1e-14)
    inside = (late[0] - 1e-9 <= FAST) & (late[-1] + 1e-9 >= FAST)
    np.testing.assert_allclose(block.dynamic_pressure[inside], 1e3 * pressure(FAST)[inside], rtol=1e-8)
    assert np.isnan(block.dynamic_pressure[~inside]).all()
    assert any("1 columns of 50 ms" in line and "interpolated" in line for line in lines)


@pytest.mark.parametrize("kind", [kind for kind in WRITERS if kind != "uff"])  # whose library writes 0
def test_missing_values_are_missing(kind: str, tmp_path: Path) -> None:
    columns = {name: (values.copy(), unit) for name, (values, unit) in gauges().items()}
    columns["G1"][0][7:11] = np.nan
    group = Group("rack", FAST, {**columns, "dynamic_pressure": (pressure(FAST), "kPa")})
    path = WRITERS[kind](tmp_path, [group])
    channels = toml(tmp_path, {gauge: gauge for gauge in GAUGES}, unit="um/m")
    block, _ = read(path, channels)
    assert np.flatnonzero(np.isnan(block.strain[:, 1])).tolist() == [7, 8, 9, 10]
    assert np.isfinite(block.strain[:, [0, 2]]).all()


def packed_hdf5(path: Path, values: np.ndarray, invalid: np.ndarray) -> None:
    """As netCDF packs it: steps of 1e-6 um/m below 5 um/m, a number for no value."""
    with h5py.File(path, "a") as file:
        del file["rack/G1"]
        raw = np.where(invalid, -(2**31), np.round((values - 5.0) * 1e6)).astype("i4")
        file["rack/G1"] = raw
        more = {
            "units": ["um/m"],
            "scale_factor": 1e-6,
            "add_offset": 5.0,
            "_FillValue": np.array([-(2**31)], "i4"),
        }
        file["rack/G1"].attrs.update(more)
        file["rack/spare"] = h5py.Empty("f8")


def invalidated_mf4(path: Path, values: np.ndarray, invalid: np.ndarray) -> None:
    """With numbers where its bits say that they are invalid."""
    asammdf = pytest.importorskip("asammdf")
    q = asammdf.Signal(pressure(FAST), FAST, name="dynamic_pressure", unit="kPa")
    signals = [asammdf.Signal(strain(i), FAST, name=name, unit="um/m") for i, name in enumerate(GAUGES)]
    signals[1] = asammdf.Signal(values, FAST, name="G1", unit="um/m", invalidation_bits=invalid)
    with asammdf.MDF() as file:
        file.append([*signals, q])
        file.save(path, overwrite=True)


@pytest.mark.parametrize(("kind", "alter"), [("hdf5", packed_hdf5), ("mf4", invalidated_mf4)])
def test_what_a_format_says_of_its_numbers_is_heeded(
    kind: str, alter: Callable[[Path, np.ndarray, np.ndarray], None], tmp_path: Path
) -> None:
    """Marks of invalid values, factors and offsets of its own."""
    group = Group("rack", FAST, {**gauges(), "dynamic_pressure": (pressure(FAST), "kPa")})
    path, invalid = WRITERS[kind](tmp_path, [group]), np.isin(np.arange(len(FAST)), [7, 8])
    alter(path, strain(1), invalid)
    block, _ = read(path)
    expected = np.where(invalid, np.nan, 1e-6 * strain(1))
    np.testing.assert_allclose(block.strain[:, 1], expected, atol=1e-12)


UNITS = ("um/m", "µm/m", "microstrain", "ue", "µε", "uStrain", "UM/M", "Microstrain", "ppm", "µin/in")


@pytest.mark.parametrize(("unit", "kind"), crossed(UNITS, [kind for kind in WRITERS if kind not in WITHOUT_UNITS]))
def test_units_are_spelt_in_any_way(kind: str, unit: str, tmp_path: Path) -> None:
    if kind == "uff" and not unit.isascii():
        pytest.skip("universal files are ASCII")
    group = Group("rack", FAST, {**gauges(unit), "dynamic_pressure": (pressure(FAST), "kPa")})
    block, _ = read(WRITERS[kind](tmp_path, [group]))
    np.testing.assert_allclose(block.strain[:, 0], 1e-6 * strain(0), atol=1e-14)
    np.testing.assert_allclose(block.dynamic_pressure, 1e3 * pressure(FAST), rtol=1e-9)


@pytest.mark.parametrize("kind", [kind for kind in WRITERS if kind not in WITHOUT_UNITS])
def test_an_unknown_unit_is_named(kind: str, tmp_path: Path) -> None:
    group = Group("rack", FAST, {**gauges("furlong"), "dynamic_pressure": (pressure(FAST), "kPa")})
    with pytest.raises(InputError, match=r"column '.*G0.*': unit: expected one of um/m, .*, got 'furlong'"):
        read(WRITERS[kind](tmp_path, [group]))


@pytest.mark.parametrize("kind", WRITERS)
def test_a_name_that_is_there_twice_is_named_and_its_group_chooses(kind: str, tmp_path: Path) -> None:
    q = {"dynamic_pressure": (pressure(FAST), "kPa")}
    groups = [Group("rack", FAST, {**gauges(), **q}), Group("spare", FAST, {"G0": (2.0 * strain(0), "um/m")})]
    if kind in ONE_FRAME or kind in ("lvm", "uff"):
        twice = {**gauges(), "G9": (strain(0), "um/m"), **q}
        path = WRITERS[kind](tmp_path, [Group("rack", FAST, twice)])
        if kind not in ("csv", "lvm"):
            pytest.skip("the format's library, or its names, allow no second one")
        path.write_text(path.read_text().replace("G9", "G0"))
        with pytest.raises(InputError, match=r"expected one column (for G0|'G0'), got 2"):
            read(path)
        return
    path = WRITERS[kind](tmp_path, groups)
    with pytest.raises(InputError, match=r"expected one column for G0, got 2: '(.*)G0' and '(.*)G0'") as error:
        read(path)
    first, second = str(error.value).split("got 2: '")[1].split("'; ")[0].split("' and '")
    assert first != second
    with pytest.raises(InputError, match="channel 'G0': expected one of that name, got 2"):
        read(path, toml(tmp_path, dict(zip(GAUGES, GAUGES, strict=True)), unit="um/m"))
    for name, factor in ((first, 1.0), (second, 2.0)):
        names = {"G0": name, "G1": "G1", "G2": "G2"}
        block, _ = read(path, toml(tmp_path, names, unit="um/m"))
        np.testing.assert_allclose(block.strain[:, 0], factor * 1e-6 * strain(0), atol=1e-14)


@pytest.mark.parametrize("kind", WRITERS)
def test_a_file_that_ends_early_is_read_as_far_or_refused_in_one_line(kind: str, tmp_path: Path) -> None:
    """At eight places; what is read are whole rows, and a line says that some are missing."""
    group = Group("rack", FAST, {**gauges(), "dynamic_pressure": (pressure(FAST), "kPa")})
    path = WRITERS[kind](tmp_path, [group])
    content, is_read, refusals = path.read_bytes(), 0, list[str]()
    channels = toml(tmp_path, {gauge: gauge for gauge in GAUGES}, unit="um/m")
    for n in np.linspace(0.3 * len(content), len(content) - 2, 8).astype(int):
        path.write_bytes(content[:n])
        try:
            block, lines = read(path, channels)
        except InputError as error:
            refusals.append(str(error))
            continue
        is_read += 1
        np.testing.assert_allclose(block.strain[:, 2], 1e-6 * strain(2)[: len(block.time)], atol=1e-14)
        if len(block.time) < len(FAST) - (kind in ("csv", "lvm") and content[n - 1 : n] == b"\n"):
            assert kind in ("csv", "lvm") or any("end" in line for line in lines)
    assert is_read > 4 or kind not in ("csv", "lvm")
    assert all("\n" not in line and line.startswith(f"{path}: ") for line in refusals)


@pytest.mark.parametrize("mode", ["Relative", "Absolute"])
def test_the_header_states_what_times_are(mode: str, tmp_path: Path) -> None:
    """LabVIEW: times since the segment began, or since the epoch; segments half a second apart."""
    q = {"dynamic_pressure": (pressure(FAST), "kPa")}
    start = 0.0 if mode == "Relative" else 3.8e9
    path = lvm_file(tmp_path, [Group("rack", FAST + start, {**gauges(), **q})])
    path.write_text(path.read_text().replace("Time_Pref\tRelative", f"Time_Pref\t{mode}"))
    block, _ = read(path)
    np.testing.assert_allclose(block.time, FAST + start, rtol=1e-12, atol=1e-9)


def damages(kind: str, seeds: range, synthetic: SyntheticFiles, folder: Path) -> list[str]:
    """Return what is wrong with how damaged files end."""
    columns = {f"G{i}": (strain(i % 3), "um/m") for i in range(6)}
    groups: Groups = [Group("rack", FAST, {**columns, "dynamic_pressure": (pressure(FAST), "kPa")})]
    path = WRITERS[kind](folder, groups)
    channels = toml(folder, {name: name for name in columns}, unit="um/m")
    content, wrong = path.read_bytes(), []
    for seed in seeds:
        path.write_bytes(mutated(content, seed))
        arguments = ("estimate", synthetic.map_1, path, "-o", folder / "o.csv", "--channels", channels)
        ended = limited_run(folder, *arguments, "--accept-strain-level")
        if problem := ended.problem():
            wrong.append(f"{kind}, seed {seed}: {problem}")
    return wrong


@pytest.mark.parametrize("kind", WRITERS)
def test_a_few_damaged_files_end_in_one_line(kind: str, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    assert damages(kind, range(2), synthetic, tmp_path) == []


def test_a_library_that_logs_what_is_damaged_adds_no_line(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """npTDMS warns on standard error of the first and the third of these files."""
    pytest.importorskip("nptdms")
    assert damages("tdms", range(103, 106), synthetic, tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", WRITERS)
def test_five_hundred_damaged_files_end_in_one_line(kind: str, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    assert damages(kind, range(500), synthetic, tmp_path) == []
