"""One recording with navigation, in every file format: the nonlinear estimator finds the same in each."""

import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from flight_fmu import whole_map
from flight_maps import exact_response
from recorded_case import NAMES, read_csv, write_csv
from recorded_formats import WRITERS, Columns, Group, Groups, Writer, uff_set
from recordings import RECORDINGS, flown
from synthetic_vehicle import SyntheticFiles

import strainfmu
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, save_inverse_map
from strainfmu.recorded.formats import open_table
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.table import Reading
from strainfmu.units import LENGTH_UNITS, NUMBER_UNITS, PRESSURE_UNITS, STRAIN_UNITS

pytestmark = pytest.mark.fast
Run = Callable[..., tuple[int, str, str]]
N_D, SAMPLES = whole_map().n_gauges, 12
TIME = 0.01 * np.arange(SAMPLES)
STRAIN = exact_response(6.0, 0.03, 0.01, 5500.0)[:N_D] + 1e-7 * np.random.default_rng(3).standard_normal(
    (SAMPLES, N_D)
)
SI = {**PRESSURE_UNITS, **LENGTH_UNITS, **NUMBER_UNITS, **STRAIN_UNITS}


ALL: Columns = {
    "dynamic_pressure": (np.full(SAMPLES, 138.6), "kPa"),
    "dynamic_pressure_std": (np.full(SAMPLES, 3.0), "kPa"),
    "mach_number": (6.0 + 0.1 * TIME, "1"),
    "mach_number_std": (np.full(SAMPLES, 0.1), "1"),
    "static_pressure": (np.full(SAMPLES, 55.0), "hPa"),
    "static_pressure_std": (np.full(SAMPLES, 2.0), "hPa"),
    "altitude": (np.full(SAMPLES, 19.97), "km"),
}
GAUGES: Columns = {f"strain[{i + 1}]": (1e6 * STRAIN[:, i], "um/m") for i in range(N_D)}


def hdf5_arrays(folder: Path, groups: Groups) -> Path:
    """Strains as one matrix."""
    path = folder / "arrays.h5"
    flow = {name: column for name, column in groups[0].columns.items() if name not in GAUGES}
    with h5py.File(path, "w") as file:
        table = {"time": (1e3 * TIME, "ms"), "strain": (1e6 * STRAIN, "um/m"), **flow}
        for name, (values, unit) in table.items():
            file[name] = values
            file[name].attrs["unit"] = unit
    return path


def hdf5_signals(folder: Path, groups: Groups) -> Path:
    """As a recorded simulation: data sets of a group, with the name of the instance."""
    path = folder / "signals.h5"
    with h5py.File(path, "w") as file:
        file["time"], group = TIME, file.create_group("signals")
        for name, (values, unit) in groups[0].columns.items():
            group[f"plant.{name}"] = values
            group[f"plant.{name}"].attrs["unit"] = unit
    return path


def test_channels_of_a_universal_file(tmp_path: Path) -> None:
    """Names of degrees of freedom, sets that are no series over time, a file that ends early."""
    pyuff = pytest.importorskip("pyuff")
    path, value = tmp_path / "hall.unv", np.arange(float(SAMPLES))
    spectrum = uff_set("s", TIME, value + 1j, "um/m", func_type=4, ord_data_type=6, abscissa_spec_data_type=18)
    sets = [uff_set("NONE", TIME, value + k, "um/m", rsp_node=7 + k, rsp_dir=-3) for k in range(2)]
    pyuff.UFF(str(path)).write_sets([*sets, spectrum], mode="overwrite")
    with open_table(path, Reading()) as file:
        assert file.names == ["7-Z", "8-Z"]
        assert [column.unit for column in file.columns] == ["um/m", "um/m"]
        ((_, values, _),) = file.frames[0].pieces([0, 2])
        np.testing.assert_allclose(values, [TIME, value + 1], rtol=1e-9, atol=1e-12)
        assert file.remarks == [f"{path}: 1 data sets that are no series over time are not read"]
    pyuff.UFF(str(path)).write_sets(sets[0], mode="overwrite")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:-2], lines[-1]]))
    with pytest.raises(InputError, match="damaged"), open_table(path, Reading()):
        pass


FLIGHTS: list[tuple[tuple[str, ...], dict[str, float]]] = [
    (tuple(ALL), {}),
    (("mach_number", "altitude"), {}),
    (("dynamic_pressure", "static_pressure"), {"dynamic_pressure": 140e3}),
]
"""What the recording holds, and what is stated beside it."""


