"""Estimates of blocks of recorded samples: by a map or an FMU, filtered and smoothed or not, column by column."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from itertools import chain, pairwise
from math import isfinite
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.cosim.estimators.description import outputs_of
from strainfmu.cosim.estimators.fmu_step import SENSORS, TEMPERATURE, FmuStep
from strainfmu.cosim.estimators.source import is_fmu
from strainfmu.cosim.estimators.step import StepRefused
from strainfmu.cosim.estimators.zeros_file import load_zeros
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import (
    AIR_DATA_NAMES,
    AIR_DATA_UNITS,
    ALTITUDE,
    DYNAMIC_PRESSURE,
    INERTIAL_NAMES,
    MACH_NUMBER,
    NAVIGATION,
    NAVIGATION_INPUTS,
    Q_SOURCE,
    STATIC_PRESSURE,
    STD,
    QSource,
)
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import USABLE_STATES, HealthState, chi_square_limit
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.map.sensors import InertiaMap
from strainfmu.estimator.map.validity import PARAMETER_TOLERANCE
from strainfmu.estimator.other_loads import SIGMA, LoadArray, load_arrays
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.settings import default_settings
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY, FILTER_TIME_CONSTANT, NOT_KNOWN
from strainfmu.interface.health_names import (
    CHI_SQUARE,
    CHI_SQUARE_LIMIT,
    ENVELOPE_SCORE,
    STATE,
    SUSPECT_GAUGE,
    SUSPECTS,
    USABLE,
    VALID_GAUGES,
)
from strainfmu.interface.input_names import given_flow
from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX, PREFIX, STD_PREFIX
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST, reading_units
from strainfmu.recorded.names import FLOW_NAMES, QUANTITIES, Wanted
from strainfmu.recorded.outputs import (
    AIR_DATA,
    COEFFICIENT_COLUMNS,
    ENVELOPE_SCORE_LIMIT,
    HEALTH_COLUMNS,
    IDENTIFIED,
    LOAD_COLUMNS,
    RESIDUAL,
    RESIDUAL_LIMIT,
    USED,
    Column,
    other_outputs_of,
)
from strainfmu.recorded.samples import Samples
from strainfmu.recorded.strain_level import LevelReference
from strainfmu.recorded.table import BLOCK_ROWS

_FMU_HEALTH = (CHI_SQUARE_LIMIT, VALID_GAUGES, SUSPECT_GAUGE, SUSPECTS, ENVELOPE_SCORE)
"""Outputs of an FMU that state health, in addition to state and chi-square."""


_MISSING = (HealthState.DEGRADED, HealthState.UNIDENTIFIED, HealthState.INVALID)
_MISFIT = (HealthState.INCONSISTENT, HealthState.SUSPECT)
"""States by gauges that are missing, and by gauges that do not fit."""


class BlockEstimates(NamedTuple):
    """Estimates of n samples; NaN where there is none.

    Attributes
    ----------
    values : (n,) of each column by name: loads, coefficients, health, and ``other_columns`` of the estimator. An
        FMU does not state degrees of freedom; health of a step that it refused is NaN.
    suspects : n texts, gauges with a semicolon between them; of an ambiguous group an FMU names the first alone.
    worst : gauge with the largest |z|, and that |z|, of each sample whose health is not OK; none of an FMU.
    blamed : (n,) whether a gauge or an input is to blame for the health of a sample, by name.
    estimates : n estimates by a map, for their pressure; None of an FMU, and of smoothed ones.
    """

    values: Mapping[str, FloatArray]
    suspects: Sequence[str]
    worst: Sequence[tuple[str, float]]
    blamed: Mapping[str, BoolArray]
    estimates: Estimate | None = None


Check = Callable[[Samples, Samples | None], Samples]
"""Returns a block without its faults, by the one that follows; blocks come in order."""

Item = TypeVar("Item")


def _with_next(items: Iterable[Item]) -> Iterator[tuple[Item, Item | None]]:
    """Return each item with the one that follows, None behind the last."""
    return cast("Iterator[tuple[Item, Item | None]]", pairwise(chain(items, (None,))))


class BlockEstimator(ABC):
    """An estimator of blocks.

    Attributes
    ----------
    wanted : what it takes of a recording.
    inputs : quantities other than strain and q_inf that it takes.
    parameters, sharpening : flow parameters that it takes, and those whose standard deviation it takes.
    zero : (n_d,) zero offsets that it subtracts from strain [m/m].
    row_names : strain gauges, then auxiliary sensors.
    other_columns : names and units of its own columns of the output.
    attributes : what the output says of a filter: its time constant [s], smoothed or not.
    inverse_map : the map, None of an FMU.
    """

    wanted: Wanted
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    sharpening: tuple[str, ...]
    zero: FloatArray
    row_names: tuple[str, ...]
    other_columns: tuple[Column, ...]
    attributes: Mapping[str, float] = MappingProxyType({})
    inverse_map: InverseMap | None = None

    def _want(
        self,
        gauge_names: tuple[str, ...],
        units: Mapping[str, str],
        sensors: tuple[str, ...],
        reference: LevelReference,
    ) -> None:
        """State what is wanted of a recording; ``units`` of auxiliary sensors and of thrust by names of inputs."""
        readings, navigates = recorded_readings(units), STATIC_PRESSURE in self.inputs
        flow = (
            *FLOW_NAMES,
            *(NAVIGATION_INPUTS if navigates else (STATIC_PRESSURE,)),
            *(name for name in INERTIAL_NAMES if name in self.inputs),
            *self.parameters,
            *(f"{name}{STD}" for name in self.sharpening),
            *readings,
        )
        of_nonlinear = (*NAVIGATION_INPUTS, *(f"{name}{STD}" for name in self.parameters))
        self.row_names = (*gauge_names, *(name for name in readings if name != THRUST))
        self.wanted = Wanted(
            gauge_names=gauge_names,
            flow=flow,
            passed=(
                *(name for name in of_nonlinear if name not in flow and name.endswith(STD)),
                *(name for name in INERTIAL_NAMES if name not in flow),
            ),
            readings=readings,
            computes_pressure=True,
            navigates=navigates,
            reference=reference,
            sensors=sensors,
        )

    @abstractmethod
    def estimate(self, block: Samples, last: float) -> BlockEstimates:
        """Return the estimates of a block; ``last`` is the time before its first sample [s], NaN at the start."""

    def estimated(self, blocks: Iterable[Samples], check: Check) -> Iterator[tuple[Samples, BlockEstimates]]:
        """Yield each block as ``check`` returns it, with its estimates.

        A block is checked and estimated in another thread while the next one is read and the one before is
        written. Files are read and written by this thread alone: a caller may hold the lock of h5py, as in a loop
        over the items of a file.
        """
        last, before = float("nan"), deque[Future[tuple[Samples, BlockEstimates]]]()

        def work(block: Samples, following: Samples | None, last: float) -> tuple[Samples, BlockEstimates]:
            checked = check(block, following)
            return checked, self.estimate(checked, last)

        with ThreadPoolExecutor(1, "strainfmu-estimator") as worker:
            for block, following in _with_next(blocks):
                before.append(worker.submit(work, block, following, last))
                last = float(block.time[-1])
                if len(before) > 1:
                    yield before.popleft().result()
            yield from (future.result() for future in before)

    def _blamed(
        self,
        block: Samples,
        values: Mapping[str, FloatArray],
        gauges: BoolArray,
        contradicted: Mapping[str, BoolArray] = MappingProxyType({}),
    ) -> dict[str, BoolArray]:
        """Return (n,) whether a gauge or an input is to blame where health is not OK, by name.

        Gauges are to blame where they are missing, or do not fit: suspects, else the one of the largest residual.
        So is an input that contradicts the loads of INCONSISTENT samples, a quantity of navigation that is left
        out of DEGRADED ones, and a flow parameter that leaves its range of those OUTSIDE.

        Parameters
        ----------
        gauges : (n, n_d) gauges to blame.
        contradicted : (n,) whether an input contradicts the loads, by its name.
        """
        health = values[STATE]
        scores = {name: values[f"{OUTSIDE_PREFIX}{name}"] for name in self.parameters}
        dropped = dropped_navigation(block, values)
        blamed = {
            **{name: rows & (health == HealthState.INCONSISTENT) for name, rows in contradicted.items()},
            **dict(zip(self.row_names, gauges.T, strict=True)),
            **{name: rows & (health == HealthState.DEGRADED) for name, rows in dropped.items()},
            **{
                name: (score > PARAMETER_TOLERANCE) & (health == HealthState.OUTSIDE)
                for name, score in scores.items()
            },
        }
        return {name: rows for name, rows in blamed.items() if rows.any()}


def _missing(valid: BoolArray, health: FloatArray) -> BoolArray:
    """Return (n, n_d) gauges without a usable reading where health is by that; where all are none is to blame."""
    gauges = ~valid & np.isin(health, _MISSING)[:, None]
    gauges[gauges.all(axis=1)] = False
    return gauges


@contextmanager
def open_estimator(
    source: Path,
    zeros: Path | None = None,
    *,
    filter_seconds: float | None = None,
    smooth: bool = False,
    residuals: bool = False,
) -> Iterator[BlockEstimator]:
    """Load an estimator FMU or an inverse map, with the ``zeros`` of its gauges (zeros.toml); free it at the end.

    A map may have a filter of ``filter_seconds``, be ``smooth``, and give the ``residuals`` of all gauges.

    Raises
    ------
    InputError
        The file is missing, damaged, or neither; or an FMU or a linear map cannot do what is asked for.
    StrainfmuError
        The FMU cannot be loaded on this machine.
    """
    if smooth and filter_seconds is None:
        raise InputError("--smooth: expected with --filter, got it alone")
    if filter_seconds == 0.0:
        raise InputError("time_constant: expected the time constant of the filter [s], got 0")
    if not is_fmu(source):
        inverse_map = load_inverse_map(source)
        names = inverse_map.gauge_names[: inverse_map.n_strain_gauges]
        estimator = Estimator(inverse_map, zeros=None if zeros is None else load_zeros(zeros, names))
        yield MapBlocks(
            estimator if filter_seconds is None else estimator.filter(filter_seconds), residuals, smooth
        )
        return
    for option, value in {"--filter": filter_seconds, "--residuals": residuals or None}.items():
        if value is not None:
            raise InputError(f"{source}: {option}: expected an inverse map, got an FMU")
    extra = other_outputs_of(outputs_of(source))
    asked = (*(name for name, _ in LOAD_COLUMNS), *_FMU_HEALTH, *extra)
    scores = [name for name in extra if name.startswith(OUTSIDE_PREFIX)]
    parameters = (name.replace(OUTSIDE_PREFIX, kind, 1) for name in scores for kind in (PREFIX, STD_PREFIX))
    with FmuStep(source, (*QUANTITIES[1:], TEMPERATURE, SENSORS, *parameters), asked) as step:
        if zeros is not None:
            step.set_zeros(load_zeros(zeros, step.gauge_names))
        yield FmuBlocks(step, extra)


LATERAL_FORCES = {"specific_force_y": 2, "specific_force_z": 1}
"""Place among the five loads of the force that causes each specific force across the axis."""

OTHER_FORCES = 0.5
"""Part of the larger force by which a fin or a jet may part the lateral force from the vehicle's mass times f."""


