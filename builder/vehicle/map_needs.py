"""Requirements of a map on a vehicle file: its gauge layouts, and enough gauges and conditions for its modes."""

from __future__ import annotations

from collections.abc import Iterator

from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError


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
    if vehicle.shape_kind == "profile" and entry.symmetry != "full":
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


def check_map_size(vehicle: Vehicle, n_gauges: int, n_conditions: int | None = None) -> None:
    """Refuse more modes, or modes of the prior, than the gauges or the snapshots can carry.

    ``n_conditions`` is the number of snapshots; by default the number of the vehicle file's conditions.

    Raises
    ------
    InputError
        ``map.modes`` or ``map.prior_modes`` is too large.
    """
    conditions = len(vehicle.flight_conditions()) if n_conditions is None else n_conditions
    max_modes = min(n_gauges, conditions) - 1
    if vehicle.map.case == 1 and vehicle.map.modes > max_modes:
        raise InputError(
            f"map.modes: {vehicle.map.modes} found, at most {max_modes} allowed with {n_gauges} gauges and "
            f"{conditions} conditions"
        )
    entry, prior_modes = vehicle.map, vehicle.map.prior_modes
    # With full symmetry there are more snapshots than conditions.
    listed = entry.case == 2 and entry.symmetry == "listed"
    if listed and prior_modes is not None and prior_modes > conditions - 1:
        raise InputError(
            f"map.prior_modes: {prior_modes} found, at most {conditions - 1} with {conditions} snapshots"
        )
