"""The estimator of a map: strain and air data in; loads, coefficients, air data and health out."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import replace
from functools import cached_property
from math import nan
from os import PathLike
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import (
    ALTITUDE,
    DYNAMIC_PRESSURE,
    TOTAL_TEMPERATURE,
)
from strainfmu.estimator.arguments import (
    SampleInputs,
    SampleRecords,
    Samples,
    checked_mask,
    checked_start,
    is_series,
    per_sample,
    real_numbers,
    refuse_without_altitude,
    split,
    time_of,
    times_of,
)
from strainfmu.estimator.core import Core, Series
from strainfmu.estimator.estimate import Estimate, PressureField
from strainfmu.estimator.gauge_zeros import GaugeZeros, zeros_of_map
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.map.validity import flow_parameters
from strainfmu.estimator.off_deadline import absolute_loads, surface_pressure
from strainfmu.estimator.other_loads import names_of, number_of
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.resource.map_file import native_resource
from strainfmu.estimator.settings import EstimatorSettings, default_settings
from strainfmu.estimator.signal_names import (
    FILTER_TIME_CONSTANT,
    LOAD_NAMES,
    STRAIN,
)
from strainfmu.estimator.tare import KnownStrain, Tare, TareLimits, judged_tare, limits_record

# Members of an Enum by name: through its class each use takes as long as a call.
_EACH, _TRACK = Series.EACH, Series.TRACK

PIECE, PIECE_NONLINEAR = 4096, 32
"""Samples, at least, for which another thread is worth its start."""

BLOCK = 1024
"""Samples whose records are made together: they stay in the processor's cache."""


def load(
    path: str | PathLike[str], settings: EstimatorSettings | None = None, zeros: GaugeZeros | None = None
) -> Estimator:
    """Return the estimator of the map at ``path``; None takes the settings that the map was built with, and zero
    offsets of 0.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version, or ``zeros`` are of another number of
        gauges.
    """
    return Estimator(load_inverse_map(Path(path)), settings, zeros)