def contradicted_forces(
    inertia: InertiaMap | None,
    inertial: Mapping[str, FloatArray],
    loads: FloatArray,
    loads_std: FloatArray,
    limit: float,
) -> dict[str, BoolArray]:
    """Return (m,) whether each specific force across the axis contradicts the lateral force F of m samples.

    It does where F - m f is beyond ``limit`` by its variance, as chi-square with one degree of freedom, and beyond
    :data:`OTHER_FORCES`: m f in g instead of m/s2, for one. None of them without a mass of the vehicle.

    Parameters
    ----------
    inertial : inertial inputs (m,) by name, NaN or :data:`NOT_KNOWN` where not known.
    loads, loads_std : (m, 5) [N, N m].
    """
    if inertia is None or inertia.vehicle_mass is None:
        return {}
    mass, contradicts = inertia.vehicle_mass, {}
    for (name, place), std in zip(LATERAL_FORCES.items(), inertia.sensor_std[1:3], strict=True):
        read = inertial[name]
        expected, force = mass * np.where(np.abs(read) <= POLICIES.largest_channel, read, np.nan), loads[:, place]
        off = np.abs(force - expected)
        is_large = off > OTHER_FORCES * np.maximum(np.abs(force), np.abs(expected))
        is_certain = off**2 > limit * ((mass * std) ** 2 + loads_std[:, place] ** 2)
        contradicts[name] = is_large & is_certain & (read != NOT_KNOWN)
    return contradicts


