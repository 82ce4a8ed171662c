"""A disk that is full, at any moment: one line, no crash, nothing left but what was there before."""

import errno
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from recorded_case import NAMES, samples, write_csv
from synthetic_vehicle import SyntheticFiles

from strainfmu.files import GuardedFile

pytestmark = pytest.mark.fast

LIMITED = """
import resource, sys
from strainfmu.cli.main import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
main(sys.argv[2:])
"""
COMMAND = "import sys; from strainfmu.cli.main import main; main(sys.argv[1:])"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a flight whose estimates take about 900 kB."""
    return write_csv(
        tmp_path_factory.mktemp("data") / "d.csv", ["time", *NAMES, "dynamic_pressure"], *samples(6000)
    )


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Return a folder on a file system of 300 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if not sys.platform.startswith("linux") or shutil.which("mount") is None:
        pytest.skip("tmpfs is a file system of Linux")
    command = ["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", str(folder)]
    mounted = subprocess.run(command, capture_output=True, check=False)
    if mounted.returncode:
        pytest.skip(f"no file system can be mounted here: {mounted.stderr.decode().strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize("suffix", [".csv", ".h5"])
def test_a_full_disk_ends_in_one_line(
    suffix: str, data: Path, small_disk: Path, synthetic: SyntheticFiles
) -> None:
    out = small_disk / f"o{suffix}"
    out.write_text("old")
    command = [sys.executable, "-c", COMMAND, "estimate", synthetic.map_1, data, "-o", out]
    ended = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    assert ended.stderr == f"strainfmu: {out}: could not be written: No space left on device\n"
    assert [item.name for item in small_disk.iterdir()] == [out.name]
    assert out.read_text() == "old"


@pytest.mark.parametrize(("suffix", "limit"), [(".h5", 5000), (".csv", 200_000)])
def test_a_file_that_may_not_grow_ends_in_one_line(
    suffix: str, limit: int, data: Path, tmp_path: Path, synthetic: SyntheticFiles
) -> None:
    pytest.importorskip("resource")
    out = tmp_path / f"o{suffix}"
    command = [sys.executable, "-c", LIMITED, limit, "estimate", synthetic.map_1, data, "-o", out]
    ended = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    # The limit holds for the file in which coverage is measured as well, which is not the command's matter.
    own = ended.stderr.partition("Exception ignored in atexit callback: <bound method Coverage.")[0]
    assert own == f"strainfmu: {out}: could not be written: File too large\n"
    assert list(tmp_path.iterdir()) == []


class FailingFile(GuardedFile):
    """A file on a disk that is full from one write on."""

    def __init__(self, path: Path, writes: int) -> None:
        super().__init__(path)
        self.writes = writes

    def _to_disk(self, content: bytes) -> None:
        self.writes -= 1
        if self.writes < 0:
            self.error = OSError(errno.ENOSPC, "full")
        else:
            super()._to_disk(content)


def fill(file: h5py.File) -> None:
    """Append to data sets, texts too, as estimates are written."""
    number = file.create_dataset("number", (0,), maxshape=(None,), dtype="f8", chunks=(512,))
    text = file.create_dataset("text", (0,), maxshape=(None,), dtype=h5py.string_dtype(), chunks=(512,))
    for block in range(1, 9):
        for item, values in ((number, np.arange(300.0)), (text, ["G1;G2"] * 300)):
            item.resize((300 * block,))
            item[300 * (block - 1) :] = values
        file.flush()


def test_hdf5_closes_in_order_whichever_write_fails(tmp_path: Path) -> None:
    path = tmp_path / "d.h5"
    whole = FailingFile(path, 10**9)
    with h5py.File(whole, "w") as file:
        fill(file)
    whole.sync()
    whole.close()
    n_writes = 10**9 - whole.writes
    assert n_writes > 20
    with h5py.File(path) as file:
        np.testing.assert_array_equal(file["number"][()], np.tile(np.arange(300.0), 8))
        assert set(file["text"][()]) == {b"G1;G2"}
    for writes in range(n_writes):
        failing = FailingFile(path, writes)
        with h5py.File(failing, "w") as file:
            fill(file)
            # What could not be written is there until the end.
            np.testing.assert_array_equal(file["number"][-300:], np.arange(300.0))
        with pytest.raises(OSError, match="full"):
            failing.sync()
        failing.close()
