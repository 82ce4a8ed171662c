"""A map made of random numbers, for tests of the run-time alone."""

from __future__ import annotations

import numpy as np

from strainfmu.inverse_map import InverseMap

N_GAUGES = 8
N_STATES = 3


def random_map(seed: int = 1) -> InverseMap:
    """Return a consistent map: W is the whitened residual projector of Z, T its pseudo-inverse."""
    random = np.random.default_rng(seed)
    sigma = 2e-7
    z = 1e-10 * random.normal(size=(N_GAUGES, N_STATES))
    gain = np.linalg.pinv(z)
    mean_strain = 1e-5 * random.normal(size=N_GAUGES)
    root = random.normal(size=(5, 5))
    return InverseMap(
        vehicle=f"vehicle {seed} – Ω",
        gauge_names=tuple(f"G{i}" for i in range(N_GAUGES)),
        gauge_position=random.normal(size=(N_GAUGES, 3)),
        gauge_direction=np.tile([1.0, 0.0, 0.0], (N_GAUGES, 1)),
        noise_std=np.full(N_GAUGES, sigma),
        strain_gain=gain,
        state_offset=-gain @ mean_strain,
        load_per_state=random.normal(size=(5, N_STATES)),
        load_of_mean=100.0 * random.normal(size=5),
        load_covariance=root @ root.T,
        mean_strain=mean_strain,
        residual_whitening=(np.eye(N_GAUGES) - z @ gain) / sigma,
        residual_degrees_of_freedom=N_GAUGES - N_STATES,
        strain_range=np.full(N_GAUGES, 1e-4),
        coefficient_range=np.tile([-1.0, 1.0], (5, 1)),
        reference_area=0.2,
        reference_length=0.5,
        nominal_dynamic_pressure=1.2e5,
        provenance={"layout": "test", "mach_number": [5.0, 7.0]},
    )