class MapBlocks(BlockEstimator):
    """An inverse map: a linear one estimates each sample by itself, a nonlinear or filtered one along time.

    Smoothed estimates are filtered from both ends, one block ahead.
    """

    inverse_map: InverseMap

    def __init__(self, estimator: Estimator, residuals: bool = False, smooth: bool = False) -> None:
        self.estimator, self._smooths = estimator, smooth
        self.inverse_map = inverse_map = estimator.inverse_map
        manifold, n = inverse_map.manifold, inverse_map.n_strain_gauges
        self.inputs = (
            *FLOW_NAMES[1:],
            *(NAVIGATION_INPUTS if estimator.is_nonlinear else ()),
            *(INERTIAL_NAMES if inverse_map.has_masses else ()),
        )
        self.parameters = estimator.parameters.names
        self.sharpening = self.parameters if manifold is not None and manifold.parameters is not None else ()
        self._series = _series(estimator, residuals)
        self.other_columns = tuple(column for columns, _ in self._series[3:] for column in columns)
        self.zero = estimator.zeros.value
        if estimator.filter_time_constant:
            self.attributes = {FILTER_TIME_CONSTANT: estimator.filter_time_constant, "smoothed": smooth}
        low, high = inverse_map.dynamic_pressure_range.tolist()
        reference = LevelReference(
            strain_range=inverse_map.strain_range[:n],
            noise_std=inverse_map.noise_std[:n],
            dynamic_pressure=inverse_map.nominal_dynamic_pressure,
            sensor_range=default_settings(inverse_map).sensor_range,
            pressure_range=(low, high) if isfinite(high) else None,
        )
        sensors = inverse_map.thermal.sensor_names
        self._want(tuple(inverse_map.gauge_names[:n]), reading_units(inverse_map), sensors, reference)

    def estimate(self, block: Samples, last: float) -> BlockEstimates:
        return self._block_estimates(block, self.estimates(block))

    def estimated(self, blocks: Iterable[Samples], check: Check) -> Iterator[tuple[Samples, BlockEstimates]]:
        """Yield each block with its estimates, smoothed ones with loads and air data by those that follow too."""
        if not self._smooths:
            yield from super().estimated(blocks, check)
            return
        checked = (check(block, following) for block, following in _with_next(blocks))
        first = range(0, BLOCK_ROWS, SMOOTHED_ROWS)
        parts = (block[k : k + SMOOTHED_ROWS] for block in checked for k in first if k < len(block.time))
        alone, backward = (self.estimator.filter(t) for t in (0.0, self.estimator.filter_time_constant))

        def estimated(block: Samples) -> Filtered:
            filtered = self.estimates(block)
            return block.time, filtered, alone.track_again(filtered.sample, filtered.mask, block.time)

        for (block, samples), following in _with_next((part, estimated(part)) for part in parts):
            loads = smoothed(backward, samples, None if following is None else following[1])
            yield block, self._block_estimates(block, samples[1], loads)

    def _block_estimates(self, block: Samples, estimate: Estimate, smoothed_loads: Any = None) -> BlockEstimates:
        """Return the estimates of a block as such, with ``smoothed_loads`` and air data or its own.

        Gauges are looked at in the samples alone whose health is not OK, with which they take twice the time.
        """
        n, loads = len(estimate), smoothed_loads or estimate
        # Columns of a record lie apart; each is read many times from here on.
        series = np.array([column for _, of in self._series for column in of(estimate, loads)], dtype=float)
        values = dict(zip((name for columns, _ in self._series for name, _ in columns), series, strict=True))
        estimates = None if smoothed_loads is not None else estimate
        rows = np.flatnonzero(estimate.health != HealthState.OK)
        suspects, worst = [""] * n, list[tuple[str, float]]()
        if not len(rows):
            return BlockEstimates(values, suspects, worst, {}, estimates)
        part, gauges = estimate[rows], np.zeros((n, len(self.row_names)), dtype=bool)
        gauges[rows] = _missing(part.valid, part.health)
        residual = np.abs(part.standardised_residual)
        largest, sizes = np.argmax(residual, axis=1).tolist(), np.max(residual, axis=1).tolist()
        worst += ((self.row_names[gauge], size) for gauge, size in zip(largest, sizes, strict=True))
        for row, of_row, gauge, health in zip(
            rows.tolist(), part.suspects, largest, part.health.tolist(), strict=True
        ):
            suspects[row] = ";".join([self.row_names[suspect] for suspect in of_row])
            if health in _MISFIT:
                gauges[row, list(of_row or (gauge,))] = True
        contradicted = contradicted_forces(
            self.inverse_map.inertia,
            block.values([*LATERAL_FORCES]),
            estimate.loads,
            estimate.loads_std,
            self.estimator.settings.alarm_scale * chi_square_limit(1),
        )
        blamed = self._blamed(block, values, gauges, contradicted)
        return BlockEstimates(values, suspects, worst, blamed, estimates)

    def unfiltered(self, block: Samples) -> Estimate:
        """Return the estimates of a block without a filter."""
        return MapBlocks(self.estimator.filter(0.0)).estimates(block)

    def estimates(self, block: Samples) -> Estimate:
        """Return the estimates of a block; thrust that the recording does not hold is 0."""
        flow, readings = block.flow, block.strain
        thrust = flow.get(THRUST, np.zeros(len(block.time)))
        if len(self.row_names) > self.inverse_map.n_strain_gauges:
            readings = np.hstack([block.strain, _all_readings(block, self.wanted.readings)])
        sharpening = {name: flow[f"{name}{STD}"] for name in self.sharpening if f"{name}{STD}" in flow}
        arguments: dict[str, Any] = {
            DYNAMIC_PRESSURE: block.dynamic_pressure,
            TEMPERATURE: _temperature(block, self.wanted),
            "parameters": {name: flow[name] for name in self.parameters if name in flow},
            "parameters_std": given_flow(sharpening) if self.sharpening else None,
            **given_flow({name: flow[name] for name in QUANTITIES[1:] if name in flow}),
        }
        readings = self.inverse_map.sensors.without_thrust(readings, thrust)
        if self.estimator.filter_time_constant > 0.0:
            return self.estimator.track(readings, time=block.time, **arguments)
        estimate = self.estimator.track if self.estimator.is_nonlinear else self.estimator.estimate
        return estimate(readings, **arguments)


