"""The linear estimator in numpy behind the interface of :class:`~strainfmu.estimator.core.Core`.

An oracle of the compiled core: the reference estimates; here are
settings, and the rules of health. It has no filter and no tables, and names the worst gauge alone as a suspect.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, static_pressure_at
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import (
    AIR_INPUT_NAMES,
    FLOW_QUANTITIES,
    INERTIAL_NAMES,
    MACH_NUMBER,
    STD,
    VIBRATION,
)
from strainfmu.estimator.core import Layout, NoCoreError, Series
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.health import (
    FALSE_ALARM_PROBABILITY,
    USABLE_STATES,
    HealthState,
    chi_square_limit,
    outlier_threshold,
)
from strainfmu.estimator.map.inverse_map import InverseMap, groups_of_outputs
from strainfmu.estimator.map.sensors import readings_of_modes, vibration_ratio, with_vibration
from strainfmu.estimator.map.validity import (
    LARGEST_SCORE,
    MACH_TOLERANCE,
    MAX_DYNAMIC_PRESSURE,
    MIN_DYNAMIC_PRESSURE,
    PARAMETER_TOLERANCE,
    PRESSURE_TOLERANCE,
    FlowParameters,
    flow_parameters,
    incidence_per_force,
)
from strainfmu.estimator.other_loads import FIVE_LOADS, OTHER_LOADS
from strainfmu.estimator.policies import MIN_INFORMATION
from strainfmu.estimator.reference.air import air_of, linear_pressure_std, measured_directions
from strainfmu.estimator.reference.linear import LinearEstimate, estimate
from strainfmu.estimator.reference.readings import amplitudes, row_noise, rows_of
from strainfmu.estimator.settings import (
    OF_ALARMS,
    OF_AREA,
    OF_LENGTH,
    OF_READINGS,
    OF_STATION,
    SETTING_NAMES,
    EstimatorSettings,
    default_settings,
)
from strainfmu.estimator.signal_names import (
    COEFFICIENT_ARRAY,
    FILTER_TIME_CONSTANT,
    STRAIN,
    TEMPERATURE,
    THRUST,
    VALID,
    ZERO,
    ZERO_COMMON_STD,
    ZERO_STD,
)
from strainfmu.recorded.estimators import contradicted_forces

RANGE_DEVIATIONS = 3.0
"""Stated standard deviations by which M may leave its range in addition, and of q_inf behind the next entry."""

LEAST_PART_OF_SLOPE = 0.8
"""Of the smallest incidence per lateral force over that at the largest incidence: curves over Mach number and roll
angle differ."""


class _Flow(NamedTuple):
    """Dynamic pressure and its standard deviation [Pa], whether they give coefficients, whether the flow is
    outside of the map (k,) each, the part of its range by which each parameter leaves it (k, n_p), and all air
    data by name."""

    pressure: FloatArray
    std: FloatArray
    known: BoolArray
    is_outside: BoolArray
    score: FloatArray
    air: Mapping[str, FloatArray]


class NumpyCore:
    """The linear estimator of one map; attributes as in :class:`~strainfmu.estimator.core.Core`."""

    def __init__(self, inverse_map: InverseMap, resource: bytes) -> None:
        """Prepare ``inverse_map``.

        Raises
        ------
        NoCoreError
            The map has tables: the nonlinear estimator needs the compiled core.
        """
        if inverse_map.manifold is not None:
            raise NoCoreError("the nonlinear estimator needs the compiled core")
        self.resource, self._map = resource, inverse_map
        n, n_strains = inverse_map.n_gauges, inverse_map.n_strain_gauges
        n_t, has_thrust = inverse_map.thermal.n_sensors, inverse_map.sensors.follows_thrust.any()
        m = inverse_map.n_loads - FIVE_LOADS.stop if groups_of_outputs(inverse_map) else 0
        n_p = len(flow_parameters(inverse_map).names)
        self.n_rows = n
        self.inputs = _layout(
            {STRAIN: n_strains, "sensor": n - n_strains}
            | dict.fromkeys(AIR_INPUT_NAMES, 1)
            | {TEMPERATURE: n_t, THRUST: int(has_thrust), "parameter": n_p}
            | dict.fromkeys(INERTIAL_NAMES, int(inverse_map.has_masses))
        )
        of_zeros = {ZERO: n_strains, ZERO_STD: n_strains, ZERO_COMMON_STD: 1, FILTER_TIME_CONSTANT: 0}
        self.settings = _layout(dict.fromkeys(SETTING_NAMES, 1) | of_zeros)
        vectors = (COEFFICIENT_ARRAY, "coefficients_std", "loads", "loads_std")
        of_health = ("health", "chi_square", "chi_square_limit", "valid_gauges", "suspect_gauge", "suspects")
        more = ("other_loads", "other_loads_std", "other_coefficients", "other_coefficients_std")
        self.outputs = _layout(
            dict.fromkeys(vectors, 5)
            | dict.fromkeys((*of_health, "envelope_score", "degrees_of_freedom", "iterations"), 1)
            | dict.fromkeys(("air_data", "air_data_std", "is_identified", "air_data_used", "is_linear"), 0)
            | dict.fromkeys(more, m)
            | {"parameter_score": n_p, "usable": 1, "load_factor": 0}
        )
        self.n_inputs, self.n_outputs = _size(self.inputs), _size(self.outputs)
        self.fit = _layout(
            {"load_covariance": 25, "coefficient_covariance": 25, "fits": 1}
            | {"state": 4, "state_covariance": 16, "air_data_residual": 3, "discrepancy_chi_square": 1}
            | {"residual_limit": 1, "noise_left": 1, "standardised_residual": n, VALID: n, "is_suspect": n},
            self.n_outputs,
        )
        self.n_fit = _size(self.fit) - self.n_outputs
        self.sample = np.full(self.n_inputs, np.nan)
        self._values = np.zeros(_size(self.settings))
        settings = default_settings(inverse_map)
        self._values[: len(SETTING_NAMES)] = [getattr(settings, name) for name in SETTING_NAMES]
        self._values[self.settings[ZERO]] = inverse_map.zero_offset[: inverse_map.n_strain_gauges]

    def copy(self) -> NumpyCore:
        """Return another one of the same map with the same settings."""
        duplicate = NumpyCore(self._map, self.resource)
        duplicate.set(0, self._values)
        return duplicate

    def renew(self) -> None:
        """Nothing to do: matrices follow with every call."""

    def set(self, first: int, values: FloatArray) -> None:
        """Set the settings from place ``first`` on; raises InputError for a value that is not allowed."""
        all_values = self._values.copy()
        all_values[first : first + len(values)] = values
        zero, std, common = (all_values[self.settings[name]] for name in (ZERO, ZERO_STD, ZERO_COMMON_STD))
        EstimatorSettings(**{name: float(all_values[self.settings[name].start]) for name in SETTING_NAMES})
        GaugeZeros(value=zero, std=std, common_std=float(common[0]))
        self._values = all_values

    def get(self, first: int, count: int) -> FloatArray:
        """Return ``count`` settings from place ``first`` on."""
        return self._values[first : first + count].copy()

    def step(
        self,
        time: float,
        how: Series,
        with_fit: bool,
        mask: BoolArray | None = None,
        start: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the record of the one sample in :attr:`sample`, and a copy of the sample; it has no start."""
        of_one = None if mask is None else mask[None]
        return self.series(how, self.sample[None], with_fit=with_fit, mask=of_one)[0], self.sample.copy()

    def series(
        self,
        how: Series,
        inputs: FloatArray,
        *,
        with_fit: bool = False,
        time: FloatArray | None = None,
        mask: BoolArray | None = None,
        start: FloatArray | None = None,
        out: FloatArray | None = None,
    ) -> FloatArray:
        """Return the records (k, n) of k samples; arguments as of the compiled core."""
        layout = {**self.outputs, **self.fit} if with_fit else self.outputs
        record = np.full((len(inputs), self.n_outputs + (self.n_fit if with_fit else 0)), np.nan)
        for name, values in self._estimates(inputs, mask).items():
            if name in layout:
                record[:, layout[name]] = values.reshape(len(record), -1)
        if out is None:
            return record
        out[:] = record
        return out

    def _setting(self, name: str) -> FloatArray:
        return self._values[self.settings[name]]

    def _estimates(self, inputs: FloatArray, mask: BoolArray | None) -> dict[str, FloatArray]:
        """Return the fields of the samples ``inputs`` by name."""
        inverse_map, k, n = self._map, len(inputs), self.n_rows
        by_name = {name: inputs[:, place] for name, place in self.inputs.items()}
        readings = inputs[:, :n]
        if by_name[THRUST].shape[1]:
            readings = inverse_map.sensors.without_thrust(readings, by_name[THRUST][:, 0])
        flow = self._flow(by_name)
        used = self._used(readings, mask, flow)
        outputs = self._nothing(k, used)
        zeros = GaugeZeros(
            value=self._setting(ZERO),
            std=self._setting(ZERO_STD),
            common_std=float(self._setting(ZERO_COMMON_STD)[0]),
        )
        inertial = {name: by_name[name][:, 0] for name in INERTIAL_NAMES if inverse_map.has_masses}
        theta, read = readings_of_modes(inverse_map.thermal, inverse_map.inertia, by_name[TEMPERATURE], inertial)
        vibration = inertial[VIBRATION] if inverse_map.has_masses else np.full(k, np.nan)
        ratio = vibration_ratio(inverse_map.inertia, vibration)
        key = np.hstack([used, read, np.isfinite(ratio)[:, None], np.nan_to_num(ratio)[:, None]])
        for pattern in np.unique(key, axis=0):
            samples = np.flatnonzero((key == pattern).all(axis=1))
            known, amplitude, unknown = pattern[n:-2] != 0.0, None, None
            if known.any() or pattern[-2]:
                modes = with_vibration(
                    inverse_map.thermal_and_inertia, inverse_map.inertia, float(ratio[samples[0]])
                )
                of_sensors = amplitudes(modes, theta[samples], known)
                amplitude, unknown = of_sensors.mean, of_sensors.covariance[0]
            rows = rows_of(inverse_map, readings[samples], np.zeros(len(samples)), zeros, amplitude)
            noise = row_noise(inverse_map, inverse_map.gauge_covariance, zeros, unknown)
            self._fill(outputs, samples, rows, pattern[:n] != 0.0, noise=noise, flow=flow)
        more = (np.nan_to_num(ratio) > 1.0) & (outputs["health"][:, 0] == HealthState.OK)
        outputs["health"][more, 0] = HealthState.DEGRADED
        limit = float(self._setting(OF_ALARMS)[0]) * chi_square_limit(1)
        judged = np.isin(outputs["health"][:, 0], (*USABLE_STATES, HealthState.SUSPECT))
        for off in contradicted_forces(
            inverse_map.inertia, inertial, outputs["loads"], outputs["loads_std"], limit
        ).values():
            outputs["health"][off & judged, 0] = HealthState.INCONSISTENT
        outputs["usable"][:, 0] = np.isin(outputs["health"][:, 0], USABLE_STATES)
        return outputs

    def _flow(self, inputs: Mapping[str, FloatArray]) -> _Flow:
        """Return what is given of the flow."""
        air = air_of(inputs)
        q, mach, altitude = (air[name] for name in FLOW_QUANTITIES)
        std = linear_pressure_std(air, self._map.dynamic_pressure_error)
        usable = (q >= MIN_DYNAMIC_PRESSURE) & (q <= MAX_DYNAMIC_PRESSURE)
        known = usable & (std >= 0.0) & (std < np.inf)
        std = np.where(known, std, 0.0)
        is_outside = _outside_by_navigation(
            self._map,
            dynamic_pressure=q,
            dynamic_pressure_std=std,
            mach_number=mach,
            mach_number_std=np.where(np.isnan(mach_std := air[MACH_NUMBER + STD]), 0.0, mach_std),
            altitude=altitude,
        )
        parameters = flow_parameters(self._map)
        score = _parameter_score(parameters, inputs["parameter"]) if parameters.names else np.zeros((len(q), 0))
        is_outside |= np.any(score > PARAMETER_TOLERANCE, axis=1)
        return _Flow(q, std, known, is_outside, score, air)

    def _used(self, readings: FloatArray, mask: BoolArray | None, flow: _Flow) -> BoolArray:
        """Return (k, n_d) the sensors in use: in range, in ``mask``, and not all exactly 0 in a flow."""
        sensors, strain = self._map.sensors, float(self._setting(OF_READINGS)[0])
        largest = np.where(sensors.is_strain, strain, sensors.largest)
        used: BoolArray = np.abs(readings) <= largest  # false for NaN
        if mask is not None:
            used &= mask
        flows = flow.pressure >= MIN_DYNAMIC_PRESSURE
        used[_silent(readings, used, self._map.n_strain_gauges) & flows] = False
        return used

    def _nothing(self, k: int, used: BoolArray) -> dict[str, FloatArray]:
        """Return the fields of samples without an estimate."""
        places = {**self.outputs, **self.fit}
        outputs = {name: np.full((k, place.stop - place.start), np.nan) for name, place in places.items()}
        for name in ("suspect_gauge", "suspects", "degrees_of_freedom", "iterations", "fits", "is_suspect"):
            outputs[name][:] = 0.0
        outputs["chi_square"][:] = outputs["envelope_score"][:] = 0.0
        limit = self._map.chi_square_scale * chi_square_limit(self._map.residual_degrees_of_freedom)
        outputs["chi_square_limit"][:] = float(self._setting(OF_ALARMS)[0]) * limit
        outputs[VALID][:], outputs["valid_gauges"][:, 0] = used, used.sum(axis=1)
        outputs["noise_left"][:] = 1.0
        outputs["health"][:, 0] = np.where(used.any(axis=1), HealthState.UNIDENTIFIED, HealthState.INVALID)
        return outputs

    def _fill(
        self,
        outputs: dict[str, FloatArray],
        samples: IntArray,
        rows: FloatArray,
        used: BoolArray,
        *,
        noise: FloatArray,
        flow: _Flow,
    ) -> None:
        """Fill in ``samples``, whose ``rows`` have the same sensors in use."""
        inverse_map = self._map
        outputs["parameter_score"][samples] = flow.score[samples]
        if not used.any() or not _identifies(inverse_map, noise, used):
            return
        known, q_std = flow.known[samples], flow.std[samples]
        q = np.where(known, flow.pressure[samples], inverse_map.nominal_dynamic_pressure)
        of_map = estimate(inverse_map, rows, used, q, q_std, noise)
        rise = 1.0 + inverse_map.level_slope * (of_map.expected_ratio - 1.0) if inverse_map.level_slope else 1.0
        scale = float(self._setting(OF_ALARMS)[0]) * (of_map.expected_ratio * rise)
        freedom = int(of_map.degrees_of_freedom[0])
        limit = inverse_map.chi_square_scale * scale * (chi_square_limit(freedom) if freedom > 0 else np.inf)
        level = outlier_threshold(int(used.sum()), FALSE_ALARM_PROBABILITY)
        threshold = level * np.sqrt(inverse_map.outlier_scale * scale)
        z, chi_square = of_map.standardised, of_map.chi_square
        worst = np.argmax(np.abs(z), axis=1)
        suspicious = np.abs(z[np.arange(len(z)), worst]) > threshold
        five = FIVE_LOADS
        covariance = of_map.coefficient_covariance[:, five, five]
        score = _envelope_score(inverse_map, of_map.coefficients[:, five], covariance)
        health = np.full(len(q), HealthState.OK if used.all() else HealthState.DEGRADED)
        # The later takes the place of the earlier.
        health[score > inverse_map.envelope_score_limit] = HealthState.OUTSIDE
        health[suspicious] = HealthState.SUSPECT
        of_force = slice(1, 3)
        found_std = np.sqrt(np.diagonal(of_map.coefficient_covariance, axis1=1, axis2=2))
        health[
            angles_contradict(
                {name: values[samples] for name, values in flow.air.items()},
                slope=LEAST_PART_OF_SLOPE * incidence_per_force(inverse_map),
                force=of_map.coefficients[:, of_force],
                force_std=found_std[:, of_force],
                limit=float(self._setting(OF_ALARMS)[0]) * chi_square_limit(1),
            )
        ] = HealthState.INCONSISTENT
        health[chi_square > limit] = HealthState.INCONSISTENT
        health[flow.is_outside[samples]] = HealthState.OUTSIDE
        health[~known] = HealthState.NO_COEFFICIENTS
        outputs["health"][samples, 0] = health

        needs_pressure = inverse_map.follows_pressure
        usable = known if needs_pressure else np.ones(len(q), dtype=bool)
        usable_samples, loads = samples[usable], self._loads(of_map)
        for name, values in loads.items():
            of_coefficients = "coefficient" in name
            which = known if of_coefficients else usable
            outputs[name][samples[which]] = values.reshape(len(samples), -1)[which]
        outputs["envelope_score"][samples[known], 0] = score[known]
        of_fit: dict[str, np.ndarray] = {
            "chi_square": chi_square,
            "chi_square_limit": limit,
            "residual_limit": threshold,
            "fits": chi_square <= limit,
            "suspects": suspicious,
            "suspect_gauge": np.where(suspicious, worst + 1, 0),
            "degrees_of_freedom": of_map.degrees_of_freedom,
        }
        for name, numbers in of_fit.items():
            outputs[name][usable_samples, 0] = numbers[usable]
        outputs["standardised_residual"][usable_samples] = z[usable]
        outputs["is_suspect"][usable_samples, worst[usable]] = suspicious[usable]

    def _loads(self, of_map: LinearEstimate) -> dict[str, FloatArray]:
        """Return loads and coefficients about the moment point and for the references of the settings."""
        of_setting = {name: float(self._setting(name)[0]) for name in SETTING_NAMES}
        m = of_map.loads.shape[1]
        transfer = np.eye(m)
        shift = of_setting[OF_STATION] - default_settings(self._map).moment_station
        transfer[3, 1] = transfer[4, 2] = shift
        references = self._map.references
        is_long = references != self._map.reference_area
        area, length = of_setting[OF_AREA], of_setting[OF_LENGTH]
        # Coefficients of the map's references are turned as loads are, then scaled to other references.
        scale = references / (area * np.where(is_long, length, 1.0))
        turned = scale[:, None] * (transfer * references / references[:, None])
        loads, covariance = of_map.loads @ transfer.T, transfer @ of_map.covariance @ transfer.T
        coefficients = of_map.coefficients @ turned.T
        of_coefficients = turned @ of_map.coefficient_covariance @ turned.T
        std, of_std = (np.sqrt(np.diagonal(matrix, axis1=1, axis2=2)) for matrix in (covariance, of_coefficients))
        five, rest = FIVE_LOADS, OTHER_LOADS
        outputs = {
            "loads": loads[:, five],
            "loads_std": std[:, five],
            COEFFICIENT_ARRAY: coefficients[:, five],
            "coefficients_std": of_std[:, five],
            "load_covariance": covariance[:, five, five],
            "coefficient_covariance": of_coefficients[:, five, five],
        }
        if self.outputs["other_loads"].stop > self.outputs["other_loads"].start:
            outputs["other_loads"], outputs["other_loads_std"] = loads[:, rest], std[:, rest]
            outputs["other_coefficients"], outputs["other_coefficients_std"] = (
                coefficients[:, rest],
                of_std[:, rest],
            )
        return outputs

    def restart(self) -> None:
        """Nothing is remembered."""

    @property
    def state(self) -> bytes:
        """Nothing is remembered."""
        return b""

    @state.setter
    def state(self, state: bytes) -> None:
        if state:
            raise InputError(f"state: {len(state)} bytes found, must be 0: it is of the compiled core")


