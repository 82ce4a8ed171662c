"""What a map knows of the vehicle's inertia, as a table."""

from __future__ import annotations

import numpy as np
from rich.markup import escape
from rich.table import Table

from strainfmu.cli.inspection.temperature import MICRO, plain_table
from strainfmu.estimator.air_inputs import VIBRATION
from strainfmu.estimator.map.sensors import CHANNELS, InertiaMap


def inertia_table(inertia: InertiaMap) -> Table:
    """Return each channel with its standard deviations, and the strain that it leaves in the gauges, rms."""
    table = plain_table("Inertia", "channel", "not measured, sigma", "um/m", "measured, sigma", "um/m")
    of_strain = MICRO * np.sqrt(np.mean(inertia.mode_strain**2, axis=0))
    rows = zip(CHANNELS, inertia.prior_std.tolist(), inertia.sensor_std.tolist(), of_strain.tolist(), strict=True)
    for name, prior, error, strain in rows:
        left = (prior**-2 + error**-2) ** -0.5
        table.add_row(
            escape(name), f"{prior:.3g}", f"{prior * strain:.3g}", f"{error:.3g}", f"{left * strain:.3g}"
        )
    rms = float(np.sqrt(np.mean(np.sum(inertia.vibration_strain**2, axis=1))))
    stated = MICRO * inertia.vibration_std
    table.add_row(VIBRATION, f"{stated:.3g} um/m", f"{stated * rms:.3g}", "as given", "")
    return table
