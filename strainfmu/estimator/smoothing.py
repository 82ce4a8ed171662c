"""Smoothing of recorded samples that the compiled core has filtered.

The core decides what a sample is: whether it fits, where the filter begins again, which air data are left out. The
reference's filter goes over the same samples with the same decisions, and its laws are smoothed. Of several
explanations of what the core did with a sample, the one whose flight state agrees with the core's is taken.
A sample that the core did not filter stays as it is, and so does one with zeros or flow parameters of stated
deviations.

Laws are smoothed from the last sample back, each with what later samples say of it. Source: Rauch, Tung and
Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3 (1965).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import Any, NamedTuple, Protocol

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.air_inputs import AIR_INPUT_NAMES, DYNAMIC_PRESSURE
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.temperature import known_sensors
from strainfmu.estimator.other_loads import OTHER_LOADS
from strainfmu.estimator.policies import BAND, LARGEST_WIDENING, NARROW, WIDEN, WINDOW
from strainfmu.estimator.reference.air import AirInputs, air_data, air_inputs_of, without
from strainfmu.estimator.reference.flight_filter import ITERATIONS, SEEN, FilteredSample, FlightFilterReference
from strainfmu.estimator.reference.kalman import Law, measured
from strainfmu.estimator.reference.linear_filter import LinearFilterReference
from strainfmu.estimator.reference.nonlinear import Sample
from strainfmu.estimator.reference.readings import Zeros, amplitudes, rows_of
from strainfmu.estimator.settings import default_settings
from strainfmu.estimator.signal_names import TEMPERATURE, THRUST, VALID
from strainfmu.estimator.surface_pressure import LARGEST_USED_SCORE
from strainfmu.estimator.tables.flight_tables import N_STATES

LOADS = 5
FIRST_STEP, LONGEST_STEP = 1.0, 1e6
"""Time step [s] before the first sample, where it does not matter, and the longest one."""

AGREES = 1e-4
"""Difference of the flight state, and relative one of its deviations, up to which an explanation agrees [1]."""

UNFILTERED = (HealthState.INVALID, HealthState.UNIDENTIFIED, HealthState.NO_COEFFICIENTS)
"""States of a linear estimate in which nothing was measured."""


class Filtered(Protocol):
    """A sample of a filter: laws ``before`` and ``after`` it, and the ``transition`` F (n, n) to it from the last.

    It ``continues`` where ``before`` follows from the last sample.
    """

    @property
    def before(self) -> Law: ...
    @property
    def after(self) -> Law: ...
    @property
    def transition(self) -> FloatArray: ...
    @property
    def continues(self) -> bool: ...


class Warm(NamedTuple):
    """Temperature modes: sensors ``known`` (n_t,), amplitudes (k,) by them, and the covariance of their errors."""

    known: BoolArray
    amplitude: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """A sample of a filter, see :class:`Filtered`.

    ``of_loads`` is what loads by a law of its states follow from; None where the estimate stays the core's.
    """

    before: Law
    after: Law
    transition: FloatArray
    continues: bool
    of_loads: Any = None

    def lean(self) -> Step:
        """Return it without the cross covariances, which smoothing does not need and which fill the memory."""
        before, after = (one._replace(cross=one.cross[:, :0].copy()) for one in (self.before, self.after))
        return replace(self, before=before, after=after)


@dataclass(frozen=True, kw_only=True, eq=False)
class Smoothed:
    """Smoothed estimates of k samples: fields of :class:`~strainfmu.estimator.estimate.Estimate` that change."""

    loads: FloatArray
    loads_std: FloatArray
    coefficients: FloatArray
    coefficients_std: FloatArray
    other_loads: FloatArray
    other_loads_std: FloatArray
    other_coefficients: FloatArray
    other_coefficients_std: FloatArray
    air: FloatArray
    air_std: FloatArray

    @classmethod
    def of(cls, found: Estimate) -> Smoothed:
        """Return those of ``found``, copied."""
        names = [name for name in cls.__dataclass_fields__ if not name.startswith("air")]
        air = found.air_data
        return cls(
            **{name: np.array(getattr(found, name)) for name in names},
            air=np.array(air.value),
            air_std=np.array(air.std),
        )


def smoothed(samples: Sequence[Filtered]) -> list[Law]:
    """Return the laws of ``samples`` given all of them; the last one is as it was filtered."""
    out: list[Law] = []
    for i in range(len(samples) - 1, -1, -1):
        later = samples[i + 1] if i + 1 < len(samples) else None
        if later is None or not later.continues:
            out.append(samples[i].after)
        else:
            out.append(_smoothed(samples[i].after, later, out[-1]))
    return out[::-1]


def _smoothed(law: Law, later: Filtered, known: Law) -> Law:
    """Return ``law`` given that the sample after it, ``later``, has the law ``known``: B = P F' (P-)^-1."""
    before = later.before
    size = np.sqrt(np.diag(before.covariance))
    # States have units of their own: equal diagonals keep the digits.
    scaled = before.covariance / np.outer(size, size)
    back = (np.linalg.solve(scaled, (later.transition @ law.covariance) / size[:, None]) / size[:, None]).T
    covariance = law.covariance + back @ (known.covariance - before.covariance) @ back.T
    mean = law.mean + back @ (known.mean - before.mean)
    return Law(mean, 0.5 * (covariance + covariance.T), law.cross)