def _layout(sizes: dict[str, int], begin: int = 0) -> Layout:
    ends = begin + np.cumsum(list(sizes.values()))
    return MappingProxyType(
        {name: slice(int(end) - size, int(end)) for (name, size), end in zip(sizes.items(), ends, strict=True)}
    )


def _size(layout: Layout) -> int:
    return max(place.stop for place in layout.values())


def _identifies(inverse_map: InverseMap, noise: FloatArray, used: BoolArray) -> bool:
    """Return whether the sensors ``used`` (n_d,) leave every free state some of its information.

    The smallest part of the information of all sensors that is left, over the combinations of states.
    """
    if inverse_map.case == 2:
        return True
    covariance = noise + inverse_map.scaled_covariance
    states = inverse_map.state_operator / np.abs(inverse_map.state_operator).max(axis=0)
    if used.sum() < states.shape[1]:
        return False
    every, some = (
        states[rows].T @ np.linalg.solve(covariance[np.ix_(rows, rows)], states[rows])
        for rows in (np.ones(len(used), dtype=bool), used)
    )
    root = np.linalg.inv(np.linalg.cholesky(every))
    return bool(np.linalg.eigvalsh(root @ some @ root.T)[0] >= MIN_INFORMATION)


def _silent(readings: FloatArray, used: BoolArray, n_strain_gauges: int) -> BoolArray:
    """Return (k,) the samples in which every strain gauge that is ``used`` (k, n_d), one or more, reads exactly 0.

    No gauge under load does: nothing has been read. ``readings`` (k, n_d) are as they come, zeros not subtracted.
    """
    of_gauges = used[:, :n_strain_gauges]
    loud = of_gauges & (readings[:, :n_strain_gauges] != 0.0)
    silent: BoolArray = of_gauges.any(axis=1) & ~loud.any(axis=1)
    return silent


