"""Readings of a ground test: means over windows of recordings, and how exactly they are known.

Noise of a sample in every window: the window's own as far as windows differ, else the gauge's.

A variance of few samples is not exact: with d degrees of freedom log s^2 scatters by trigamma(d / 2). Variances of
one gauge that scatter more from window to window differ in truth. That scatter is taken for scaled inverse
chi-square with d_0 degrees of freedom, the same for all gauges. A window's variance is then

    (d_0 s_0^2 + d s^2) / (d_0 + d - 2),

the mean square of what its samples differ by from their true mean, s_0^2 the gauge's. Windows that are alike have
an infinite d_0: the pooled variance of the gauge. They count as alike where chance leaves such a scatter with a
probability above :data:`ALIKE`.

Source: Smyth, Linear models and empirical Bayes methods, Stat. Appl. Genet. Mol. Biol. 3 (2004), article 3,
section 6.
"""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc, polygamma, psi

from builder.calibration.ground_test.channel_faults import channel_faults, resolution
from builder.calibration.ground_test.load_test import LoadCase, LoadStep, LoadTest
from builder.calibration.ground_test.load_test_file import CaseEntry, LoadTestFile, StepEntry
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import FaultsError, InputError
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.samples import open_recording

ALIKE = 1e-3
"""Probability of the scatter of the variances from which they are taken for the same."""

FEWEST, MOST = 1e-2, 1e4
"""Limits of d_0; above, windows are alike."""


def window_variances(variance: FloatArray, freedom: FloatArray) -> FloatArray:
    """Return the variance of a sample in each window (n_c, n_d) [(m/m)^2].

    Parameters
    ----------
    variance : (n_c, n_d) estimated in each window.
    freedom : (n_c, n_d) degrees of freedom of these; where it is 0 the gauge's variance is returned, and 0 where
        the gauge has none.
    """
    counts: BoolArray = (freedom > 0.0) & (variance > 0.0)
    total = np.where(counts, freedom, 0.0)
    pooled = np.sum(total * variance, axis=0) / np.maximum(total.sum(axis=0), 1.0)
    # Logarithms without the bias of few samples, NaN where there is none, and their mean of each gauge.
    half = 0.5 * np.where(counts, freedom, 1.0)
    logs = np.where(counts, np.log(np.where(counts, variance, 1.0)) - psi(half) + np.log(half), np.nan)
    level = np.nansum(logs, axis=0) / np.maximum(counts.sum(axis=0), 1)
    prior = _prior_freedom(logs - level, freedom, counts)
    if not np.isfinite(prior):
        return np.broadcast_to(pooled, variance.shape).copy()
    start = np.exp(level + psi(0.5 * prior) - np.log(0.5 * prior))
    both = (prior * start + total * variance) / np.maximum(prior + total - 2.0, 1.0)
    return np.asarray(np.where(counts, both, np.where(counts.any(axis=0), pooled, 0.0)))


def _prior_freedom(residual: FloatArray, freedom: FloatArray, counts: BoolArray) -> float:
    """Return d_0 by the logarithms less the mean of their gauge; infinite where windows differ by no more than
    their samples leave."""
    number = counts.sum(axis=0)
    total_freedom = int(np.sum(np.maximum(number - 1, 0)))
    if total_freedom < 1:
        return np.inf
    scatter = float(np.nansum(residual**2)) / total_freedom
    rows = counts & (number > 1)
    expected = float(np.mean(polygamma(1, 0.5 * freedom[rows])))
    alike = float(chdtrc(total_freedom, total_freedom * scatter / expected)) > ALIKE
    if alike or scatter - expected <= float(polygamma(1, 0.5 * MOST)):
        return np.inf
    target = min(scatter - expected, float(polygamma(1, 0.5 * FEWEST)))
    return float(brentq(lambda d: float(polygamma(1, 0.5 * d)) - target, FEWEST, MOST))


Source = tuple[Path, Path | None]
"""A recording, and its channels file."""

Recordings = dict[Source, tuple[FloatArray, FloatArray]]
"""Times (n,) [s] and strains (n, n_d) [m/m] of every source."""

SETTLED = 6.0
"""Difference between both halves of a window, in its standard deviations, above which the load still moved."""


