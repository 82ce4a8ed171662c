"""Tares of the strain gauges: inputs, limits, results, and what is said of them.

The compiled core computes them (``fmus/native/estimator/zeros``): of a window, or by the edges of a flag, as an
FMU takes it. While the flag is up readings are averaged, then judged as a window is; besides, the dynamic pressure
must be known in every step. The bus, FMUs and recordings say the same of a tare.

Readings of a tare must not look like load. The strain of every flow of the map is a sum of a few patterns: the
mean flow's and one for each pressure mode. Own weight has three more. Zeros are random from gauge to gauge. With k
orthonormal patterns of n gauges, the part b of their sum of squares that lies along the patterns has the
distribution Beta(k/2, (n - k)/2) for normal zeros, whatever their size. Source: the F test of a linear model, Rao,
*Linear Statistical Inference and its Applications*, section 4b.2.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from math import isnan

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.core import Core
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.health import FALSE_ALARM_PROBABILITY
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.schema import MapRecord, entry
from strainfmu.estimator.map.sensors import SPECIFIC_FORCE
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.signal_names import TARE, ZERO, ZERO_COMMON_STD, ZERO_STD


class TareFault(IntFlag):
    """Why zeros are not to be used: bits of ``strainload.h``."""

    NONE = 0
    NO_PRESSURE = 1
    PRESSURE = 2
    SHORT = 4
    DRIFTS = 8
    MOVES = 16
    TOO_LARGE = 32
    LIKE_LOAD = 64
    FEW_GAUGES = 128


class TareState(IntEnum):
    """What has become of the last tare."""

    IDLE = 0
    AVERAGING = 1
    DONE = 2
    REFUSED = 3


@dataclass(frozen=True, kw_only=True, repr=False)
class TareLimits(MapRecord, where=TARE):
    """What a tare accepts."""

    # fmt: off
    dynamic_pressure: float = entry(unit="Pa", meaning="largest |q_inf| at which air does not load the vehicle",
        default=100.0, place=f"{TARE}.dynamic_pressure", low=0.0, high=sys.float_info.max)
    zero: float = entry(unit="m/m", meaning="largest plausible |zero|", default=2e-3, place=f"{TARE}.zero",
        low=0.0, high=sys.float_info.max)
    drift: float = entry(unit="m/m",
        meaning="largest rise of a gauge over the window; it joins the standard deviation", default=2e-6,
        place=f"{TARE}.drift", low=0.0, high=sys.float_info.max)
    # fmt: on


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownStrain:
    """Strain of known loads during a tare, such as own weight.

    Attributes
    ----------
    value : (n_d,) [m/m].
    relative_std : standard deviation of its error, relative [1].
    own_std : (n_d,) standard deviation of each gauge [m/m]; None for the relative one.
    """

    value: FloatArray
    relative_std: float = 0.02
    own_std: FloatArray | None = None

    @property
    def std(self) -> FloatArray:
        """(n_d,) standard deviation of its error [m/m]."""
        return self.relative_std * np.abs(self.value) if self.own_std is None else self.own_std


@dataclass(frozen=True, kw_only=True, eq=False)
class Tare:
    """Zero offsets of a tare, and its checks.

    Attributes
    ----------
    zeros : of gauges that do not read: 0 with the largest standard deviation there is.
    samples : number of readings.
    memory : factor on the standard deviations for correlated readings [1].
    gauges : number of gauges that have a zero offset.
    rms, largest_std : of their zero offsets, and the largest of their standard deviations [m/m].
    reasons : all checks that failed.
    faults : the failed checks in words, but for too few gauges; none of a good tare.
    notes : remarks for the user.
    """

    zeros: GaugeZeros
    samples: int
    memory: float
    gauges: int
    rms: float
    largest_std: float
    reasons: TareFault
    faults: tuple[str, ...]
    notes: tuple[str, ...]


def limits_record(limits: TareLimits, known: KnownStrain | None, n_gauges: int) -> FloatArray:
    """Return (3 + 2 n_d,) the record of limits and known strain that the core takes."""
    loads = known or KnownStrain(value=np.zeros(n_gauges))
    for values in (loads.value, loads.std):
        if values.shape != (n_gauges,):
            raise InputError(f"known strain: expected ({n_gauges},) values, got {values.shape}")
    return np.concatenate([[limits.dynamic_pressure, limits.zero, limits.drift], loads.value, loads.std])


def judged_tare(inverse_map: InverseMap, outcome: Mapping[str, FloatArray], limits: TareLimits) -> Tare:
    """Return the tare of the gauges of ``held`` by ``outcome`` of the core, which names its values."""
    reasons, samples = TareFault(int(outcome["faults"][0])), int(outcome["samples"][0])
    if TareFault.SHORT in reasons:
        raise InputError(f"window: expected at least {POLICIES.least_samples} samples, got {samples}")
    return Tare(
        zeros=zeros_of(outcome),
        samples=samples,
        memory=float(outcome["memory"][0]),
        gauges=int(outcome["gauges"][0]),
        rms=float(outcome["rms"][0]),
        largest_std=float(outcome["largest_std"][0]),
        reasons=reasons,
        faults=_faults(inverse_map, reasons, outcome, limits),
        notes=_notes(inverse_map, outcome),
    )


def zeros_of(outcome: Mapping[str, FloatArray]) -> GaugeZeros:
    """Return the zeros in ``outcome``."""
    return GaugeZeros(value=outcome[ZERO], std=outcome[ZERO_STD], common_std=float(outcome[ZERO_COMMON_STD][0]))


def loads_fault(dynamic_pressure: float, limits: TareLimits, where: str = "") -> str:
    """Return why loads are not known at ``dynamic_pressure`` [Pa], NaN where it is not stated; "" if they are.

    ``where`` says where it should be, as " on the bus".
    """
    if isnan(dynamic_pressure):
        return f"loads are not known: no dynamic pressure{where}"
    if abs(dynamic_pressure) > limits.dynamic_pressure:
        return (
            f"loads are not known: dynamic pressure is {dynamic_pressure:.4g} Pa, expected at most "
            f"{limits.dynamic_pressure:g} Pa"
        )
    return ""


def refusal(tare: Tare) -> str:
    """Return why the zeros of a window are not to be used; "" if they are."""
    if tare.faults:
        return "; ".join(tare.faults)
    if TareFault.FEW_GAUGES in tare.reasons:
        return f"{tare.gauges} of {len(tare.zeros.value)} gauges read"
    return ""


def refused_text(why: str) -> str:
    """Return the line of a tare that is refused."""
    return f"tare refused: {why}; zeros as before"


def taken_text(tare: Tare, unit: str) -> str:
    """Return the line of zeros that are taken; ``unit`` says what their window counts, as "cycles"."""
    return (
        f"tare taken: {tare.gauges} zeros from {tare.samples} {unit}, rms {1e6 * tare.rms:.4g} um/m, standard "
        f"deviations up to {1e6 * tare.largest_std:.2g} um/m each and {1e6 * tare.zeros.common_std:.2g} um/m in "
        "common"
    )


def _faults(
    inverse_map: InverseMap, reasons: TareFault, outcome: Mapping[str, FloatArray], limits: TareLimits
) -> tuple[str, ...]:
    numbers = {name: float(values[0]) for name, values in outcome.items() if len(values) == 1}

    def gauge(kind: str) -> str:
        return inverse_map.gauge_names[int(numbers[f"{kind}_gauge"]) - 1]

    noise = inverse_map.noise_std[int(numbers["moving_gauge"]) - 1]
    lines = {
        TareFault.PRESSURE: f"loads are not known: dynamic pressure reaches {numbers[DYNAMIC_PRESSURE]:.4g} Pa, "
        f"expected at most {limits.dynamic_pressure:g} Pa",
        TareFault.DRIFTS: f"readings drift: gauge '{gauge('drifting')}' by {1e6 * numbers['drift']:.3g} um/m over "
        f"the window, expected at most {1e6 * limits.drift:g} um/m",
        TareFault.MOVES: f"readings move: gauge '{gauge('moving')}' by {1e6 * numbers['moving_scatter']:.3g} um/m "
        f"rms, expected at most {POLICIES.loud:g} times its noise of {1e6 * noise:.3g} um/m",
        TareFault.TOO_LARGE: f"no plausible zero: gauge '{gauge('largest')}' reads {1e6 * numbers['largest']:.4g} "
        f"um/m, expected at most {1e6 * limits.zero:g} um/m",
        TareFault.LIKE_LOAD: f"readings look like load: {1e6 * numbers['along']:.3g} um/m of them lie along the "
        f"strain of flights, expected at most {1e6 * numbers['along_limit']:.3g} um/m of random zeros",
    }
    return tuple(line for fault, line in lines.items() if fault in reasons)


def _notes(inverse_map: InverseMap, outcome: Mapping[str, FloatArray]) -> tuple[str, ...]:
    reads, scatter = outcome["reads"] != 0.0, outcome["scatter"]
    silent = [inverse_map.gauge_names[i] for i in np.flatnonzero(~reads)]
    seldom = f"reads in less than {100 * POLICIES.least_part:g} % of the window: no zero, not to be used"
    notes = [f"gauge '{name}': {seldom}" for name in silent]
    still = [inverse_map.gauge_names[i] for i in np.flatnonzero(reads & (scatter == 0.0))]
    notes += [f"gauge '{name}': every reading is the same: is it alive?" for name in still]
    lost, samples = int(outcome["samples_without"][0]), int(outcome["samples"][0])
    if lost == samples:
        notes.append("dynamic pressure is not recorded: that air does not load the vehicle is taken on trust")
    elif lost:
        notes.append(
            f"dynamic pressure has no value in {lost} of {samples} samples: that air does not load "
            "the vehicle then is taken on trust"
        )
    return tuple(notes)


class EdgeTare:
    """Takes the tare of the strain gauges of ``held`` by ``core``, which takes no other tare by steps.

    ``known`` is the strain of the loads that act meanwhile.

    Attributes
    ----------
    state : of the last tare.
    is_up : the flag at the last step.
    zeros : that a tare has set; None if none has.
    text : the last outcome, one line; "" if there was none since :attr:`text` was emptied.
    """

    def __init__(self, core: Core, inverse_map: InverseMap, known: KnownStrain | None = None) -> None:
        self._core, self._map, self._limits = core, inverse_map, TareLimits()
        self._record = limits_record(self._limits, known, inverse_map.n_strain_gauges)
        self.state, self.is_up = TareState.IDLE, False
        self.zeros: GaugeZeros | None = None
        self.text = ""

    def step(self, is_up: bool, strain: FloatArray, dynamic_pressure: float) -> bool:
        """Take a step in; return whether there are other zeros now.

        Parameters
        ----------
        is_up : the flag.
        strain : (n_d,) readings [m/m], NaN for gauges not in use.
        dynamic_pressure : q_inf [Pa], NaN if unknown.
        """
        may_end = self.state == TareState.AVERAGING or (is_up and not self.is_up)
        changed, outcome = self._core.tare_step(self._record, is_up, strain, dynamic_pressure)
        self._take(outcome)
        if changed:
            self.zeros = zeros_of(outcome)
        if may_end and self.state in (TareState.DONE, TareState.REFUSED):
            self.text = self._ended(outcome)
        return changed

    def drop(self) -> None:
        """Forget the zeros: others are given."""
        self._take(self._core.tare_drop())
        self.zeros = None

    def saved(self) -> bytes:
        """Return all of it, for :meth:`restore`."""
        return self._core.tare_state

    def restore(self, saved: bytes) -> None:
        """Go on from what :meth:`saved` gave.

        Raises
        ------
        InputError
            It cannot be; then nothing has changed.
        """
        outcome = self._core.restore_tare(saved)
        self._take(outcome)
        self.zeros, self.text = zeros_of(outcome) if outcome["has_zeros"][0] else None, ""

    def _take(self, outcome: Mapping[str, FloatArray]) -> None:
        self.state, self.is_up = TareState(int(outcome["state"][0])), bool(outcome["is_up"][0])

    def _ended(self, outcome: Mapping[str, FloatArray]) -> str:
        """Return what is said of the tare that has ended."""
        reasons = TareFault(int(outcome["faults"][0]))
        if reasons & (TareFault.NO_PRESSURE | TareFault.PRESSURE):
            return refused_text(loads_fault(float(outcome[DYNAMIC_PRESSURE][0]), self._limits))
        if TareFault.SHORT in reasons:
            return refused_text(
                f"window: expected at least {POLICIES.least_samples} steps, got {int(outcome['samples'][0])}"
            )
        tare = judged_tare(self._map, outcome, self._limits)
        return refused_text(refusal(tare)) if reasons else taken_text(tare, "steps")


GAUGES_PER_PATTERN = 4
"""Gauges that read for each pattern, at least: with fewer any zeros look like load."""

_HALVINGS = 60
"""Of the interval that a limit is searched in: to the precision of a double."""


def load_patterns(inverse_map: InverseMap) -> FloatArray:
    """Return (k, n_d) strain of loads, to any scale.

    Of the mean flow; of own weight along each axis, if the map knows masses; then of pressure modes in order.
    """
    n, inertia = inverse_map.n_strain_gauges, inverse_map.inertia
    weight = np.zeros((inverse_map.n_gauges, 0)) if inertia is None else inertia.mode_strain[:, SPECIFIC_FORCE]
    columns = np.column_stack([inverse_map.mean_strain, weight, inverse_map.state_operator])[:n]
    return np.ascontiguousarray(columns[:, : max(1, n // GAUGES_PER_PATTERN)].T)


def load_odds(inverse_map: InverseMap) -> FloatArray:
    """Return (n_d + 1,) limits of b / (1 - b) by the number of gauges that read; 0 where no pattern is judged.

    Random zeros exceed them with :data:`FALSE_ALARM_PROBABILITY`.
    """
    n_patterns = len(load_patterns(inverse_map))
    odds = np.zeros(inverse_map.n_strain_gauges + 1)
    for n in range(GAUGES_PER_PATTERN, len(odds)):
        part = largest_part(min(n_patterns, n // GAUGES_PER_PATTERN), n, FALSE_ALARM_PROBABILITY)
        odds[n] = part / (1.0 - part)
    return odds


def largest_part(n_patterns: int, n_gauges: int, probability: float) -> float:
    """Return the part of the sum of squares along patterns that random zeros exceed with ``probability``.

    An odd number of patterns counts as the next even one, whose limit is a little higher.
    """
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        part = 0.5 * (low + high)
        if part_survival(part, n_patterns + n_patterns % 2, n_gauges) > probability:
            low = part
        else:
            high = part
    return high


def part_survival(part: float, n_patterns: int, n_gauges: int) -> float:
    """Return the probability that a Beta(k/2, (n - k)/2) variable exceeds ``part``, k = ``n_patterns`` even.

    Source: (1 - b)^m sum_{i < k/2} (m)_i b^i / i! with m = (n - k)/2, repeated integration by parts of the beta
    function (Abramowitz & Stegun, 26.5.7).
    """
    half_left = 0.5 * (n_gauges - n_patterns)
    term = total = 1.0
    for i in range(1, n_patterns // 2):
        term *= part * (half_left + i - 1.0) / i
        total += term
    return float((1.0 - part) ** half_left * total)
