"""Random windows of readings for tares: zeros with what speaks against them, drawn with fixed seeds."""

from dataclasses import dataclass

import numpy as np
from random_map import map_of, random_model

from strainfmu.estimator.tare import KnownStrain, TareLimits

N_D = 12
HELD = map_of(random_model(n_gauges=N_D))


@dataclass(frozen=True, kw_only=True)
class TareWindow:
    """Readings (n, n_d) [m/m] and dynamic pressures (n,) [Pa] of a window, and what its tare is given."""

    strain: np.ndarray
    pressure: np.ndarray
    limits: TareLimits | None = None
    known: KnownStrain | None = None


def tare_window(seed: int) -> TareWindow:
    """Return a window of 64 to 500 readings; each of the effects below acts in some of the windows."""
    random = np.random.default_rng([seed, 20])
    n, noise = int(random.integers(64, 500)), HELD.noise_std

    def acts(chance: float) -> bool:
        return bool(random.random() < chance)

    strain = random.choice([1e-6, 2e-4, 6e-4]) * random.normal(size=N_D) + noise * random.normal(size=(n, N_D))
    if acts(0.4):  # noise in common
        strain += random.uniform(0.0, 2.0) * np.median(noise) * random.normal(size=(n, 1))
    if acts(0.4):  # readings remember
        memory = random.uniform(0.3, 0.97)
        for k in range(1, n):
            strain[k] = memory * strain[k - 1] + (1.0 - memory) * strain[k]
    if acts(0.3):  # of one gauge
        gauge = int(random.integers(N_D))
        for k in range(1, n):
            strain[k, gauge] += 0.8 * (strain[k - 1, gauge] - strain[0, gauge])
    if acts(0.3):  # drift
        ramp = np.linspace(0.0, 10.0 ** random.uniform(-7.0, -4.0), n)
        strain[:, int(random.integers(N_D))] += random.choice([-1.0, 1.0]) * ramp
    if acts(0.15):  # somebody is at work
        strain[:, int(random.integers(N_D))] += 3e-5 * 10.0 ** random.uniform(-1.0, 1.0) * random.normal(size=n)
    if acts(0.15):  # broken lead
        strain[:, int(random.integers(N_D))] += random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-2.7, -1.0)
    if acts(0.15):  # load
        strain += random.uniform(0.0, 40.0) * HELD.mean_strain
    if acts(0.5):  # lost readings
        strain[random.random(strain.shape) < random.uniform(0.0, 0.08)] = random.choice([np.nan, np.inf])
    if acts(0.3):  # dead gauges
        strain[:, random.random(N_D) < random.choice([0.1, 0.5, 0.9])] = np.nan
    if acts(0.2):  # late gauge
        strain[: n // int(random.integers(5, 40)), int(random.integers(N_D))] = np.nan
    if acts(0.2):  # frozen gauge
        strain[:, int(random.integers(N_D))] = 1e-4
    pressure = np.zeros(n)
    if acts(0.3):
        pressure = random.choice([10.0, 60.0]) * random.normal(size=n)
    if acts(0.3):
        pressure[random.random(n) < random.choice([0.1, 1.0])] = np.nan
    limits, known = None, None
    if acts(0.4):
        limits = TareLimits(dynamic_pressure=random.uniform(0.0, 300.0), zero=10.0 ** random.uniform(-4.0, -1.5))
    if acts(0.4):
        value = 1e-5 * random.normal(size=N_D)
        own = None if acts(0.5) else 1e-7 * random.random(N_D)
        known = KnownStrain(value=value, relative_std=random.uniform(0.0, 0.1), own_std=own)
    return TareWindow(strain=strain, pressure=pressure, limits=limits, known=known)
