"""Errors that the calibration takes for zero: does the test say that they are not?

The estimate holds the taper and the second harmonic of the wall at zero, and the noise of the readings at its
stated size. A score test asks of each what one step that sets it free would find: with r the readings less the
estimate's linear model, S their covariance before the test, and d the derivatives by the terms,

    size = C d' S^-1 r,  C = (d' S^-1 d + 1 / WIDE^2)^-1,

all terms at once, so that one is not taken for another. A kind of term is judged by size' C^-1 size, chi-square
with as many degrees of freedom as it has terms. The noise is judged by what is left without the terms:
M = S^-1 - S^-1 d C d' S^-1, and |M r|^2 has the mean tr M + (s^2 - 1) tr M^2 where the noise is s times as large
as stated. Where it is, the terms are judged by that noise.

Source: Cox and Hinkley, Theoretical Statistics (1974), section 9.3.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, hstack
from scipy.special import chdtrc

from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.gaussian import GaussianModel
from builder.structure.as_built.as_built_vehicle import Key
from builder.structure.as_built_kinds import KINDS as AS_BUILT_KINDS
from strainfmu.arrays import FloatArray

WIDE = 0.1
"""Standard deviation before the test of a term that is set free [1]: far more than the error of a wall."""

ALARM = 0.001
"""Probability that a sound vehicle is said to have any such error; each kind and the noise get an equal share.