class FmuBlocks(BlockEstimator):
    """An estimator FMU, step by step."""

    def __init__(self, step: FmuStep, extra: Mapping[str, Column]) -> None:
        self._step, self._others = step, extra
        self.other_columns, self.inputs, self.zero = tuple(extra.values()), step.other_inputs, step.zero_offset
        parameters = (name for name in step.other_inputs if name.startswith(PREFIX))
        self.parameters = tuple(name.removeprefix(PREFIX) for name in parameters)
        self.sharpening = tuple(name for name in self.parameters if f"{STD_PREFIX}{name}" in self.inputs)
        reference = LevelReference(
            strain_range=step.strain_nominal,
            noise_std=np.zeros(step.n_gauges) if step.noise_std is None else step.noise_std,
            dynamic_pressure=step.pressure_nominal,
            sensor_range=step.sensor_range,
        )
        self._want(step.gauge_names, step.reading_units, step.sensor_names, reference)
        self._columns = {
            **{name: name for name in QUANTITIES[1:] if name in self.inputs},
            **{f"{PREFIX}{name}": name for name in self.parameters},
            **{f"{STD_PREFIX}{name}": f"{name}{STD}" for name in self.sharpening},
            **dict(zip(step.reading_units, self.wanted.readings, strict=True)),
        }

    def estimate(self, block: Samples, last: float) -> BlockEstimates:
        first = (*(name for name, _ in COEFFICIENT_COLUMNS), CHI_SQUARE, STATE)
        loads = tuple(name for name, _ in LOAD_COLUMNS)
        asked, n = (*loads, *_FMU_HEALTH, *self._others), len(block.time)
        table, unknown = np.full((n, len(first) + len(asked)), np.nan), np.full(n, np.nan)
        inputs = {
            name: block.flow[column].tolist() for name, column in self._columns.items() if column in block.flow
        }
        if (temperature := _temperature(block, self.wanted)) is not None:
            inputs |= zip(self.wanted.temperatures, temperature.T.tolist(), strict=True)
        # The first sample has no predecessor.
        first_step = float(block.time[1] - block.time[0]) if n > 1 else 1e-3
        step_sizes = np.diff(block.time, prepend=last if np.isfinite(last) else block.time[0] - first_step)
        for i, step_size in enumerate(step_sizes.tolist()):
            of_sample = {name: values[i] for name, values in inputs.items()}
            try:
                result = self._step(block.strain[i], float(block.dynamic_pressure[i]), step_size, **of_sample)
            except StepRefused:
                continue
            of_loads = *result.coefficients, *result.coefficients_std, result.chi_square, result.health
            table[i] = *of_loads, *(result.other_outputs.get(name, np.nan) for name in asked)
        outputs = dict(zip((*first, *asked), table.T, strict=True))
        has_reading = np.isfinite(_all_readings(block, self.wanted.readings))
        valid = np.hstack([np.abs(block.strain) <= self._step.sensor_range, has_reading])
        used, health = outputs[VALID_GAUGES], outputs[STATE]
        values = {
            **{name: outputs[name] for name in (*loads, *first, CHI_SQUARE_LIMIT, SUSPECTS, ENVELOPE_SCORE)},
            "gauges_used": np.where(np.isfinite(used), used, valid.sum(axis=1)),
            "health.degrees_of_freedom": unknown,
            ENVELOPE_SCORE_LIMIT: unknown,
            USABLE: np.where(np.isnan(health), np.nan, np.isin(health, USABLE_STATES)),
            **{column: outputs[name] for name, (column, _) in self._others.items()},
        }
        suspect = np.nan_to_num(outputs[SUSPECT_GAUGE]).astype(int) - 1
        suspects = [self.row_names[gauge] if gauge >= 0 else "" for gauge in suspect.tolist()]
        rows = np.flatnonzero(np.isin(health, _MISFIT) & (suspect >= 0))
        gauges = _missing(valid, health)
        gauges[rows, suspect[rows]] = True
        return BlockEstimates(values, suspects, (), self._blamed(block, values, gauges))


