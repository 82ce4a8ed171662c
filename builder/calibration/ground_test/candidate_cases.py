"""Load cases that a test could apply: pads at stations and roll angles, attitudes, pressure, axial force.

A plain test has pads over the body in two planes and more, and own weight in four attitudes.
"""

from dataclasses import dataclass

import numpy as np

from builder.calibration.ground_test.load_entries import NO_LOAD_CELL, entry_of
from builder.calibration.ground_test.load_test import KnownLoad, LoadErrors, LoadTest
from builder.structure.loads.applied import Load, PadForce, PadPressure, SectionLoad, SurfacePressure, Weight
from builder.structure.loads.fourier import harmonics_of, pad_harmonics
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError

DIRECTIONS = ("in", "out", "axial", "around")
"""Of a pad's force: pressing, pulling a bonded pad, along the body, round it."""

STATIONS = 10
"""Stations of pads that are offered where none are stated."""


@dataclass(frozen=True, kw_only=True)
class LoadLimits:
    """What the rig can do.

    Attributes
    ----------
    force : of a pad [N].
    stations : of pads [m]; None for evenly placed ones.
    roll_angles : of pads [rad].
    directions : of a pad's force, of :data:`DIRECTIONS`.
    half_length, half_angle : of a pad [m], [rad].
    internal_pressure : over the ambient one [Pa]; 0 for none.
    axial_force : on the ring at the first station, aft [N]; 0 for none.
    attitudes : roll angles of the meridian that points up [rad] in which the vehicle lies under its weight.
    largest_strain : of any gauge [m/m]; loads are lowered to it.
    """

    force: float = 1500.0
    stations: tuple[float, ...] | None = None
    roll_angles: tuple[float, ...] = tuple(float(a) for a in np.deg2rad(np.arange(0.0, 360.0, 45.0)))
    directions: tuple[str, ...] = ("in",)
    half_length: float = 0.05
    half_angle: float = float(np.deg2rad(30.0))
    internal_pressure: float = 0.0
    axial_force: float = 0.0
    attitudes: tuple[float, ...] = tuple(float(a) for a in np.deg2rad([0.0, 90.0, 180.0, 270.0]))
    largest_strain: float = 1e-3

    def __post_init__(self) -> None:
        for direction in self.directions:
            if direction not in DIRECTIONS:
                raise InputError(f"--directions: expected some of {', '.join(DIRECTIONS)}, got '{direction}'")


@dataclass(frozen=True, kw_only=True)
class PlannedCase:
    """A load case that could be applied: its name and what acts in addition to the weight.

    >>> import builder
    >>> builder.PlannedCase(name="no load", loads=()).name
    'no load'
    """

    name: str
    loads: tuple[Load, ...]


def candidate_cases(vehicle: Vehicle, limits: LoadLimits, span: tuple[float, float]) -> list[PlannedCase]:
    """Return the cases within ``limits``; ``span`` is the outer surface's, from nose to base [m].

    Raises
    ------
    InputError
        A station is beyond the wall, or nothing may act.
    """
    cases = []
    for station in pad_stations(vehicle, limits, span):
        for roll in limits.roll_angles:
            cases += [_pad(limits, station, roll, direction) for direction in limits.directions if limits.force]
    first = _wall(vehicle, limits, span)[0]
    if limits.axial_force:
        load = SectionLoad(station=first, force=(limits.axial_force, 0.0, 0.0))
        cases.append(PlannedCase(name=f"axial {limits.axial_force:g} N", loads=(load,)))
    if limits.internal_pressure:
        inside = SurfacePressure(surface="inner", pressure=limits.internal_pressure)
        cases.append(PlannedCase(name=f"pressure {1e-3 * limits.internal_pressure:g} kPa", loads=(inside,)))
    if not cases:
        raise InputError("load test: expected --force, --axial or --pressure above 0, got none")
    return cases


def attitude_cases(limits: LoadLimits) -> list[PlannedCase]:
    """Return the cases of own weight: one for each attitude."""
    return [
        PlannedCase(name=f"weight, {np.rad2deg(up):g} deg up", loads=(Weight(up_roll_angle=up),))
        for up in limits.attitudes
    ]


def pad_stations(vehicle: Vehicle, limits: LoadLimits, span: tuple[float, float]) -> tuple[float, ...]:
    """Return the stations of pads [m].

    Raises
    ------
    InputError
        A pad would reach beyond the hollow part of the body.
    """
    low, high = _wall(vehicle, limits, span)
    if limits.stations is None:
        return tuple(round(float(x), 3) for x in np.linspace(low, high, STATIONS))
    for station in limits.stations:
        if not low <= station <= high:
            raise InputError(f"--stations: expected {low:g} .. {high:g} m, where pads fit, got {station:g}")
    return limits.stations


def _wall(vehicle: Vehicle, limits: LoadLimits, span: tuple[float, float]) -> tuple[float, float]:
    """Return the first and the last station of pads [m]."""
    low = max(vehicle.structure.solid_tip_length_m or 0.0, span[0]) + 2.0 * limits.half_length
    high = span[1] - 2.0 * limits.half_length
    if low >= high:
        raise InputError(f"--pad-length: expected pads shorter than the wall, got {2e3 * limits.half_length:g} mm")
    return low, high


def _pad(limits: LoadLimits, station: float, roll: float, direction: str) -> PlannedCase:
    name = f"{direction} {station:g} m, {np.rad2deg(roll):g} deg"
    place = {
        "station": station,
        "roll_angle": roll,
        "half_length": limits.half_length,
        "half_angle": limits.half_angle,
    }
    if direction == "in":
        return PlannedCase(name=name, loads=(PadPressure(**place, push=limits.force),))
    s, c = float(np.sin(roll)), float(np.cos(roll))
    along = {"out": (0.0, s, c), "axial": (1.0, 0.0, 0.0), "around": (0.0, c, -s)}[direction]
    x, y, z = (limits.force * part for part in along)
    return PlannedCase(name=name, loads=(PadForce(**place, force=(x, y, z)),))


def harmonics_of_test(test: LoadTest) -> int:
    """Return the highest harmonic in roll angle of the loads of ``test`` and of the pads that a plan offers."""
    loads = [known.load for case in test.cases for known in case.loads]
    return max([pad_harmonics(LoadLimits().half_angle), *map(harmonics_of, loads)])


def known_loads(case: PlannedCase, errors: LoadErrors) -> tuple[KnownLoad, ...]:
    """Return the loads of a case as its file states them."""
    on_cell = [entry_of(load)["kind"] not in NO_LOAD_CELL for load in case.loads]
    return tuple(
        KnownLoad(load=load, std=errors.load if is_read else 0.0, on_load_cell=is_read)
        for load, is_read in zip(case.loads, on_cell, strict=True)
    )
