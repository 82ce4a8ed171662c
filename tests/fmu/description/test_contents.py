"""What an FMU states beside its model description: read as it was written, nothing of what has another form."""

import json
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest
from synthetic_vehicle import synthetic_inverse_map

from strainfmu.interface.contents import (
    CONTENTS,
    FmuContents,
    Position,
    contents_from,
    estimator_contents,
    stated_contents,
)
from strainfmu.interface.estimator_variables import estimator_interface

pytestmark = pytest.mark.fast


def test_entries_are_read_as_they_are_written() -> None:
    inverse_map = synthetic_inverse_map(1)
    entries = estimator_contents(inverse_map)
    found = contents_from(json.dumps(entries).encode())
    assert found.gauges == inverse_map.gauge_names
    np.testing.assert_allclose(found.gauge_noise, inverse_map.noise_std, rtol=1e-5)
    assert [one.x for one in found.positions] == pytest.approx(inverse_map.gauge_position[:, 0].tolist())
    assert found.ranges["C_A"] == (0.1, 0.2)
    scalars = estimator_interface(inverse_map)
    signals = entries["signals"]
    assert sum(one["size"] for one in signals) == len(scalars)
    kinds = {
        kind: {one["name"] for one in signals if one["kind"] == kind} for kind in {s["kind"] for s in signals}
    }
    assert {"strain", "valid"} <= kinds["reading"]
    assert {"dynamic_pressure", "mach_number", "altitude"} <= kinds["air data"]
    assert {"coefficients", "force", "moment"} <= kinds["output"]
    assert all(one.startswith(("health.", "tare_state")) for one in kinds["health"])
    assert "sensor_range" in kinds["parameter"]


def test_what_has_another_form_is_not_stated() -> None:
    """Entries with a value of another type, drawn from a fixed seed: nothing is raised, and nothing is made up."""
    rng = np.random.default_rng(7)
    entries = estimator_contents(synthetic_inverse_map(1))
    others = [None, True, 3, -1.5, "x", [], [None], [[1.0]], {}, {"a": 1}, {"a": None}, 1e400]
    for name in entries:
        for value in rng.permutation(np.array(others, dtype=object))[:6]:
            found = contents_from(json.dumps({**entries, name: value}).encode())
            assert all(isinstance(one, Position) for one in found.positions)
            assert all(isinstance(one, str) for one in (*found.gauges, *found.temperature_sensors))
            assert all(np.isfinite(found.gauge_noise))
    for text in (b"", b"{", b"[1]", b"\xff", b"null"):
        assert contents_from(text) == FmuContents()


def test_another_file_states_nothing(tmp_path: Path) -> None:
    (tmp_path / "no.fmu").write_text("no archive")
    assert stated_contents(tmp_path / "no.fmu") == stated_contents(tmp_path / "none.fmu") == FmuContents()


def test_an_entry_that_cannot_be_unpacked_or_is_huge_states_nothing(tmp_path: Path) -> None:
    """Damages of every byte of the compressed entry; then one that unpacks to 60 MB."""
    text = json.dumps({"noise": [f"gauge {k % 7}" for k in range(400)]}).encode()
    path = tmp_path / "a.fmu"
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        archive.writestr(CONTENTS, text)
    content = path.read_bytes()
    for place in range(len(content)):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x2A]) + content[place + 1 :])
        stated_contents(path)
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        archive.writestr(CONTENTS, b" " * 60_000_000)
    assert stated_contents(path) == FmuContents()
