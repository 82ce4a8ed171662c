"""Readings of a ground test: means over windows of recordings, and how exactly they are known."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builder.calibration.ground_test.load_test import LoadCase, LoadTest
from builder.calibration.ground_test.load_test_file import CaseEntry, LoadTestFile
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.recorded.columns.column_names import Wanted
from strainfmu.recorded.strains.strain_files import open_strains

SETTLED = 6.0
"""Difference between both halves of a window, in its standard deviations, above which the load still moved."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Readings:
    """Readings of all cases.

    Attributes
    ----------
    mean : (n_cases, n_d) [m/m], NaN where no sample of a window has a value.
    std : (n_cases, n_d) of the mean [m/m].
    samples : (n_cases, n_d) number of samples.
    notes : lines for the user.
    """

    mean: FloatArray
    std: FloatArray
    samples: FloatArray
    notes: tuple[str, ...]


def load_test(file: LoadTestFile, gauge_names: tuple[str, ...]) -> tuple[LoadTest, tuple[str, ...]]:
    """Return the test with the readings of its recordings, and lines for the user.

    Parameters
    ----------
    gauge_names : of the map, the order of the readings.

    Raises
    ------
    InputError
        A recording is missing or wrong, a window holds no sample, a reading's standard deviation is not known, or
        no case has a load.
    """
    if not any(case.load for case in file.case):
        raise InputError(f"{file.path}: case: expected a load in one case or more, got baselines alone")
    found, errors = read_windows(file, gauge_names), file.errors.errors()
    cases = tuple(
        LoadCase(
            name=case.name,
            loads=case.known_loads(errors),
            reading=found.mean[k],
            reading_std=found.std[k],
            temperature=case.temperature_K,
            group=case.zeros,
        )
        for k, case in enumerate(file.case)
    )
    return LoadTest(gauge_names=gauge_names, cases=cases, errors=errors), found.notes


def read_windows(file: LoadTestFile, gauge_names: tuple[str, ...]) -> Readings:
    """Return mean and standard deviation of every gauge in the window of every case.

    The scatter of one sample is pooled over all windows, gauge by gauge; white noise is assumed.

    Raises
    ------
    InputError
        As :func:`load_test`.
    """
    recordings: dict[tuple[Path, Path | None], tuple[FloatArray, FloatArray]] = {}
    notes: list[str] = []
    windows = []
    for number, case in enumerate(file.case, start=1):
        source = _source(file, case, number)
        if source not in recordings:
            recordings[source] = _samples(*source, gauge_names, notes)
        windows.append(_window(file, case, number, *recordings[source]))
    count = np.array([np.isfinite(one).sum(axis=0) for one in windows], dtype=float)
    has_any = count > 0.0
    mean = np.array([np.nansum(one, axis=0) for one in windows]) / np.maximum(count, 1.0)
    squares = [np.nansum((one - m) ** 2, axis=0) for one, m in zip(windows, mean, strict=True)]
    freedom = np.maximum(count - 1.0, 0.0).sum(axis=0)
    scatter = np.sqrt(np.sum(squares, axis=0) / np.maximum(freedom, 1.0))
    still: BoolArray = np.all([_repeats(one) for one in windows], axis=0) & (freedom > 0.0)
    if still.any() and not still.all():
        # A channel that repeats one value says nothing of its noise.
        scatter = np.where(still, np.median(scatter[scatter > 0.0]), scatter)
        named = ", ".join(name for name, one in zip(gauge_names, still.tolist(), strict=True) if one)
        notes.append(f"{file.path}: readings do not scatter within any window: {named}")
    floor = 1e-6 * file.readings.reading_std_um_per_m
    std = np.hypot(scatter / np.sqrt(np.maximum(count, 1.0)), floor)
    _check_std(file, gauge_names, std, has_any)
    notes += _missing(file, gauge_names, has_any)
    notes += _unsettled(file, windows, std=np.hypot(scatter, floor))
    return Readings(mean=np.where(has_any, mean, np.nan), std=std, samples=count, notes=tuple(notes))


