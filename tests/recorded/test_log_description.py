"""The description next to a log: what the recorder writes comes back, anything else gets one line."""

import json
from pathlib import Path
from typing import Any

import pytest

from strainfmu.can.log_description import load_description, sidecar
from strainfmu.can.options import BridgeOptions
from strainfmu.can.profiles import Identifiers
from strainfmu.can.recording import MicrosecondClock, Recorder
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a log without a frame, its description next to it."""
    path, fmu = tmp_path / "run.log", tmp_path / "x.fmu"
    fmu.write_bytes(b"an FMU")
    recorder = Recorder(path, MicrosecondClock())
    options = BridgeOptions(
        interface="virtual",
        channel="x",
        bus_options=("a=1",),
        profile="classic-le",
        dbc=tmp_path / "a.dbc",
        mapping=None,
        cycle_time=0.02,
        identifiers=Identifiers(1, 2, True),
        dynamic_pressure=9e4,
        result_form="fd",
        stuck_cycles=0,
        max_age=4,
    )
    recorder.describe(fmu, options, 12.5, 7)
    recorder.close(20.0, [(1.0, 2.0)], [(3.0, 4.0)])
    return path


def test_a_description_comes_back(log: Path) -> None:
    found = load_description(log)
    assert found is not None
    assert found["options"] == BridgeOptions(
        interface="virtual",
        channel="x",
        bus_options=("a=1",),
        profile="classic-le",
        dbc=log.parent / "a.dbc",
        mapping=None,
        cycle_time=0.02,
        identifiers=Identifiers(1, 2, True),
        dynamic_pressure=9e4,
        result_form="fd",
        stuck_cycles=0,
        max_age=4.0,
    )
    assert (found["start"], found["end"], found["lost"]) == (12.5, 20.0, 0)
    assert (found["skips"], found["unanswered"]) == ([(1.0, 2.0)], [(3.0, 4.0)])


WRONG: tuple[tuple[str, Any, str], ...] = (
    ("options.cycle_time", "x", "entry 'cycle_time': expected float, got 'x'"),
    ("options.cycle_time", float("nan"), "entry 'cycle_time': expected float, got 'nan'"),
    ("options.cycle_time", True, "entry 'cycle_time': expected float, got 'True'"),
    ("options.cycle_time", 10**400, "int too large to convert to float"),
    ("options.stuck_cycles", 2.5, "entry 'stuck_cycles': expected int or null, got '2.5'"),
    ("options.synchronised", "x", "entry 'synchronised': expected float or null, got 'x'"),
    ("options.dynamic_pressure", "9e4", "entry 'dynamic_pressure': expected float or null, got '9e4'"),
    ("options.identifiers.base", "0x300", "entry 'base': expected int or null, got '0x300'"),
    ("options.identifiers", [1], "entry 'identifiers': expected dict, got '[1]'"),
    ("options.bus_options", [1], "entry 'bus_options': expected str, got '1'"),
    ("options.dbc", 5, "entry 'dbc': expected str or null, got '5'"),
    ("options", 5, "damaged"),
    ("start", "x", "entry 'start': expected float, got 'x'"),
    ("log_start", None, "entry 'log_start': expected float, got 'None'"),
    ("end", [], "entry 'end': expected float or null, got '[]'"),
    ("skips", [[1.0]], "damaged"),
    ("skips", [[1.0, "x"]], "entry 'skips': expected float, got 'x'"),
    ("unanswered", 3, "damaged"),
    ("fmu_sha256", 1, "entry 'fmu_sha256': expected str, got '1'"),
    ("lost", "none", "entry 'lost': expected int, got 'none'"),
)


@pytest.mark.parametrize(("entry", "value", "line"), WRONG, ids=[f"{e}={str(v)[:8]}" for e, v, _ in WRONG])
def test_wrong_entries_get_one_line(log: Path, entry: str, value: Any, line: str) -> None:
    held = json.loads(sidecar(log).read_text())
    *above, last = entry.split(".")
    entry = held
    for name in above:
        entry = entry[name]
    entry[last] = value
    sidecar(log).write_text(json.dumps(held))
    with pytest.raises(InputError) as error:
        load_description(log)
    assert str(error.value).startswith(f"{sidecar(log)}: damaged: ")
    assert line in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("entry", ["start", "log_start", "fmu", "fmu_sha256", "options"])
def test_missing_entries_get_one_line(log: Path, entry: str) -> None:
    held = json.loads(sidecar(log).read_text())
    del held[entry]
    sidecar(log).write_text(json.dumps(held))
    with pytest.raises(InputError, match=f"damaged: no entry '{entry}'"):
        load_description(log)


@pytest.mark.parametrize("text", ["[" * 100_000, "[]", "", "5"], ids=["deep", "list", "empty", "number"])
def test_other_files_get_one_line(log: Path, text: str) -> None:
    sidecar(log).write_text(text)
    with pytest.raises(InputError, match="damaged"):
        load_description(log)