def _all_readings(block: Samples, readings: Mapping[str, str]) -> FloatArray:
    """Return (n, n_s) what the auxiliary sensors read, NaN of one that the recording does not hold."""
    columns = [*block.values([name for name in readings if name != THRUST]).values()]
    return np.column_stack(columns) if columns else np.empty((len(block.time), 0))


def _temperature(block: Samples, wanted: Wanted) -> FloatArray | None:
    """Return (n, n_t) what the temperature sensors read [K], NaN where one gives none; None without any."""
    if block.flow.keys().isdisjoint(wanted.temperatures):
        return None
    return np.column_stack([*block.values([*wanted.temperatures]).values()])


# --- smoothing: the filter from both ends ------------------------------------------------------------------------
#
# The filter averages each sample with the samples before it, and, over the samples in reverse, with the samples
# behind it. Both averages hold the sample itself. With the parts f and g of the variance of its noise that they
# leave, the one with each sample once is
#
#     h (forward / f + backward / g - alone),    1 / h = 1 / f + 1 / g - 1,
#
# and leaves the part h. What lasts is not averaged.

_ROLL_ANGLE = AIR_DATA_NAMES.index("wind_roll_angle")

SMOOTHED_ROWS = 2000
"""Samples that are smoothed at once, with as many that follow."""

