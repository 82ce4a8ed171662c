"""Memory of an estimate of HDF5 written to HDF5 does not grow with the length of the recording."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from recorded_case import samples
from synthetic_vehicle import SyntheticFiles

CHUNK = 4096
LENGTHS = {
    "seconds": (40 * CHUNK, 160 * CHUNK, 20.0),
    "hours": (250 * CHUNK, 2500 * CHUNK, 4.0),
}
"""Samples of a short and a long recording, and the largest growth of memory [bytes a sample]: a row of the output
has 280. Bookkeeping of chunks and the allocator's gaps are within it; of the index of the chunks of a file HDF5
retains 32 MiB at most, by default."""

PEAKS = """
import sys
from pathlib import Path
from strainfmu.recorded.run import estimate_file

for data in sys.argv[2:]:
    estimate_file(sys.argv[1], data, Path(data).with_name("o.h5"))
    status = Path("/proc/self/status").read_text()
    print(status.partition("VmHWM:")[2].split()[0])
"""
"""Prints the largest memory [KiB] of the process up to the end of each recording."""


def recorded_in_pieces(path: Path, n: int) -> Path:
    _, strain, pressure = samples(CHUNK)
    columns = {"time": np.arange(n) * 1e-3, "strain": strain, "dynamic_pressure": pressure}
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            data_set = file.create_dataset(name, (n, *values.shape[1:]), "f8", chunks=(CHUNK, *values.shape[1:]))
            for first in range(0, n, CHUNK):
                data_set[first : first + CHUNK] = values[first:][:CHUNK] if len(values) == n else values
    return path


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the kernel states no peak of memory")
@pytest.mark.parametrize("which", ["seconds", pytest.param("hours", marks=pytest.mark.slow)])
def test_memory_does_not_grow_with_the_recording(which: str, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    short, long, largest_growth = LENGTHS[which]
    files = [recorded_in_pieces(tmp_path / f"{n}.h5", n) for n in (short, long)]
    done = subprocess.run(
        [sys.executable, "-c", PEAKS, str(synthetic.map_1), *map(str, files)],
        capture_output=True,
        text=True,
        check=True,
    )
    peaks = [1024 * int(line) for line in done.stdout.split()]
    assert (peaks[1] - peaks[0]) / (long - short) < largest_growth
