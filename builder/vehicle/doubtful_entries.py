"""Entries that are within their limits and hardly meant: angles in radians, noise far above any gauge's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import degrees, pi

from builder.vehicle.file import Vehicle
from strainfmu.flight_condition import FlightCondition

SMALLEST_RANGE_DEG = 0.6
"""Snapshots whose angles all stay below it are in radians, or of no use: 0.6 rad are 34 deg."""

FEWEST_TIMES = 20.0
"""How many times smaller than the snapshots' angles others are before they are taken for radians."""

USUAL_NOISE_UM_PER_M = (0.1, 10.0)
DOUBTFUL_NOISE_UM_PER_M = 50.0
"""Noise of foil gauges with a bridge amplifier, and the value from which it is questioned."""


def doubtful_entries(vehicle: Vehicle, conditions: Sequence[FlightCondition]) -> Iterator[str]:
    """Yield a line for every entry that is probably in another unit than its name says.

    ``conditions`` are the snapshots', from a manifest where the vehicle file names one.
    """
    yield from _small_angles(conditions)
    largest = max(degrees(one.total_incidence) for one in conditions)
    truth = max(vehicle.truth.total_incidence_deg or (0.0,))
    if is_in_radians(truth, largest):
        yield (
            f"truth.total_incidence_deg: at most {truth:.4g} deg, the snapshots go to {largest:.4g} deg: is it in "
            "radians?"
        )
    yield from _small_roll_angles(vehicle)
    noise = vehicle.noise
    for name, values in (
        ("std_um_per_m", [noise.std_um_per_m or 0.0]),
        ("std_of_gauges_um_per_m", noise.std_of_gauges_um_per_m or [0.0]),
    ):
        if max(values) > DOUBTFUL_NOISE_UM_PER_M:
            low, high = USUAL_NOISE_UM_PER_M
            yield (
                f"noise.{name}: {max(values):g} um/m found, gauges have {low:g} to {high:g} um/m: is it the noise "
                "of one reading, in um/m?"
            )


def is_in_radians(flown_deg: float, held_deg: float) -> bool:
    """Return whether angles of ``flown_deg`` at most are probably radians, given snapshots up to ``held_deg``."""
    return 0.0 < FEWEST_TIMES * flown_deg < held_deg and degrees(flown_deg) <= 1.2 * held_deg


def _small_angles(conditions: Sequence[FlightCondition]) -> Iterator[str]:
    for name, angles in (
        ("angle_of_attack_deg", [one.angle_of_attack for one in conditions]),
        ("sideslip_angle_deg", [one.sideslip_angle for one in conditions]),
    ):
        largest = degrees(max(map(abs, angles)))
        if 0.0 < largest < SMALLEST_RANGE_DEG:
            yield (
                f"conditions: {name}: at most {largest:.4g} deg; {largest:.4g} rad are {degrees(largest):.3g} "
                "deg: is it in radians?"
            )


def _small_roll_angles(vehicle: Vehicle) -> Iterator[str]:
    """Yield layouts whose rows lie all round the body if roll angles are radians, and side by side if not."""
    for name, layout in vehicle.gauges.layouts.items():
        rolls = sorted({row.roll_angle_deg for row in layout.rows or ()})
        if len(rolls) > 2 and max(map(abs, rolls)) <= 2.0 * pi and rolls[-1] - rolls[0] > 0.5 * pi:
            yield (
                f"gauges.layouts.{name}: roll_angle_deg: {rolls[0]:.4g} to {rolls[-1]:.4g} deg, all rows in one "
                "sector: is it in radians?"
            )
