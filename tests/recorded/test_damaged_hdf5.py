"""Damaged HDF5 recordings end soon and in one line, whether HDF5 reports an error, loops or crashes."""

from collections.abc import Callable
from pathlib import Path

import h5py
import pytest
from mutations import ends_in_one_line, limited, mutated
from recorded_case import NAMES, samples
from synthetic_vehicle import SyntheticFiles

import strainfmu.first_look as first_look
from strainfmu.errors import InputError
from strainfmu.recorded.formats import open_table
from strainfmu.recorded.table import Reading

Run = Callable[..., tuple[int, str, str]]

CHANNELS = "defaults.unit = 'm/m'\n" + "".join(f"[[channel]]\nname = '{n}'\ngauge = '{n}'\n" for n in NAMES)


def write_arrays(path: Path) -> Path:
    """Write the arrays ``strain``, ``time``, ``dynamic_pressure`` and ``gauge_names``."""
    time, strain, pressure = samples(60)
    with h5py.File(path, "w") as file:
        file["time"], file["strain"], file["dynamic_pressure"] = time, strain, pressure
        file["gauge_names"] = NAMES
        file["strain"].attrs["unit"] = "m/m"
    return path


def write_signals(path: Path) -> Path:
    """Write a data set for each gauge, as a recorded system simulation has them."""
    time, strain, pressure = samples(60)
    with h5py.File(path, "w") as file:
        group, file["time"] = file.create_group("signals"), time
        for name, values in zip(NAMES, strain.T, strict=True):
            group[name] = values
            group[name].attrs["unit"] = "m/m"
        group["dynamic_pressure"] = pressure
    return path


FAILED = [
    *((write_arrays, seed) for seed in (4, 12, 17, 26, 34, 40, 53, 73, 109)),
    *((write_signals, seed) for seed in (8, 25, 34, 60, 71, 90, 146)),
]
"""Some seeds of damages that were called an internal error, or one of the file system; 300 are tried slowly."""


@pytest.mark.fast
@pytest.mark.parametrize(("write", "seed"), FAILED)
def test_a_damaged_recording_gets_one_line(
    write: Callable[[Path], Path], seed: int, synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    check_damaged(write, seed, synthetic, tmp_path, run)


@pytest.mark.slow
@pytest.mark.parametrize("write", [write_arrays, write_signals])
def test_damaged_recordings_get_one_line(
    write: Callable[[Path], Path], synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    for seed in range(300):
        check_damaged(write, seed, synthetic, tmp_path, run)


def check_damaged(
    write: Callable[[Path], Path], seed: int, synthetic: SyntheticFiles, folder: Path, run: Run
) -> None:
    """Estimate a file with the damages of ``seed``, with channels.toml for every other seed."""
    path, toml = write(folder / "d.h5"), folder / "channels.toml"
    path.write_bytes(mutated(path.read_bytes(), seed))
    toml.write_text(CHANNELS)
    more = ("--channels", toml) if seed % 2 and write is write_signals else ()
    ends_in_one_line(run, "estimate", synthetic.map_1, path, "-o", folder / "o.csv", *more)


@pytest.mark.fast
@pytest.mark.parametrize("size", [93, 1, 255])
def test_a_heap_that_hdf5_reads_for_ever_is_damaged(
    size: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The size of an object in the heap that holds the texts of attributes: HDF5 never ends with some."""
    monkeypatch.setattr(first_look.reads_well, "__defaults__", (0.5,))
    path = write_signals(tmp_path / "d.h5")
    content = bytearray(path.read_bytes())
    content[content.index(b"GCOL") + 96] = size
    path.write_bytes(content)
    line = f"{path}: damaged, or not an HDF5 file"
    with limited(), pytest.raises(InputError, match=line), open_table(path, Reading()):
        pass
