"""Strain of own weight and ambient pressure while zero offsets are taken: options of ``strainfmu tare``."""

from __future__ import annotations

from math import radians
from pathlib import Path

import numpy as np

from builder.structure.loads.applied import Weight
from builder.structure.loads.standing import squeeze_strain, weight_strain
from builder.vehicle.file import load_vehicle
from strainfmu.cosim.estimators.zeros_file import write_zeros
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros
from strainfmu.estimator.zeros.tare import KnownStrain


def known_strain(
    inverse_map: str | Path,
    vehicle: str | Path,
    *,
    weight_up_roll_deg: float | None = None,
    weight_nose_deg: float = 0.0,
    ambient_pressure: float = 0.0,
    known_output: str | Path | None = None,
) -> tuple[KnownStrain, dict[str, str | float]]:
    """Return the strain of own weight and ambient pressure, and what it is made from, for :func:`strainfmu.tare`.

    Parameters
    ----------
    inverse_map : inverse map (map.h5).
    vehicle : vehicle file: subtracts the strain of own weight or air, of the options below.
    weight_up_roll_deg : with ``vehicle``: roll angle of the meridian that is up [deg].
    weight_nose_deg : with ``weight_up_roll_deg``: elevation of the nose [deg].
    ambient_pressure : with ``vehicle``: pressure of the air inside and outside [Pa].
    known_output : with ``vehicle``: write the strain of the known loads (tare.known of a bus file).

    Raises
    ------
    InputError
        A file is missing or wrong, or it has other gauges than the map.
    """
    loaded, held = load_vehicle(vehicle), load_inverse_map(Path(inverse_map))
    n = held.n_strain_gauges
    stated: dict[str, str | float] = {"vehicle": str(vehicle), "ambient_pressure_Pa": ambient_pressure}
    strain = np.zeros(n)
    if weight_up_roll_deg is not None:
        weight = Weight(up_roll_angle=radians(weight_up_roll_deg), nose_elevation=radians(weight_nose_deg))
        strain = weight_strain(loaded, loaded.gauges.layout, weight)
        if len(strain) != n:
            raise InputError(f"{vehicle}: layout in use has {len(strain)} gauges, the map has {n}")
        stated |= {"weight_up_roll_deg": weight_up_roll_deg, "weight_nose_deg": weight_nose_deg}
    known = KnownStrain(value=strain + squeeze_strain(loaded, ambient_pressure))
    if known_output is not None:
        zeros = GaugeZeros(value=known.value, std=known.std)
        write_zeros(Path(known_output), held.gauge_names[:n], zeros, stated)
    return known, stated
