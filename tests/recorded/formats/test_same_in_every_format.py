"""One recording with navigation, in every file format: the nonlinear estimator finds the same in each."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import pytest
from flight_fmu import whole_map
from flight_maps import exact_response

import strainfmu
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.recorded.formats.channel_file import Reading
from strainfmu.recorded.formats.registry import open_channels
from strainfmu.recorded.run import estimate_file
from strainfmu.units import LENGTH_UNITS, NUMBER_UNITS, PRESSURE_UNITS

pytestmark = pytest.mark.fast
N_D, SAMPLES = whole_map().n_gauges, 12
TIME = 0.01 * np.arange(SAMPLES)
STRAIN = exact_response(6.0, 0.03, 0.01, 5500.0)[:N_D] + 1e-7 * np.random.default_rng(3).standard_normal(
    (SAMPLES, N_D)
)
SI = {**PRESSURE_UNITS, **LENGTH_UNITS, **NUMBER_UNITS}


class Column(NamedTuple):
    """Values in a unit."""

    values: np.ndarray
    unit: str


Columns = Mapping[str, Column]
Writer = Callable[[Path, Columns], Path]

ALL = {
    "dynamic_pressure": Column(np.full(SAMPLES, 138.6), "kPa"),
    "dynamic_pressure_std": Column(np.full(SAMPLES, 3.0), "kPa"),
    "mach_number": Column(6.0 + 0.1 * TIME, "1"),
    "mach_number_std": Column(np.full(SAMPLES, 0.1), "1"),
    "static_pressure": Column(np.full(SAMPLES, 55.0), "hPa"),
    "static_pressure_std": Column(np.full(SAMPLES, 2.0), "hPa"),
    "altitude": Column(np.full(SAMPLES, 19.97), "km"),
}
GAUGES = [f"strain[{i + 1}]" for i in range(N_D)]


def csv_file(folder: Path, flow: Columns) -> Path:
    path = folder / "flight.csv"
    headings = ["time [ms]", *(f"{name} [um/m]" for name in GAUGES)]
    headings += [f"{name} [{one.unit}]" for name, one in flow.items()]
    table = np.column_stack([1e3 * TIME, 1e6 * STRAIN, *(one.values for one in flow.values())])
    np.savetxt(path, table, delimiter=",", header=",".join(headings), comments="", fmt="%.17g")
    return path


def hdf5_arrays(folder: Path, flow: Columns) -> Path:
    path = folder / "arrays.h5"
    with h5py.File(path, "w") as file:
        table = {"time": Column(1e3 * TIME, "ms"), "strain": Column(1e6 * STRAIN, "um/m"), **flow}
        for name, one in table.items():
            file[name] = one.values
            file[name].attrs["unit"] = one.unit
    return path


def hdf5_signals(folder: Path, flow: Columns) -> Path:
    """As a recorded simulation: data sets of a group, with the name of the instance."""
    path = folder / "signals.h5"
    strain = {name: Column(1e6 * STRAIN[:, i], "um/m") for i, name in enumerate(GAUGES)}
    with h5py.File(path, "w") as file:
        file["time"], group = TIME, file.create_group("signals")
        for name, one in {**strain, **flow}.items():
            group[f"plant.{name}"] = one.values
            group[f"plant.{name}"].attrs["unit"] = one.unit
    return path


def mat_file(folder: Path, flow: Columns) -> Path:
    scipy_io = pytest.importorskip("scipy.io")
    path = folder / "flight.mat"
    in_si = {name: one.values * SI[one.unit] for name, one in flow.items()}
    scipy_io.savemat(path, {"time": TIME, "strain": STRAIN, **in_si})
    return path


def parquet_file(folder: Path, flow: Columns) -> Path:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = folder / "flight.parquet"
    table = {"time [ms]": 1e3 * TIME, **{f"{name} [um/m]": 1e6 * STRAIN[:, i] for i, name in enumerate(GAUGES)}}
    table |= {f"{name} [{one.unit}]": one.values for name, one in flow.items()}
    parquet.write_table(arrow.table(table), path)
    return path


def mf4_file(folder: Path, flow: Columns) -> Path:
    asammdf = pytest.importorskip("asammdf")
    path = folder / "flight.mf4"
    signals = [asammdf.Signal(1e6 * STRAIN[:, i], TIME, name=name, unit="um/m") for i, name in enumerate(GAUGES)]
    signals += [asammdf.Signal(one.values, TIME, name=name, unit=one.unit) for name, one in flow.items()]
    with asammdf.MDF() as file:
        file.append(signals)
        file.save(path, overwrite=True)
    return path


def tdms_file(folder: Path, flow: Columns) -> Path:
    nptdms = pytest.importorskip("nptdms")
    path = folder / "flight.tdms"
    strain = {name: Column(1e6 * STRAIN[:, i], "um/m") for i, name in enumerate(GAUGES)}
    table = {"time": Column(TIME, "s"), **strain, **flow}
    with nptdms.TdmsWriter(path) as file:
        channels = [
            nptdms.ChannelObject("log", name, one.values, {"unit_string": one.unit}) for name, one in table.items()
        ]
        file.write_segment(channels)
    return path


def uff_set(name: str, values: np.ndarray, unit: str, **more: object) -> dict[str, object]:
    """A data set 58 of double precision over even times."""
    held: dict[str, object] = dict.fromkeys(("id2", "id3", "id4", "id5", "rsp_ent_name", "ref_ent_name"), "NONE")
    held |= dict.fromkeys(("orddenom_spec_data_type", "z_axis_spec_data_type", "func_id", "load_case_id"), 0)
    return {
        **held,
        "type": 58,
        "binary": 0,
        "func_type": 1,
        "id1": name,
        "rsp_node": 1,
        "rsp_dir": 1,
        "ref_node": 1,
        "ref_dir": 1,
        "data": values,
        "x": TIME,
        "ord_data_type": 4,
        "abscissa_spacing": 1,
        "abscissa_min": TIME[0],
        "abscissa_inc": TIME[1] - TIME[0],
        "abscissa_spec_data_type": 17,
        "ordinate_axis_units_lab": unit,
        **more,
    }


def uff_file(folder: Path, flow: Columns) -> Path:
    pyuff = pytest.importorskip("pyuff")
    path = folder / "flight.uff"
    strain = {name: Column(1e6 * STRAIN[:, i], "um/m") for i, name in enumerate(GAUGES)}
    sets = [
        uff_set(name, one.values, one.unit, binary=k % 2)
        for k, (name, one) in enumerate({**strain, **flow}.items())
    ]
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")
    return path


def test_channels_of_a_universal_file(tmp_path: Path) -> None:
    """Names of degrees of freedom, sets that are no series over time, a file that ends early."""
    pyuff = pytest.importorskip("pyuff")
    path, value = tmp_path / "hall.unv", np.arange(float(SAMPLES))
    spectrum = uff_set("s", value + 1j, "um/m", func_type=4, ord_data_type=6, abscissa_spec_data_type=18)
    sets = [uff_set("NONE", value + k, "um/m", rsp_node=7 + k, rsp_dir=-3) for k in range(2)]
    pyuff.UFF(str(path)).write_sets([*sets, spectrum], mode="overwrite")
    with open_channels(path, Reading()) as file:
        assert file.names == ("7-Z", "8-Z")
        assert (file.numbers("8-Z").tolist(), dict(file.units)) == (
            (value + 1).tolist(),
            dict.fromkeys(file.names, "um/m"),
        )
        np.testing.assert_allclose(file.clock("7-Z"), TIME, rtol=1e-9, atol=1e-12)
        assert file.remarks == [f"{path}: 1 data sets that are no series over time are not read"]
    pyuff.UFF(str(path)).write_sets(sets[0], mode="overwrite")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:-2], lines[-1]]))
    with pytest.raises(InputError, match="damaged"), open_channels(path, Reading()):
        pass


FLIGHTS: list[tuple[tuple[str, ...], dict[str, float]]] = [
    (tuple(ALL), {}),
    (("mach_number", "mach_number_std", "static_pressure", "static_pressure_std"), {}),
    (("mach_number", "altitude"), {}),
    (("dynamic_pressure", "static_pressure"), {"dynamic_pressure": 140e3}),
    ((), {"dynamic_pressure": float("nan")}),
]
"""What the recording holds, and what is stated beside it."""


def estimates(folder: Path, inverse_map: Path, write: Writer) -> list[dict[str, np.ndarray]]:
    """Return the columns of the estimates of each of ``FLIGHTS``."""
    found = []
    for held, given in FLIGHTS:
        data = write(folder, {name: ALL[name] for name in held})
        estimate_file(inverse_map, data, folder / "loads.h5", **given)
        with h5py.File(folder / "loads.h5") as file:
            found.append({name: item[()] for name, item in file.items() if item.dtype.kind == "f"})
    return found


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[dict[str, np.ndarray]]]:
    """The map, and the estimates from CSV files."""
    folder = tmp_path_factory.mktemp("csv")
    save_inverse_map(whole_map(), folder / "map.h5")
    return folder / "map.h5", estimates(folder, folder / "map.h5", csv_file)


@pytest.mark.parametrize(
    "write",
    [hdf5_arrays, hdf5_signals, mat_file, parquet_file, mf4_file, tdms_file, uff_file],
    ids=lambda one: one.__name__,
)
def test_every_format_gives_the_estimates_of_the_others(
    tmp_path: Path, expected: tuple[Path, list[dict[str, np.ndarray]]], write: Writer
) -> None:
    inverse_map, by_csv = expected
    for found, wanted in zip(estimates(tmp_path, inverse_map, write), by_csv, strict=True):
        assert found.keys() == wanted.keys()
        for name, values in wanted.items():
            np.testing.assert_allclose(found[name], values, rtol=1e-9, atol=1e-12, err_msg=name)


def test_the_extra_all_holds_what_readers_ask_for() -> None:
    """A reader without its library names the extra that installs it; the licence note names those of the LGPL."""
    root = Path(strainfmu.__file__).parents[1]
    if not (root / "pyproject.toml").is_file():
        pytest.skip("installed without its sources")
    sources = "".join(path.read_text() for path in (root / "strainfmu" / "recorded").rglob("*.py"))
    asked = set(re.findall(r"pip install 'strainfmu\[(\w+)\]'", sources))
    extras = tomllib.loads((root / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (own,) = (one for one in extras["all"] if one.startswith("strainfmu["))
    assert asked == {"mf4", "tdms", "uff", "mat", "parquet"}
    assert asked <= set(own.removeprefix("strainfmu[").rstrip("]").split(","))
    note = (root / "README.md").read_text().partition("\nLicence: ")[2]
    assert all(name in note.partition("LGPL")[2] for name in ("python-can", "asammdf", "npTDMS"))
