"""Readings that no error with a name explains: a vehicle far from its tolerances, a misfit beyond noise, or one
that many gauges or loads must be left out for.

What has a name is warned of, and the map is made: noise larger than stated, walls that taper or are not round,
gauges and loads at fault. A vehicle that is many standard deviations from the drawing, or readings that no vehicle
fits, mean that loads, units or signs are not what is stated; a map of them would look good and be wrong. So do
many faults at once: what gauges and loads have in common is wrong rather than each of them.
"""

from __future__ import annotations

from collections.abc import Sequence

from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.ground_test_faults import Fault, too_many
from builder.calibration.estimate.outside_terms import OutsideModel
from builder.calibration.estimate.remarks import leading_causes

FARTHEST = 6.0
"""Standard deviations that a parameter may be from its value before the test.

Of a sound test the largest was 2.8, of single samples said to be means of 25 it was 5.1; all readings times 1.5
move the modulus by 9, times 0.5 the gain by 15."""

MOST_NOISE = 6.0
"""Noise over what is stated that counts as noise: single samples said to be means of 25 are 5."""

MISFIT = 3.0
"""Chi-square per reading, for noise as found, from which no vehicle fits. Walls that taper by 2 % leave 1.3."""


def unexplained(found: Estimate, outside: OutsideModel, faults: Sequence[Fault]) -> str:
    """Return what speaks against a map of ``found``, in one clause; empty where every error has a name."""
    many = too_many(found.model, faults)
    if many:
        return f"{many}; leading causes in common: {leading_causes(found)}"
    noise = max(min(outside.noise_factor, MOST_NOISE / outside.counted), 1.0)
    name, size = found.farthest
    against = []
    if found.per_reading > MISFIT * noise**2:
        against.append(f"chi-square per reading is {found.per_reading:.3g} (1 is expected)")
    if not size <= FARTHEST:
        against.append(
            f"{name} would be {size:.1f} standard deviations from what the vehicle file or the test states"
        )
    return f"{found.far_off}; {', '.join(against)}" if against else ""
