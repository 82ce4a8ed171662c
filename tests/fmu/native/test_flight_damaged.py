"""Maps of the nonlinear estimator with sizes and values that cannot be, under sanitizers: refused, or harmless."""

from __future__ import annotations

import struct
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest
from c_host import host_by_clang
from flight_fmu import whole_map
from raw_fmu import GUID
from sensor_maps import with_sensors
from thermal_maps import with_temperature

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.resource.map_file import CHECKED_FROM, native_resource
from strainfmu.fmu.native.build import source_files

pytestmark = pytest.mark.slow

SECTION_HEADER = 24
NAMES = (b"FLIGHT\0\0", b"FILTER\0\0", b"SENSORS\0", b"THERMAL\0")
VALUES = (0.0, -1.0, np.nan, np.inf, 1e300, -1e300, 5e-324, 1e9)
SIZES = (0, 1, 3, 64, 255, 2**31, 2**32 - 1)
INPUTS = 40
"""Damaged maps of each section."""


def damaged(content: bytes, name: bytes, random: np.random.Generator) -> bytes:
    """``content`` with one size or up to three values of a section changed, and the check sums put right."""
    out = bytearray(content)
    start = out.index(name)
    (length,) = struct.unpack_from("<Q", out, start + 8)
    first, n_sizes = start + SECTION_HEADER, 1 if name.startswith(b"SENSORS") else 8
    if random.random() < 0.3:
        at = first + 4 * int(random.integers(n_sizes))
        struct.pack_into("<I", out, at, int(random.choice(SIZES)))
    else:
        for _ in range(int(random.integers(1, 4))):
            # Scalars stand in front of the arrays: half of the changes hit them.
            last = min(length, 8 * 60) if random.random() < 0.5 else length
            at = first + 8 * int(random.integers(4, last // 8))
            struct.pack_into("<d", out, at, float(random.choice(VALUES)))
    out[start + 16 : start + 20] = zlib.crc32(out[first : first + length]).to_bytes(4, "little")
    out[CHECKED_FROM - 8 : CHECKED_FROM - 4] = zlib.crc32(out[CHECKED_FROM:]).to_bytes(4, "little")
    return bytes(out)


MAPS = {"gauges": whole_map(), "sensors": with_sensors(whole_map()), "temperature": with_temperature(whole_map())}


@pytest.mark.parametrize("whole", MAPS.values(), ids=MAPS)
def test_no_damage_reaches_memory(tmp_path: Path, whole: InverseMap) -> None:
    content, random = native_resource(whole, GUID), np.random.default_rng(5)
    inputs = [
        content,
        *(damaged(content, name, random) for name in NAMES if name in content for _ in range(INPUTS)),
    ]
    paths = [tmp_path / f"{number}.bin" for number in range(len(inputs))]
    for path, one in zip(paths, inputs, strict=True):
        path.write_bytes(b"\0" + one)  # a map as it is
    core = tuple(path for path in source_files() if not path.parent.name.startswith("fmi"))
    memory = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-DREPLAY")
    fuzz = host_by_clang(tmp_path / "fuzz", *memory, sources=(Path(__file__).parent / "fuzz.c", *core))
    finished = subprocess.run([str(fuzz), *map(str, paths)], capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr[-4000:]
    assert finished.stdout == f"{len(inputs)} inputs\n"
