"""Kinds of error by inertia: masses of the vehicle in a manoeuvre, with an inertial unit and without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import sqrt
from typing import Any

import numpy as np

from builder.inverse.noise.inertia import UNLISTED, InertiaStrain, manoeuvre_strain, strain_by_inertia
from builder.stress.hardware_kinds import stated_class
from builder.stress.kind import Hardware, Kind, KindClass, as_read
from builder.structure.loads.applied import STANDARD_GRAVITY
from builder.vehicle.file import Vehicle
from builder.vehicle.map.options import Noise
from builder.vehicle.structure.mass import Mass
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import MEASURED_MOTION, VIBRATION
from strainfmu.flight_condition import FlightCondition

LATERAL_G = 5.0
EXTRA_KG = 2.0
AMPLITUDE = 5e-6
"""Size of the lateral specific force [g], of the mass at mid-body that the file does not list [kg], and of the
bending mode at the gauge that it strains most [m/m]."""


@lru_cache(maxsize=1)
def _kept(vehicle: str, entry: str) -> list[InertiaStrain]:
    """Return a place for the strain of a vehicle, by the text of its file: kinds of it share one."""
    return []


def independent_strain(vehicle: Vehicle, entry: Mass) -> InertiaStrain:
    """Return the strain by inertia of the independent model's mesh, with 1 kg at mid-body."""
    place = _kept(vehicle.model_dump_json(), entry.model_dump_json())
    if not place:
        middle = 0.5 * vehicle.body().length
        place.append(strain_by_inertia(vehicle, entry, vehicle.resolution.truth, [middle]))
    return place[0]


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
        found = independent_strain(self.vehicle, self.entry)
        extra = self.extra * found.by_part[f"{UNLISTED} 1"]
        return (found.of_listed * self.with_listed + extra)[:, 1:3]

    def readings(
        self, strain: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator
    ) -> FloatArray:
        """Return ``strain`` (k, n_d) with the strain of the manoeuvre."""
        return as_read(strain, wind, hardware, random) + self.force(wind) @ self._strain.T

    def force(self, wind: FloatArray) -> FloatArray:
        """Return (k, 2) the specific force along y and z [m/s2]; ``wind`` (k, 1) is the leeward meridian."""
        return STANDARD_GRAVITY * self.load_factor * np.hstack([np.sin(wind), np.cos(wind)])


@dataclass(frozen=True, eq=False, kw_only=True)
class Vibration:
    """A vehicle that vibrates in its first bending mode, each sample at another phase and across another axis.

    ``amplitude`` [m/m] is the amplitude of the gauge with the largest strain.
    """

    vehicle: Vehicle
    entry: Mass
    amplitude: float

    @cached_property
    def _strain(self) -> FloatArray:
        return independent_strain(self.vehicle, self.entry).by_bending

    def readings(
        self, strain: FloatArray, wind: FloatArray, hardware: Hardware, random: np.random.Generator
    ) -> FloatArray:
        """Return ``strain`` (k, n_d) with the strain of the vibration."""
        phase, axis = 2.0 * np.pi * random.random((2, len(strain), 1))
        size = self.amplitude * np.sin(phase) * np.hstack([np.sin(axis), np.cos(axis)])
        return as_read(strain, wind, hardware, random) + size @ self._strain.T


@dataclass(frozen=True, eq=False, kw_only=True)
class InertialUnit:
    """The inertial unit of a vehicle in ``manoeuvre``, with errors of the stated sizes.

    ``vibration`` [m/m] is the standard deviation that is stated besides; None for none.
    """

    manoeuvre: Manoeuvre
    vibration: float | None = None

    def known(
        self, conditions: Sequence[FlightCondition], noise: Noise, random: np.random.Generator
    ) -> dict[str, Any]:
        """Return the inertial inputs by name."""
        entry, names = self.manoeuvre.entry, [one.name for one in MEASURED_MOTION]
        force = self.manoeuvre.force(np.array([[one.leeward_roll_angle] for one in conditions]))
        true = np.zeros((len(conditions), len(names)))
        true[:, 1:3] = force
        stds = {
            "m/s2": entry.specific_force_std_m_per_s2,
            "rad/s": entry.angular_rate_std_rad_per_s,
            "rad/s2": entry.angular_acceleration_std_rad_per_s2,
        }
        std = np.array([stds[one.unit] for one in MEASURED_MOTION])
        read = true + std * random.standard_normal(true.shape)
        found: dict[str, Any] = dict(zip(names, read.T, strict=True))
        return found if self.vibration is None else {**found, VIBRATION: np.full(len(true), self.vibration)}