def with_modes(law: Law, covariance: FloatArray) -> Law:
    """Return the stationary ``law`` with ``covariance`` (k, k) of its last states, the temperature modes."""
    first, whole = len(law.mean) - len(covariance), law.covariance.copy()
    whole[first:, first:] = covariance
    return law._replace(covariance=whole)


def smoother_of(estimator: Estimator) -> FlightSmoother | LinearSmoother:
    """Return the smoother of samples that ``estimator``, which filters over time, has tracked."""
    return FlightSmoother(estimator) if estimator.is_nonlinear else LinearSmoother(estimator)


class _Records:
    """What smoothers read of samples, and how loads turn to the references of the settings."""

    def __init__(self, estimator: Estimator) -> None:
        self.estimator, self.map = estimator, estimator.inverse_map
        settings, zeros = estimator.settings, estimator.zeros
        self.layout, self.zeros = estimator.core.inputs, Zeros(value=zeros.value, std=zeros.std)
        # Errors of zeros stay what they are: laws without them would take them for errors that later samples tell.
        self.smooths = not (np.any(zeros.std > 0.0) or zeros.common_std > 0.0)
        self.transfer = np.eye(LOADS)
        shift = settings.moment_station - default_settings(self.map).moment_station
        self.transfer[3, 1] = self.transfer[4, 2] = shift
        length = settings.reference_length
        self.references = settings.reference_area * np.array([1.0, 1.0, 1.0, length, length])
        thermal = self.map.thermal
        none = np.diag(thermal.prior_std**2)
        self.cold = self.warm = Warm(np.zeros(thermal.n_sensors, dtype=bool), np.zeros(len(none)), none)

    def value(self, record: FloatArray, name: str) -> float:
        place = self.layout[name]
        return float(record[place.start]) if place.stop > place.start else 0.0

    def warm_of(self, record: FloatArray) -> Warm:
        """Return what the temperature sensors of a sample say of the modes."""
        thermal = self.map.thermal
        temperature = record[self.layout[TEMPERATURE]][None]
        known = known_sensors(thermal, temperature)[0]
        if not known.any():
            return self.cold
        found = amplitudes(thermal, np.where(known, temperature, thermal.reference_temperature), known)
        return Warm(known, found.mean[0], found.covariance)

    def carried(self, law: Law, warm: Warm) -> Law:
        """Return ``law`` of the last sample for the sensors that read now: amplitudes stay, their errors move."""
        last, self.warm = self.warm, warm
        if np.array_equal(last.known, warm.known):
            return law
        mean = law.mean.copy()
        mean[len(mean) - len(warm.amplitude) :] += last.amplitude - warm.amplitude
        return law._replace(mean=mean)

    def rows(self, record: FloatArray, used: BoolArray, warm: Warm, errors: FloatArray) -> FloatArray:
        """Return rows (n_d,) at the amplitudes of ``warm`` and their ``errors`` (k,), linear about these."""
        n, thrust = self.map.n_gauges, np.array([self.value(record, THRUST)])
        readings, amplitude = np.where(used, record[:n], 0.0)[None], (warm.amplitude + errors)[None]
        found = rows_of(self.map, readings, thrust, self.zeros, amplitude)[0]
        found = found + self.map.thermal.linear_strain @ errors
        return np.where(used, found, 0.0)


