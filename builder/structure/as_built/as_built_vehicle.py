"""What a vehicle as built may have different from its drawing: one value of every kind, or many vehicles' at once.

The kinds are listed in :mod:`builder.structure.as_built_kinds`. A calibration estimates the kinds
:data:`~builder.structure.as_built_kinds.AS_BUILT` as one vector, in the order of the table.

Derivatives of readings by these parameters are by kind: (n_d, ..) where each gauge has its own parameter, or one
for the whole vehicle. A parameter of one gauge changes its own reading alone, so one difference serves all gauges.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from builder.structure.as_built_kinds import AS_BUILT, IN_FLIGHT, IN_NOISE, KINDS, ParameterKind
from builder.structure.loads.applied import Load
from builder.vehicle.map_options import Calibration, Noise
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import ZERO

GAUGE_KINDS = tuple(kind.name for kind in AS_BUILT if kind.extent == "gauge")
"""Parameters of each gauge on its own."""

HELD_KINDS = tuple(kind.name for kind in AS_BUILT if kind.taken_for_zero)
"""Parameters of each region that the section [calibration] takes for zero unless it says otherwise."""


class Counts(NamedTuple):
    """Numbers of gauges, regions of the wall, rows of gauges at one roll angle, and joints: extents of kinds."""

    gauge: int
    region: int = 1
    row: int = 1
    joint: int = 0

    def of(self, kind: ParameterKind) -> int:
        """Return how many parameters a kind has."""
        return 1 if kind.extent == "vehicle" else int(getattr(self, kind.extent))

    def in_flight(self, kind: ParameterKind) -> int:
        """Return how many errors of a kind a vehicle in flight has."""
        return 1 if kind.is_one_in_flight else self.of(kind)


@dataclass(frozen=True, eq=False)
class AsBuilt:
    """Errors of a vehicle; zero is the vehicle of the file.

    Every kind of :data:`~builder.structure.as_built_kinds.AS_BUILT` and
    :data:`~builder.structure.as_built_kinds.IN_FLIGHT` is an attribute of its name, (.., n) in SI: n
    counts what has an error of its own (gauges, regions, rows, joints); it is 1 for an error in common, and n_d
    where each gauge sees another one. Leading axes are vehicles.

    Attributes
    ----------
    counts : numbers of what has parameters of its own.
    errors : by kind; those that are left out are 0.
    """

    counts: Counts
    errors: Mapping[str, FloatArray]

    def __post_init__(self) -> None:
        values = {}
        for kind in (*AS_BUILT, *IN_FLIGHT):
            size = self.counts.of(kind)
            value = np.asarray(self.errors.get(kind.name, np.zeros(size)), dtype=float)
            if not value.ndim or value.shape[-1] not in {1, size, self.counts.gauge}:
                raise InputError(f"{kind.name}: expected ({size},) values, got {value.shape}")
            values[kind.name] = value
        unknown = sorted(set(self.errors) - set(values))
        if unknown:
            raise InputError(f"vehicle as built: expected kinds {', '.join(values)}, got {', '.join(unknown)}")
        object.__setattr__(self, "errors", values)

    def __getattr__(self, name: str) -> FloatArray:
        try:
            value: FloatArray = self.__dict__["errors"][name]
        except KeyError:
            raise AttributeError(name) from None
        return value

    def changed(self, **errors: ArrayLike) -> AsBuilt:
        """Return the vehicle with other errors of some kinds; one number is for all."""
        return AsBuilt(
            self.counts, {**self.errors, **{name: np.atleast_1d(value) for name, value in errors.items()}}
        )

    def one_of(self, number: int) -> AsBuilt:
        """Return vehicle ``number`` of many."""
        return AsBuilt(
            self.counts, {name: value[number] if value.ndim > 1 else value for name, value in self.errors.items()}
        )

    def of_some(self, gauges: slice) -> AsBuilt:
        """Return the vehicle with some of its ``gauges`` alone."""
        of_gauge = {kind.name for kind in (*AS_BUILT, *IN_FLIGHT) if kind.extent == "gauge"}
        parts = {
            name: value[..., gauges] if name in of_gauge and value.shape[-1] > 1 else value
            for name, value in self.errors.items()
        }
        return AsBuilt(self.counts._replace(gauge=len(range(self.counts.gauge)[gauges])), parts)

    def of_all(self, kind: str) -> FloatArray:
        """Return (.., 1) what all regions have in common, or (n_d,) what each gauge sees."""
        value = self.errors[kind]
        if value.shape[-1] in (1, self.counts.gauge):
            return value
        if np.ptp(value, axis=-1).any():
            raise InputError(f"{kind}: expected one value for all regions, got {value}")
        return value[..., :1]

    @property
    def vector(self) -> FloatArray:
        """(n,) all parameters of a calibration, in the order of the table."""
        return np.concatenate(
            [np.broadcast_to(getattr(self, name), size) for name, size in _sizes(self.counts).items()]
        )

    @property
    def n_gauges(self) -> int:
        return self.counts.gauge

    @property
    def n_regions(self) -> int:
        return self.counts.region

    def of_vector(self, vector: FloatArray) -> AsBuilt:
        """Return the parameters of ``vector`` (n,), as many of each kind as here."""
        return AsBuilt(self.counts, {kind: vector[part] for kind, part in slices(self.counts).items()})

    def record(self, kinds: Sequence[ParameterKind]) -> dict[str, Any]:
        """Return the errors of ``kinds`` for a file: a number of the vehicle, or a list."""
        return {
            kind.name: self.of_all(kind.name).item() if kind.is_one_in_flight else self.errors[kind.name].tolist()
            for kind in kinds
        }


def _sizes(counts: Counts) -> dict[str, int]:
    return {kind.name: counts.of(kind) for kind in AS_BUILT}


def slices(counts: Counts) -> dict[str, slice]:
    """Return where each kind stands in the vector."""
    places, start = {}, 0
    for kind, size in _sizes(counts).items():
        places[kind] = slice(start, start + size)
        start += size
    return places


def parameter_names(gauge_names: Sequence[str], counts: Counts) -> tuple[str, ...]:
    """Return a name for every entry of the vector."""
    names_of: dict[str, Sequence[str]] = {
        extent: [f"{extent} {k + 1}" for k in range(count)] for extent, count in counts._asdict().items()
    }
    names_of["gauge"] = gauge_names
    return tuple(
        f"{kind.in_words} {which}".rstrip() for kind in AS_BUILT for which in names_of.get(kind.extent, [""])
    )


def exactly_built(counts: Counts | int) -> AsBuilt:
    """Return the vehicle of the file, without errors; ``counts`` may be the number of gauges alone."""
    return AsBuilt(counts if isinstance(counts, Counts) else Counts(counts), {})


def as_drawn(counts: Counts) -> AsBuilt:
    """Return the vehicle of the file with as many numbers of each kind as [noise] states errors."""
    return AsBuilt(counts, {kind.name: np.zeros(counts.in_flight(kind)) for kind in IN_NOISE})


def as_built_std(entry: Calibration, counts: Counts) -> AsBuilt:
    """Return the standard deviation of every parameter before a test, from the section [calibration]."""
    return AsBuilt(counts, {kind: np.full(size, KINDS[kind].std(entry)) for kind, size in _sizes(counts).items()})


def draw_as_built(std: AsBuilt, random: np.random.Generator) -> AsBuilt:
    """Return a vehicle whose errors are drawn from normal distributions of the standard deviations ``std``."""
    vector = std.vector
    return std.of_vector(vector * random.standard_normal(len(vector)))


Key = tuple[str, int]
"""Kind of a parameter, and the number of the region, row or joint, or 0."""


def derivative_keys(counts: Counts) -> list[Key]:
    """Return the keys in the order of the vector, without the zeros."""
    return [
        (kind.name, number)
        for kind in AS_BUILT
        if kind.name != ZERO
        for number in range(1 if kind.extent in ("gauge", "vehicle") else getattr(counts, kind.extent))
    ]


def uncertain_keys(std: AsBuilt, in_flight: bool = False) -> list[Key]:
    """Return the keys of parameters whose standard deviation is not zero; those alone that strain in flight
    depends on, where it is ``in_flight`` that they are needed."""
    return [
        key
        for key in derivative_keys(std.counts)
        if (KINDS[key[0]].flight or not in_flight)
        and np.any(getattr(std, key[0]) if of_gauges(key) else getattr(std, key[0])[key[1]])
    ]


def stated_keys(noise: Noise, counts: Counts) -> list[Key]:
    """Return the keys of errors in proportion to strain that the section [noise] states, in the order of draws."""
    return [
        (kind.name, number)
        for kind in IN_NOISE
        if kind in AS_BUILT and kind.std(noise) > 0.0
        for number in range(1 if kind.extent == "gauge" else counts.in_flight(kind))
    ]


def of_gauges(key: Key) -> bool:
    """Return whether every gauge has its own parameter of a kind."""
    return KINDS[key[0]].extent == "gauge"


def places_of(keys: Sequence[Key], counts: Counts) -> IntArray:
    """Return (n_d, n_keys) where the parameters of ``keys`` that each gauge reads with stand in the vector."""
    gauge, where = np.arange(counts.gauge), slices(counts)
    numbers = [gauge if of_gauges(key) else np.full_like(gauge, key[1]) for key in keys]
    return np.stack([where[kind].start + number for (kind, _), number in zip(keys, numbers, strict=True)], axis=1)


def parameter_derivatives(
    evaluate: Callable[[AsBuilt], FloatArray],
    parameters: AsBuilt,
    keys: Sequence[Key] | None = None,
) -> dict[Key, FloatArray]:
    """Return the derivative of ``evaluate`` (n_d, ..), readings without zeros that go with 1 / E, by ``keys``.

    These are all by default.
    """
    value = evaluate(parameters)
    slopes: dict[Key, FloatArray] = {}
    for key in derivative_keys(parameters.counts) if keys is None else keys:
        slope = slope_by_factor(key[0], value, parameters)
        slopes[key] = _difference(evaluate, parameters, *key) if slope is None else slope
    return slopes


def slope_by_factor(
    kind: str,
    reading: FloatArray,
    as_built: AsBuilt,
    by_stress: FloatArray | float = 1.0,
    by_mass: FloatArray | float | None = None,
) -> FloatArray | None:
    """Return the derivative of a ``reading`` (n_d, ..) by what multiplies it: gains, Young's modulus, the mass.

    Parameters
    ----------
    kind : of the parameter; of other kinds the derivative is None.
    by_stress, by_mass : 1 where strain goes with 1 / E, and with the mass, 0 where not; None where not known.
    """
    if kind == "gauge_gain":
        return times_gauges(reading, 1.0 / (1.0 + as_built.gauge_gain))
    if kind == "common_gain":
        return reading / (1.0 + as_built.common_gain[0])
    if kind == "youngs_modulus":
        return -reading * by_stress / (1.0 + as_built.youngs_modulus[0] * by_stress)
    if kind == "mass" and by_mass is not None:
        return reading * by_mass / (1.0 + as_built.mass[0] * by_mass)
    return None


def times_gauges(value: FloatArray, factor: FloatArray) -> FloatArray:
    """Return ``value`` (n_d, ..) with the row of each gauge times its ``factor`` (n_d,)."""
    return value * factor.reshape(-1, *[1] * (value.ndim - 1))


def _difference(
    evaluate: Callable[[AsBuilt], FloatArray], parameters: AsBuilt, kind: str, region: int
) -> FloatArray:
    value = getattr(parameters, kind)
    step = KINDS[kind].step
    change = np.full(len(value), step)
    if KINDS[kind].extent not in ("gauge", "vehicle"):
        change[np.arange(len(value)) != region] = 0.0
    plus, minus = (evaluate(parameters.changed(**{kind: value + sign * change})) for sign in (1.0, -1.0))
    return np.asarray((plus - minus) / (2.0 * step))


StrainOfLoads = Callable[[Sequence[Load]], FloatArray]
"""Readings (n_loads, n_d) of a vehicle under each of some loads [m/m]."""


class BuiltStructure:
    """What a structure of any make has, of which parts may differ from the drawing.

    ``response`` is what a load strains, ``response_strain`` the readings of a vehicle as built under it.
    """

    response: Callable[..., Any]
    nominal_response: Callable[..., Any]
    response_strain: Callable[..., FloatArray]

    @property
    def counts(self) -> Counts:
        """Numbers of what has parameters of its own; each structure states them."""
        raise NotImplementedError

    @property
    def n_gauges(self) -> int:
        return self.counts.gauge

    @property
    def n_regions(self) -> int:
        return self.counts.region

    def exactly_built(self) -> AsBuilt:
        """Return the parameters of the vehicle of the file: zeros."""
        return exactly_built(self.counts)

    def solve_for(self, loads: Sequence[Load]) -> None:
        """Find the responses of ``loads`` in one solution, on structures where each alone costs more."""

    def load_strain(self, parameters: AsBuilt, loads: Sequence[Load]) -> FloatArray:
        """Return what every gauge reads under loads that act together, without zeros, (n_d,) [m/m]."""
        total = np.zeros(self.n_gauges)
        for load in loads:
            total += self.response_strain(parameters, self.response(load))
        return total

    def reading(self, parameters: AsBuilt, loads: Sequence[Load]) -> FloatArray:
        """Return what every gauge reads, zeros included, (n_d,) [m/m]."""
        return self.load_strain(parameters, loads) + parameters.zero

    def nominal_strain(self, parameters: AsBuilt, loads: Sequence[Load]) -> FloatArray:
        """Return the readings (n_loads, n_d) [m/m] under each of ``loads`` on the wall that was solved for."""
        return self.response_strain(parameters, self.nominal_response(loads))

    def strain_near(self, parameters: AsBuilt) -> StrainOfLoads:
        """Return what each of several loads strains, for differences between loads: readings of a vehicle."""
        return partial(self.nominal_strain, parameters)