def inertia_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return masses in a manoeuvre, and vibration.

    A vehicle without a section [mass] flies the masses of its file, too, where its materials have a density. The
    nonlinear estimator expects them at ``noise.manoeuvre_load_factor``; no linear map separates them from air
    loads.
    """
    if vehicle.mass is not None:
        return _stated_kinds(vehicle, vehicle.mass)
    held = vehicle.is_of_revolution and vehicle.structure.support != "free_flight"
    return _unknown_kinds(vehicle) if held and vehicle.material.density_kg_per_m3 is not None else []


def _unknown_kinds(vehicle: Vehicle) -> list[Kind]:
    """Return kinds of a vehicle without a section [mass]."""
    entry = Mass()
    wall = Manoeuvre(vehicle=vehicle, entry=entry, load_factor=LATERAL_G)
    extra = Manoeuvre(vehicle=vehicle, entry=entry, load_factor=LATERAL_G, with_listed=False, extra=EXTRA_KG)
    vibration = Vibration(vehicle=vehicle, entry=entry, amplitude=AMPLITUDE)
    lateral, bending = f"{LATERAL_G:g} g lateral", f"{1e6 * AMPLITUDE:g} um/m"
    load_factor = vehicle.noise.manoeuvre_load_factor
    is_expected = vehicle.map.estimator != "linear" and manoeuvre_strain(vehicle) is not None
    of_wall: KindClass = stated_class(LATERAL_G, load_factor) if is_expected else "unobservable"
    of_other: KindClass = "outside" if is_expected else "unobservable"
    cure = "A section [mass] in the vehicle file includes it in sigma; an inertial unit then takes it off."
    expected = f"Sigma includes the wall's mass at {load_factor:g} g." if is_expected else cure
    listed = (
        (of_wall, "inertia of the masses", lateral, "Masses of the file, accelerated to the leeward side.", wall),
        (
            of_other,
            "inertia of a mass that is not listed",
            f"{EXTRA_KG:g} kg at mid-body, {lateral}",
            "A mass at mid-body that the file does not list, without the others.",
            extra,
        ),
        (of_other, "vibration", bending, "First bending mode at any phase, across any axis.", vibration),
    )
    return [
        Kind(error=error, size=size, group=group, what=f"{what} {expected}", readings=one.readings)
        for group, error, size, what, one in listed
    ]


def _stated_kinds(vehicle: Vehicle, entry: Mass) -> list[Kind]:
    """Return kinds of a vehicle with the section [mass] ``entry``."""
    listed = Manoeuvre(vehicle=vehicle, entry=entry, load_factor=LATERAL_G)
    extra = Manoeuvre(vehicle=vehicle, entry=entry, load_factor=LATERAL_G, with_listed=False, extra=EXTRA_KG)
    straight = Manoeuvre(vehicle=vehicle, entry=entry, load_factor=0.0)
    both = Manoeuvre(vehicle=vehicle, entry=entry, load_factor=LATERAL_G, extra=EXTRA_KG)
    size, of_mass = f"{LATERAL_G:g} g lateral", f"{EXTRA_KG:g} kg at mid-body, {LATERAL_G:g} g lateral"
    by_load = stated_class(LATERAL_G, entry.lateral_g)
    by_mass = stated_class(EXTRA_KG, entry.unlisted_kg)
    by_vibration = stated_class(1e6 * AMPLITUDE, entry.vibration_um_per_m)
    vibration, bending = Vibration(vehicle=vehicle, entry=entry, amplitude=AMPLITUDE), f"{1e6 * AMPLITUDE:g} um/m"
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
        Kind(
            error="vibration",
            size=bending,
            group=by_vibration,
            what="First bending mode at any phase, across any axis. Nothing states it; an inertial unit reads 0.",
            readings=vibration.readings,
            air_data=InertialUnit(manoeuvre=straight),
        ),
        Kind(
            error="vibration, stated",
            size=bending,
            group="within",
            what="The same, with its standard deviation as an input.",
            readings=vibration.readings,
            air_data=InertialUnit(manoeuvre=straight, vibration=AMPLITUDE / sqrt(2.0)),
        ),
    ]