def time_steps(time: FloatArray, last: float) -> FloatArray:
    """Return the steps (k,) [s] to samples at ``time``, ``last`` before the first; NaN for none."""
    before = np.append(last if np.isfinite(last) else time[0] - FIRST_STEP, time[:-1])
    return np.clip(time - before, 0.0, LONGEST_STEP)


class FlightSmoother(_Records):
    """A nonlinear map: the reference's filter of the flight state with the core's decisions."""

    def __init__(self, estimator: Estimator) -> None:
        super().__init__(estimator)
        self.reference = FlightFilterReference(self.map, estimator.filter_time_constant)
        self.window = _Window()
        self.left_out = np.zeros(3, dtype=bool)
        manifold = self.map.manifold
        assert manifold is not None
        self.sharpens = manifold.parameters is not None

    def steps(self, found: Estimate, time: FloatArray, last: float) -> list[Step]:
        """Return the steps of the samples ``found``, tracked by the core behind those before.

        ``time`` (k,) [s] is theirs, ``last`` that of the sample before, NaN for none.
        """
        core = {name: np.asarray(getattr(found, name)) for name in _OF_CORE}
        core["std"] = np.sqrt(np.maximum(np.diagonal(found.state_covariance, axis1=1, axis2=2), 0.0))
        each = [_Core(**{name: values[k] for name, values in core.items()}) for k in range(len(found))]
        seconds = time_steps(time, last).tolist()
        return [self._step(*one).lean() for one in zip(seconds, found.sample, each, strict=True)]

    def _step(self, seconds: float, record: FloatArray, core: _Core) -> Step:
        reference, used = self.reference, core.valid
        warm, transition = self.warm_of(record), reference.transition(seconds)
        own = self._widened(1.0, warm.covariance)
        if not self.smooths or self._is_sharpened(record, core):
            reference.law, self.window, self.warm = None, _Window(), warm
            self.left_out = np.zeros(3, dtype=bool)
            return Step(before=own, after=own, transition=transition, continues=False)
        law, slopes, errors = None, None, np.zeros(len(warm.amplitude))
        if reference.law is None:
            self.warm = warm
        else:
            reference.law = self.carried(reference.law, warm)
            stationary = self._widened(self.window.widening, warm.covariance)
            law = reference.predicted(reference.law, seconds, stationary)
            slopes = reference.slopes_after(seconds, law)
            errors = law.mean[len(law.mean) - len(errors) :]
        air = self._air(record)
        sample = Sample(rows=self.rows(record, used, warm, errors), used=used, air=air)
        if used.any() and not (core.fits and core.health not in UNFILTERED[:2]):
            return self._lost(law or own, core, transition, law is not None)
        if not used.any():
            return self._coasted(law, own, sample, core, transition)
        begins, after, explained = self._explained(law, own, sample, core, slopes)
        self.left_out = np.isfinite(air.value) & ~core.air_data_used
        self._keep(after, None if begins else slopes, 0.0 if begins else reference.age + seconds)
        self.window = self.window.noted(float(core.chi_square), self._expected(core))
        before = own if begins or law is None else law
        kept = explained if not core.is_linear else None
        return Step(before=before, after=after.law, transition=transition, continues=not begins, of_loads=kept)

    def _widened(self, factor: float, of_modes: FloatArray) -> Law:
        """Return the prior with ``factor`` on the variance of pressure errors; ``of_modes`` (k, k) is of modes."""
        found, seen = with_modes(self.reference.prior, of_modes), slice(SEEN, self.reference.hardware)
        found.covariance[seen, seen] *= factor
        return found

    def _is_sharpened(self, record: FloatArray, core: _Core) -> bool:
        """Return whether a flow parameter is known with a deviation, about which the core begins again."""
        if not self.sharpens:
            return False
        known = np.isfinite(record[self.layout["parameter"]]) & (core.parameter_score <= LARGEST_USED_SCORE)
        return bool(np.any(known & np.isfinite(record[self.layout["parameter_std"]])))

    def _air(self, record: FloatArray) -> AirInputs:
        return air_inputs_of(self.map, {name: self.value(record, name) for name in AIR_INPUT_NAMES})

    def _expected(self, core: _Core) -> float:
        return self.estimator.settings.alarm_scale * float(core.degrees_of_freedom)

    def _keep(self, after: FilteredSample, slopes: FloatArray | None, age: float) -> None:
        reference = self.reference
        reference.law, reference.state = after.law, after.law.mean[:N_STATES]
        reference.slopes, reference.age = slopes, age

    def _lost(self, law: Law, core: _Core, transition: FloatArray, continues: bool) -> Step:
        """Return the step of a sample that fits nowhere: the law, if there is one, goes on."""
        if continues:
            self.reference.law = law
        self.reference.slopes, self.reference.age = None, 0.0
        self.window = self.window.noted(float(core.chi_square), self._expected(core))
        return Step(before=law, after=law, transition=transition, continues=continues)

    def _coasted(self, law: Law | None, own: Law, sample: Sample, core: _Core, transition: FloatArray) -> Step:
        """Return the step of a sample without gauges: the prediction, with the air data that it has.

        The core does not state which it used: all, or those that it did not leave out before.
        """
        if law is None:
            return Step(before=own, after=own, transition=transition, continues=False)
        ways = [sample]
        if self.left_out.any():
            ways.append(replace(sample, air=_only(sample.air, ~self.left_out)))
        start = self.reference.state
        found = [self.reference.dropped(law, one, start, ITERATIONS, None) for one in ways]
        number = int(np.argmin([_apart(one, core) for one in found]))
        self._keep(found[number], None, 0.0)
        after = found[number].law
        return Step(before=law, after=after, transition=transition, continues=True, of_loads=ways[number])

    def _explained(
        self, law: Law | None, own: Law, sample: Sample, core: _Core, slopes: FloatArray | None
    ) -> tuple[bool, FilteredSample, Sample]:
        """Return whether the filter begins again, what it makes of ``sample``, and that as it was used."""
        best, nearest = None, np.inf
        for begins in (True,) if law is None else (False, True):
            before = own if begins or law is None else law
            for read, doubted in _as_used(sample, core):
                start = core.state if begins else self.reference.state
                number = 0 if begins and doubted is read else ITERATIONS
                found = self.reference.filtered(before, read, doubted, start, number, None if begins else slopes)
                apart = _apart(found, core)
                if apart < nearest:
                    best, nearest = (begins, found, replace(sample, air=doubted.air)), apart
                if apart < AGREES:
                    break
            if nearest < AGREES:
                break
        assert best is not None
        return best

    def estimates(self, found: Estimate, steps: Sequence[Step], laws: Sequence[Law]) -> Smoothed:
        """Return the estimates of the samples ``found`` by smoothed ``laws``."""
        out = Smoothed.of(found)
        turn = self.transfer * self.reference.static.references[:LOADS] / self.references[:, None]
        own = self.reference.static.references[LOADS:]
        other_turn = own / self._other_references(len(own))
        for k, (step, law) in enumerate(zip(steps, laws, strict=True)):
            if step.of_loads is None or np.isnan(out.loads[k]).any():
                continue
            at = self.reference.loads(law, step.of_loads)
            out.loads[k], out.coefficients[k] = self.transfer @ at.loads[:LOADS], turn @ at.coefficients[:LOADS]
            out.loads_std[k] = _std(self.transfer, at.covariance[:LOADS, :LOADS])
            out.coefficients_std[k] = _std(turn, at.coefficient_covariance[:LOADS, :LOADS])
            if len(own):
                out.other_loads[k] = at.loads[LOADS:]
                out.other_loads_std[k] = np.sqrt(np.maximum(np.diag(at.covariance)[LOADS:], 0.0))
                out.other_coefficients[k] = other_turn * at.coefficients[LOADS:]
                of_both = np.maximum(np.diag(at.coefficient_covariance)[LOADS:], 0.0)
                out.other_coefficients_std[k] = other_turn * np.sqrt(of_both)
            out.air[k], out.air_std[k] = air_data(at.state, at.state_covariance)
        return out

    def _other_references(self, n: int) -> FloatArray:
        """Return S of forces and S L of moments of ``n`` other loads by the settings."""
        settings, moments = self.estimator.settings, self.estimator.inverse_map.is_moment[OTHER_LOADS][:n]
        return settings.reference_area * np.where(moments, settings.reference_length, 1.0)


