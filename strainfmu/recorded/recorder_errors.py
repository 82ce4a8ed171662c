"""What a recording shows of its recorder: noise, steps and hum of readings, a scanner's delay, a thermal gradient,
and a specific force in g.

Noise is by fourth differences, which leave nothing of a slow flight, in the calmer windows. The step is the
smallest difference of two values. A hum is a line in the spectrum. What gauges read late, or a gradient adds, is
the multiple of its column that takes most off the residuals. A specific force is in g where strain fits it so.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_inputs import MEASURED_MOTION
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import SPECIFIC_FORCE
from strainfmu.estimator.signal_names import NOT_KNOWN
from strainfmu.recorded.estimators import BlockEstimator, MapBlocks
from strainfmu.recorded.samples import Samples
from strainfmu.units import READING_UNITS

SAMPLES = 4096
"""Of a recording that are looked at, at most."""

PROVENANCE = "recorder"
"""Entry of a map's provenance with the section [recorder] of its vehicle."""

WINDOW, FEWEST = 64, 256
"""Samples of a window of the noise, and of a recording of which anything is said."""

LARGER = 1.3
"""Measured over stated size from which a line names the entry."""

LINE = 40.0
"""Power of a hum over the median power of the spectrum about it."""

FLAGGED = 256
"""Successive samples whose residuals are looked at: where most are INCONSISTENT."""

COURSE = 8
"""Degree of the polynomial that strain follows meanwhile, for its rate."""

SMALLEST = 0.01
"""Of a delay [ms] or a gradient [um/m] that is named."""

TAKEN = 0.5
"""Part of the squared residuals that a scanner's delay or a gradient takes off, to be named."""

DECIDES = 4.0
"""Chi-square of a sample that the unit g takes off: two standard deviations, as of an error of all samples."""

_GRAVITY = READING_UNITS["m/s2"]["g"]


class ReadingErrors(NamedTuple):
    """Of the middle gauge: noise with steps, step, amplitude of a hum [m/m], frequency [Hz], if it is common."""

    noise: float
    step: float
    hum: float = 0.0
    frequency: float = 0.0
    is_common: bool = False