def read_load_test(file: LoadTestFile, gauge_names: tuple[str, ...]) -> tuple[LoadTest, tuple[str, ...]]:
    """Return the test with the readings of its recordings, and lines for the user.

    Parameters
    ----------
    gauge_names : of the map, the order of the readings.

    Raises
    ------
    InputError
        A recording is missing or wrong, a window is not within it or overlaps another one, a reading's standard
        deviation is not known, or no case has a load.
    """
    if not any(case.load for case in file.case):
        raise InputError(f"{file.path}: case: expected a load in one case or more, got baselines alone")
    if all(case.check for case in file.case):
        raise InputError(f"{file.path}: case: expected one without check or more, got check loads alone")
    unknown = [change.gauge for change in file.changed if change.gauge not in gauge_names]
    if unknown:
        raise InputError(f"{file.path}: changed: expected gauges of the map, got '{unknown[0]}'")
    places, errors = _places(file), file.errors.errors()
    mean, std, left_out, notes = _read(file, places, gauge_names)
    cases = tuple(
        LoadCase(
            name=case.name,
            loads=case.known_loads(errors),
            reading=mean[k],
            reading_std=std[k],
            group=case.zeros,
            check=case.check,
            steps=_steps_of(case, [n for n in range(len(places)) if places[n].case == k], places, mean, std),
        )
        for k, case in enumerate(file.case)
    )
    test = LoadTest(
        gauge_names=gauge_names,
        cases=cases,
        errors=errors,
        left_out=left_out,
        full_scale={cell.name: cell.full_scale_N for cell in file.load_cell if cell.full_scale_N is not None},
        changed={change.gauge: change.change for change in file.changed},
    )
    return test, notes


class _Place(NamedTuple):
    """Where a reading stands in its recording.

    Attributes
    ----------
    where : its entry in the file, such as ``case.2`` or ``case.2.step.1``.
    name : of its case, in words.
    case : number of that, from 0.
    entry : of the case or of the step.
    source : recording, and its channels file.
    """

    where: str
    name: str
    case: int
    entry: CaseEntry | StepEntry
    source: Source


def _places(file: LoadTestFile) -> list[_Place]:
    """Return the places of all cases, then of all steps."""
    cases, steps = list[_Place](), list[_Place]()
    for number, case in enumerate(file.case):
        where, name, source = f"case.{number + 1}", f"'{case.name}'", _source(file, case, number + 1)
        cases.append(_Place(where, name, number, case, source))
        for k, step in enumerate(case.step, start=1):
            part = f"{name}, {step.load_percent:g} %"
            steps.append(_Place(f"{where}.step.{k}", part, number, step, source))
    return cases + steps


def _read(
    file: LoadTestFile, places: Sequence[_Place], gauge_names: tuple[str, ...]
) -> tuple[FloatArray, FloatArray, tuple[str, ...], tuple[str, ...]]:
    """Return mean and standard deviation (n_places, n_d) of every gauge in every window [m/m], NaN where no sample
    has a value, and lines: on channels that stand still, whose readings are left out, and all of them.

    Each gauge has the scatter of its own samples in each window, as exact as their number makes it;
    white noise is assumed.
    """
    notes = list[str]()
    _refuse_without_time(file, places)
    recordings: Recordings = {}
    for place in places:
        if place.source not in recordings:
            recordings[place.source] = _samples(*place.source, gauge_names, notes)
    windows = [_window(file, place, *recordings[place.source]) for place in places]
    _refuse_overlaps(file, places)
    recorded = np.array([np.isfinite(window).any(axis=0) for window in windows])
    windows, left_out = _without_faults(file, places, recordings, windows, gauge_names)
    count = np.array([np.isfinite(window).sum(axis=0) for window in windows], dtype=float)
    has_any = count > 0.0
    mean = np.array([np.nansum(window, axis=0) for window in windows]) / np.maximum(count, 1.0)
    squares = np.array([np.nansum((window - m) ** 2, axis=0) for window, m in zip(windows, mean, strict=True)])
    freedom = np.maximum(count - 1.0, 0.0)
    scatter = np.sqrt(window_variances(squares / np.maximum(freedom, 1.0), freedom))
    repeats = np.array([_repeats(window) for window in windows]) & (freedom > 0.0)
    still: BoolArray = np.all(repeats | (freedom == 0.0), axis=0) & repeats.any(axis=0)
    if still.any() and not still.all():
        # A channel that repeats one value says nothing of its noise.
        scatter = np.where(still, np.median(scatter[scatter > 0.0]), scatter)
        named = ", ".join(name for name, is_still in zip(gauge_names, still.tolist(), strict=True) if is_still)
        notes.append(f"{file.path}: readings do not scatter within any window: {named}")
    floor = 1e-6 * file.readings.reading_std_um_per_m
    # A value that repeats is one sample, rounded.
    alone = np.hypot(scatter, _rounding(places, recordings))
    of_mean = np.where(repeats, alone, scatter / np.sqrt(np.maximum(count, 1.0)))
    std = np.hypot(of_mean, floor)
    _check_std(places, file, gauge_names, std, has_any)
    notes += [*left_out, *_missing(file, gauge_names, recorded[: len(file.case)])]
    notes += _unsettled(file, places, windows, std=np.hypot(scatter, floor))
    return np.where(has_any, mean, np.nan), std, left_out, tuple(notes)