_OF_CORE = (
    VALID,
    "fits",
    "health",
    "is_linear",
    "state",
    "chi_square",
    "degrees_of_freedom",
    "air_data_used",
    "air_data_residual",
    "parameter_score",
)


class _Core(NamedTuple):
    """The core's estimate of one sample, and ``std`` (4,) of its state."""

    valid: BoolArray
    fits: bool
    health: int
    is_linear: bool
    state: FloatArray
    chi_square: float
    degrees_of_freedom: int
    air_data_used: BoolArray
    air_data_residual: FloatArray
    parameter_score: FloatArray
    std: FloatArray


class _Window(NamedTuple):
    """The core's window: ``mean`` of normalised innovations over ``steps``, and the ``widening`` that follows."""

    mean: float = 1.0
    steps: int = 0
    widening: float = 1.0

    def noted(self, chi_square: float, expected: float) -> _Window:
        """Return it with one more innovation, of ``expected`` size."""
        if not expected > 0.0:
            return self
        band = BAND * sqrt(2.0 / (expected * (2.0 * WINDOW - 1.0)))
        mean = self.mean + (min(chi_square / expected, 1.0 + 0.5 * WINDOW * band) - self.mean) / WINDOW
        steps, widening = self.steps + 1, self.widening
        if steps >= WINDOW and mean > 1.0 + band:
            widening = min(WIDEN * widening, LARGEST_WIDENING)
        elif mean < 1.0:
            widening = max(NARROW * widening, 1.0)
        return _Window(mean, steps, widening)