def _source(file: LoadTestFile, case: CaseEntry, number: int) -> tuple[Path, Path | None]:
    """Return recording and channels file of a case."""
    recording = case.recording or file.readings.recording
    if recording is None:
        raise InputError(f"{file.path}: case.{number}.recording: entry is missing, and so is readings.recording")
    channels = case.channels or (file.readings.channels if case.recording is None else None)
    return file.beside(recording), None if channels is None else file.beside(channels)


def _samples(
    recording: Path, channels: Path | None, gauge_names: tuple[str, ...], notes: list[str]
) -> tuple[FloatArray, FloatArray]:
    """Return times (n,) [s] and strains (n, n_d) [m/m] of a whole recording."""
    # Columns of load cells and the like are not read; a gauge's that is misspelt is missed, and said.
    wanted = Wanted(gauge_names=gauge_names, fixed_pressure=0.0, ignored=("*",))
    with open_strains(recording, wanted, channels) as opened:
        blocks = [block for block, _ in opened.blocks]
        notes += [*opened.notes, *opened.remarks]
    return np.concatenate([one.time for one in blocks]), np.concatenate([one.strain for one in blocks])


def _window(file: LoadTestFile, case: CaseEntry, number: int, time: FloatArray, strain: FloatArray) -> FloatArray:
    """Return the samples (n, n_d) of a case."""
    where = f"{file.path}: case.{number}"
    if case.row is not None:
        if case.row > len(time):
            raise InputError(f"{where}.row: expected at most {len(time)}, the recording's rows, got {case.row}")
        return strain[case.row - 1 : case.row]
    if case.window_s is None:
        raise InputError(f"{where}.window_s: entry is missing, expected it or row")
    first, last = case.window_s
    within = (time >= first) & (time <= last)
    if not within.any():
        raise InputError(
            f"{where}.window_s: expected times of the recording, {time[0]:g} to {time[-1]:g} s, "
            f"got {case.window_s}"
        )
    return strain[within]


def _repeats(window: FloatArray) -> BoolArray:
    """Return whether a gauge's samples (n, n_d) are all the same, (n_d,)."""
    held = np.where(np.isfinite(window), window, np.inf)
    low = held.min(axis=0)
    return np.asarray(np.where(np.isfinite(held), held, -np.inf).max(axis=0) <= low)


def _check_std(file: LoadTestFile, gauge_names: tuple[str, ...], std: FloatArray, has_any: BoolArray) -> None:
    """Refuse readings whose standard deviation is 0: a sample for each case and no more is known."""
    wrong = np.argwhere((std == 0.0) & has_any)
    if len(wrong):
        case, gauge = wrong[0]
        raise InputError(
            f"{file.path}: readings.reading_std_um_per_m: expected more than 0, as samples of gauge "
            f"'{gauge_names[gauge]}' in case '{file.case[case].name}' do not scatter"
        )


def _missing(file: LoadTestFile, gauge_names: tuple[str, ...], has_any: BoolArray) -> list[str]:
    """Return lines on readings that are not there."""
    never = [
        name for name, any_case in zip(gauge_names, np.any(has_any, axis=0).tolist(), strict=True) if not any_case
    ]
    lines = [f"{file.path}: gauge '{name}' has no reading in any case" for name in never]
    for case, row in zip(file.case, has_any, strict=True):
        lost = int((~row).sum()) - len(never)
        if lost:
            lines.append(f"{file.path}: case '{case.name}': {lost} gauges without a reading")
    return lines


def _unsettled(file: LoadTestFile, windows: list[FloatArray], std: FloatArray) -> list[str]:
    """Return lines on windows in which the strain still moved."""
    lines = []
    for case, window in zip(file.case, windows, strict=True):
        half = len(window) // 2
        parts = window[:half], window[len(window) - half :]
        if half < 2 or not all(np.isfinite(part).any() for part in parts):
            continue
        full = np.isfinite(window).all(axis=0)
        step = np.abs(parts[1].mean(axis=0) - parts[0].mean(axis=0))[full]
        limit = SETTLED * std[full] * np.sqrt(2.0 / half)
        if np.any(step > limit):
            worst = 1e6 * float(step.max())
            lines.append(f"{file.path}: case '{case.name}': strain moves by {worst:.3g} um/m within its window")
    return lines
