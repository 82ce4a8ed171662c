"""Kinds of error by inertia: masses of the vehicle in a manoeuvre, with an inertial unit and without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from builder.inverse.noise.inertia import UNLISTED, strain_by_inertia, strain_of_listed
from builder.stress.hardware_kinds import stated_class
from builder.stress.kind import Hardware, Kind, as_read
from builder.structure.loads.applied import STANDARD_GRAVITY
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import Noise
from builder.vehicle.structure.mass import Mass
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import INERTIAL_NAMES
from strainfmu.flight_condition import FlightCondition

LATERAL_G = 5.0
EXTRA_KG = 2.0
"""Size of the lateral specific force [g], and of the mass at mid-body that the file does not list [kg]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Manoeuvre:
    """A vehicle that is accelerated across its axis, to the leeward side, as the normal force accelerates it.

    Attributes
    ----------
    vehicle, entry : the vehicle and its section [mass].
    load_factor : specific force [g].
    with_listed : whether masses that the file lists strain the gauges.
    extra : mass at mid-body besides [kg].
    """

    vehicle: Vehicle
    entry: Mass
    load_factor: float
    with_listed: bool = True
    extra: float = 0.0

    @cached_property
    def _strain(self) -> FloatArray:
        """(n_d, 2) strain of the gauges per specific force along y and z, by the independent mesh."""
        middle = 0.5 * self.vehicle.body().length
        by_part = strain_by_inertia(self.vehicle, self.entry, self.vehicle.resolution.truth, [middle])
        extra = self.extra * by_part[f"{UNLISTED} 1"]
        return (strain_of_listed(by_part) * self.with_listed + extra)[:, 1:3]

    def readings(
        self, strain: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator
    ) -> FloatArray:
        """Return ``strain`` (k, n_d) with that of the manoeuvre."""
        return as_read(strain, wind, hardware, random) + self.force(wind) @ self._strain.T

    def force(self, wind: FloatArray) -> FloatArray:
        """Return (k, 2) the specific force along y and z [m/s2]; ``wind`` (k, 1) is the leeward meridian."""
        return STANDARD_GRAVITY * self.load_factor * np.hstack([np.sin(wind), np.cos(wind)])


@dataclass(frozen=True, eq=False, kw_only=True)
class InertialUnit:
    """The inertial unit of a vehicle in ``manoeuvre``, with errors of the stated sizes."""

    manoeuvre: Manoeuvre

    def known(
        self, conditions: Sequence[FlightCondition], noise: Noise, random: np.random.Generator
    ) -> dict[str, Any]:
        """Return the inertial inputs by name."""
        entry, names = self.manoeuvre.entry, list(INERTIAL_NAMES)
        force = self.manoeuvre.force(np.array([[one.leeward_roll_angle] for one in conditions]))
        true = np.zeros((len(conditions), len(names)))
        true[:, 1:3] = force
        std = np.repeat(
            [
                entry.specific_force_std_m_per_s2,
                entry.angular_rate_std_rad_per_s,
                entry.angular_acceleration_std_rad_per_s2,
            ],
            [3, 3, 2],
        )
        read = true + std * random.standard_normal(true.shape)
        return dict(zip(names, read.T, strict=True))


def inertia_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return masses in a manoeuvre, none of a vehicle without a section [mass]."""
    entry = vehicle.mass
    if entry is None:
        return []
    listed = Manoeuvre(vehicle=vehicle, entry=entry, load_factor=LATERAL_G)
    extra = Manoeuvre(vehicle=vehicle, entry=entry, load_factor=LATERAL_G, with_listed=False, extra=EXTRA_KG)
    both = Manoeuvre(vehicle=vehicle, entry=entry, load_factor=LATERAL_G, extra=EXTRA_KG)
    size, of_mass = f"{LATERAL_G:g} g lateral", f"{EXTRA_KG:g} kg at mid-body, {LATERAL_G:g} g lateral"
    by_load = stated_class(LATERAL_G, entry.lateral_g)
    by_mass = stated_class(EXTRA_KG, entry.unlisted_kg)
    unit = "An inertial unit measures the specific force."
    return [
        Kind(
            error="inertia of the masses",
            size=size,
            group=by_load,
            what="Masses that the file lists, accelerated to the leeward side; nothing measures it.",
            readings=listed.readings,
        ),
        Kind(
            error="inertia of the masses, inertial unit",
            size=size,
            group="within",
            what=f"The same. {unit}",
            readings=listed.readings,
            air_data=InertialUnit(manoeuvre=listed),
        ),
        Kind(
            error="inertia of a mass that is not listed",
            size=of_mass,
            group=by_load if by_mass == "within" else by_mass,
            what="A mass at mid-body that the file does not list, without the others; nothing measures it.",
            readings=extra.readings,
        ),
        Kind(
            error="inertia of a mass that is not listed, inertial unit",
            size=of_mass,
            group=by_mass,
            what=f"The same, with the masses that the file lists. {unit}",
            readings=both.readings,
            air_data=InertialUnit(manoeuvre=both),
        ),
    ]
