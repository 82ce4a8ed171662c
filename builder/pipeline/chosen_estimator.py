"""The estimator of a map by an option, instead of the vehicle file's."""

from __future__ import annotations

from typing import Literal

from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import wrong_estimator
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import PER_PRESSURE, InverseMap

Estimators = Literal["auto", "linear", "nonlinear"]


def estimator_of(inverse_map: InverseMap) -> Estimators:
    """Return the estimator that a map is for."""
    return "linear" if inverse_map.manifold is None else "nonlinear"


def with_estimator(vehicle: Vehicle, estimator: Estimators | None) -> Vehicle:
    """Return ``vehicle`` with another estimator in its section [map]; None leaves it.

    Raises
    ------
    InputError
        There is no estimator of this name, or the vehicle file does not fit the nonlinear estimator.
    """
    if estimator is None:
        return vehicle
    if (reason := wrong_estimator(estimator)) is not None:
        raise InputError(f"--estimator: {reason}")
    entry = vehicle.map
    if estimator == "nonlinear":
        requirements = {
            "map.form": (entry.form, PER_PRESSURE),
            "strains per snapshot": ("none" if vehicle.structure.strain_per_snapshot is None else "some", "none"),
        }
        if vehicle.is_axisymmetric:
            requirements["map.symmetry"] = (entry.symmetry, "full")
        for name, (got, needed) in requirements.items():
            if got != needed:
                raise InputError(f"--estimator nonlinear: needs {name} {needed!r}, got {got!r}")
    return vehicle.model_copy(update={"map": entry.model_copy(update={"estimator": estimator})})