At 0.01 three of 120 tests of sound vehicles on another mesh said one, at 0.001 none."""

NAMED = 3.0
"""Standard deviations from which a term is named, where its kind is not zero."""

KINDS = {"taper": ("wall_taper",), "second harmonic": ("wall_second_cosine", "wall_second_sine")}
"""Kinds of terms and the parameters of each."""

NOISE = "noise"


@dataclass(frozen=True, kw_only=True)
class OutsideTerm:
    """One term of the wall of one region; ``size`` and ``std`` are relative to the thickness [1].

    A second harmonic has one size, its crest's, at roll angle ``crest`` [rad] and half a turn on.
    """

    kind: str
    region: int
    size: float
    std: float
    crest: float | None = None

    @property
    def line(self) -> str:
        """What is said of the term."""
        place = "" if self.crest is None else f", thickest at {np.rad2deg(self.crest):.0f} deg and opposite"
        return (
            f"the wall's {self.kind} in region {self.region + 1}: {100.0 * self.size:.2g} +- "
            f"{100.0 * self.std:.1g} %{place}"
        )


@dataclass(frozen=True, kw_only=True)
class OutsideKind:
    """A kind of error that is taken for zero: ``chance`` is the probability that it is.

    Attributes
    ----------
    kind : of :data:`KINDS`, or :data:`NOISE`.
    statistic, freedom : chi-square and its degrees of freedom.
    terms : of each region; none of the noise.
    """

    kind: str
    statistic: float
    freedom: float
    chance: float
    terms: tuple[OutsideTerm, ...] = ()


@dataclass(frozen=True, kw_only=True)
class OutsideModel:
    """What a test says of the errors that the calibration takes for zero.

    Attributes
    ----------
    kinds : every kind, the noise last.
    noise_factor : standard deviation of the readings over the noise that the estimate counts with [1].
    counted : that noise over what is stated [1].
    """

    kinds: tuple[OutsideKind, ...]
    noise_factor: float
    counted: float = 1.0

    @property
    def over_stated(self) -> float:
        """Standard deviation of the readings over what is stated [1]."""
        return self.counted * self.noise_factor

    @property
    def found(self) -> tuple[OutsideKind, ...]:
        """Kinds that are not zero."""
        return tuple(kind for kind in self.kinds if kind.chance < ALARM / len(self.kinds))

    @property
    def lines(self) -> tuple[str, ...]:
        """What is found and what to do, in lines; none where nothing is."""
        return tuple(line for kind in self.found for line in self._lines(kind))

    def _lines(self, kind: OutsideKind) -> list[str]:
        if kind.kind == NOISE:
            return [
                f"outside the model: the readings scatter {self.over_stated:.2g} times as much as stated; state "
                "their noise (readings.reading_std_um_per_m, or windows of more samples) and calibrate again"
            ]
        named = [term for term in kind.terms if abs(term.size) > NAMED * term.std] or [
            max(kind.terms, key=lambda term: abs(term.size) / term.std)
        ]
        entry = AS_BUILT_KINDS[KINDS[kind.kind][0]].entry
        size = 100.0 * float(np.sqrt(np.mean([term.size**2 for term in kind.terms])))
        return [f"outside the model: {term.line}" for term in named] + [
            f"the sigmas of the map leave the wall's {kind.kind} out; with calibration.{entry} = "
            f"{size:.1g} in the vehicle file it is estimated"
        ]


def outside_model(fit: Estimate) -> OutsideModel:
    """Return what the test of ``found`` says of the errors that its estimate takes for zero."""
    model, used, linear = fit.model, fit.used, fit.linear
    derivatives = model.held_derivatives(fit.vector)
    columns = np.zeros((len(linear.misfit), len(derivatives)))
    for number, derivative in enumerate(derivatives.values()):
        columns[: used.sum(), number] = WIDE * derivative[used] / model.test.reading_stds[used]
    gauge_of_wide = np.append(linear.gauge_of, np.full(len(derivatives), -1))
    wide = GaussianModel(hstack([linear.rows, csr_array(columns)]).tocsr(), linear.misfit, gauge_of_wide)
    of_terms = slice(linear.rows.shape[1], None)
    size, covariance = WIDE * wide.mean[of_terms], WIDE**2 * wide.covariance[of_terms, of_terms]
    of_noise, factor = _noise(wide)
    scale = max(factor**2, 1.0) if of_noise.chance < ALARM else 1.0
    kinds = [_kind(kind, list(derivatives), size, scale * covariance) for kind in KINDS]
    return OutsideModel(
        kinds=(*(kind for kind in kinds if kind.terms), of_noise), noise_factor=factor, counted=model.noise_factor
    )


def _noise(wide: GaussianModel) -> tuple[OutsideKind, float]:
    """Return the test of the noise, larger than stated, and its factor; M is the S^-1 of ``wide``."""
    # 1 - C is what the readings determine: the sum of its squares is k - 2 tr C + tr C^2.
    unknown = float(np.trace(wide.covariance))
    trace = len(wide.misfit) - len(wide.covariance) + unknown
    square = trace - unknown + float(np.vdot(wide.covariance, wide.covariance))
    statistic = float(np.sum(wide.weighted**2))
    # Chi-square of the same mean and variance.
    freedom = trace**2 / square
    noise = OutsideKind(
        kind=NOISE,
        statistic=statistic * trace / square,
        freedom=freedom,
        chance=float(chdtrc(freedom, statistic * trace / square)),
    )
    return noise, float(np.sqrt(max(1.0 + (statistic - trace) / square, 0.0)))


def _kind(kind: str, keys: Sequence[Key], size: FloatArray, covariance: FloatArray) -> OutsideKind:
    """Return the test of one kind; ``size`` and ``covariance`` are of all ``keys``."""
    places = [number for number, key in enumerate(keys) if key[0] in KINDS[kind]]
    of_kind = covariance[np.ix_(places, places)]
    statistic = float(size[places] @ np.linalg.solve(of_kind, size[places]))
    terms = []
    for region in sorted({keys[number][1] for number in places}):
        of_region = [number for number in places if keys[number][1] == region]
        sizes, spread = size[of_region], covariance[np.ix_(of_region, of_region)]
        is_wave = len(of_region) > 1
        term_size = float(np.hypot(*sizes)) if is_wave else float(sizes[0])
        along = sizes / max(abs(term_size), 1e-300)
        terms.append(
            OutsideTerm(
                kind=kind,
                region=region,
                size=term_size,
                std=float(np.sqrt(along @ spread @ along if is_wave else spread[0, 0])),
                crest=float(0.5 * np.arctan2(sizes[1], sizes[0]) % np.pi) if is_wave else None,
            )
        )
    return OutsideKind(
        kind=kind,
        statistic=statistic,
        freedom=len(places),
        chance=float(chdtrc(len(places), statistic)) if places else 1.0,
        terms=tuple(terms),
    )
