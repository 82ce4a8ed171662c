"""A long text with channels.toml is read in pieces: the samples, lines for the user and refusals of the whole."""

from pathlib import Path

import numpy as np
import pytest

from strainfmu.errors import InputError
from strainfmu.recorded.formats import text as text_format
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import open_recording

pytestmark = pytest.mark.fast

N = 240
HEAD = "[defaults]\nunit = 'um/m'\n"
LEGS = ("leg b", "leg c", "leg d")
CHANNELS = "".join(f"[[channel]]\nname = 'ch{i}'\ngauge = '{gauge}'\n" for i, gauge in enumerate(["A", *LEGS]))
ROSETTE = f"[[rosette]]\nlegs = {[*LEGS]}\nangles_deg = [0, 45, 90]\ngauges_deg.B = 10.0\ngauges_deg.C = 60.0\n"
FLOW = "[[flow]]\nname = 'q'\nquantity = 'dynamic_pressure'\nunit = 'kPa'\n"


def recording(time: np.ndarray | None, every: int, between: str = ";") -> str:
    """Return a text of N samples with decimal commas; q has a value in each sample ``every`` one."""
    rng = np.random.default_rng(2)
    names = [*(["time"] if time is not None else []), "ch0", "ch1", "ch2", "ch3", "q"]
    rows = [between.join(names), between.join("pqrxyz"[: len(names)])]
    for k in range(N):
        q = f"{90.0 + 0.01 * k:.3f}" if k % every == 0 else ""
        cells = [f"{value:.4f}" for value in 100.0 * rng.standard_normal(4)]
        cells[1] = "OVL" if k == 100 else cells[1]
        rows.append(between.join([*([f"{time[k]:.4f}"] if time is not None else []), *cells, q]))
    return "\n".join(rows).replace(".", ",")


def outcome(data: Path, toml: Path) -> tuple[np.ndarray, list[str]] | str:
    """Return times, strains and q_inf with all lines for the user, or the refusal."""
    try:
        with open_recording(data, Wanted(gauge_names=("A", "B", "C")), toml) as opened:
            blocks = [*opened.blocks]
    except InputError as error:
        return str(error)
    table = [np.column_stack([one.time, one.strain, one.dynamic_pressure]) for one in blocks]
    return np.concatenate(table), opened.notes


TIME = 0.01 * np.arange(N)
GAPS = TIME + 0.2 * (np.arange(N) > 77)
TEXTS = {
    "one raster": (recording(TIME, 1), HEAD),
    "a slower channel": (recording(TIME, 5), HEAD),
    "held": (recording(TIME, 4), f"join.rule = 'hold'\n{HEAD}"),
    "a rate": (recording(None, 5), f"time.rate_hz = 100\n{HEAD}"),
    "a gap": (recording(GAPS, 5), HEAD),
    "the raster of the slower channel": (recording(TIME, 5), f"join.raster = 'q'\n{HEAD}"),
    "a time that repeats": (recording(np.where(np.arange(N) == 150, TIME[149], TIME), 1), HEAD),
    "text": (recording(TIME, 1).replace("OVL", "x"), HEAD),
    "infinite": (recording(TIME, 1).replace("OVL", "1e999"), HEAD),
    "no samples": (recording(TIME, 1)[:30], HEAD),
}


@pytest.mark.parametrize("name", TEXTS)
def test_pieces_are_the_whole(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, head = TEXTS[name]
    data, toml = tmp_path / "d.csv", tmp_path / "channels.toml"
    data.write_text(text, encoding="utf-8")
    toml.write_text(head + CHANNELS + ROSETTE + FLOW, encoding="utf-8")
    expected = outcome(data, toml)
    monkeypatch.setattr(text_format, "PIECE", 700)
    found = outcome(data, toml)
    assert isinstance(expected, str) == (name in ("a time that repeats", "text", "infinite", "no samples"))
    if isinstance(expected, str) or isinstance(found, str):
        assert str(expected).startswith(f"{data}: ")
        assert str(found) == expected
        return
    np.testing.assert_array_equal(found[0], expected[0])
    assert found[1] == expected[1]
    assert any("a gap of 0.21 s behind line 80" in line for line in found[1]) == (name == "a gap")
