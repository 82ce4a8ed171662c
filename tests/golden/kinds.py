"""Golden streams: what the estimator gives today of every kind of map, kept as files.

A *kind* is a map by name, made by a factory of ``tests/support`` from fixed seeds. A *stream* is a series of
samples of such a map: readings, masks, air data, temperatures, flow parameters, zero offsets. It is estimated in
*modes*: ``each`` sample by itself, ``track`` each from what the one before left, ``filter`` over time.
The file ``data/KIND.npz`` holds

- the inputs of each of its streams, ``STREAM/NAME``, as float32,
- what the compiled core makes of them in each mode, ``STREAM/MODE/FIELD``, as float64 and whole numbers.

Files hold no part of a map and no name of the program: they outlive another layout of the map file, of the core or
of the packages. A new factory for a kind has to give the same map, to about 13 digits.

    python tests/golden/record.py                  record all files again, with the inputs that they hold
    python tests/golden/record.py scaled_case_1    one kind, or several
    python tests/golden/record.py --draw           with inputs drawn again; new streams are drawn without it, too
    python tests/golden/record.py --check          record nothing; print how far results are from the files

Recording prints, for each kind and field, what the last digits of the map do, and what changed since the file
before. After a change of the core that is meant to change results: record again, read what is printed, run
``pytest -m "slow or not slow" tests/estimator/reference``, which compares the core with the reference on random
samples of every kind and over flights of these files, and commit the files with the change. Random samples of
every kind include strain of zero, as of a dead bus; flights jump, and lose sensors, air data and whole samples.

:data:`KINDS` and :data:`STREAMS` are the tables. ``inputs.py`` reads and writes the files, ``comparison.py``
states how far two results are apart, ``estimator_carrier.py`` and ``fmu_carriers.py`` run a stream. ``draw.py``,
``draw_faults.py`` and ``last_digits.py`` serve recording alone.

Another machine, whose linear algebra rounds a map differently, finds the same results. Of random samples those are
left out which a change of the map by 1e-13 moves by more than a fifth of the tolerance, and those of which one by
1e-9 takes a statistic over its threshold. Flights have no such sample; recording states it if they get one, and
marks it in the field ``near_threshold``: tests then leave it out.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any
from zlib import crc32

import numpy as np
from calibrated_maps import calibrated
from deflected_shape import known_map
from flight_maps import whole_map, with_considered_columns, with_considered_error
from inertia_maps import with_masses
from other_load_maps import with_further_tables, with_own_further
from parameter_maps import with_errors_of_parameters, with_parameter_tables, with_parameters
from random_map import map_of, random_map, random_model
from scaled_maps import scaled_map, whole_scaled_map, with_envelope
from sensor_maps import with_sensors
from shape_case import shape_map
from thermal_maps import with_temperature

from strainfmu.estimator.map.inverse_map import InverseMap

MODES = ("each", "track", "filter")
TOLERANCE, TOLERANCE_OF_ITERATIONS = 1e-9, 1e-6
"""Largest difference [standard deviations]: of linear maps, and of tables and filters, whose iterations end early
and whose sums are long."""

OF_DIGITS = 1e4
"""Standard deviations that a relative difference of a map may make."""


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of map.

    Attributes
    ----------
    make : makes it; :func:`map_of_kind` keeps it.
    is_nonlinear : it has tables over the flight state.
    has_filter : its estimator filters over time.
    digits : relative difference of the map that another machine makes; that of finite elements is larger.
    """

    make: Callable[[], InverseMap]
    is_nonlinear: bool = False
    has_filter: bool = True
    digits: float = 1e-13


@dataclass(frozen=True, kw_only=True)
class Stream:
    """A stream of samples.

    Attributes
    ----------
    draw : function of ``draw.py`` or ``draw_faults.py`` that draws it.
    seed : of what is drawn.
    modes : some of :data:`MODES`.
    seconds : time constant of the filter [s].
    options : arguments of ``draw``.
    """

    draw: str
    seed: int
    modes: tuple[str, ...]
    seconds: float = 1.0
    options: Mapping[str, Any] = field(default_factory=dict)


def tolerance_of(kind: str, mode: str) -> float:
    """Return the largest difference from the file [standard deviations]."""
    one = KINDS[kind]
    own = TOLERANCE_OF_ITERATIONS if one.is_nonlinear or mode == "filter" else TOLERANCE
    return max(own, OF_DIGITS * one.digits)


@cache
def map_of_kind(name: str) -> InverseMap:
    """Return the map of the kind ``name``."""
    return KINDS[name].make()