Filtered = tuple[FloatArray, Estimate, Estimate]
"""Successive samples: times (k,) [s], estimates with a filter, and of each alone."""


def smoothed(backward: Estimator, samples: Filtered, later: Filtered | None) -> SimpleNamespace:
    """Return loads, coefficients and air data of ``samples``, which a filter as ``backward`` has estimated.

    Their names are the fields of :class:`~strainfmu.estimator.estimate.Estimate`. ``later`` are the samples that
    follow, None at the end.
    """
    both = [samples] if later is None else [samples, later]
    time = np.concatenate([times for times, *_ in both])
    inputs = np.concatenate([filtered.sample for _, filtered, _ in both])
    masks = [
        np.broadcast_to(True if filtered.mask is None else filtered.mask, filtered.valid.shape)
        for _, filtered, _ in both
    ]
    backward.restart()
    reverse = backward.track_again(inputs[::-1], np.concatenate(masks)[::-1], -time[::-1])
    times, filtered, alone = samples
    ends = filtered, reverse[np.arange(len(time))[::-1][: len(times)]], alone
    remaining = [estimates.noise_left[:, None] for estimates in ends[:2]]
    fields = SimpleNamespace()
    for name in ("loads", COEFFICIENT_ARRAY, "other_loads", "other_coefficients"):
        of_ends = [(getattr(estimates, name), getattr(estimates, f"{name}_std")) for estimates in ends]
        value, std = _joined(remaining, of_ends)
        setattr(fields, name, value)
        setattr(fields, f"{name}_std", std)
    air, near = [estimates.air_data for estimates in ends], list[tuple[FloatArray, FloatArray]]()
    for of_end in air:
        # Roll angles on the turn of the sample alone: they may leave -pi to pi by less than noise.
        value = of_end.value.copy()
        apart = np.nan_to_num(value[:, _ROLL_ANGLE] - air[2].value[:, _ROLL_ANGLE])
        value[:, _ROLL_ANGLE] -= 2.0 * np.pi * np.round(apart / (2.0 * np.pi))
        near.append((value, of_end.std))
    value, std = _joined(remaining, near)
    fields.air_data = SimpleNamespace(value=value, std=std)
    return fields