def _steps_of(
    case: CaseEntry, numbers: Sequence[int], places: Sequence[_Place], mean: FloatArray, std: FloatArray
) -> tuple[LoadStep, ...]:
    """Return the steps of a case in the order of time; ``numbers`` are of its readings, its own first."""
    ordered = sorted(numbers[1:], key=lambda n: (places[n].entry.start, n))
    return tuple(
        LoadStep(
            part=0.01 * step.load_percent,
            unloading=step.start > case.start,
            reading=mean[n],
            reading_std=std[n],
        )
        for n in ordered
        if isinstance(step := places[n].entry, StepEntry)
    )


def _without_faults(
    file: LoadTestFile,
    places: Sequence[_Place],
    recordings: Recordings,
    windows: Sequence[FloatArray],
    gauge_names: tuple[str, ...],
) -> tuple[list[FloatArray], tuple[str, ...]]:
    """Return the windows without samples of channels that stand still in them, and a line for each of these."""
    sound, lines = [window.copy() for window in windows], []
    for source, (_, strain) in recordings.items():
        of_source = [k for k, place in enumerate(places) if place.source == source]
        for fault in channel_faults(strain, [windows[k] for k in of_source]):
            hit = [of_source[k] for k in fault.windows]
            for k in hit:
                sound[k][:, fault.gauge] = np.nan
            where = "all cases" if len(hit) == len(of_source) else _named([places[k] for k in hit])
            percent = f"{100.0 * fault.fraction:.{1 if fault.fraction < 0.1 else 0}f} %"
            values = " or ".join(f"{1e6 * value:.6g}" for value in fault.values[:2])
            lines.append(
                f"{file.path}: gauge '{gauge_names[fault.gauge]}': {fault.kind}, {percent} of "
                f"its samples in {source[0].name} stand at {values} um/m; left out of {where}"
            )
    return sound, tuple(lines)


def _named(places: Sequence[_Place]) -> str:
    """Return the cases of readings in words, with the number of their steps."""
    names = list(dict.fromkeys(place.case for place in places))
    steps = sum(isinstance(place.entry, StepEntry) for place in places)
    text = f"{len(names)} cases: " if len(names) > 1 else "case "
    text += ", ".join(next(place.name for place in places if place.case == case) for case in names)
    has_both = steps and len(places) > steps
    return f"{text}, and of {steps} steps of these" if has_both else text


def _rounding(places: Sequence[_Place], recordings: Recordings) -> FloatArray:
    """Return the standard deviation of a sample by the resolution of its channel (n_windows, n_d) [m/m]."""
    by_source = {
        source: np.array([resolution(strain[:, g]) for g in range(strain.shape[1])]) / np.sqrt(12.0)
        for source, (_, strain) in recordings.items()
    }
    return np.array([by_source[place.source] for place in places])


def _refuse_without_time(file: LoadTestFile, places: Sequence[_Place]) -> None:
    """Refuse readings of which the file does not state when they were recorded: a line each."""
    missing = [
        f"{file.path}: {place.where}.window_s: {place.name}: entry is missing, expected it or row"
        for place in places
        if place.entry.row is None and place.entry.window_s is None
    ]
    if missing:
        raise FaultsError("\n".join(missing))