class Estimator:
    """The estimator of one map, computed by the compiled core.

    A sensor is left out of a sample if its reading is not finite or out of its range, or if the caller excludes
    it. ``gauge_names`` are the sensors in the order of ``strain``.

    Example
    -------
    >>> import strainfmu
    >>> estimator = strainfmu.load("demo/map.h5")
    >>> strain = estimator.inverse_map.mean_strain  # a measurement
    >>> result = estimator.estimate(strain, dynamic_pressure=138e3)
    >>> print(f"{result.C_A:.3f} +- {3 * result.sigma.C_A:.3f}, {result.health.name}")
    0.014 +- 0.005, OK
    """

    def __init__(
        self,
        inverse_map: InverseMap,
        settings: EstimatorSettings | None = None,
        zeros: GaugeZeros | None = None,
        *,
        filter_time_constant: float = 0.0,
    ) -> None:
        """Prepare ``inverse_map``; None takes the settings that it was built with, and the zero offsets that it
        holds.

        ``filter_time_constant`` [s] is the time constant of :meth:`track`, 0 for none: see :meth:`filter`.

        Raises
        ------
        InputError
            ``zeros`` are of another number of gauges, or the map has no filter.
        NoCoreError
            The compiled core is not available on this machine.
        """
        self.inverse_map, self.settings = inverse_map, settings or default_settings(inverse_map)
        self.zeros, self.filter_time_constant = zeros or zeros_of_map(inverse_map), filter_time_constant
        self.parameters = flow_parameters(inverse_map)
        self.is_nonlinear = inverse_map.manifold is not None
        self.gauge_names = inverse_map.gauge_names
        self.section_station, self.load_groups = inverse_map.section_station, inverse_map.load_groups
        self._begin(native_resource(inverse_map, ""))

    def _begin(self, resource: bytes) -> None:
        self._lock = threading.Lock()
        self.core = self._new_core(resource)
        self._set_up(self.core)
        self._tracks: Core | None = None
        self._others: list[Core] = []
        self._records = SampleRecords(self.inverse_map, self.core)

    def _new_core(self, resource: bytes) -> Core:
        """Return the compiled core of the map."""
        return Core(resource)

    def _set_up(self, core: Core, filter_time_constant: float = 0.0) -> None:
        """Give ``core`` the settings of this estimator."""
        settings, zeros = self.settings, self.zeros
        if len(zeros.value) != self.inverse_map.n_strain_gauges:
            raise InputError(f"zeros: expected {self.inverse_map.n_strain_gauges} values, got {len(zeros.value)}")
        limits = [getattr(settings, name) for name in list(core.settings)[:5]]
        core.set(0, np.concatenate([limits, zeros.value, zeros.std, [zeros.common_std]]))
        constant = core.settings[FILTER_TIME_CONSTANT]
        if constant.stop > constant.start:
            core.set(constant.start, np.array([filter_time_constant]))
        core.renew()

    @property
    def load_names(self) -> tuple[str, ...]:
        """Names of the five loads, then of the other ones that the map gives."""
        return (*LOAD_NAMES, *names_of(self.load_groups))

    @cached_property
    def linear(self) -> Estimator:
        """The linear estimator of the same map; this one itself where the map has no tables."""
        if not self.is_nonlinear:
            return self
        return Estimator(self.inverse_map.without_tables(), self.settings, self.zeros)

    # Other estimators of the same map, whose tracks go on from where the last sample left this one.

    def _other(self, **changed: Any) -> Estimator:
        estimator = copy(self)
        vars(estimator).pop("linear", None)
        vars(estimator).update(changed)
        estimator._begin(self.core.resource)
        if self._tracks is not None:
            estimator._new_track(self._tracks.state)
        return estimator

    def with_settings(self, settings: EstimatorSettings) -> Estimator:
        """Return an estimator of the same map with other settings."""
        return self._other(settings=settings)

    def with_zeros(self, zeros: GaugeZeros) -> Estimator:
        """Return an estimator of the same map with ``zeros`` instead of its own.

        They are subtracted from what the gauges read. Their standard deviations join the noise of the gauges.

        Raises
        ------
        InputError
            They are of another number of gauges.
        """
        return self._other(zeros=zeros)

    def filter(self, time_constant: float) -> Estimator:
        """Return an estimator of the same map whose :meth:`track` averages over ``time_constant`` [s] at most.

        Raises
        ------
        InputError
            The time constant is not in its range, or the map has no filter.
        """
        if not (time_constant == 0.0 or POLICIES.smallest_time <= time_constant <= POLICIES.largest_time):
            allowed = f"0 or {POLICIES.smallest_time:g} to {POLICIES.largest_time:g} s"
            raise InputError(f"time_constant: expected {allowed}, got {time_constant:g}")
        place = self.core.settings[FILTER_TIME_CONSTANT]
        if time_constant > 0.0 and place.stop == place.start:
            raise InputError(
                "filter: expected a map of gamma 1 in Case 2, or with tables, "
                f"got gamma {self.inverse_map.regularisation:g}"
            )
        return self._other(filter_time_constant=float(time_constant))

    # Samples.

    def estimate(
        self,
        strain: ArrayLike,
        dynamic_pressure: ArrayLike = nan,
        *,
        start: ArrayLike | None = None,
        with_residuals: bool = False,
        **inputs: Unpack[SampleInputs],
    ) -> Estimate:
        """Estimate the loads of one sample, or of k samples at once, each by itself.

        Parameters
        ----------
        strain : (n_d,) or (k, n_d) readings [m/m], readings of auxiliary sensors in units of their own, in the
            order of ``inverse_map.gauge_names``.
        dynamic_pressure, mach_number, static_pressure : q_inf [Pa], M [1], p_inf [Pa], one for all samples or
            (k,); NaN where not known. A linear map needs q_inf, and uses M for health alone.
        valid : (n_d,) or (k, n_d) of bool, false for sensors to leave out; None for none.
        dynamic_pressure_std, mach_number_std, static_pressure_std : their standard deviations; NaN takes the
            values of the map.
        altitude : geopotential [m]; gives p_inf of the standard atmosphere where ``static_pressure`` is not known.
        total_temperature, total_temperature_std : T0 [K] of a perfect gas and its standard deviation, NaN takes
            1 %: a Mach number by T0 = T (1 + 0.2 M^2), with T of the standard atmosphere at ``altitude``, which it
            needs, and 3 % of T. It is joined with ``mach_number``. Maps with tables alone take it.
        q_source : what ``dynamic_pressure`` is computed from: a :class:`QSource`, its name or its number, one for
            all samples or numbers (k,). A computed one is no measurement; with a Mach number so is the default.
        measured_angle_of_attack, measured_sideslip_angle : [rad] by an inertial system, vanes or flush ports, NaN
            where not known; a linear estimate uses them for health alone.
        measured_angle_of_attack_std, measured_sideslip_angle_std : their standard deviations; NaN takes 1 deg.
        temperature : (n_t,) or (k, n_t) readings of the map's temperature sensors [K], NaN where one gives none;
            None for none.
        thrust : [N], of a map with sensors that respond to it.
        parameters : flow parameters by the names of the map, one value for all samples or (k,), in the units of
            the vehicle file, NaN where not known; out of their range health is ``OUTSIDE``.
        parameters_std : their standard deviations, with which they sharpen the nonlinear estimate.
        start : (4,) or (k, 4) flight states (M, u, w, ln p_inf), from each of which a nonlinear estimate starts;
            None searches the tables, which takes several times as long.
        with_residuals : whether residuals and suspects of k samples are found at once. By default a linear map
            estimates the samples again when these are first read, and takes a quarter of the memory until then.
        inertial : what an inertial unit measures, of a map with masses: ``specific_force_x``, ``_y``, ``_z``
            [m/s2], ``angular_rate_x``, ``_y``, ``_z`` [rad/s], ``angular_acceleration_y``, ``_z`` [rad/s2], NaN
            where not known.

        Raises
        ------
        InputError
            An argument has the wrong shape or is no number, ``valid`` is not of bool, a standard deviation is
            negative, ``total_temperature`` is given without ``altitude`` or to a linear map, or the map has no
            sensors or parameters of that kind. Values that are not finite are no
            error: health states what the estimate lacks.
        """
        air, more, valid = split(dynamic_pressure, inputs)
        known: Mapping[str, Any] = inputs
        if TOTAL_TEMPERATURE in known:
            refuse_without_altitude(known[TOTAL_TEMPERATURE], known.get(ALTITUDE, nan))
        if not is_series(strain):
            begin = None if start is None else checked_start(np.atleast_2d(start), 1)[0]
            return self._one(strain, valid, air, more, core=self.core, how=_EACH, start=begin)
        samples = self._records.samples(strain, valid, air, more)
        if start is not None:
            samples = replace(samples, start=checked_start(start, len(samples.inputs)))
        with self._lock:
            record = self._each(samples, with_fit=with_residuals or self.is_nonlinear)
        make_fit = None if with_residuals or self.is_nonlinear else self._with_fit
        return Estimate(record, self, samples.inputs, samples.mask, make_fit)

    def step(self, strain: ArrayLike, dynamic_pressure: float = nan, **of_sample: Any) -> Estimate:
        """Estimate the loads of one sample by itself; arguments and errors as :meth:`estimate`."""
        return self.estimate(strain, dynamic_pressure, **of_sample)

    def track(
        self,
        strain: ArrayLike,
        dynamic_pressure: ArrayLike = nan,
        *,
        time: ArrayLike = nan,
        **inputs: Unpack[SampleInputs],
    ) -> Estimate:
        """Estimate one sample or k samples along time, each from what the sample before it left.

        The first sample after the estimator was made or :meth:`restart` searches the tables; the others start from
        the last flight state, in a fraction of the time. ``time`` [s], of one sample or (k,), is needed by a
        filter (:meth:`filter`); samples of a time that does not go on are of the same moment. Other arguments and
        errors as :meth:`estimate`.
        """
        air, more, valid = split(dynamic_pressure, inputs)
        core = self._tracks or self._new_track()
        if not is_series(strain):
            now = 0.0 if self.filter_time_constant == 0.0 else time_of(time)
            return self._one(strain, valid, air, more, core=core, how=_TRACK, time=now)
        known: Mapping[str, Any] = inputs
        if ALTITUDE not in known and TOTAL_TEMPERATURE in known:  # single samples may lose it
            refuse_without_altitude(known[TOTAL_TEMPERATURE], nan)
        samples = self._records.samples(strain, valid, air, more)
        records = samples.filled(slice(None))
        times = None if self.filter_time_constant == 0.0 else times_of(time, len(records))
        with self._lock:
            record = core.series(Series.TRACK, records, with_fit=True, time=times, mask=samples.mask)
        return Estimate(record, self, records, samples.mask)

    def track_again(self, samples: FloatArray, mask: BoolArray | None, time: FloatArray) -> Estimate:
        """Return estimates of k samples along time from the inputs that an estimator of the same map recorded.

        ``samples`` (k, n_inputs) are the inputs of its estimates, ``mask`` (k, n_d) the sensors that were not left
        out, None for all, ``time`` (k,) [s].
        """
        core = self._tracks or self._new_track()
        with self._lock:
            record = core.series(Series.TRACK, samples, with_fit=True, time=time, mask=mask)
        return Estimate(record, self, samples, mask)

    def restart(self) -> None:
        """Begin a new sequence of samples for :meth:`track`."""
        if self._tracks is not None:
            self._tracks.restart()

    @property
    def memory(self) -> bytes:
        """What the last sample of :meth:`track` left; setting it goes on from there, also in another process."""
        return (self._tracks or self._new_track()).state

    @memory.setter
    def memory(self, state: bytes) -> None:
        core = self._tracks or self._new_track()
        core.state = state
        self._set_up(core, self.filter_time_constant)  # the state holds the settings of its sample

    def _new_track(self, state: bytes | None = None) -> Core:
        core = self._new_core(self.core.resource)
        if state is not None:
            core.state = state
        self._set_up(core, self.filter_time_constant)
        self._tracks = core
        return core

    def _one(
        self,
        strain: ArrayLike,
        valid: ArrayLike | None,
        air: tuple[Any, ...],
        more: tuple[Any, ...],
        *,
        core: Core,
        how: Series,
        time: float = 0.0,
        start: FloatArray | None = None,
    ) -> Estimate:
        """Return the estimate of one sample."""
        with_fit = self.is_nonlinear or (how is _TRACK and self.filter_time_constant > 0.0)
        mask = None if valid is None else checked_mask(valid, self.inverse_map.n_gauges)
        with self._lock:
            if not self._records.write_plain(core.sample, strain, air, more):
                core.sample[:] = self._records.samples(strain, None, air, more).filled(slice(None))[0]
            record, inputs = core.step(time, how, with_fit, mask, start)
        return Estimate(record, self, inputs, mask, None if with_fit else self._with_fit)

    def _each(self, samples: Samples, *, with_fit: bool) -> FloatArray:
        """Return the records of samples by themselves, in pieces on all processors."""
        k = len(samples.inputs)
        n_pieces = max(1, min(_processors(), k // (PIECE_NONLINEAR if self.is_nonlinear else PIECE)))
        while len(self._others) < n_pieces - 1:
            self._others.append(self.core.copy())
        record = np.empty((k, self.core.n_outputs + (self.core.n_fit if with_fit else 0)))
        edges = np.linspace(0, k, n_pieces + 1).astype(int).tolist()

        def run(piece: int) -> None:
            core = self.core if piece == 0 else self._others[piece - 1]
            for first in range(edges[piece], edges[piece + 1], BLOCK):
                rows = slice(first, min(first + BLOCK, edges[piece + 1]))
                mask = None if samples.mask is None else samples.mask[rows]
                start = None if samples.start is None else samples.start[rows]
                inputs = samples.filled(rows)
                core.series(Series.EACH, inputs, with_fit=with_fit, mask=mask, start=start, out=record[rows])

        if n_pieces == 1:
            run(0)
        else:
            with ThreadPoolExecutor(n_pieces) as pool:
                list(pool.map(run, range(n_pieces)))
        return record

    def _with_fit(self, inputs: FloatArray, mask: BoolArray | None) -> FloatArray:
        """Return the records of samples by themselves with their fit, or the record of one, of a linear map."""
        masks = None if mask is None else np.atleast_2d(mask)
        samples = Samples(strain=None, columns=(), mask=masks, inputs=np.atleast_2d(inputs))
        with self._lock:
            return self._each(samples, with_fit=True).reshape(*inputs.shape[:-1], -1)

    def tare(
        self,
        strain: ArrayLike,
        dynamic_pressure: ArrayLike = nan,
        limits: TareLimits | None = None,
        known: KnownStrain | None = None,
    ) -> Tare:
        """Return the zero offsets of the strain gauges from a window of readings while the loads are known.

        The estimator's own zero offsets stay; :meth:`with_zeros` applies the new ones.

        Parameters
        ----------
        strain : (k, n_d) readings of the strain gauges [m/m], NaN where there is none.
        dynamic_pressure : q_inf [Pa], one for all samples or (k,), NaN where it is not known.
        limits : what is accepted; None for the usual limits.
        known : strain of the loads that act; None for none.

        Raises
        ------
        InputError
            An argument has the wrong shape or is no number, or the window holds too few readings.
        NoCoreError
            The compiled core is not available on this machine.
        """
        n, chosen = self.inverse_map.n_strain_gauges, limits or TareLimits()
        readings = real_numbers(STRAIN, strain)
        if readings.ndim != 2 or readings.shape[1] != n:
            raise InputError(f"strain: expected (k, {n}) values, got {readings.shape}")
        pressures = per_sample(DYNAMIC_PRESSURE, dynamic_pressure, len(readings))
        with self._lock:
            outcome = self.core.tare(limits_record(chosen, known, n), readings, pressures)
        return judged_tare(self.inverse_map, outcome, chosen)

    # What is made of estimates off the deadline.

    def other_loads_of(self, estimate: Estimate) -> FloatArray:
        """Return (4, .., m) the loads behind the five of a map whose core has none, their standard deviations,
        coefficients and theirs.

        They are zero where the five loads are known, but for maps of form "absolute" with such loads.
        """
        if self.inverse_map.has_other_loads and not self.is_nonlinear:
            loads = absolute_loads(self.inverse_map, self.zeros, self.settings, estimate, self.core.inputs)
            return loads.reshape(4, *estimate.loads.shape[:-1], -1)
        five = np.stack([estimate.loads, estimate.loads, estimate.coefficients, estimate.coefficients])
        known = np.isfinite(five).all(axis=-1, keepdims=True)
        return np.where(known, np.zeros(number_of(self.load_groups)), nan)

    def pressure_of(self, estimate: Estimate, with_std: bool = True) -> PressureField:
        """Return the pressure on the surface of one ``estimate``: :meth:`Estimate.pressure`."""
        return surface_pressure(self.inverse_map, self.zeros, estimate, self.core.inputs, with_std)


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
