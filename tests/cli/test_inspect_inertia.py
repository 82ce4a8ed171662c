"""``strainfmu inspect`` of a map that knows of the vehicle's inertia."""

from io import StringIO
from pathlib import Path

import pytest
from inertia_maps import PRIOR, with_masses
from rich.console import Console
from scaled_maps import scaled_map

from strainfmu.cli.inspection.inverse_map import inspect_map
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map

pytestmark = pytest.mark.fast


def text_of(held: InverseMap, path: Path) -> str:
    stream = StringIO()
    save_inverse_map(held, path)
    inspect_map(path, None, Console(file=stream, width=200))
    return stream.getvalue()


def test_channels_and_vibration_are_shown(tmp_path: Path) -> None:
    found = text_of(with_masses(scaled_map(2, seed=4), size=4e-6), tmp_path / "map.h5")
    lines = {line.split("  ")[0].strip(): line.split() for line in found.splitlines() if line.strip()}
    assert float(lines["f_z"][1]) == PRIOR[2]
    assert float(lines["f_z"][4]) < 0.02 * float(lines["f_z"][2])
    assert lines["vibration"][1:3] == ["4", "um/m"]


def test_other_maps_have_no_such_table(tmp_path: Path) -> None:
    assert "Inertia" not in text_of(scaled_map(2, seed=4), tmp_path / "map.h5")
