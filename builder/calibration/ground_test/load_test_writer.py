"""Writing the file of a ground test: a proposal to be filled in, or a test that was simulated."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from builder.calibration.ground_test.load_entries import entry_of
from builder.structure.loads.applied import Load
from strainfmu.files import write_bytes_atomically


@dataclass(frozen=True, kw_only=True)
class WrittenStep:
    """A step as it is written: part of the loads [1], and its window as of a case."""

    part: float
    unloading: bool
    window: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class WrittenCase:
    """A case as it is written.

    Attributes
    ----------
    name : of the case.
    loads : that act, as they are stated.
    window : first and last time of its reading [s]; None leaves a line to be filled in.
    remark : comment above the case, empty for none.
    check : whether it is a check load.
    steps : on the way to its loads and back, in the order of time.
    """

    name: str
    loads: tuple[Load, ...]
    window: tuple[float, float] | None = None
    remark: str = ""
    check: bool = False
    steps: tuple[WrittenStep, ...] = ()


def write_load_test(
    path: Path,
    name: str,
    cases: Sequence[WrittenCase],
    readings: Mapping[str, object],
    errors: Mapping[str, object],
    *,
    head: Sequence[str] = (),
    vehicle: str | None = None,
    blanks: bool = False,
) -> None:
    """Write ``loadtest.toml``.

    Parameters
    ----------
    readings, errors : entries of the sections of these names; a value of None leaves a line to be filled in.
    head : lines of comment at the top.
    vehicle : path of the vehicle file, relative to this one; None for none.
    blanks : leave lines to be filled in for the date of the test and its load cell.
    """
    lines = [f"# {line}".rstrip() for line in head] + ["", f"name = {_toml(name)}"]
    lines += [] if vehicle is None else [f"vehicle = {_toml(vehicle)}"]
    lines += [_line("tested_on", None)] if blanks else []
    for section, entries in (("readings", readings), ("errors", errors)):
        lines += ["", f"[{section}]", *(_line(key, value) for key, value in entries.items())]
    if blanks:
        lines += ["", "[[load_cell]]", 'name = "1"', _line("serial_number", None), _line("calibrated_on", None)]
    for case in cases:
        lines += ["", *([f"# {case.remark}"] if case.remark else []), "[[case]]", f"name = {_toml(case.name)}"]
        lines.append(_line("window_s", None if case.window is None else list(case.window)))
        lines += ["check = true"] if case.check else []
        for step in case.steps:
            lines += [f"[[case.step]]  # {'unloading' if step.unloading else 'loading'}"]
            lines += [f"load_percent = {_toml(round(100.0 * step.part, 4))}"]
            lines.append(_line("window_s", None if step.window is None else list(step.window)))
        for load in case.loads:
            lines += ["[[case.load]]", *(_line(key, value) for key, value in entry_of(load).items())]
    write_bytes_atomically(path, ("\n".join(lines).lstrip("\n") + "\n").encode())


def _toml(value: object) -> str:
    """Return a text, a number or a list as TOML has them, which is as JSON has them."""
    return json.dumps(value, ensure_ascii=False)


def _line(key: str, value: object) -> str:
    return f"# {key} = " if value is None else f"{key} = {_toml(value)}"
