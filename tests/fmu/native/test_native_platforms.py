"""The same bits on every processor and system that can be tried on this machine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from c_host import host_by_zig, program, run_host
from conftest import NativeCase
from raw_fmu import N_OUTPUTS

pytest.importorskip("ziglang", reason="needs zig: pip install 'strainfmu[native]'")
pytestmark = pytest.mark.slow

STEPS = 2000


@pytest.fixture(scope="module")
def linux(cases: dict[str, NativeCase], tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Outputs of the host on x86-64 Linux for each map."""
    host = host_by_zig("x86_64-linux-gnu.2.17", tmp_path_factory.mktemp("host") / "host")
    return {name: run_host([str(host)], case, "run", STEPS, 5) for name, case in cases.items()}


def test_host_takes_all_branches(linux: dict[str, bytes]) -> None:
    states = {
        int(state) for content in linux.values() for state in np.frombuffer(content).reshape(-1, N_OUTPUTS)[:, 20]
    }
    assert len(np.frombuffer(linux["case 1"])) == STEPS * N_OUTPUTS
    assert {1, 4} <= states


def test_aarch64(cases: dict[str, NativeCase], linux: dict[str, bytes], tmp_path: Path) -> None:
    emulator = program("qemu-aarch64", install="apt install qemu-user libc6-arm64-cross")
    sysroot = Path("/usr/aarch64-linux-gnu")
    if not sysroot.is_dir():
        pytest.skip("needs the C library of aarch64: apt install libc6-arm64-cross")
    host = host_by_zig("aarch64-linux-gnu.2.17", tmp_path / "host")
    for name, case in cases.items():
        assert run_host([emulator, "-L", str(sysroot), str(host)], case, "run", STEPS, 5) == linux[name], name


def test_windows(cases: dict[str, NativeCase], linux: dict[str, bytes], tmp_path: Path) -> None:
    wine = program("wine64", "wine", "/usr/lib/wine/wine64", install="apt install wine64")
    host = host_by_zig("x86_64-windows-gnu", tmp_path / "host.exe")
    for name, case in cases.items():
        location = f"file:///Z:{case.uri.removeprefix('file://')}"
        assert run_host([wine, str(host)], case, "run", STEPS, 5, location=location) == linux[name], name


def test_windows_paths(small: NativeCase, tmp_path: Path) -> None:
    wine = program("wine64", "wine", "/usr/lib/wine/wine64", install="apt install wine64")
    host = host_by_zig("x86_64-windows-gnu", tmp_path / "host.exe")
    content = (small.resources / "map.bin").read_bytes()
    folders = ["Jürgen Groß + (1)", "日本語", "/".join(["a folder of many letters " * 4] * 3) + "/x"]
    for name in folders:
        folder = tmp_path / name
        folder.mkdir(parents=True)
        (folder / "map.bin").write_bytes(content)
        location = f"file:///Z:{folder.as_uri().removeprefix('file://')}"
        assert run_host([wine, str(host)], small, "run", 1, 5, location=location)