def _only(air: AirInputs, kept: BoolArray) -> AirInputs:
    return AirInputs(value=np.where(kept, air.value, np.nan), std=np.where(kept, air.std, np.nan))


def _as_used(sample: Sample, core: _Core) -> Iterator[tuple[Sample, Sample]]:
    """Yield ways in which the core may have used the air data of ``sample``: as read, and with its doubts.

    What it left out was named as wrong before, but for one at most that was dropped in this sample.
    """
    used = core.air_data_used
    read = replace(sample, air=_only(sample.air, used))
    yield read, read
    for dropped in np.flatnonzero(np.isfinite(sample.air.value) & ~used).tolist():
        both = _only(sample.air, used | (np.arange(len(used)) == dropped))
        yield replace(sample, air=both), replace(sample, air=without(both, core.air_data_residual, dropped))


def _apart(found: FilteredSample, core: _Core) -> float:
    """Return how far ``found`` is from the core's flight state and its deviations."""
    std, known = np.sqrt(np.diag(found.law.covariance)[:N_STATES]), core.std
    return float(
        max(np.abs((found.law.mean[:N_STATES] - core.state) / known).max(), np.abs(std / known - 1).max())
    )


def _std(turn: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", turn, covariance, turn), 0.0))


class _Read(NamedTuple):
    """Rows of a linear map in use, q_inf over nominal, loads by the sample alone, and the static covariances."""

    rows: FloatArray
    used: BoolArray
    ratio: float
    alone: tuple[FloatArray, FloatArray]
    static: Estimate


class LinearSmoother(_Records):
    """A linear map: the reference's filter; memory changes the estimate of a sample alone, as in the core."""

    def __init__(self, estimator: Estimator) -> None:
        super().__init__(estimator)
        self.reference = LinearFilterReference(self.map, estimator.filter_time_constant)

    def steps(self, found: Estimate, time: FloatArray, last: float) -> list[Step]:
        """Return the steps of the samples ``found``; arguments as of :meth:`FlightSmoother.steps`."""
        record, valid = found.sample, found.valid
        names = (DYNAMIC_PRESSURE, "dynamic_pressure_std")
        more: dict[str, Any] = {name: record[:, self.layout[name].start] for name in names}
        more[TEMPERATURE] = record[:, self.layout[TEMPERATURE]]
        if self.layout[THRUST].stop > self.layout[THRUST].start:
            more[THRUST] = record[:, self.layout[THRUST].start]
        static = self.estimator.estimate(record[:, : self.map.n_gauges], valid=valid, **more)
        seconds = time_steps(time, last).tolist()
        return [
            self._step(seconds[k], record[k], valid[k], static[k], found.loads[k]).lean()
            for k in range(len(found))
        ]

    def _step(
        self, seconds: float, record: FloatArray, used: BoolArray, static: Estimate, loads: FloatArray
    ) -> Step:
        reference, warm = self.reference, self.warm_of(record)
        transition, own = reference.transition(seconds), with_modes(reference.prior, warm.covariance)
        law = reference.law
        if law is None:
            self.warm = warm
        else:
            law = reference.predicted(self.carried(law, warm), seconds, own)
        fits = static.health not in UNFILTERED and static.chi_square <= static.chi_square_limit
        if not (fits and self.smooths):
            reference.law, kept = law, own if law is None else law
            return Step(before=kept, after=kept, transition=transition, continues=law is not None)
        rows = self.rows(record, used, warm, np.zeros(len(warm.amplitude)))
        ratio = self.value(record, DYNAMIC_PRESSURE) / self.map.nominal_dynamic_pressure
        alone, _ = measured(own, reference.rows(own, rows, used, ratio))
        read = _Read(rows, used, ratio, reference.loads(alone, rows, used, ratio), static)
        if law is not None:
            after, _ = measured(law, reference.rows(law, rows, used, ratio))
            by_memory = self.transfer @ (reference.loads(after, rows, used, ratio)[0] - read.alone[0])
            # The core's loads are those with memory, or those of the sample alone where the filter begins again.
            if np.sum(((loads - static.loads - by_memory) / static.loads_std) ** 2) <= np.sum(
                ((loads - static.loads) / static.loads_std) ** 2
            ):
                reference.law = after
                return Step(before=law, after=after, transition=transition, continues=True, of_loads=read)
        reference.law = alone
        return Step(before=own, after=alone, transition=transition, continues=False, of_loads=read)

    def estimates(self, found: Estimate, steps: Sequence[Step], laws: Sequence[Law]) -> Smoothed:
        """Return the estimates of the samples ``found`` by smoothed ``laws``."""
        out = Smoothed.of(found)
        for k, (step, law) in enumerate(zip(steps, laws, strict=True)):
            if step.of_loads is None:
                continue
            read: _Read = step.of_loads
            loads, covariance = self.reference.loads(law, read.rows, read.used, read.ratio)
            apart = self.transfer @ (loads - read.alone[0])
            by = self.transfer @ (covariance - read.alone[1]) @ self.transfer.T
            scale = 1.0 / (read.ratio * self.map.nominal_dynamic_pressure * self.references)
            of_loads = read.static.load_covariance + by
            of_coefficients = read.static.coefficient_covariance + scale[:, None] * by * scale
            if not (_is_positive(of_loads) and np.all(np.diag(of_coefficients) > 0.0)):
                # Errors at a weak current strain are smaller than those that the laws hold.
                of_loads, of_coefficients = read.static.load_covariance, read.static.coefficient_covariance
            out.loads[k], out.loads_std[k] = read.static.loads + apart, np.sqrt(np.diag(of_loads))
            out.coefficients[k] = read.static.coefficients + scale * apart
            out.coefficients_std[k] = np.sqrt(np.diag(of_coefficients))
        return out


def _is_positive(covariance: FloatArray) -> bool:
    if not np.all(np.isfinite(covariance)):  # of a deviation of q_inf beyond numbers
        return False
    size = 1.0 / np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return bool(np.linalg.eigvalsh(covariance * np.outer(size, size))[0] > 0.0)