def _absolute(gamma: float) -> InverseMap:
    return map_of(random_model(gamma, n_gauges=27, n_states=20 if gamma else 5))


def _with_envelope() -> InverseMap:
    wide = {name: one for name, one in with_envelope(n=21, size=0.02).items() if not name.endswith("error")}
    return replace(random_map(2), **wide)


def _with_twins() -> InverseMap:
    """Two pairs of gauges of which each pair responds alike: no residual distinguishes them."""
    model = random_model(full=False, n_gauges=9, n_states=3, seed=6)
    a = model.a.copy()
    a[[1, 7]] = a[[0, 6]] * [[1.001], [0.999]]
    own = np.diag(model.noise_covariance).copy()
    own[[0, 1, 6, 7]] *= 1e-2
    return map_of(replace(model, a=a, noise_covariance=np.diag(own)))


def _warm(inverse_map: InverseMap) -> InverseMap:
    """``inverse_map`` with 6 modes and 4 sensors, thermal strain of the size of its gauges' noise."""
    noise = float(np.sqrt(np.median(np.diag(inverse_map.gauge_covariance))))
    strain = 0.1 * noise * np.random.default_rng(3).normal(size=(inverse_map.n_gauges, 6))
    return with_temperature(inverse_map, mode_strain=strain, apparent_strain=noise * np.array([2e-2, -1e-4]))


def _linear(make: Callable[[], InverseMap], has_filter: bool = True, digits: float = 1e-13) -> Kind:
    return Kind(make=make, has_filter=has_filter, digits=digits)


def _nonlinear(make: Callable[[], InverseMap], digits: float = 1e-13) -> Kind:
    return Kind(make=make, is_nonlinear=True, digits=digits)


KINDS: dict[str, Kind] = {
    # Pressure in Pa: Case 1, then Case 2 with gamma as the theory has it and as its rules choose it.
    "few_gauges": _linear(random_map, has_filter=False),
    "twin_gauges": _linear(_with_twins, has_filter=False),
    "absolute_envelope": _linear(_with_envelope, has_filter=False),
    "absolute_case_1": _linear(lambda: _absolute(0.0), has_filter=False),
    "absolute_gamma_1": _linear(lambda: _absolute(1.0), has_filter=False),
    "absolute_gamma_1e-3": _linear(lambda: _absolute(1e-3), has_filter=False),
    "absolute_gamma_1e-6": _linear(lambda: _absolute(1e-6), has_filter=False),
    "absolute_sensors": _linear(
        lambda: with_sensors(map_of(random_model(n_gauges=27, n_states=4))), has_filter=False
    ),
    # Pressure per unit of q_inf.
    "scaled_case_1": _linear(lambda: whole_scaled_map(1, seed=4, n=24, n_states=5)),
    "scaled_case_2": _linear(lambda: whole_scaled_map(2, seed=4, n=24, n_states=30)),
    "scaled_five_gauges": _linear(lambda: scaled_map(2, seed=4, n=5, n_states=6)),
    "scaled_temperature": _linear(lambda: _warm(whole_scaled_map(2, seed=4, n=20, n_states=25))),
    "scaled_sensors": _linear(lambda: with_sensors(_warm(whole_scaled_map(1, seed=5, n=24, n_states=3)))),
    "scaled_sections": _linear(lambda: with_own_further(whole_scaled_map(2, seed=6, n=20, n_states=25))),
    "scaled_parameters": _linear(lambda: with_parameters(whole_scaled_map(1, seed=7, n=18, n_states=4))),
    "scaled_calibrated": _linear(lambda: calibrated("linear"), digits=1e-9),
    "scaled_air_sources": _linear(lambda: whole_scaled_map(2, seed=9, n=18, n_states=4)),
    "scaled_masses": _linear(lambda: with_masses(_warm(whole_scaled_map(2, seed=10, n=20, n_states=25)))),
    # Tables over the flight state.
    "masses": _nonlinear(lambda: with_masses(whole_map())),
    "air_sources": _nonlinear(whole_map),
    "revolution": _nonlinear(whole_map),
    "sections": _nonlinear(lambda: with_further_tables(whole_map())),
    "surface": _nonlinear(shape_map),
    "considered": _nonlinear(
        lambda: with_considered_columns(with_considered_error(with_further_tables(whole_map())))
    ),
    "temperature": _nonlinear(lambda: with_temperature(whole_map())),
    "sensors": _nonlinear(lambda: with_temperature(with_sensors(with_further_tables(whole_map())))),
    "parameters": _nonlinear(
        lambda: with_errors_of_parameters(with_parameter_tables(with_further_tables(whole_map())))
    ),
    "deflected_surface": _nonlinear(known_map),
    "calibrated": _nonlinear(lambda: calibrated("nonlinear"), digits=1e-9),
}


