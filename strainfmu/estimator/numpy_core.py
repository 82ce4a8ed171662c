"""The linear estimator in numpy behind the interface of :class:`~strainfmu.estimator.core.Core`.

For machines without a library of the compiled estimator and without a compiler. It has no filter, and no tables.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.core import Layout, NoCoreError, Series
from strainfmu.estimator.estimates.load_estimate import LoadEstimates
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.linear.flow_parameters import flow_parameters
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.offers import has_further_outputs
from strainfmu.estimator.settings import EstimatorSettings
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros

_AIR_DATA = (
    "dynamic_pressure",
    "dynamic_pressure_std",
    "mach_number",
    "altitude",
    "mach_number_std",
    "static_pressure",
    "static_pressure_std",
)
_SETTINGS = ("sensor_range", "alarm_scale", "reference_area", "reference_length", "moment_station")


class NumpyCore:
    """The linear estimator of one map; attributes as those of :class:`~strainfmu.estimator.core.Core`."""

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
        n_t = 0 if inverse_map.thermal is None else inverse_map.thermal.n_sensors
        has_thrust = inverse_map.sensors is not None and bool(inverse_map.sensors.follows_thrust.any())
        further = inverse_map.further if has_further_outputs(inverse_map) else None
        m = 0 if further is None else len(further.load_of_mean)
        n_p = len(flow_parameters(inverse_map).names)
        self.n_rows = n
        self.inputs = _layout(
            {"strain": n_strains, "sensor": n - n_strains}
            | dict.fromkeys(_AIR_DATA, 1)
            | {"temperature": n_t, "thrust": int(has_thrust), "parameter": n_p}
        )
        of_zeros = {"zero": n_strains, "zero_std": n_strains, "zero_common_std": 1, "filter_time_constant": 0}
        self.settings = _layout(dict.fromkeys(_SETTINGS, 1) | of_zeros)
        vectors = ("coefficients", "coefficients_std", "loads", "loads_std")
        of_health = ("health", "chi_square", "chi_square_limit", "valid_gauges", "suspect_gauge", "suspects")
        more = ("further_loads", "further_loads_std", "further_coefficients", "further_coefficients_std")
        self.outputs = _layout(
            dict.fromkeys(vectors, 5)
            | dict.fromkeys((*of_health, "envelope_score", "degrees_of_freedom"), 1)
            | dict.fromkeys(("air_data", "air_data_std", "is_identified", "air_data_used", "is_linear"), 0)
            | dict.fromkeys(more, m)
            | {"parameter_score": n_p}
        )
        self.n_inputs, self.n_outputs = _size(self.inputs), _size(self.outputs)
        self.fit = _layout(
            {"load_covariance": 25, "coefficient_covariance": 25, "fits": 1}
            | {"state": 4, "state_covariance": 16, "air_data_residual": 3, "discrepancy_chi_square": 1}
            | {"residual_limit": 1, "standardised_residual": n, "valid": n, "is_suspect": n},
            self.n_outputs,
        )
        self.n_fit = _size(self.fit) - self.n_outputs
        self.sample = np.full(self.n_inputs, np.nan)
        self._values = np.zeros(_size(self.settings))
        self._estimator = Estimator(inverse_map)
        settings = self._estimator.settings
        self._values[: len(_SETTINGS)] = [getattr(settings, name) for name in _SETTINGS]

    def copy(self) -> NumpyCore:
        """Return another one of the same map with the same settings."""
        other = NumpyCore(self._map, self.resource)
        other.set(0, self._values)
        return other

    def set(self, first: int, values: FloatArray) -> None:
        """Set the settings from place ``first`` on; raises InputError for a value that is not allowed."""
        held = self._values.copy()
        held[first : first + len(values)] = values
        zero, std, common = (held[self.settings[name]] for name in ("zero", "zero_std", "zero_common_std"))
        settings = EstimatorSettings(**{name: float(held[self.settings[name].start]) for name in _SETTINGS})
        self._estimator = Estimator(
            self._map, settings, GaugeZeros(value=zero, std=std, common_std=float(common[0]))
        )
        self._values = held

    def get(self, first: int, count: int) -> FloatArray:
        """Return ``count`` settings from place ``first`` on."""
        return self._values[first : first + count].copy()

    def step(
        self, time: float, how: Series, with_fit: bool, mask: BoolArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the record of the one sample in :attr:`sample`, and a copy of the sample."""
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
        found = self._estimates(inputs, mask)
        record = np.full((len(inputs), self.n_outputs + (self.n_fit if with_fit else 0)), np.nan)
        suspects = [one[0] + 1 if one else 0 for one in found.suspects]
        of_outputs = {
            name: getattr(found, name)
            for name in self.outputs
            if hasattr(found, name) and self.outputs[name].stop > self.outputs[name].start
        } | {
            "valid_gauges": found.valid.sum(axis=1),
            "suspect_gauge": np.array(suspects),
            "suspects": np.array([len(one) for one in found.suspects]),
        }
        _write(record, self.outputs, of_outputs)
        if with_fit:
            _write(record, self.fit, self._fit(found))
        if out is None:
            return record
        out[:] = record
        return out

    def _estimates(self, inputs: FloatArray, mask: BoolArray | None) -> LoadEstimates:
        of = {name: inputs[:, place] for name, place in self.inputs.items()}
        strain, sensors = inputs[:, : self.n_rows], self._map.sensors
        if sensors is not None and of["thrust"].shape[1]:
            strain = sensors.without_thrust(strain, of["thrust"][:, 0])
        names = flow_parameters(self._map).names
        found = self._estimator.estimate(
            strain,
            of["dynamic_pressure"][:, 0],
            mask,
            of["dynamic_pressure_std"][:, 0],
            mach_number=of["mach_number"][:, 0],
            altitude=of["altitude"][:, 0],
            temperature=of["temperature"] if of["temperature"].shape[1] else None,
            parameters=dict(zip(names, of["parameter"].T, strict=True)) if names else None,
        )
        assert isinstance(found, LoadEstimates)
        return found

    def _fit(self, found: LoadEstimates) -> dict[str, FloatArray]:
        """Return the fit of ``found`` by name."""
        k, n = found.valid.shape
        is_suspect = np.zeros((k, n))
        for row, one in enumerate(found.suspects):
            is_suspect[row, list(one)] = 1.0
        return {
            "load_covariance": found.load_covariance.reshape(k, -1),
            "coefficient_covariance": found.coefficient_covariance.reshape(k, -1),
            "fits": (found.chi_square <= found.chi_square_limit).astype(float),
            "standardised_residual": found.standardised_residual,
            "valid": found.valid.astype(float),
            "is_suspect": is_suspect,
            "residual_limit": self._residual_limit(found),
        }

    def _residual_limit(self, found: LoadEstimates) -> FloatArray:
        """Return (k,) the detection threshold of the largest |z|, which moves with that of chi-square."""
        masks, which = np.unique(found.valid, axis=0, return_inverse=True)
        maps = [self._estimator.masked_map(mask) for mask in masks]
        threshold = np.array([np.nan if one is None else one.outlier_threshold for one in maps])
        nominal = np.array([np.nan if one is None else one.chi_square_limit for one in maps])
        of_sample = np.ravel(which)
        with np.errstate(invalid="ignore"):
            moved = found.chi_square_limit / (self._map.chi_square_scale * nominal[of_sample])
        return np.asarray(threshold[of_sample] * np.sqrt(self._map.outlier_scale * moved))

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


def _write(record: FloatArray, layout: Layout, fields: dict[str, FloatArray]) -> None:
    for name, values in fields.items():
        record[:, layout[name]] = values.reshape(len(record), -1)
