"""Times of ASC logs: since the start, or since the event before where the header says `timestamps relative`."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from strainfmu.can.tools.log_frames import LogState, log_frames

pytestmark = pytest.mark.fast

HEADER = "date Tue May 04 09:00:00.000 am 2021\nbase hex  timestamps {}\ninternal events logged\n"
EVENTS = (
    "Start of measurement",
    "1  200             Rx   d 2 16 00",
    "1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B 0.05%",
    "1  201             Rx   d 2 4C 00",
    "CANFD   1 Rx 300 0 0 2 2 00 01",
    "1  200             Rx   d 2 27 00",
)
TIMES = (0.0, 0.0001, 0.0051, 0.0103, 0.0105, 3600.02)


def frames(path: Path, kind: str, times: tuple[float, ...]) -> list[tuple[int, bytes, float]]:
    lines = [f"   {time:.6f} {event}\n" for time, event in zip(times, EVENTS, strict=True)]
    path.write_text(HEADER.format(kind) + "".join(lines), encoding="utf-8")
    return [(frame.identifier, frame.data, frame.time) for frame, _ in log_frames(path, 0.0, LogState())]


def test_relative_times_add_up_over_all_events(tmp_path: Path) -> None:
    steps = (TIMES[0], *(round(now - before, 6) for before, now in itertools.pairwise(TIMES)))
    absolute = frames(tmp_path / "a.asc", "absolute", TIMES)
    assert [time for _, _, time in absolute] == [0.0001, 0.0103, 0.0105, 3600.02]
    assert frames(tmp_path / "r.asc", "relative", steps) == absolute
