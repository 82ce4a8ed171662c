"""Arguments of ``estimate`` and ``track``, of one sample or of several, checked and as records of the core."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import isfinite, nan
from operator import itemgetter
from struct import Struct
from struct import error as StructError
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import (
    AIR_INPUT_NAMES,
    AIR_INPUTS,
    ALTITUDE,
    DYNAMIC_PRESSURE,
    INERTIAL_NAMES,
    Q_SOURCE,
    TOTAL_TEMPERATURE,
    QSource,
)
from strainfmu.estimator.core import Core
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.validity import parameter_names_of
from strainfmu.estimator.signal_names import STRAIN, TEMPERATURE, THRUST, VALID


class SampleInputs(TypedDict, total=False):
    """Inputs of a sample in addition to strain and dynamic pressure: arguments of ``estimate`` and ``track``.

    Each is one value for all samples, or one of each; NaN or left out where it is not known.
    """

    valid: ArrayLike | None
    dynamic_pressure_std: ArrayLike
    mach_number: ArrayLike
    mach_number_std: ArrayLike
    altitude: ArrayLike
    static_pressure: ArrayLike
    static_pressure_std: ArrayLike
    total_temperature: ArrayLike
    total_temperature_std: ArrayLike
    q_source: QSource | str | ArrayLike
    measured_angle_of_attack: ArrayLike
    measured_angle_of_attack_std: ArrayLike
    measured_sideslip_angle: ArrayLike
    measured_sideslip_angle_std: ArrayLike
    temperature: ArrayLike | None
    thrust: ArrayLike
    parameters: Mapping[str, ArrayLike] | None
    parameters_std: Mapping[str, ArrayLike] | None
    specific_force_x: ArrayLike
    specific_force_y: ArrayLike
    specific_force_z: ArrayLike
    angular_rate_x: ArrayLike
    angular_rate_y: ArrayLike
    angular_rate_z: ArrayLike
    angular_acceleration_y: ArrayLike
    angular_acceleration_z: ArrayLike
    vibration: ArrayLike


def real_numbers(name: str, values: ArrayLike) -> FloatArray:
    """Return ``values`` as an array of real numbers."""
    try:
        array = np.asarray(values)
        if array.dtype.kind != "c":
            return np.asarray(array, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected real numbers: {error}") from error
    raise InputError(f"{name}: expected real numbers, got {array.dtype}")


def is_series(strain: ArrayLike) -> bool:
    """Return whether ``strain`` has two axes, samples and sensors."""
    return (strain if type(strain) is np.ndarray else real_numbers(STRAIN, strain)).ndim == 2


def strain_of_samples(strain: ArrayLike, n_gauges: int) -> FloatArray:
    """Return ``strain`` of k samples (k, n_d), or of one (n_d,), as (k, n_d) [m/m]."""
    d = real_numbers(STRAIN, strain)
    if d.ndim not in (1, 2) or d.shape[-1] != n_gauges:
        raise InputError(
            f"strain: expected {f'(k, {n_gauges})' if d.ndim == 2 else n_gauges} values, got {d.shape}"
        )
    return np.atleast_2d(d)


def checked_mask(valid: ArrayLike, n_gauges: int, samples: int | None = None) -> BoolArray:
    """Return a copy of ``valid`` as an array: (n_d,), or for a number of ``samples`` also (k, n_d)."""
    mask = np.array(valid)
    shapes = [(n_gauges,)] if samples is None else [(n_gauges,), (samples, n_gauges)]
    if mask.shape not in shapes or mask.dtype != np.bool_:
        expected = " or ".join(str(shape) for shape in shapes)
        raise InputError(f"valid: expected {expected} values of bool, got {mask.shape} of {mask.dtype}")
    return mask


def positive(values: FloatArray) -> FloatArray:
    """Return ``values`` of Mach number, altitude or a pressure, NaN where not given: where they are 0 or below."""
    return np.asarray(np.where(values > 0.0, values, np.nan))


def per_sample(name: str, value: ArrayLike, samples: int) -> FloatArray:
    """Return ``value``, one number or one of each sample, as (samples,)."""
    values = None
    with suppress(InputError):
        values = None if value is None else real_numbers(name, value)
    if values is None or values.shape not in ((), (samples,)):
        expected = "a number" if samples == 1 else f"a number or {samples} numbers"
        got = str(value.dtype) if isinstance(value, np.ndarray) else repr(value)
        got = got if values is None else f"shape {values.shape}"
        raise InputError(f"{name}: expected {expected}, got {got}")
    return np.full(samples, values) if values.ndim == 0 else values


_NO_THRUST = 0.0

_NOT_GIVEN: dict[str, Any] = {
    **dict.fromkeys(AIR_INPUT_NAMES, nan),
    Q_SOURCE: QSource.AUTO,
    VALID: None,
    TEMPERATURE: None,
    THRUST: _NO_THRUST,
    "parameters": None,
    "parameters_std": None,
}
_air_of = itemgetter(*AIR_INPUT_NAMES)
_more_of = itemgetter(TEMPERATURE, THRUST, "parameters", "parameters_std")

_STDS = tuple(item.name for item in AIR_INPUTS if item.is_std)
_SOURCES = {member: float(member) for member in QSource}
"""Their numbers; a look-up takes a fraction of a conversion's time."""

