"""Channels of a recording that stand still where a sound one would not: railed at an extreme value, or frozen.

The samples of a sound channel scatter by its noise. One value of a channel of resolution q and noise s takes at
most the fraction

    p = erf(q / (2 sqrt(2) s))

of its samples. Samples at the largest or the smallest value are railed where there are so many that p allows them
with a probability below :data:`CHANCE`, and the mean over their window is wrong. A window of one value alone is
frozen by the same rule. A channel that takes each value several times, as one that is slower than the recording,
has as many fewer samples. A channel that stands still throughout has no noise of its own: it is judged by the
median of the others. Where none has noise, nothing is found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import bdtrc, erf

from strainfmu.arrays import FloatArray

CHANCE = 1e-9
"""Probability below which the samples of a window are not taken for samples of a sound channel."""


@dataclass(frozen=True, kw_only=True)
class ChannelFault:
    """A gauge whose channel stands still in a recording.

    Attributes
    ----------
    gauge : its number.
    kind : "railed", "frozen", or "railed or frozen" where all samples are of one value.
    fraction : of the samples of the recording that stand at one of ``values`` [1].
    values : at which it stands [m/m].
    windows : numbers of the windows in which it does.
    """

    gauge: int
    kind: str
    fraction: float
    values: tuple[float, ...]
    windows: tuple[int, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Steadiness:
    """How often a sound channel repeats a value.

    Attributes
    ----------
    place : (k,) medians of the windows in which it scatters [m/m].
    most : (k,) largest fraction of the samples that one value takes there [1]. Resolutions of numbers with so many
        digits differ with their size, so that each window has its own.
    repeats : samples in a row that are of one value, on the average.
    """

    place: FloatArray
    most: FloatArray
    repeats: float

    def too_many(self, value: float, count: int, samples: int) -> bool:
        """Return whether ``count`` of ``samples`` are more at ``value`` [m/m] than a sound channel has there."""
        most = float(self.most[int(np.abs(self.place - value).argmin())])
        repeated, independent = int(count / self.repeats), int(np.ceil(samples / self.repeats))
        # The first sample may be anywhere; the others must meet it.
        return repeated > 1 and float(bdtrc(repeated - 2, independent - 1, most)) < CHANCE


def channel_faults(strain: FloatArray, windows: Sequence[FloatArray]) -> list[ChannelFault]:
    """Return the channels of a recording that stand still in a window.

    Parameters
    ----------
    strain : (n, n_d) samples of the whole recording, NaN where there is none.
    windows : (k, n_d) samples of each window in it.
    """
    faults = []
    sound = _steadiness(strain, windows)
    for gauge, steadiness in enumerate(sound):
        samples = strain[:, gauge]
        samples = samples[np.isfinite(samples)]
        if steadiness is None or not len(samples):
            continue
        ends = np.unique([samples.min(), samples.max()])
        at_end, still = list[int](), list[int]()
        values = set[float]()
        for number, window in enumerate(windows):
            of_gauge = window[:, gauge]
            of_gauge = of_gauge[np.isfinite(of_gauge)]
            railed = [end for end in ends if steadiness.too_many(end, int(np.sum(of_gauge == end)), len(of_gauge))]
            if railed:
                at_end.append(number)
                values |= {float(end) for end in railed}
            elif (
                len(of_gauge)
                and np.ptp(of_gauge) == 0.0
                and steadiness.too_many(of_gauge[0], len(of_gauge), len(of_gauge))
            ):
                still.append(number)
                values.add(float(of_gauge[0]))
        if at_end or still:
            faults.append(
                ChannelFault(
                    gauge=gauge,
                    kind="railed or frozen" if len(ends) == 1 else "railed" if at_end else "frozen",
                    fraction=float(np.mean(np.isin(samples, list(values)))),
                    values=tuple(sorted(values)),
                    windows=tuple(sorted(at_end + still)),
                )
            )
    return faults


def resolution(samples: FloatArray) -> float:
    """Return the smallest difference between two values of ``samples`` (n,) [m/m]; 0 where all are the same."""
    steps = np.diff(np.sort(samples[np.isfinite(samples)]))
    return float(steps[steps > 0.0].min(initial=np.inf)) if steps.any() else 0.0


def _steadiness(strain: FloatArray, windows: Sequence[FloatArray]) -> list[Steadiness | None]:
    """Return how often each channel repeats a value where it does not stand at its ends, by the windows."""
    every: list[Steadiness | None] = []
    for gauge in range(strain.shape[1]):
        samples = strain[:, gauge]
        samples = samples[np.isfinite(samples)]
        ends = [samples.min(), samples.max()] if len(samples) else []
        parts = [window[:, gauge] for window in windows]
        parts = [part[np.isfinite(part) & ~np.isin(part, ends)] for part in parts]
        parts = [part for part in parts if len(part) > 1 and np.ptp(part) > 0.0]
        every.append(_of_channel(parts) if parts else None)
    known = [steadiness for steadiness in every if steadiness is not None]
    if not known:
        return every
    median = Steadiness(
        place=np.zeros(1),
        most=np.array([np.median([np.median(steadiness.most) for steadiness in known])]),
        repeats=float(np.median([steadiness.repeats for steadiness in known])),
    )
    return [median if steadiness is None else steadiness for steadiness in every]


def _of_channel(parts: Sequence[FloatArray]) -> Steadiness:
    """Return how often a channel repeats a value, by windows (n,) in which it scatters."""
    square = sum(float(np.sum((part - part.mean()) ** 2)) for part in parts)
    noise = np.sqrt(square / sum(len(part) - 1 for part in parts))
    step = np.array([resolution(part) for part in parts])
    changes = sum(1 + int(np.count_nonzero(np.diff(part))) for part in parts)
    return Steadiness(
        place=np.array([np.median(part) for part in parts]),
        most=np.asarray(erf(step / (2.0 * np.sqrt(2.0) * noise))),
        repeats=sum(map(len, parts)) / changes,
    )
