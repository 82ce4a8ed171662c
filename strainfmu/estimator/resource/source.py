"""What the values of ``map.bin`` follow from: a map, and what several of them need, computed once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.envelope import FlightRanges, flight_ranges
from strainfmu.estimator.map.flow_parameters import FlowParameters, flow_parameters
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.numerics.fixed_order import householder, product
from strainfmu.estimator.other_loads import FIVE_LOADS, LoadArray, load_arrays
from strainfmu.estimator.settings import EstimatorSettings, default_settings
from strainfmu.estimator.tables.channel_tables import ChannelTables, channel_tables
from strainfmu.estimator.tables.flight_tables import FlightTables
from strainfmu.estimator.tables.manifold_map import ManifoldMap
from strainfmu.estimator.tables.parameter_factors import factors
from strainfmu.estimator.tables.parameter_tables import ParameterTables
from strainfmu.estimator.zeros.tare import KnownStrain


@dataclass(frozen=True, kw_only=True, eq=False)
class Spread:
    """What has a prior, as columns: (n_d, n_d) strain, (n_d, n_f) loads; (n_f, n_f) what no column has."""

    strain: FloatArray
    load: FloatArray
    unseen: FloatArray


class Source:
    """A map, and the strain of the loads that act while a tare is taken."""

    def __init__(self, inverse_map: InverseMap, known: KnownStrain) -> None:
        self.map, self.known = inverse_map, known

    @cached_property
    def nonlinear(self) -> ManifoldMap:
        """The tables of the map, which has some."""
        assert self.map.manifold is not None
        return self.map.manifold

    @cached_property
    def parameter_tables(self) -> ParameterTables:
        """What flow parameters change, of tables that have some."""
        assert self.nonlinear.parameters is not None
        return self.nonlinear.parameters

    @cached_property
    def considered_tables(self) -> FlightTables:
        """Tables of the considered error, of tables that have one."""
        assert self.nonlinear.considered_tables is not None
        return self.nonlinear.considered_tables

    @cached_property
    def settings(self) -> EstimatorSettings:
        """Start values of settings."""
        return default_settings(self.map)

    @cached_property
    def ranges(self) -> FlightRanges:
        """Ranges of the flight."""
        return flight_ranges(self.map)

    @cached_property
    def parameters(self) -> FlowParameters:
        """Flow parameters of the map."""
        return flow_parameters(self.map)

    @cached_property
    def load_arrays(self) -> tuple[LoadArray, ...]:
        """Arrays of outputs of the loads behind the five."""
        return load_arrays(self.map.load_groups)

    @cached_property
    def fixed_strain(self) -> FloatArray:
        """(n_d,) strain that does not follow q_inf; 0 in form "absolute", where nothing does."""
        return self.map.fixed_strain * self.map.follows_pressure

    @cached_property
    def fixed_load(self) -> FloatArray:
        """(n_f,) the same of loads."""
        return self.map.fixed_load * self.map.follows_pressure

    @cached_property
    def spread(self) -> Spread:
        """Errors that scale, and in Case 2 the states: covariances of strain and loads are the same.

        In form "absolute" nothing scales: errors are noise, and states alone are columns.
        """
        follows = self.map.follows_pressure
        strain, load = self.map.error_strain[:, : None if follows else 0], self.map.error_load
        load = load[:, : strain.shape[1]]
        if self.map.case == 2:
            strain = np.hstack([self.map.state_operator, strain])
            load = np.hstack([self.map.load_per_state, load])
        n = len(strain)
        rows = np.zeros((max(strain.shape[1], n), n + len(load)))
        rows[: strain.shape[1]] = np.hstack([strain.T, load.T])
        triangle, _ = householder(rows, n)
        rest = triangle[n:, n:]
        return Spread(strain=triangle[:n, :n].T, load=triangle[:n, n:], unseen=product(rest.T.copy(), rest))

    @cached_property
    def channels(self) -> dict[str, ChannelTables]:
        """Tables without repetition by part."""
        roll_angle = np.arctan2(*self.map.gauge_position[:, 1:].T)
        tables = {"flight": channel_tables(self.nonlinear.tables.response, roll_angle)}
        if self.nonlinear.considered_tables is not None:
            tables["considered"] = channel_tables(self.considered_tables.response, roll_angle)
        if self.map.has_other_loads:
            first = self.nonlinear.n_gauges + FIVE_LOADS.stop
            tables["flight_loads"] = channel_tables(self.nonlinear.response[:, :, first:], np.zeros(0))
        return tables

    @cached_property
    def factors(self) -> tuple[FloatArray, FloatArray]:
        """Tables of flow parameters as sums of few."""
        return factors(self.parameter_tables.slope)


def white_noise(inverse_map: InverseMap) -> FloatArray:
    """Return (n_d,) variances of what is independent from sample to sample in the readings.

    A covariance of the gauges below the one of their noise has less noise than stated.
    """
    covariance = inverse_map.gauge_covariance
    if inverse_map.thermal_and_inertia.n_modes:
        covariance = inverse_map.thermal_and_inertia.isothermal_covariance
    elif inverse_map.manifold is not None:
        covariance = inverse_map.manifold.gauge_covariance
    std = inverse_map.noise_std
    smallest = float(np.linalg.eigvalsh(covariance / (std[:, None] * std))[0])
    return np.asarray(min(1.0, smallest) * std**2)
