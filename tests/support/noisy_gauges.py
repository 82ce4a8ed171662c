"""A bridge core in virtual time behind gauges with noise and quantisation, as a rack of amplifiers sends them."""

from collections.abc import Callable, Collection

import numpy as np
from can_case import CYCLE, Ears, Projection, layout_of

from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings

STEP = 0.25e-6
"""Quantisation step of the profiles' integers [m/m]."""

Falsify = Callable[[int, np.ndarray], np.ndarray]


class NoisyStep(Projection):
    """An estimator that states the noise of its gauges."""

    def __init__(self, n_gauges: int, noise_std: float | None) -> None:
        super().__init__(n_gauges)
        self.noise_std = None if noise_std is None else np.full(n_gauges, noise_std)


def strains_at_rest(n_cycles: int, n_gauges: int, noise: float, level: float = 0.0, seed: int = 1) -> np.ndarray:
    """Return (n_cycles, n_gauges) strains [m/m]: a constant of up to ``level`` and white noise."""
    random = np.random.default_rng(seed)
    return random.uniform(-level, level, n_gauges) + noise * random.normal(size=(n_cycles, n_gauges))


def answers(
    strains: np.ndarray,
    stated_noise: float | None,
    layout: InputLayout | None = None,
    settings: BridgeSettings | None = None,
    lost: Collection[int] = (),
) -> list[Result]:
    """Return the results of all cycles of ``strains`` (n_cycles, n_d) [m/m] sent in time, but ``lost`` ones."""
    layout = layout or layout_of("fd64", strains.shape[1])
    core = Machine(layout, NoisyStep(layout.n_gauges, stated_noise), settings or BridgeSettings(), start=0.0)
    encoder, results = StrainEncoder(layout), list[Result]()
    ears = Ears(encoder)
    for number, strain in enumerate(strains):
        time = number * CYCLE
        if number in lost:
            results += ears.hear(core.advance(time + 0.9 * CYCLE))
            continue
        for index, frame in enumerate(encoder.encode(strain, 9e4, cycle=number, sample_time=time)):
            object.__setattr__(frame, "time", time + 1e-5 * index)
            results += ears.hear(core.receive(frame))
        results += ears.hear(core.advance(time + 0.9 * CYCLE))
    assert core.account.unaccounted == 0
    return results
