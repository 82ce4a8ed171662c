"""Channels of a recording that stand still where a sound one would not: railed at an extreme value, or frozen.

The samples of a sound channel scatter by its noise. One value of a channel of resolution q and noise s takes at
most the fraction

    p = erf(q / (2 sqrt(2) s))

of its samples. Samples at the largest or the smallest value are railed where there are so many that p allows them
with a probability below :data:`CHANCE`, and the mean over their window is wrong. A window of one value alone is
frozen by the same rule. A channel that takes each value several times, as one that is slower than the recording,
has as many fewer samples. A channel that stands still throughout has no noise of its own: it is judged by the
median of the others. Where none has noise, no channel is named.
"""

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
    largest_fraction : (k,) of the samples that one value takes there [1]. Resolutions of numbers with so many
        digits differ with their size, so that each window has its own.
    repeats : samples in a row that are of one value, on the average.
    """

    place: FloatArray
    largest_fraction: FloatArray
    repeats: float

    def too_many(self, value: float, samples: FloatArray) -> bool:
        """Return whether ``samples`` (n,) equal ``value`` [m/m] more often than readings of a sound channel do."""
        fraction = float(self.largest_fraction[int(np.abs(self.place - value).argmin())])
        repeated = int(np.sum(samples == value) / self.repeats)
        independent = int(np.ceil(len(samples) / self.repeats))
        # The first sample may be anywhere; the others must meet it.
        return repeated > 1 and float(bdtrc(repeated - 2, independent - 1, fraction)) < CHANCE


def channel_faults(strain: FloatArray, windows: Sequence[FloatArray]) -> list[ChannelFault]:
    """Return the channels of a recording that stand still in a window.

    Parameters
    ----------
    strain : (n, n_d) samples of the whole recording, NaN where there is none.
    windows : (k, n_d) samples of each window in it.
    """
    faults = []
    for gauge, steadiness in enumerate(_steadiness(strain, windows)):
        samples = _finite(strain[:, gauge])
        if steadiness is None or not len(samples):
            continue
        ends = np.unique([samples.min(), samples.max()]).tolist()
        railed, frozen = dict[int, list[float]](), dict[int, list[float]]()
        for number, window in enumerate(windows):
            of_window = _finite(window[:, gauge])
            at_end = [end for end in ends if steadiness.too_many(end, of_window)]
            is_still = len(of_window) > 0 and np.ptp(of_window) == 0.0
            if at_end:
                railed[number] = at_end
            elif is_still and steadiness.too_many(float(of_window[0]), of_window):
                frozen[number] = [float(of_window[0])]
        values = sorted({value for stands_at in (railed | frozen).values() for value in stands_at})
        if values:
            faults.append(
                ChannelFault(
                    gauge=gauge,
                    kind="railed or frozen" if len(ends) == 1 else "railed" if railed else "frozen",
                    fraction=float(np.mean(np.isin(samples, values))),
                    values=tuple(values),
                    windows=tuple(sorted(railed | frozen)),
                )
            )
    return faults


def _finite(samples: FloatArray) -> FloatArray:
    return np.asarray(samples[np.isfinite(samples)])


def resolution(samples: FloatArray) -> float:
    """Return the smallest difference between two values of ``samples`` (n,) [m/m]; 0 where all are the same."""
    steps = np.diff(np.sort(_finite(samples)))
    return float(steps[steps > 0.0].min(initial=np.inf)) if steps.any() else 0.0


def _steadiness(strain: FloatArray, windows: Sequence[FloatArray]) -> list[Steadiness | None]:
    """Return how often each channel repeats a value where it does not stand at its ends, by the windows."""
    every: list[Steadiness | None] = []
    for gauge in range(strain.shape[1]):
        samples = _finite(strain[:, gauge])
        ends = [samples.min(), samples.max()] if len(samples) else []
        parts = [part[~np.isin(part, ends)] for part in (_finite(window[:, gauge]) for window in windows)]
        parts = [part for part in parts if len(part) > 1 and np.ptp(part) > 0.0]
        every.append(_of_channel(parts) if parts else None)
    known = [steadiness for steadiness in every if steadiness is not None]
    if not known:
        return every
    median = Steadiness(
        place=np.zeros(1),
        largest_fraction=np.array([np.median([np.median(steadiness.largest_fraction) for steadiness in known])]),
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
        largest_fraction=np.asarray(erf(step / (2.0 * np.sqrt(2.0) * noise))),
        repeats=sum(map(len, parts)) / changes,
    )