def estimates(folder: Path, inverse_map: Path, write: Writer) -> list[dict[str, np.ndarray]]:
    """Return the columns of the estimates of each of ``FLIGHTS``; a format without units holds SI units."""
    found = []
    for names, stated in FLIGHTS:
        columns = {**GAUGES, **{name: ALL[name] for name in names}}
        if write is WRITERS["mat"]:
            columns = {name: (values * SI[unit], "") for name, (values, unit) in columns.items()}
        data = write(folder, [Group("log", TIME, columns)])
        estimate_file(inverse_map, data, folder / "loads.h5", **stated)
        with h5py.File(folder / "loads.h5") as file:
            found.append({name: item[()] for name, item in file.items() if item.dtype.kind == "f"})
    return found


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[dict[str, np.ndarray]]]:
    """The map, and the estimates from CSV files."""
    folder = tmp_path_factory.mktemp("csv")
    save_inverse_map(whole_map(), folder / "map.h5")
    return folder / "map.h5", estimates(folder, folder / "map.h5", WRITERS["csv"])


@pytest.mark.parametrize(
    "write", [hdf5_arrays, hdf5_signals, *WRITERS.values()], ids=lambda write: str(write.__name__)
)
def test_every_format_gives_the_estimates_of_the_others(
    tmp_path: Path, expected: tuple[Path, list[dict[str, np.ndarray]]], write: Writer
) -> None:
    inverse_map, by_csv = expected
    for found, wanted in zip(estimates(tmp_path, inverse_map, write), by_csv, strict=True):
        assert found.keys() == wanted.keys()
        for name, values in wanted.items():
            digits = 1e-6 if write is WRITERS["lvm"] else 1e-9  # a text with nine decimals
            np.testing.assert_allclose(found[name], values, rtol=digits, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("name", RECORDINGS)
def test_recordings_of_other_programs_give_equal_estimates(
    name: str, synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    """Twelve files of one flight, in formats and units of their own."""
    library = {"tdms": "nptdms", "parquet": "pyarrow", "mf4": "asammdf", "csv": "pandas", "mat": "scipy"}
    pytest.importorskip(library.get(name.partition("_")[0], "h5py"))
    time, strain, pressure = flown()
    plain = write_csv(tmp_path / "plain.csv", ["time", *NAMES, "dynamic_pressure"], time, strain, pressure)
    estimate_file(synthetic.map_1, plain, tmp_path / "plain_out.csv")
    data, channels = RECORDINGS[name](tmp_path)
    code, out, errors = run(
        *("estimate", synthetic.map_1, data, "-o", tmp_path / "o.csv", "--channels", channels),
        *("--columns", "all"),
    )
    assert (code, errors) == (0, ""), errors
    assert "left out" not in out
    found, expected = read_csv(tmp_path / "o.csv"), read_csv(tmp_path / "plain_out.csv")
    np.testing.assert_allclose(found["time [s]"], expected["time [s]"], atol=2e-9)
    sigmas = () if name == "csv_mach" else tuple(f"sigma.{one}" for one in COEFFICIENT_NAMES)  # q is computed
    for coefficient in (*COEFFICIENT_NAMES, *sigmas):
        heading = f"{coefficient} [1]"
        np.testing.assert_allclose(found[heading], expected[heading], rtol=1e-7, atol=1e-9, err_msg=coefficient)


def test_the_extra_all_holds_what_readers_ask_for() -> None:
    """A reader without its library names the extra that installs it; the licence note names those of the LGPL."""
    root = Path(strainfmu.__file__).parents[1]
    if not (root / "pyproject.toml").is_file():
        pytest.skip("installed without its sources")
    sources = "".join(path.read_text() for path in (root / "strainfmu" / "recorded").rglob("*.py"))
    asked = set(re.findall(r"""library\([^)]*"(\w+)"\)|pip install 'strainfmu\[(\w+)\]'""", sources))
    asked = {extra for names in asked for extra in names if extra}
    extras = tomllib.loads((root / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (own,) = (one for one in extras["all"] if one.startswith("strainfmu["))
    assert asked == {"mf4", "tdms", "uff", "mat", "parquet", "report"}
    assert asked <= set(own.removeprefix("strainfmu[").rstrip("]").split(","))
    note = (root / "README.md").read_text().partition("\n## Licence")[2]
    assert all(name in note.partition("LGPL")[0] for name in ("python-can", "asammdf", "npTDMS"))