_TOTAL_PLACE = AIR_INPUT_NAMES.index(TOTAL_TEMPERATURE)
_STD_PLACES = tuple(place for place, item in enumerate(AIR_INPUTS) if item.is_std)

EXACT = 1e-150
"""Standard deviation that stands for 0: to the core, as to hosts of FMUs, 0 is one that is not given."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Samples:
    """Samples that have been checked.

    Attributes
    ----------
    strain : (k, n_d) readings; None where ``inputs`` are written already.
    columns : places in a record, and what is written there: a number, or one or a row of each sample.
    mask : (k, n_d) of bool; None for all sensors.
    inputs : (k, n_inputs) their records, written by :meth:`filled`.
    start : (k, 4) flight states to start from; None for a search.
    """

    strain: FloatArray | None
    columns: tuple[tuple[slice, Any], ...]
    mask: BoolArray | None
    inputs: FloatArray
    start: FloatArray | None = None

    def filled(self, rows: slice) -> FloatArray:
        """Write the records of ``rows`` and return them."""
        records = self.inputs[rows]
        if self.strain is not None:
            records[:, : self.strain.shape[1]] = self.strain[rows]
        for place, value in self.columns:
            is_of_each = isinstance(value, np.ndarray) and value.ndim == 2 and len(value) == len(self.inputs)
            records[:, place] = value[rows] if is_of_each else value
        return records


class SampleRecords:
    """Records of the samples of one map, in the layout of its compiled core."""

    def __init__(self, inverse_map: InverseMap, core: Core) -> None:
        places = core.inputs
        self._map, self._places, self._parameters = inverse_map, places, parameter_names_of(inverse_map)
        self._n, self._shape, self._n_inputs = inverse_map.n_gauges, (inverse_map.n_gauges,), core.n_inputs
        self._std_places = [places[name].start for name in _STDS]
        # What lies behind the readings of a record: air data, and what is not known of a plain sample.
        first_air = places[AIR_INPUT_NAMES[0]].start
        more = np.full(self._n_inputs, nan)
        more[places[THRUST]] = _NO_THRUST
        self._no_more = tuple(more[first_air + len(AIR_INPUT_NAMES) :].tolist())
        self._pack_behind: Callable[..., None] = Struct(f"{self._n_inputs - first_air}d").pack_into
        self._behind_offset = first_air * more.itemsize

    def write_plain(
        self, record: FloatArray, strain: ArrayLike, air: tuple[Any, ...], more: tuple[Any, ...]
    ) -> bool:
        """Write readings and ``air`` of one sample, of which nothing else is known, into ``record``.

        Return whether it is done: the way of many samples takes, or refuses, what is no array of floats and
        numbers.
        """
        temperature, thrust, parameters, stds, inertial = more
        if temperature is not None or thrust is not _NO_THRUST or not (parameters is stds is None) or inertial:
            return False
        if type(strain) is not np.ndarray or strain.shape != self._shape or strain.dtype.kind != "f":
            return False
        try:
            self._pack_behind(record, self._behind_offset, *air, *self._no_more)
        except StructError:
            return False
        record[: self._n] = strain
        if air[_TOTAL_PLACE] > 0.0 or any(air[place] <= 0.0 for place in _STD_PLACES):
            self._refuse_negative(dict(zip(AIR_INPUT_NAMES, air, strict=True)))
            record[self._std_places] = _exact(record[self._std_places])
        return True

    def _refuse_negative(self, air: Mapping[str, Any]) -> None:
        """Refuse negative standard deviations, and a total temperature that the map cannot use."""
        if self._map.manifold is None and np.any(np.greater(air[TOTAL_TEMPERATURE], 0.0)):
            raise InputError(f"{TOTAL_TEMPERATURE}: expected none, a linear map does not take it")
        for name in _STDS:
            if np.any(np.less(air[name], 0.0)):
                raise InputError(f"{name}: expected numbers from 0 on, got {np.nanmin(air[name]):g}")

    def samples(
        self, strain: ArrayLike, valid: ArrayLike | None, air: tuple[ArrayLike, ...], more: tuple[Any, ...]
    ) -> Samples:
        """Return the samples, checked; arguments as of ``Estimator.estimate``."""
        d = strain_of_samples(strain, self._n)
        k, layout = len(d), self._places
        self._refuse_negative(dict(zip(AIR_INPUT_NAMES, air, strict=True)))
        temperature, thrust, parameters, stds, inertial = more
        columns: list[tuple[slice, Any]] = [
            (layout[name], _column(name, value, k)) for name, value in zip(AIR_INPUT_NAMES, air, strict=True)
        ]
        columns += [
            (layout[TEMPERATURE], self._temperatures(temperature, k)),
            (layout[THRUST], _column(THRUST, thrust, k)),
            (layout["parameter"], nan if parameters is None else self._by_name("parameters", parameters, k)),
            (layout.get("parameter_std", slice(0, 0)), nan if stds is None else self._parameter_stds(stds, k)),
            *self._inertial(inertial, k),
        ]
        mask = None
        if valid is not None:
            mask = checked_mask(valid, self._n, k if is_series(strain) else None)
            mask = np.broadcast_to(mask, (k, self._n))
        return Samples(
            strain=d,
            columns=tuple(column for column in columns if column[0].stop > column[0].start),
            mask=mask,
            inputs=np.empty((k, self._n_inputs)),
        )

    def _inertial(self, motion: Mapping[str, ArrayLike], samples: int) -> list[tuple[slice, Any]]:
        """Return the places of the inertial inputs and the values ``motion``, NaN of those that are not."""
        for name in motion:
            if name not in INERTIAL_NAMES:
                raise InputError(f"{name}: expected a quantity of a sample, such as {INERTIAL_NAMES[0]}")
            if not self._map.has_masses:
                raise InputError(f"{name}: expected none, the map was built without [mass]")
        return [(self._places[name], _column(name, motion.get(name, nan), samples)) for name in INERTIAL_NAMES]

    def _by_name(self, argument: str, stated: Mapping[str, ArrayLike], samples: int) -> FloatArray:
        """Return (samples, n_p) the values of flow parameters ``stated`` by name, NaN of those that are not."""
        names, known = self._parameters, ", ".join(self._parameters) or "none"
        values = np.full((samples, len(names)), nan)
        if not isinstance(stated, Mapping):
            raise InputError(f"{argument}: expected values by name, of the map's {known}, got {stated!r}")
        for name, value in stated.items():
            if name not in names:
                raise InputError(f"{argument}: expected the parameters of the map, {known}, got '{name}'")
            values[:, names.index(name)] = per_sample(name, value, samples)
        return values

    def _parameter_stds(self, stated: Mapping[str, ArrayLike], samples: int) -> FloatArray:
        stds = self._by_name("parameters_std", stated, samples)
        if np.any(stds < 0.0):
            raise InputError(f"parameters_std: expected numbers from 0 on, got {np.nanmin(stds):g}")
        return _exact(stds)

    def _temperatures(self, temperature: ArrayLike | None, samples: int) -> Any:
        """Return the readings of the temperature sensors [K], NaN of those that give none."""
        if temperature is None:
            return nan
        values, n_t = real_numbers(TEMPERATURE, temperature), self._map.thermal.n_sensors
        if np.size(values) and not self._map.has_temperature:
            raise InputError("temperature: expected none, the map was built without [temperature]")
        if values.shape not in ((n_t,), (samples, n_t)):
            raise InputError(f"temperature: expected ({n_t},) or ({samples}, {n_t}) values, got {values.shape}")
        return values


def _source_number(source: QSource | str | ArrayLike) -> Any:
    """Return the number of a source of the dynamic pressure, or the numbers of the sources of each sample."""
    if type(source) is QSource:
        return _SOURCES[source]
    if isinstance(source, str):
        if source.upper() not in QSource.__members__:
            raise InputError(f"{Q_SOURCE}: expected one of {', '.join(QSource.__members__)}, got '{source}'")
        return _SOURCES[QSource[source.upper()]]
    numbers = np.nan_to_num(real_numbers(Q_SOURCE, source))
    if not np.isin(numbers, list(_SOURCES.values())).all():
        raise InputError(f"{Q_SOURCE}: expected 0 to {max(QSource).value}, got {str(source)[:60]}")
    return float(numbers) if numbers.ndim == 0 else numbers


def split(
    dynamic_pressure: ArrayLike, inputs: SampleInputs
) -> tuple[tuple[Any, ...], tuple[Any, ...], ArrayLike | None]:
    """Return the air data in the order of a record, what else is known of the samples, and the sensors to use."""
    stated = {**_NOT_GIVEN, **inputs, DYNAMIC_PRESSURE: dynamic_pressure}
    stated[Q_SOURCE] = _source_number(stated[Q_SOURCE])
    inertial = {name: value for name, value in inputs.items() if name not in _NOT_GIVEN}
    return _air_of(stated), (*_more_of(stated), inertial), stated[VALID]


def checked_start(start: ArrayLike, samples: int) -> FloatArray:
    """Return flight states to start from, (samples, 4)."""
    states = np.asarray(start, dtype=float)
    if states.shape != (samples, 4) or not np.all(np.isfinite(states)):
        raise InputError(f"start: expected ({samples}, 4) finite numbers, got {states.shape}")
    return states


def _exact(stds: FloatArray) -> FloatArray:
    return np.where(stds == 0.0, EXACT, stds)


def _column(name: str, value: ArrayLike, samples: int) -> Any:
    """Return ``value`` of all samples, a number, or of each (samples, 1)."""
    if type(value) is float:
        return EXACT if name in _STDS and value == 0.0 else value
    values = per_sample(name, value, samples)[:, None]
    return _exact(values) if name in _STDS else values


def time_of(time: ArrayLike) -> float:
    """Return the ``time`` of one sample [s]."""
    return time if type(time) is float and isfinite(time) else float(times_of(time, 1)[0])


def times_of(time: ArrayLike, samples: int) -> FloatArray:
    """Return ``time``, one or one of each sample, as (samples,) [s]."""
    times = per_sample("time", time, samples)
    if not np.all(np.isfinite(times)):
        raise InputError(f"time: expected the time of each sample [s] for the filter, got {time!r}")
    return times


def refuse_without_altitude(total_temperature: ArrayLike, altitude: ArrayLike) -> None:
    """Refuse total temperatures without an altitude, from which the static one follows."""
    total, height = real_numbers(TOTAL_TEMPERATURE, total_temperature), real_numbers(ALTITUDE, altitude)
    if np.any(total > 0.0) and not np.any(height > 0.0):
        raise InputError(f"{TOTAL_TEMPERATURE}: expected the altitude with it, got none")