def _parameter_score(known: FlowParameters, values: FloatArray) -> FloatArray:
    """Return (k, n_p) the part of its range by which each of ``values`` leaves it; 0 where not known."""
    excess = np.maximum(np.maximum(known.minimum - values, values - known.maximum), 0.0) / known.span
    return np.where(np.isnan(values), 0.0, np.minimum(excess, LARGEST_SCORE))


def _envelope_score(inverse_map: InverseMap, coefficients: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (k,) the largest (n'C - limit) / sigma of n'C over the half-spaces, 0 where C is inside all [1].

    ``coefficients`` is (k, 5), ``covariance`` theirs (k, 5, 5), both for the references of the map.
    """
    excess = coefficients @ inverse_map.envelope_direction.T - inverse_map.envelope_limit
    score = np.zeros(len(coefficients))
    for sample in np.flatnonzero(np.any(excess > 0.0, axis=1)):
        is_outside = excess[sample] > 0.0
        direction = inverse_map.envelope_direction[is_outside]
        variance = np.sum((direction @ covariance[sample]) * direction, axis=1)
        score[sample] = np.max(excess[sample, is_outside] / np.sqrt(variance))
    return score


def _outside_by_navigation(
    inverse_map: InverseMap,
    *,
    dynamic_pressure: FloatArray,
    dynamic_pressure_std: FloatArray,
    mach_number: FloatArray,
    mach_number_std: FloatArray,
    altitude: FloatArray,
) -> BoolArray:
    """Return (k,) whether q_inf [Pa], M or h [m] leave the ranges or contradict each other; NaN is not known."""
    q, mach = dynamic_pressure, mach_number
    low, high = inverse_map.mach_number_range * np.array([1.0 - MACH_TOLERANCE, 1.0 + MACH_TOLERANCE])
    outside = (q < inverse_map.dynamic_pressure_range[0]) | (q > inverse_map.dynamic_pressure_range[1])
    slack = RANGE_DEVIATIONS * mach_number_std
    outside |= (mach < low - slack) | (mach > high + slack)
    outside |= (altitude < inverse_map.altitude_range[0]) | (altitude > inverse_map.altitude_range[1])
    if np.all(np.isnan(mach) | np.isnan(altitude)):  # nothing to compare the dynamic pressure with
        return np.asarray(outside)
    with np.errstate(over="ignore", invalid="ignore"):  # of values out of range, which are outside already
        expected = 0.5 * HEAT_CAPACITY_RATIO * mach * mach * static_pressure_at(altitude)
        allowed = PRESSURE_TOLERANCE * expected + RANGE_DEVIATIONS * dynamic_pressure_std
        return np.asarray(outside | (np.abs(q - expected) > allowed))


class ByNumpy(Estimator):
    """An estimator on this oracle of the compiled core."""

    def _new_core(self, resource: bytes) -> NumpyCore:
        return NumpyCore(self.inverse_map, resource)


def angles_contradict(
    air: Mapping[str, FloatArray],
    *,
    slope: float,
    force: FloatArray,
    force_std: FloatArray,
    limit: float,
) -> BoolArray:
    """Return (k,) whether the flow comes from another side by the measured angles than by the lateral forces.

    Parameters
    ----------
    slope : minimum incidence per lateral coefficient [rad]; 0 for no test.
    force, force_std : (k, 2) C_N and C_Y, and their standard deviations.
    limit : largest square of the standardised difference.
    """
    value, std = measured_directions(air)
    known = np.isfinite(std)
    need = np.where(known, slope * force, 0.0)
    size = np.linalg.norm(need, axis=1)
    part = np.divide(need, size[:, None], out=np.zeros_like(need), where=size[:, None] > 0.0)
    apart = size - (part * value).sum(axis=1)
    of_angle = np.where(known, std, 0.0) ** 2 + (slope * np.nan_to_num(force_std)) ** 2
    variance = (part**2 * np.where(known, of_angle, 0.0)).sum(axis=1)
    return (size > 0.0) & (apart > 0.0) & (apart**2 > limit * variance)
