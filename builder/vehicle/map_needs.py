"""Requirements of a map on a vehicle file: its gauge layouts, and enough gauges and conditions for its modes.

Entries that are within their limits and hardly meant: angles in radians, noise far above any gauge's.
"""

from collections.abc import Iterator, Sequence
from math import degrees, pi

from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import MapEntry
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition


def used_layouts(vehicle: Vehicle) -> list[str]:
    """Return the layouts a map needs: the one in use and the one its noise is measured on."""
    reference = vehicle.noise.of_layout or vehicle.gauges.layout
    return sorted({vehicle.gauges.layout, reference})


OF_THE_NONLINEAR = (
    "model_form_percent",
    "discrepancy_percent",
    "discrepancy_length",
    "discrepancy_roll_deg",
    "discrepancy_of_prior_percent",
    "discrepancy_of_overpressure_percent",
)
"""Entries of [map] that the tables of the nonlinear estimator take alone."""


def why_linear(vehicle: Vehicle) -> str | None:
    """Return why the file allows no tables of the nonlinear estimator, by its entry; None where it allows them."""
    entry = vehicle.map
    if not entry.follows_pressure:
        return f"map.form is '{entry.form}'"
    if vehicle.is_axisymmetric and entry.symmetry != "full":
        return f"map.symmetry is '{entry.symmetry}' with a profile"
    if vehicle.structure.strain_per_snapshot is not None:
        return "structure.strain_per_snapshot gives strain at the snapshots alone"
    if vehicle.noise.model == "paper":
        return "noise.model is 'paper'"
    return None


def unused_entries(vehicle: Vehicle) -> Iterator[str]:
    """Yield a line for every entry of [map] or [noise] that the file states and its map does not use.

    They are no fault: `compare` makes maps of either estimator and of either case from the same file.
    """
    entry = vehicle.map
    if entry.estimator == "linear" or (entry.estimator == "auto" and why_linear(vehicle) is not None):
        for name in OF_THE_NONLINEAR:
            if name in entry.model_fields_set:
                yield f"map.{name}: not used, it is for estimator 'nonlinear', and the map's is 'linear'"
    if entry.case == 1 and entry.prior_modes is not None:
        yield "map.prior_modes: not used, it is for case 2, and the map's is 1"


def check_map_size(entry: MapEntry, n_gauges: int, conditions: int) -> None:
    """Refuse more modes, or modes of the prior, than the gauges or as many ``conditions`` can carry.

    Raises
    ------
    InputError
        ``map.modes`` or ``map.prior_modes`` is too large.
    """
    max_modes = min(n_gauges, conditions) - 1
    if entry.case == 1 and entry.modes > max_modes:
        raise InputError(
            f"map.modes: {entry.modes} found, at most {max_modes} allowed with {n_gauges} gauges and "
            f"{conditions} conditions"
        )
    prior_modes = entry.prior_modes
    # With full symmetry there are more snapshots than conditions.
    listed = entry.case == 2 and entry.symmetry == "listed"
    if listed and prior_modes is not None and prior_modes > conditions - 1:
        raise InputError(
            f"map.prior_modes: {prior_modes} found, at most {conditions - 1} with {conditions} snapshots"
        )


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
    largest = max(degrees(condition.total_incidence) for condition in conditions)
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
        ("angle_of_attack_deg", [condition.angle_of_attack for condition in conditions]),
        ("sideslip_angle_deg", [condition.sideslip_angle for condition in conditions]),
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
