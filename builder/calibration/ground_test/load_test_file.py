"""The file of a ground test, ``loadtest.toml``: load cases, how exactly they are known, where the readings are.

It is read and checked, and written: a proposal to be filled in, or a test that was simulated.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from builder.calibration.ground_test.equations_file import WholeFile
from builder.calibration.ground_test.load_entries import NO_LOAD_CELL, AnyLoadEntry, entry_of
from builder.calibration.ground_test.load_test import KnownLoad, LoadErrors
from builder.structure.as_built_kinds import OF_LOADS
from builder.structure.loads.applied import Load
from builder.structure.loads.temperature import uniform_temperature
from builder.vehicle.toml.entry_faults import Faults
from builder.vehicle.toml.reading import read_sections
from builder.vehicle.toml.toml_sections import FileName, Section, one_line
from strainfmu.files import write_bytes_atomically


def _rising(value: list[float]) -> list[float]:
    if value[0] >= value[1]:
        raise ValueError(f"expected two rising times, got {value}")
    return value


CaseName = Annotated[str, Field(min_length=1, max_length=200), AfterValidator(one_line)]
Percent = Annotated[float, Field(ge=0.0, le=100.0)]


class ErrorEntries(Section):
    """How exactly the loads are known, one standard deviation each.

    ``load_percent`` is of each load on its own where it states no ``std_percent``. ``load_cell_percent``,
    ``load_cell_offset_N`` and ``load_cell_nonlinearity_percent`` of full scale are common to all loads of one
    ``load_cell``: its gain, its reading without load and its curve. ``rig_mass_kg`` hangs on every pad and point
    and no cell reads it; zeros drift by ``drift_um_per_m`` from the first case to the last.
    Weight, acceleration and temperature have no part in these: ``mass_percent`` is the vehicle's, the same in all
    attitudes, by default the value of its section [calibration]. Pads and points stand ``pad_position_mm`` and
    ``pad_roll_deg`` off, and forces point ``load_direction_deg`` off about both axes across them, except forces of
    pads that press along the normal.
    """

    load_percent: Percent = 0.5
    load_cell_percent: Percent = 0.5
    load_cell_offset_N: float = Field(default=0.0, ge=0.0, le=1e6)
    load_cell_nonlinearity_percent: Percent = 0.05
    rig_mass_kg: float = Field(default=0.0, ge=0.0, le=1e4)
    drift_um_per_m: float = Field(default=0.1, ge=0.0, le=1e4)
    pad_position_mm: float = Field(default=2.0, ge=0.0, le=1e3)
    pad_roll_deg: float = Field(default=0.3, ge=0.0, le=90.0)
    pad_shape_percent: Percent = 10.0
    load_direction_deg: float = Field(default=1.0, ge=0.0, le=45.0)
    mass_percent: Percent | None = None

    def errors(self) -> LoadErrors:
        """Return the same in SI units."""
        mass = None if self.mass_percent is None else 0.01 * self.mass_percent
        return LoadErrors(mass=mass, **{kind.name: kind.std(self) for kind in OF_LOADS})


class ReadingEntries(Section):
    """Where the readings are, of all cases that do not say otherwise; files are relative to this one.

    ``channels`` is a channels.toml for recordings whose columns are not named by the gauges. A reading is the mean
    over its window; its standard deviation follows from the scatter in the windows, and ``reading_std_um_per_m``
    (drift, hysteresis) is added to it.
    """

    recording: FileName | None = None
    channels: FileName | None = None
    reading_std_um_per_m: float = Field(default=0.0, ge=0.0, le=1e4)


Window = Annotated[list[float], Field(min_length=2, max_length=2), AfterValidator(_rising)]


class RecordedEntry(Section):
    """When a reading was recorded: the window from which it is the mean, or one row of the recording."""

    window_s: Window | None = None
    row: int | None = Field(default=None, ge=1, le=10**9)

    @model_validator(mode="after")
    def _one_place(self) -> RecordedEntry:
        if self.window_s is not None and self.row is not None:
            raise ValueError("expected window_s or row, got both")
        return self

    @property
    def start(self) -> float:
        """Time or row, to order readings of one case by."""
        return float(self.row or 0) if self.window_s is None else self.window_s[0]


class StepEntry(RecordedEntry):
    """A reading on the way to the loads of a case, or back: ``load_percent`` of each load that a load cell reads.

    Steps after the case's own window are unloading, 0 % is the return to zero. They show the curve of the load
    cell, hysteresis, and how far readings return to zero.
    """

    load_percent: float = Field(ge=0.0, le=200.0)


class CaseEntry(RecordedEntry):
    """A load case: what acts, and when it was recorded: from ``window_s``, or one ``row`` of the recording.

    A case with ``check`` is predicted and not fitted. Cases of one ``zeros`` were read with the same zeros; a
    recorder that was balanced again starts another one. ``temperature_K`` is the vehicle's above that at which its
    zeros were taken; it acts by the vehicle file's [temperature]. A case without loads is a baseline.
    """

    name: CaseName
    recording: FileName | None = None
    channels: FileName | None = None
    check: bool = False
    zeros: CaseName = "1"
    temperature_K: float = Field(default=0.0, ge=-300.0, le=1000.0)
    load: list[AnyLoadEntry] = Field(default=[], max_length=200)
    step: list[StepEntry] = Field(default=[], max_length=200)

    def known_loads(self, errors: LoadErrors) -> tuple[KnownLoad, ...]:
        """Return the loads in SI units."""
        loads = []
        for entry in self.load:
            on_cell = entry.kind not in NO_LOAD_CELL
            default = errors.load if on_cell else 0.0
            std = default if entry.std_percent is None else 0.01 * entry.std_percent
            loads.append(KnownLoad(load=entry.load(), std=std, on_load_cell=on_cell, load_cell=entry.load_cell))
        if self.temperature_K:
            loads.append(KnownLoad(load=uniform_temperature(self.temperature_K), on_load_cell=False))
        return tuple(loads)


class LoadCellEntry(Section):
    """A load cell: loads name it as their ``load_cell``.

    Its curve is judged over ``full_scale_N``, by default the largest of its loads.
    """

    name: CaseName
    full_scale_N: float | None = Field(default=None, gt=0.0, le=1e9)
    serial_number: CaseName | None = None
    calibrated_on: date | None = None


class ChangedGauge(Section):
    """A gauge that changed after the test: it has the tolerances before the test again, of all its errors where it
    was replaced, of its zero offset where it was balanced again."""

    gauge: CaseName
    change: Literal["replaced", "balanced again"]
    on: date | None = None


class LoadTestFile(WholeFile):
    """The file of a ground test, whole."""

    name: CaseName
    vehicle: FileName | None = None
    tested_on: date | None = None
    load_cell: list[LoadCellEntry] = Field(default=[], max_length=200)
    errors: ErrorEntries = ErrorEntries()
    readings: ReadingEntries = ReadingEntries()
    case: list[CaseEntry] = Field(min_length=1, max_length=1000)
    changed: list[ChangedGauge] = Field(default=[], max_length=10_000)

    @model_validator(mode="after")
    def _each_name_once(self) -> LoadTestFile:
        names = [case.name for case in self.case]
        faults = [
            f"case.{k}.name: expected each name once, got '{name}' again"
            for k, name in enumerate(names, start=1)
            if name in names[: k - 1]
        ]
        cells = [cell.name for cell in self.load_cell]
        faults += [
            f"case.{k}.load.{n}.load_cell: expected one of {', '.join(cells)}, got '{load.load_cell}'"
            for k, case in enumerate(self.case, start=1)
            for n, load in enumerate(case.load, start=1)
            if cells and load.kind not in NO_LOAD_CELL and load.load_cell not in cells
        ]
        if faults:
            raise Faults(faults)
        return self


def read_test_file(path: str | Path) -> LoadTestFile:
    """Read and check the file of a ground test; recordings are read by
    :func:`~builder.calibration.ground_test.ground_test_readings.read_load_test`.

    Raises
    ------
    FaultsError
        Entries are unknown, missing or outside their limits: one line each.
    InputError
        The file is missing or no TOML.
    """
    path = Path(path)
    file = read_sections(path, LoadTestFile, "file of a ground test")
    file._path = path
    return file


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


def error_entries(errors: LoadErrors) -> dict[str, object]:
    """Return the section [errors] of a file; a mass that is not stated is left to be filled in."""
    entries: dict[str, object] = {
        kind.entry: float(f"{getattr(errors, kind.name) / kind.scale:.9g}") for kind in OF_LOADS
    }
    return entries | {"mass_percent": None if errors.mass is None else float(f"{100.0 * errors.mass:.9g}")}


def _toml(value: object) -> str:
    """Return a text, a number or a list as TOML has them, which is as JSON has them."""
    return json.dumps(value, ensure_ascii=False)


def _line(key: str, value: object) -> str:
    return f"# {key} = " if value is None else f"{key} = {_toml(value)}"