def _joined(
    noise_left: Sequence[FloatArray], ends: Sequence[tuple[FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """Return values (k, n) and standard deviations from both ends; ``noise_left`` (k, 1) parts of either.

    ``ends`` are those forward, backward and of the samples alone. Where a sample alone gives none, the end that is
    more certain does.
    """
    (forward, forward_std), (backward, backward_std), (alone, alone_std) = ends
    forward_left, backward_left = noise_left
    remaining = 1.0 / (1.0 / forward_left + 1.0 / backward_left - 1.0)
    value = remaining * (forward / forward_left + backward / backward_left - alone)
    nearer = forward_left <= backward_left
    least = np.where(nearer, forward_left, backward_left)
    averaged = alone_std**2 - np.where(nearer, forward_std, backward_std) ** 2
    noise = np.maximum(averaged, 0.0) / np.where(least < 1.0, 1.0 - least, 1.0)
    std = np.sqrt(np.maximum(alone_std**2 - noise * (1.0 - remaining), 0.0))
    coasts = np.isnan(alone)
    takes_backward = coasts & ~(forward_std <= backward_std)
    value = np.where(coasts, np.where(takes_backward, backward, forward), value)
    return value, np.where(coasts, np.where(takes_backward, backward_std, forward_std), std)


# --- columns -----------------------------------------------------------------------------------------------------


Series = tuple[Sequence[Column], Callable[[Estimate, Any], Iterable[Any]]]
"""Columns, and what returns their values (n,) of estimates, and of the same or smoothed ones."""


def _columns(prefix: str, names: Sequence[str], units: Sequence[str] = ()) -> list[Column]:
    return [(f"{prefix}{name}", unit) for name, unit in zip(names, units or ["1"] * len(names), strict=True)]


def _series(estimator: Estimator, residuals: bool) -> list[Series]:
    """Return the five loads, coefficients, health, air data, loads behind the five and scores of flow parameters
    ahead of their sigma; last the ``residuals`` of all gauges, behind the alarm level of the largest."""
    inverse_map = estimator.inverse_map
    series: list[Series] = [
        (LOAD_COLUMNS, lambda _, loads: [*loads.loads.T, *loads.loads_std.T]),
        (COEFFICIENT_COLUMNS, lambda _, loads: [*loads.coefficients.T, *loads.coefficients_std.T]),
        (
            HEALTH_COLUMNS,
            lambda estimate, _: [
                *(estimate.chi_square, estimate.health, estimate.valid_gauges, estimate.chi_square_limit),
                *(estimate.degrees_of_freedom, estimate.suspect_count, estimate.envelope_score),
                *(np.full(len(estimate), inverse_map.outside_score), estimate.usable),
            ],
        ),
    ]
    if estimator.is_nonlinear:
        air = AIR_DATA_NAMES, AIR_DATA_UNITS
        series += [
            (_columns(AIR_DATA, *air), lambda _, loads: loads.air_data.value.T),
            (_columns(f"{SIGMA}{AIR_DATA}", *air), lambda _, loads: loads.air_data.std.T),
            (_columns(IDENTIFIED, AIR_DATA_NAMES), lambda estimate, _: estimate.air_data.is_identified.T),
            (_columns(USED, NAVIGATION), lambda estimate, _: estimate.air_data_used.T),
            (_columns("", ["linear_loads"]), lambda estimate, _: [estimate.is_linear]),
        ]
    arrays = load_arrays(inverse_map.load_groups) if inverse_map.has_other_loads else ()
    series += [_load_series(array) for array in arrays if not array.is_std]
    scores = _columns(OUTSIDE_PREFIX, estimator.parameters.names)
    series += [(scores, lambda estimate, _: estimate.parameter_score.T)]
    series += [_load_series(array) for array in arrays if array.is_std]
    if residuals:
        of_gauges = _columns(RESIDUAL, inverse_map.gauge_names)
        series += [(_columns("", [RESIDUAL_LIMIT]), lambda estimate, _: [estimate.residual_limit])]
        series += [(of_gauges, lambda estimate, _: estimate.standardised_residual.T)]
    return series


def _load_series(array: LoadArray) -> Series:
    """Return the columns of an array of loads behind the five."""
    field = f"other_{COEFFICIENT_ARRAY if array.is_coefficient else 'loads'}{'_std' if array.is_std else ''}"
    columns = _columns("", array.columns, [array.unit.replace(".", " ")] * len(array.columns))
    return columns, lambda _, loads: getattr(loads, field)[..., array.group.rows].T


def recorded_readings(units: Mapping[str, str]) -> dict[str, str]:
    """Return the units of auxiliary sensors and of thrust by the names of columns, inputs less the prefix."""
    return {name.removeprefix(SENSOR_PREFIX): unit for name, unit in units.items()}


def dropped_navigation(block: Samples, values: Mapping[str, FloatArray]) -> dict[str, BoolArray]:
    """Return (n,) whether each quantity of navigation is given and not used, by its name; {} of a linear map.

    A computed dynamic pressure is none. ``values`` are of :class:`BlockEstimates`.
    """
    used = {name: values[column] for name in NAVIGATION if (column := f"{USED}{name}") in values}
    if NAVIGATION[0] not in used:
        return {}
    flow = block.values((*NAVIGATION, ALTITUDE, Q_SOURCE))
    is_given = {name: ~np.isnan(flow[name]) for name in NAVIGATION}
    is_given[STATIC_PRESSURE] |= ~np.isnan(flow[ALTITUDE])
    source = np.nan_to_num(flow[Q_SOURCE])
    is_measured = np.round(source) == QSource.INDEPENDENT
    is_given[DYNAMIC_PRESSURE] &= np.where(source < 0.5, ~is_given[MACH_NUMBER], is_measured)
    return {name: is_given[name] & ~(column > 0.0) for name, column in used.items()}
