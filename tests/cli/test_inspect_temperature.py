"""``strainfmu inspect`` of a map that knows of the wall's temperature."""

import re
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console
from scaled_maps import scaled_map
from thermal_maps import with_temperature

from strainfmu.cli.inspection.inverse_map import inspect_map
from strainfmu.estimator.map.inverse_map import save_inverse_map

pytestmark = pytest.mark.fast


def text_of(path: Path) -> str:
    stream = StringIO()
    inspect_map(path, None, Console(file=stream, width=200))
    return stream.getvalue()


def test_modes_and_sensors_are_shown(tmp_path: Path) -> None:
    save_inverse_map(with_temperature(scaled_map(2, seed=4)), tmp_path / "map.h5")
    found = text_of(tmp_path / "map.h5")
    assert re.search(r"modulus_slope +-0.00045 +1/K", found)
    lines = {line.split("  ")[0].strip(): line for line in found.splitlines()}
    left = [float(lines[name].split()[-1]) for name in ("no sensor", "all sensors")]
    assert 0.0 < left[1] < left[0]
    assert lines["T3"].split()[1] == "temperature[4]"


def test_other_maps_have_no_such_table(tmp_path: Path) -> None:
    save_inverse_map(scaled_map(2, seed=4), tmp_path / "map.h5")
    assert "Temperature" not in text_of(tmp_path / "map.h5")