def reading_errors(time: FloatArray, strain: FloatArray) -> ReadingErrors | None:
    """Return the errors of readings (n, n_d) [m/m] at the times (n,) [s]; None of too few samples."""
    strain = strain[:, np.isfinite(strain).all(axis=0)][:SAMPLES]
    n, time = len(strain) // WINDOW * WINDOW, time[: len(strain)]
    if n < FEWEST or not strain.shape[1]:
        return None
    values = [np.unique(item) for item in strain.T]
    steps = [np.min(np.diff(item)) if 1 < len(item) < 0.7 * len(strain) else 0.0 for item in values]
    fourth = np.diff(strain[:n], n=4, axis=0) ** 2 / 70.0  # 1 + 16 + 36 + 16 + 1
    windows = fourth[: len(fourth) // WINDOW * WINDOW].reshape(-1, WINDOW, strain.shape[1]).mean(axis=1)
    noise = np.sqrt(np.quantile(windows, 0.25, axis=0))
    return ReadingErrors(float(np.median(noise)), float(np.median(steps)), *_hum(time[:n], strain[:n]))


def _hum(time: FloatArray, strain: FloatArray) -> tuple[float, float, bool]:
    """Return the strongest line of the spectrum above a twentieth of the sampling rate, as of ReadingErrors."""
    n, taper = len(strain), np.hanning(len(strain))[:, None]
    amplitude = 2.0 * np.fft.rfft(taper * (strain - strain.mean(axis=0)), axis=0) / taper.sum()
    power, first = np.mean(np.abs(amplitude) ** 2, axis=1), max(n // 20, 8)
    peak = first + int(np.argmax(power[first:-1]))
    low = max(peak - 40, first)
    about = np.median(np.delete(power[low : peak + 40], slice(low, None, 10**6)))
    step = float(np.median(np.diff(time)))
    if power[peak] < LINE * about or not step > 0.0:
        return 0.0, 0.0, False
    common = abs(amplitude[peak].mean()) > 0.8 * np.abs(amplitude[peak]).mean()
    return float(np.sqrt(power[peak])), peak / (n * step), bool(common)


def disagreements(errors: ReadingErrors | None, inverse_map: InverseMap) -> list[str]:
    """Return lines on readings that disagree with the vehicle file of the map, with the entry to set."""
    if errors is None:
        return []
    stated: Mapping[str, Any] = inverse_map.provenance.get(PROVENANCE) or {}
    expected = float(np.median(inverse_map.noise_std[: inverse_map.n_strain_gauges]))
    micro = {name: 1e6 * getattr(errors, name) for name in ("noise", "step", "hum")}
    lines = []
    if errors.step / np.sqrt(12.0) > LARGER * expected:
        lines.append(
            f"step of a reading {micro['step']:.3g} um/m, of {1e6 * expected:.3g} um/m that the map expects as "
            f"noise: set recorder.bits and recorder.range_um_per_m = 2^bits x {0.5 * micro['step']:.3g}"
        )
    if errors.hum > LARGER * max(np.sqrt(2.0) * expected, 1e-6 * stated.get("pickup_um_per_m", 0.0)):
        kind = "common" if errors.is_common else "cable"
        lines.append(
            f"readings hum with {micro['hum']:.3g} um/m at {errors.frequency:.4g} Hz: vibration, or set "
            f'recorder.pickup_um_per_m = {micro["hum"]:.2g} and recorder.pickup = "{kind}"'
        )
    if not lines and errors.noise > LARGER * expected:
        more = float(np.sqrt(errors.noise**2 - expected**2))
        lines.append(
            f"noise of a reading {micro['noise']:.3g} um/m, the map expects {1e6 * expected:.3g} um/m: set "
            f"recorder.noise_um_per_m = {np.hypot(1e6 * more, np.max(stated.get('noise_um_per_m', 0.0))):.2g}"
        )
    return lines


def late_or_warm(block: Samples, inverse_map: InverseMap, residuals: Callable[[Samples], FloatArray]) -> list[str]:
    """Return the line that names a scanner's delay or a gradient where it takes off most of the residuals.

    ``residuals`` returns the standardised ones (n, n_d) of a block.
    """
    n_d, position = inverse_map.n_strain_gauges, inverse_map.gauge_position
    if len(block.time) < 8 or position is None:
        return []
    x = position[:n_d, 0]
    about = np.arange(len(block.time)) - 0.5 * (len(block.time) - 1)
    course = np.polynomial.polynomial.polyfit(about, block.strain, min(COURSE, len(about) - 1))
    by_sample = np.polynomial.polynomial.polyval(about, np.polynomial.polynomial.polyder(course)).T
    late = 1e-3 * np.arange(n_d) * by_sample / float(np.median(np.diff(block.time)))
    warm = np.broadcast_to(1e-6 * x / np.max(x), block.strain.shape)
    before, candidates = residuals(block)[:, :n_d], []
    if not np.nanmean(before**2) > LARGER:
        return []
    for name, column in (("late", late), ("warm", warm)):
        change = residuals(replace(block, strain=block.strain - column))[:, :n_d] - before
        used = np.isfinite(change) & np.isfinite(before)
        size = -float(np.sum((before * change)[used])) / max(float(np.sum(change[used] ** 2)), 1e-300)
        remaining = np.sum((before + size * change)[used] ** 2) / max(float(np.sum(before[used] ** 2)), 1e-300)
        candidates.append((float(remaining), name, size))
    part, name, size = min(candidates)
    if part > TAKEN or (size if name == "late" else abs(size)) < SMALLEST:
        return []
    if name == "late":
        return [f"residuals of a scanner: set recorder.channel_ms = {size:.2g}"]
    return [
        f"residuals of gauges that do not cancel a gradient, {size:.3g} um/m at the aft end: set "
        "recorder.gradient_K and recorder.mismatch_um_per_m_per_K"
    ]


def force_in_g(block: Samples, estimates: Callable[[Samples], Estimate]) -> list[str]:
    """Return the line that names a specific force which strain fits as if it were in g.

    ``estimates`` returns the estimates of a block.
    """
    in_g = {name: _GRAVITY * force for name, force in _forces(block).items()}
    changed = replace(block, flow={**block.flow, **in_g})
    if not in_g or not np.nanmean(estimates(block).chi_square - estimates(changed).chi_square) > DECIDES:
        return []
    return [f"{', '.join(in_g)}: strain fits {_GRAVITY:.3g} times the readings: if they are in g, state the unit"]


def _forces(block: Samples) -> dict[str, FloatArray]:
    """Return each specific force of a block (n,) [m/s2], NaN where it is not known."""
    names = [item.name for item in MEASURED_MOTION[SPECIFIC_FORCE] if item.name in block.flow]
    return {name: np.where(force == NOT_KNOWN, np.nan, force) for name, force in block.values(names).items()}


@dataclass
class _Window:
    """The :data:`FLAGGED` successive samples with the largest sum of something, if that is above ``most``."""

    most: float
    samples: Samples | None = None

    def add(self, block: Samples, of_samples: FloatArray | BoolArray) -> None:
        sums = np.add.reduceat(of_samples, np.arange(0, len(of_samples), FLAGGED))
        if sums.max() > self.most:
            first, self.most = FLAGGED * int(np.argmax(sums)), float(sums.max())
            self.samples = block[first : first + FLAGGED]


@dataclass(eq=False)
class RecorderWatch:
    """What a recording at ``path`` shows of its recorder while it is estimated by a map; nothing by an FMU."""

    path: Path
    estimator: BlockEstimator
    _start: list[Samples] = field(default_factory=list)
    _flagged: _Window = field(default_factory=lambda: _Window(-1.0))
    _pushed: _Window = field(default_factory=lambda: _Window(0.0))

    def add(self, block: Samples, health: FloatArray) -> None:
        """Look at a block, of which (n,) states of ``health`` are estimated."""
        if sum(len(start.time) for start in self._start) < SAMPLES:
            self._start.append(block)
        self._flagged.add(block, health == HealthState.INCONSISTENT)
        if forces := _forces(block):
            self._pushed.add(block, np.nansum(np.square([*forces.values()]), axis=0))

    def notes(self) -> list[str]:
        """Return the lines on what disagrees with the vehicle file of the map."""
        estimator = self.estimator
        if not isinstance(estimator, MapBlocks) or self._flagged.samples is None:
            return []
        time = np.concatenate([start.time for start in self._start])
        errors = reading_errors(time, np.concatenate([start.strain for start in self._start]))
        lines = disagreements(errors, estimator.inverse_map)
        lines = lines or late_or_warm(
            self._flagged.samples,
            estimator.inverse_map,
            lambda block: np.asarray(estimator.unfiltered(block).standardised_residual),
        )
        because = "INCONSISTENT by its readings alone: " if self._flagged.most > TAKEN * FLAGGED else ""
        lines = [because + line for line in lines]
        if self._pushed.samples is not None:
            lines += force_in_g(self._pushed.samples, estimator.unfiltered)
        return [f"{self.path}: {line}" for line in lines]
