"""What an estimation says of a flight: numbers of samples, states of health, and its course in bounded memory.

The course is loads with their bands, angles, health, and when loads are not usable. Samples are collected in bins,
at most :data:`MAX_BINS` of them: when there are more, two become one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.estimators.step import health_name
from strainfmu.errors import library
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.health import USABLE_STATES, HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.estimator.other_loads import SIGMA
from strainfmu.interface.enumerations import HEALTH_ITEMS
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.interface.health_names import ENVELOPE_SCORE, STATE, USABLE
from strainfmu.recorded.checks import FaultCounts
from strainfmu.recorded.estimators import BlockEstimates
from strainfmu.recorded.names import TIME
from strainfmu.recorded.outputs import ENVELOPE_SCORE_LIMIT
from strainfmu.recorded.samples import Gaps, Samples
from strainfmu.records import brief

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_BINS = 1500
MAX_PERIODS = 200
"""Periods without usable loads that are listed."""

REFUSED = "refused"
"""Stands for the state of samples that an FMU refused."""

_ANGLES = ("air_data.angle_of_attack", "air_data.sideslip_angle")
_SHOWN = tuple(f"{sigma}{name}" for name in (*LOADS, *_ANGLES) for sigma in ("", SIGMA))
"""Columns that the course shows, where an estimator gives them."""

COLOURS = {
    HealthState.OK.name: "#2c7a3f",
    HealthState.DEGRADED.name: "#7fb069",
    HealthState.OUTSIDE.name: "#e0a100",
    HealthState.SUSPECT.name: "#e07000",
    HealthState.NO_COEFFICIENTS.name: "#9aa7b1",
    HealthState.INCONSISTENT.name: "#b3202c",
    HealthState.UNIDENTIFIED.name: "#7b3294",
    HealthState.INVALID.name: "#3c3c3c",
    REFUSED: "#000000",
}
"""Colour of each state in the band of health, which shows the last of the states in this order."""

_NAMES = tuple(COLOURS)
_RANKS = np.array([float(_NAMES.index(name)) for name in (*HealthState.__members__, REFUSED)])
"""Place of each number of a state in that order, last of -1."""


class Peak(NamedTuple):
    """The largest |load| among usable samples: value, standard deviation, time [s]; NaN without any."""

    value: float = float("nan")
    sigma: float = float("nan")
    time: float = float("nan")


class Period(NamedTuple):
    """Successive samples in one state in which loads are not usable: times of the first and the last [s]."""

    state: str
    begin: float
    end: float
    samples: int


class Misfit(NamedTuple):
    """A gauge that does not fit the others: samples in which it fits worst, and its largest |z|."""

    samples: int = 0
    largest: float = 0.0


@dataclass(eq=False)
class History:
    """The course of a flight.

    Attributes
    ----------
    peaks : by name of the load.
    periods : without usable loads; ``further`` counts those beyond the list.
    misfits : by name of the gauge, where a map gives residuals.
    """

    peaks: dict[str, Peak] = field(default_factory=lambda: {name: Peak() for name in LOADS})
    periods: list[Period] = field(default_factory=list)
    further: int = 0
    misfits: dict[str, Misfit] = field(default_factory=dict)
    _per_bin: int = 1
    _names: tuple[str, ...] = ()
    _bins: list[FloatArray] = field(default_factory=list)
    _rest: list[FloatArray] = field(default_factory=list)

    def add(self, block: Samples, estimates: BlockEstimates) -> None:
        """Take the samples of a block."""
        values, pressure = estimates.values, block.dynamic_pressure
        health = np.nan_to_num(values[STATE], nan=-1.0).astype(int)
        usable = values[USABLE] > 0.0
        if (estimated := values.get(f"air_data.{DYNAMIC_PRESSURE}")) is not None:
            pressure = np.where(np.isnan(pressure), estimated, pressure)
        shown = {name: values[name] for name in _SHOWN if name in values}
        self._collect({TIME: block.time, DYNAMIC_PRESSURE: pressure, STATE: _RANKS[health], **shown})
        for name, peak in self.peaks.items():
            size = np.where(usable, np.abs(values[name]), np.nan)
            if not (largest := np.fmax.reduce(size)) <= abs(peak.value) and largest >= 0.0:
                row = int(np.nanargmax(size))
                of_row = (values[name][row], values[f"{SIGMA}{name}"][row], block.time[row])
                self.peaks[name] = Peak(*map(float, of_row))
        if not usable.all():
            self._add_periods(block.time, health)
        for gauge, residual in estimates.worst:
            samples, most = self.misfits.get(gauge, Misfit())
            self.misfits[gauge] = Misfit(samples + 1, max(most, residual))

    def _collect(self, columns: Mapping[str, FloatArray]) -> None:
        """Collect columns (n,) in bins, (3, n_c, m): smallest, mean and largest of each column in each bin."""
        self._names = tuple(columns)
        rows = np.hstack([*self._rest, np.array([*columns.values()])])
        complete = rows.shape[1] - rows.shape[1] % self._per_bin
        self._rest = [rows[:, complete:]]
        if complete:
            parts = rows[:, :complete].reshape(len(rows), -1, self._per_bin)
            self._bins.append(_reduced(parts, parts, parts))
        if sum(bins.shape[-1] for bins in self._bins) > 2 * MAX_BINS:
            bins = np.concatenate(self._bins, axis=-1)
            even = bins.shape[-1] - bins.shape[-1] % 2
            self._bins = [_reduced(*bins[..., :even].reshape(3, len(rows), -1, 2)), bins[..., even:]]
            self._per_bin *= 2

    def _add_periods(self, time: FloatArray, health: Any) -> None:
        row = 0
        for state, same in groupby(health.tolist()):
            n = len(list(same))
            name = REFUSED if state < 0 else health_name(state)
            begin, end, row = float(time[row]), float(time[row + n - 1]), row + n
            if state in USABLE_STATES:
                continue
            last = self.periods[-1] if self.periods else None
            if row == n and last is not None and last.state == name and not self.further:
                self.periods[-1] = Period(name, last.begin, end, last.samples + n)
            elif len(self.periods) < MAX_PERIODS:
                self.periods.append(Period(name, begin, end, n))
            else:
                self.further += 1

    @property
    def bins(self) -> dict[str, FloatArray]:
        """(3, n) smallest, mean and largest in each bin of time, dynamic pressure, rank of health, and loads."""
        rest = [_reduced(rows[:, None], rows[:, None], rows[:, None]) for rows in self._rest if rows.size]
        bins = np.concatenate([*self._bins, *rest], axis=-1)
        return {name: bins[:, i] for i, name in enumerate(self._names)}

    def plot(self, which: str = "all", width: float = 9.0) -> Figure:
        """Return a figure of the flight: five loads with 3 sigma, angles, dynamic pressure, health as a band.

        Parameters
        ----------
        which : "loads", "state", or "all" of them.
        width : of the figure [in].

        Raises
        ------
        StrainfmuError
            matplotlib is not installed.
        """
        bins, curves = self.bins, dict[str, FloatArray]()
        if which != "state":
            for name, load in LOADS.items():
                curves[f"{load.label} [{load.unit.replace('.', ' ')}]"] = _band(bins, name)
        if which != "loads":
            for name in filter(bins.__contains__, _ANGLES):
                if np.isfinite(angle := np.degrees(_band(bins, name))).any():
                    label = name.removeprefix("air_data.").replace("_angle", "").replace("_", " ")
                    curves[f"{label} [deg]"] = angle
            curves["q [kPa]"] = 1e-3 * bins[DYNAMIC_PRESSURE][[1, 1, 1]]
        n, module = len(curves) + 1, library("matplotlib.figure", "matplotlib", "report")
        figure: Figure = module.Figure(figsize=(width, 1.45 * n + 0.6), layout="constrained")
        axes = figure.subplots(n, 1, sharex=True, height_ratios=[*[1.0] * (n - 1), 0.35])
        time = bins[TIME][1]
        for axis, (label, curve) in zip(axes, curves.items(), strict=False):
            _draw(axis, time, curve, label)
        _draw_health(axes[-1], time, bins[STATE][2])
        axes[-1].set_xlabel("time [s]")
        return figure


@dataclass(kw_only=True)
class EstimationSummary:
    """Summary of an estimation.

    Attributes
    ----------
    samples : number of rows estimated.
    first, last : times of the first and the last sample [s].
    missing_pressure : number of samples without a dynamic pressure that have no coefficients.
    refused : number of steps that the FMU refused; their outputs are NaN.
    results : number of samples that have coefficients.
    fields : number of pressure fields written.
    health : number of samples by state.
    blamed : by state, in how many of its samples a gauge was to blame: it was missing where gauges are missing,
        and a suspect, or else the one of the largest residual, where the strains do not fit; of INCONSISTENT,
        first an input that contradicts the loads. Of OUTSIDE, a flow parameter of the flow that left its range; of
        DEGRADED, a quantity of navigation that is left out, too.
    beyond : number of samples OUTSIDE because of the estimated coefficients; None where that is not known.
    history : the course of the flight: when loads are not usable, largest loads, gauges that do not fit.
    faults : strains that no gauge has measured, and those without a value, by gauge.
    gaps : gaps between samples, and the time from sample to sample.
    unused : columns of the data that were not read.
    notes : remarks on the data.
    """

    samples: int = 0
    first: float = float("nan")
    last: float = float("nan")
    missing_pressure: int = 0
    refused: int = 0
    results: int = 0
    fields: int = 0
    health: Counter[str] = field(default_factory=Counter)
    blamed: dict[str, Counter[str]] = field(default_factory=dict)
    by_coefficients: int | None = None
    history: History = field(default_factory=History)
    faults: FaultCounts = field(default_factory=FaultCounts)
    gaps: Gaps = field(default_factory=Gaps)
    unused: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)

    __repr__ = brief

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return self.last - self.first

    def plot(self) -> Figure:
        """Return a figure of the flight; as :meth:`~strainfmu.recorded.summary.History.plot`."""
        return self.history.plot()

    def health_lines(self) -> list[str]:
        """Return a line for each state other than OK, the most frequent first."""
        total = sum(self.health.values())
        texts = {state.name: text for state, text in HEALTH_ITEMS}
        lines = []
        for name, number in self.health.most_common():
            if name == HealthState.OK.name:
                continue
            text = f"{name}: {number} of {total} samples ({100.0 * number / total:.3g} %)"
            if name in texts:
                text += f": {texts[name][0].lower()}{texts[name][1:]}"
            if name == HealthState.OUTSIDE.name and self.by_coefficients is not None:
                estimated = self.by_coefficients
                text += (
                    f"; by the estimated coefficients in {estimated}, by the flow alone in {number - estimated}"
                )
            for gauge, samples in self.blamed[name].most_common(1):
                text += f"; most often to blame: '{gauge}' (in {samples})"
            lines.append(text)
        return lines

    def take(self, later: EstimationSummary) -> None:
        """Add what is counted of samples that come later; their course is not kept."""
        self.first = float(np.fmin(self.first, later.first))
        self.last = later.last
        for name in ("samples", "missing_pressure", "refused", "results"):
            setattr(self, name, getattr(self, name) + getattr(later, name))
        self.health.update(later.health)
        for state, blamed in later.blamed.items():
            self.blamed.setdefault(state, Counter()).update(blamed)
        if later.by_coefficients is not None:
            self.by_coefficients = (self.by_coefficients or 0) + later.by_coefficients
        self.faults.take(later.faults)
        self.gaps.take(later.gaps)
        self.notes += [note for note in later.notes if note not in self.notes]

    def add(self, block: Samples, estimates: BlockEstimates) -> None:
        """Take a block and its estimates."""
        values, health = estimates.values, estimates.values[STATE]
        for state in np.unique(health[np.isfinite(health)]):
            rows, name = health == state, health_name(int(state))
            self.health[name] += int(rows.sum())
            if state == HealthState.OUTSIDE and np.isfinite(values[ENVELOPE_SCORE_LIMIT][0]):
                by_coefficients = values[ENVELOPE_SCORE][rows] > values[ENVELOPE_SCORE_LIMIT][rows]
                self.by_coefficients = int(by_coefficients.sum()) + (self.by_coefficients or 0)
            counts = {gauge: int(k) for gauge, blamed in estimates.blamed.items() if (k := blamed[rows].sum())}
            self.blamed.setdefault(name, Counter()).update(counts)
        self.history.add(block, estimates)
        known = np.logical_or.reduce([np.isfinite(values[name]) for name in COEFFICIENT_NAMES])
        # The nonlinear estimator has coefficients without it.
        self.missing_pressure += int((np.isnan(block.dynamic_pressure) & ~known).sum())
        self.refused += int(np.isnan(health).sum())
        self.results += int(known.sum())
        self.samples += len(block.time)
        self.first = float(np.fmin(self.first, block.time[0]))
        self.last = float(block.time[-1])


def _reduced(low: FloatArray, mean: FloatArray, high: FloatArray) -> FloatArray:
    """Return (3, n_c, n) smallest, mean and largest of (n_c, n, k); NaN where all are."""
    with np.errstate(all="ignore"):
        known = np.isfinite(mean)
        middle = np.where(known, mean, 0.0).sum(axis=2) / known.sum(axis=2)
        return np.stack([np.fmin.reduce(low, axis=2), middle, np.fmax.reduce(high, axis=2)])


def _band(bins: Mapping[str, FloatArray], name: str) -> FloatArray:
    """Return (3, n) smallest less, mean, largest of a quantity, with 3 sigma at both ends."""
    (low, mean, high), sigma = bins[name], bins[f"{SIGMA}{name}"][2]
    return np.array([low - 3.0 * sigma, mean, high + 3.0 * sigma])


def _draw(axis: Any, time: FloatArray, values: FloatArray, label: str) -> None:
    """Draw a quantity (3, n) with its band; no line is drawn in a gap."""
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > 5.0 * np.median(steps)) + 1 if len(steps) else np.empty(0, dtype=int)
    time = np.insert(time, gaps, 0.5 * (time[gaps - 1] + time[gaps]))
    low, mean, high = np.insert(values, gaps, np.nan, axis=1)
    axis.fill_between(time, low, high, color="#9ecae1", linewidth=0.0)
    axis.plot(time, mean, color="#08519c", linewidth=0.9)
    axis.set_ylabel(label, fontsize="small")
    axis.grid(alpha=0.3)


def _draw_health(axis: Any, time: FloatArray, states: FloatArray) -> None:
    """Draw the states as a band, by their largest rank (n,) in each bin."""
    from matplotlib.patches import Patch

    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    first, patches = 0, dict[str, Any]()
    for rank, same in groupby(states.astype(int).tolist()):
        n, name = len(list(same)), _NAMES[rank]
        rows = time[first : first + n]
        for part in np.split(rows, np.flatnonzero(np.diff(rows) > 5.0 * step) + 1):
            axis.axvspan(part[0], part[-1] + step, color=COLOURS[name], linewidth=0.0)
        patches.setdefault(name, Patch(color=COLOURS[name], label=name))
        first += n
    axis.set_yticks([])
    axis.set_ylabel("health", fontsize="small")
    axis.legend(
        handles=list(patches.values()),
        loc="upper center",
        bbox_to_anchor=(0.5, -1.0),
        ncols=3,
        fontsize="x-small",
        frameon=False,
    )
