"""The estimator of a map by an option, in place of that of the vehicle file."""

from __future__ import annotations

from typing import Literal

from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError

Estimators = Literal["linear", "manifold"]


def with_estimator(vehicle: Vehicle, estimator: Estimators | None) -> Vehicle:
    """Return ``vehicle`` with another estimator in its section [map]; None leaves it.

    Raises
    ------
    InputError
        The vehicle file does not fit the nonlinear estimator.
    """
    if estimator is None:
        return vehicle
    entry = vehicle.map
    if estimator == "manifold":
        found = {
            "map.form": (entry.form, "dynamic_pressure"),
            "strains per snapshot": ("none" if vehicle.structure.strain_per_snapshot is None else "some", "none"),
        }
        if vehicle.shape_kind == "profile":
            found["map.symmetry"] = (entry.symmetry, "full")
        for name, (got, needed) in found.items():
            if got != needed:
                raise InputError(f"--estimator manifold: needs {name} {needed!r}, got {got!r}")
    return vehicle.model_copy(update={"map": entry.model_copy(update={"estimator": estimator})})