def _refuse_overlaps(file: LoadTestFile, places: Sequence[_Place]) -> None:
    """Refuse readings that are of the same samples of a recording."""
    ordered = sorted(
        places, key=lambda place: (str(place.source[0]), place.entry.window_s is None, place.entry.start)
    )
    for first, second in pairwise(ordered):
        if second.source[0] != first.source[0]:
            continue
        (row, window), (last_row, last_window) = (
            (place.entry.row, place.entry.window_s) for place in (second, first)
        )
        if row is not None and row == last_row:
            raise InputError(
                f"{file.path}: {second.where}.row: {second.name}: expected another row than {first.where} "
                f"{first.name}, got {row} as well"
            )
        if window is not None and last_window is not None and window[0] < last_window[1]:
            raise InputError(
                f"{file.path}: {second.where}.window_s: {second.name}: expected a window apart from {first.where} "
                f"{first.name}, {last_window} s, got {window}, which overlaps"
            )


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
    with open_recording(recording, wanted, channels) as opened:
        blocks = [*opened.blocks]
        notes += opened.notes
    return np.concatenate([block.time for block in blocks]), np.concatenate([block.strain for block in blocks])


def _window(file: LoadTestFile, place: _Place, time: FloatArray, strain: FloatArray) -> FloatArray:
    """Return the samples (n, n_d) of a reading."""
    where, row, window = f"{file.path}: {place.where}", place.entry.row, place.entry.window_s
    if row is not None:
        if row > len(time):
            raise InputError(
                f"{where}.row: {place.name}: expected at most {len(time)}, the recording's rows, got {row}"
            )
        return strain[row - 1 : row]
    assert window is not None, "as _refuse_without_time found"
    first, last = window
    within = (time >= first) & (time <= last)
    # Windows may end where the next sample would be.
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if first < time[0] - step or last > time[-1] + step or not within.any():
        raise InputError(
            f"{where}.window_s: {place.name}: expected times of the recording, {time[0]:g} to {time[-1]:g} s, "
            f"got {window}"
        )
    return strain[within]


def _repeats(window: FloatArray) -> BoolArray:
    """Return whether a gauge's samples (n, n_d) are all the same, (n_d,)."""
    values = np.where(np.isfinite(window), window, np.inf)
    low = values.min(axis=0)
    return np.asarray(np.where(np.isfinite(values), values, -np.inf).max(axis=0) <= low)


def _check_std(
    places: Sequence[_Place], file: LoadTestFile, gauge_names: tuple[str, ...], std: FloatArray, has_any: BoolArray
) -> None:
    """Refuse readings whose standard deviation is 0: a sample for each case and no more is known."""
    wrong = np.argwhere((std == 0.0) & has_any)
    if len(wrong):
        case, gauge = wrong[0]
        raise InputError(
            f"{file.path}: readings.reading_std_um_per_m: expected more than 0, as samples of gauge "
            f"'{gauge_names[gauge]}' in case {places[case].name} do not scatter"
        )


def _missing(file: LoadTestFile, gauge_names: tuple[str, ...], has_any: BoolArray) -> list[str]:
    """Return lines on readings that are not in the recordings; ``has_any`` is (n_cases, n_d)."""
    never = [
        name for name, any_case in zip(gauge_names, np.any(has_any, axis=0).tolist(), strict=True) if not any_case
    ]
    lines = [f"{file.path}: gauge '{name}' has no reading in any case" for name in never]
    for case, row in zip(file.case, has_any, strict=True):
        lost = int((~row).sum()) - len(never)
        if lost:
            lines.append(f"{file.path}: case '{case.name}': {lost} gauges without a reading")
    return lines


def _unsettled(
    file: LoadTestFile, places: Sequence[_Place], windows: list[FloatArray], std: FloatArray
) -> list[str]:
    """Return lines on windows in which the strain still moved."""
    lines = []
    usual = np.median(std, axis=0)  # a window in which the strain moves scatters by that as well
    for place, window in zip(places, windows, strict=True):
        half = len(window) // 2
        parts = window[:half], window[len(window) - half :]
        if half < 2 or not all(np.isfinite(part).any() for part in parts):
            continue
        full = np.isfinite(window).all(axis=0)
        step = np.abs(parts[1].mean(axis=0) - parts[0].mean(axis=0))[full]
        limit = SETTLED * usual[full] * np.sqrt(2.0 / half)
        if np.any(step > limit):
            worst = 1e6 * float(step.max())
            lines.append(f"{file.path}: case {place.name}: strain moves by {worst:.3g} um/m within its window")
    return lines
