"""Maps of the nonlinear estimator with sizes and values that cannot be, under sanitizers: refused, or harmless."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from c_host import fuzz_program, run_fuzz
from damaged_resource import arrays_of, pack
from flight_fmu import whole_map
from sensor_maps import with_sensors
from thermal_maps import with_temperature

from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.slow

PARTS = ("flight", "filter", "sensors", "thermal")
VALUES = (0.0, -1.0, np.nan, np.inf, 1e300, -1e300, 5e-324, 1e9)
COUNTS = (0, 1, 3, 64, 255, 2**31 - 1, -1)
INPUTS = 40
"""Damaged maps of each part."""


def damaged(arrays: Mapping[str, np.ndarray], part: str, random: np.random.Generator) -> bytes:
    """``map.bin`` with a length of an array, a count, or up to three values of a part changed."""
    names = [name for name in arrays if name.startswith(f"{part}.")]
    out = dict(arrays)
    for _ in range(int(random.integers(1, 4))):
        name = str(random.choice(names))
        array = out[name].copy()
        if array.dtype.kind == "i":
            array[...] = random.choice(COUNTS)
        elif array.ndim > 0 and random.random() < 0.1:
            axis = int(random.integers(array.ndim))
            array = np.repeat(array, int(random.integers(3)), axis)
        elif array.size > 0:
            array.reshape(-1)[random.integers(array.size)] = random.choice(VALUES)
        out[name] = array
    return pack(out)


MAPS = {"gauges": whole_map(), "sensors": with_sensors(whole_map()), "temperature": with_temperature(whole_map())}


@pytest.mark.parametrize("whole", MAPS.values(), ids=MAPS)
def test_no_damage_reaches_memory(tmp_path: Path, whole: InverseMap) -> None:
    arrays, random = arrays_of(whole), np.random.default_rng(5)
    inputs = [
        pack(arrays),
        *(
            damaged(arrays, part, random)
            for part in PARTS
            if any(name.startswith(f"{part}.") for name in arrays)
            for _ in range(INPUTS)
        ),
    ]
    paths = [tmp_path / f"{number}.bin" for number in range(len(inputs))]
    for path, one in zip(paths, inputs, strict=True):
        path.write_bytes(b"\0" + one)  # a map as it is
    (tmp_path / "map.bin").write_bytes(inputs[0])
    fuzz = fuzz_program(tmp_path / "fuzz")
    assert run_fuzz(fuzz, tmp_path / "map.bin", "inputs", *paths) == f"{len(inputs)} inputs\n"
