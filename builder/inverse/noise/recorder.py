"""Errors of the readings, from the section [recorder] of a vehicle file.

Noise, steps and a hum of each cable are noise of each gauge. A common hum and an expansion that gauges do not
cancel are columns of strain. A scanner's delay t_i of gauge i reads t_i (d strain / d angle) (d angle / d t): it
follows the flow.
"""

import numpy as np

from builder.inverse.ensemble import Ensemble
from builder.inverse.noise.hardware_errors import HardwareError
from builder.inverse.noise.model import NoiseTerm, nuisance_modes
from builder.vehicle.gauges.gauge_entries import Recorder
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

PICKUP, SCAN, MISMATCH = "common pickup", "scan time", "uncompensated gradient"
"""Names of the errors."""

_MICRO = 1e-6


def reading_std(entry: Recorder, n_gauges: int) -> dict[str, FloatArray]:
    """Return (n_gauges,) standard deviations of each reading by its cause [m/m].

    Raises
    ------
    InputError
        The number of values differs from the number of gauges.
    """
    noise = np.atleast_1d(np.array(entry.noise_um_per_m, dtype=float))
    if len(noise) not in (1, n_gauges):
        raise InputError(f"recorder.noise_um_per_m: {len(noise)} values found, must be 1 or {n_gauges}")
    micro = np.full(n_gauges, _MICRO)
    hum = entry.pickup_um_per_m / np.sqrt(2.0)
    return {
        "noise": noise * micro,
        "step": entry.step_um_per_m / np.sqrt(12.0) * micro,
        "pickup": (hum if entry.pickup == "cable" else 0.0) * micro,
    }


def recorder_terms(entry: Recorder, aft: FloatArray) -> list[NoiseTerm]:
    """Return what gauges have in common at the fractions ``aft`` (n_d,) of the length, from 0 at the nose."""
    hum = entry.pickup_um_per_m / np.sqrt(2.0) if entry.pickup == "common" else 0.0
    sizes = {
        PICKUP: _MICRO * hum * np.ones(len(aft)),
        MISMATCH: _MICRO * entry.mismatch_um_per_m_per_K * entry.gradient_K * aft,
    }
    return [nuisance_modes(name, std[:, None], np.ones(1)) for name, std in sizes.items() if std.any()]


def scan_errors(entry: Recorder, operator: FloatArray, ensemble: Ensemble) -> list[HardwareError]:
    """Return the errors of gauges that are read one after another, in turns across either axis.

    ``operator`` is Z_p (n_d, n_p) [1/Pa]. Derivatives by the angles are of a cubic polynomial through the flows of
    each Mach number.
    """
    if entry.channel_ms == 0.0 or entry.turn_deg_per_s == 0.0:
        return []
    size = 1e-3 * entry.channel_ms * np.radians(entry.turn_deg_per_s) * np.arange(len(operator))
    n, rolls = len(ensemble.conditions), ensemble.rolls
    pressure = np.tile(ensemble.ambient_pressure, rolls)[:, None]
    strain = ensemble.responses(operator) / pressure
    mach, incidence, roll = (
        np.tile([getattr(condition, name) for condition in ensemble.conditions], rolls)
        for name in ("mach_number", "total_incidence", "leeward_roll_angle")
    )
    roll = roll + 2.0 * np.pi * np.repeat(np.arange(rolls), n) / rolls
    largest = max(float(incidence.max()), 1e-9)
    u, w = incidence / largest * np.cos(roll), incidence / largest * np.sin(roll)
    powers = [(a, b) for a in range(4) for b in range(4 - a)]
    terms = np.column_stack([u**a * w**b for a, b in powers])
    by_u = np.column_stack([a * u ** max(a - 1, 0) * w**b for a, b in powers])
    by_w = np.column_stack([b * u**a * w ** max(b - 1, 0) for a, b in powers])
    slope = np.zeros((2, *strain.shape))
    for mach_number in np.unique(mach):
        rows = mach == mach_number
        factor = np.linalg.lstsq(terms[rows], strain[rows], rcond=1e-6)[0]
        slope[:, rows] = by_u[rows] @ factor / largest, by_w[rows] @ factor / largest
    return [
        HardwareError(name=SCAN, strain=size * pressure * gauge_slope, common=True, with_rest=True)
        for gauge_slope in slope
    ]


def reading_in_words(entry: Recorder, gauge_std: float | None) -> str:
    """Return the standard deviation of a reading and its parts; ``gauge_std`` [um/m] None until flows state it."""
    count = len(entry.noise_um_per_m) if isinstance(entry.noise_um_per_m, list) else 1
    parts = {name: 1e6 * float(np.mean(std)) for name, std in reading_std(entry, count).items() if std.any()}
    if gauge_std is None:
        listed = "".join(f", {name} {value:.3g} um/m" for name, value in parts.items())
        return f"gauge noise by the median strain of the flows{listed}"
    parts = {"gauge": gauge_std} | parts
    listed = ", ".join(f"{name} {value:.3g}" for name, value in parts.items())
    return f"{np.sqrt(sum(value**2 for value in parts.values())):.3g} um/m ({listed})"