def _samples(draw: str, seed: int, **options: Any) -> Stream:
    return Stream(draw=draw, seed=seed, modes=("each",), options=options)


def _flight(draw: str, seed: int, *modes: str, **options: Any) -> Stream:
    return Stream(draw=draw, seed=seed, modes=modes or ("track", "filter"), options=options)


def _of_every_kind(name: str, kind: Kind) -> dict[str, Stream]:
    """Return random samples and a flight."""
    draw, seed = "table" if kind.is_nonlinear else "linear", crc32(name.encode())
    modes = MODES if kind.is_nonlinear else ("each", "filter") if kind.has_filter else ("each",)
    return {
        "samples": _samples(f"{draw}_samples", seed, n=500),
        "flight": _flight(f"{draw}_flight", seed, *modes, steps=120),
    }


_SETTINGS = {
    "sensor_range": 0.02,
    "alarm_scale": 2.0,
    "reference_area": 0.3,
    "reference_length": 1.5,
    "moment_station": 0.7,
}

_OF_SOME_KINDS: tuple[tuple[tuple[str, ...], dict[str, Stream]], ...] = (
    (
        ("absolute_case_1", "absolute_gamma_1", "scaled_case_2", "scaled_sensors"),
        {
            "zeros": _samples("with_zeros", 2, of="linear_samples", std=1.0, n=80),
            "settings": _samples("with_settings", 3, of="linear_samples", settings=_SETTINGS, n=60),
        },
    ),
    (("few_gauges", "twin_gauges", "scaled_case_1"), {"one_gauge_off": _flight("one_gauge_off", 1, "each")}),
    (
        ("scaled_case_1", "scaled_case_2", "scaled_temperature", "scaled_calibrated"),
        {"restart": _flight("linear_restart", 4, "filter")},
    ),
    (
        ("revolution", "sensors"),
        {
            "zeros": _samples("with_zeros", 5, of="table_samples", std=1.0, n=80),
            "exact_zeros": _flight("with_zeros", 6, "filter", of="table_flight", std=0.0, steps=60),
            "settings": _samples("with_settings", 7, of="table_samples", settings=_SETTINGS, n=60),
        },
    ),
    (
        ("revolution",),
        {
            "air_data_dropped": _flight("air_data_dropped", 11),
            "air_data_doubted": _flight("air_data_doubted", 12),
            "return_after_misfit": _flight("return_after_misfit", 15, size=0.2),
            "jumps_and_spikes": _flight("jumps_and_spikes", 16),
            "one_sensor_off": _flight("one_sensor_off", 17),
            "pressure_off_the_tables": _flight("pressure_off_the_tables", 18, size=0.18),
            "restart": _flight("restart", 20),
            "without_air_data": _flight("without_air_data", 21, pressure=400.0),
            "each_without_air_data": _flight("each_without_air_data", 22, "each", pressure=400.0),
            "coasting": _flight("coasting", 23),
        },
    ),
    (
        ("surface",),
        {
            "air_data_dropped": _flight("air_data_dropped", 24),
            "return_after_misfit": _flight("return_after_misfit", 25, size=0.2),
            "without_air_data": _flight("without_air_data", 26, pressure=3e3),
        },
    ),
    (
        ("scaled_air_sources",),
        {
            "samples": _samples("with_sources", 27, of="linear_samples", n=200),
            "flight": _flight("with_sources", 28, "each", of="linear_flight", steps=60),
        },
    ),
    (
        ("air_sources",),
        {
            "samples": _samples("with_sources", 29, of="table_samples", n=200),
            "flight": _flight("with_sources", 30, *MODES, of="table_flight", steps=80),
        },
    ),
    (
        ("scaled_masses",),
        {
            "samples": _samples("with_motion", 31, of="linear_samples", n=200),
            "flight": _flight("with_motion", 32, "each", "filter", of="linear_flight", steps=60),
        },
    ),
    (
        ("masses",),
        {
            "samples": _samples("with_motion", 33, of="table_samples", n=200),
            "flight": _flight("with_motion", 34, *MODES, of="table_flight", steps=80),
        },
    ),
)

STREAMS: dict[str, dict[str, Stream]] = {
    name: _of_every_kind(name, kind)
    | {title: stream for kinds, streams in _OF_SOME_KINDS if name in kinds for title, stream in streams.items()}
    for name, kind in KINDS.items()
}
