"""Case 2 of the source: the whole field with the snapshots of P2 as prior; modes, gamma and three examples."""

from dataclasses import dataclass

import numpy as np

from builder.aero.load_operator import load_operator
from builder.reports.findings.prior_observability import grid_mirrors, symmetric_part
from builder.reproduce.case_1 import FieldExample
from builder.reproduce.protocol import DRAWN_MODES, DRAWS, DRAWS_PER_CONDITION, SEED
from builder.reproduce.setups import SetUp
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.linear.pressure_modes import LowRankPrior
from strainfmu.linear.regularisation import (
    RULES,
    DataSpectrum,
    Rule,
    expected_data,
    measured_data,
    select_gamma,
)
from strainfmu.linear.state_map import GaussianMap, WhitenedSpectrum, gaussian_map, whitened_spectrum

COEFFICIENTS = ("C_A", "C_N", "C_Y", "M_P", "M_Y")


@dataclass(frozen=True)
class LoadReading:
    """A way to take coefficients from a field; the source does not state one.

    Attributes
    ----------
    name : in words.
    moment_station : reference point of the moments [m from the nose tip].
    absolute : whether p itself is integrated over the open surface, or p - p_internal.
    """

    name: str
    moment_station: float
    absolute: bool


LITERAL = LoadReading("p over the open fore-body, moments about the nose tip", 0.0, True)
"""The source's words: f = C_map p, q_coeff = G f, without internal pressure. The moment point is not given."""


def load_readings(moment_station: float) -> tuple[LoadReading, ...]:
    """Return the readings that are compared; ``moment_station`` [m] is the vehicle file's."""
    station = f"x = {moment_station:g} m"
    return (
        LITERAL,
        LoadReading(f"p over the open fore-body, moments about {station}", moment_station, True),
        LoadReading("p - p_internal, moments about the nose tip", 0.0, False),
        LoadReading(f"p - p_internal, moments about {station} (vehicle file)", moment_station, False),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Case2Map:
    """The map of one layout in one set-up.

    Attributes
    ----------
    prior : of the snapshots.
    spectrum : of the whitened Z_p F.
    state_operator, mean_strain : (n_d, N) Z_p F [1], (n_d,) [m/m].
    data_operator : (n_d, n_p) Z_p of the data [1/Pa].
    sigma : of the noise [m/m].
    internal : pressure inside [Pa].
    """

    prior: LowRankPrior
    spectrum: WhitenedSpectrum
    state_operator: FloatArray
    mean_strain: FloatArray
    data_operator: FloatArray
    sigma: float
    internal: float

    def with_gamma(self, gamma: float) -> GaussianMap:
        """Return the map with ``gamma``."""
        noise = self.sigma**2 * np.eye(len(self.data_operator))
        return gaussian_map(
            state_operator=self.state_operator,
            mean_strain=self.mean_strain,
            noise_covariance=noise,
            regularisation=gamma,
            spectrum=self.spectrum,
        )

    def modes(self, count: int) -> FloatArray:
        """Return (n_p, ``count``) the first modes b_k = F v_k of the Hessian [Pa]."""
        return np.asarray(self.prior.factor @ self.spectrum.right_vectors[:, :count])

    def projection(self, pressure: FloatArray, count: int) -> FloatArray:
        """Return the pressure (n_p,) [Pa] nearest to ``pressure`` in mean + span of the first ``count`` modes.

        The source names no inner product; this is the Euclidean one.
        """
        basis, _ = np.linalg.qr(self.modes(count))
        return np.asarray(self.prior.mean + (pressure - self.prior.mean) @ basis @ basis.T)

    def modes_above(self, gamma: float) -> int:
        """Return how many eigenvalues are at least ``gamma``."""
        return int(np.sum(self.spectrum.eigenvalues >= gamma))


def case_2_map(prior: LowRankPrior, setup: SetUp, names: list[str], internal: float) -> Case2Map:
    """Return the map of the gauges ``names``; ``internal`` is the pressure inside [Pa]."""
    operator = setup.inversion.operator_of(names)
    state_operator = operator @ prior.factor
    spectrum = whitened_spectrum(state_operator, setup.sigma**2 * np.eye(len(names)))
    mean_strain = operator @ (prior.mean - internal)
    return Case2Map(
        prior=prior,
        spectrum=spectrum,
        state_operator=state_operator,
        mean_strain=mean_strain,
        data_operator=setup.data.operator_of(names),
        sigma=setup.sigma,
        internal=internal,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class GammaStudy:
    """gamma by each rule.

    Attributes
    ----------
    by_rule : over an ensemble of noisy strains; ``"morozov, expected"`` on the data expected from prior and noise,
        ``"morozov, M5 a6 b6"`` on draws of that flight alone; NaN where a rule finds none.
    eigenvalues : (k,) of the prior-preconditioned Hessian, falling.
    """

    by_rule: dict[str, float]
    eigenvalues: FloatArray


def study_gamma(case: Case2Map, ensemble: FloatArray, flight: FloatArray, seed: int = SEED) -> GammaStudy:
    """Return gamma by the source's rule and by three others.

    Parameters
    ----------
    of : the map.
    ensemble : (n, n_d) strains of many flights, without noise [m/m].
    flight : (n_d,) strains of M5 a6 b6 [m/m].
    seed : of the noise; each flight of the ensemble gets 50 draws, ``flight`` gets 100.
    """
    random = np.random.default_rng(seed)

    def noisy(strain: FloatArray, draws: int) -> DataSpectrum:
        repeated = np.repeat(np.atleast_2d(strain), draws, axis=0)
        return measured_data(
            case.spectrum.eigenvalues,
            case.spectrum.whitened_data(
                repeated + case.sigma * random.normal(size=repeated.shape), case.mean_strain
            ),
        )

    data = noisy(ensemble, DRAWS_PER_CONDITION)
    by_rule: dict[str, float] = {rule: _gamma(rule, data) for rule in RULES}
    by_rule["morozov, expected"] = _gamma(
        "morozov", expected_data(case.spectrum.eigenvalues, len(case.spectrum.left_vectors))
    )
    by_rule["morozov, M5 a6 b6"] = _gamma("morozov", noisy(flight, DRAWS))
    return GammaStudy(by_rule=by_rule, eigenvalues=case.spectrum.eigenvalues)


def _gamma(rule: Rule, data: DataSpectrum) -> float:
    try:
        return select_gamma(rule, data)
    except InputError:
        return float("nan")


def drawn_modes(case: Case2Map) -> FloatArray:
    """Return (n_p, 5) the eigenvectors that the source draws, of unit Euclidean norm."""
    modes = case.modes(max(DRAWN_MODES))[:, [k - 1 for k in DRAWN_MODES]]
    unit: FloatArray = modes / np.linalg.norm(modes, axis=0)
    return unit


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldStudy(FieldExample):
    """One flight condition, estimated from many draws of noise or from none.

    Attributes
    ----------
    load_error : (n, 5, n_readings) relative error of each coefficient of each draw, by each load reading [1].
    odd_fraction : (2,) fraction of |p| that is odd both in y and in z: of the reference, of the estimate's error.
    """

    load_error: FloatArray
    odd_fraction: FloatArray


def study_field(
    case: Case2Map,
    tested: FloatArray,
    gamma: float,
    noisy: bool,
    grid: SurfaceGrid,
    readings: tuple[LoadReading, ...],
    draws: int = DRAWS,
    seed: int = SEED,
) -> FieldStudy:
    """Estimate one ``tested`` field (n_p,) [Pa]; without noise there is one draw."""
    solved = case.with_gamma(gamma)
    strain = case.data_operator @ (tested - case.internal)
    noise = np.zeros((1, len(strain)))
    if noisy:
        noise = case.sigma * np.random.default_rng(seed).normal(size=(draws, len(strain)))
    states = (strain + noise) @ solved.strain_gain.T + solved.state_offset
    error = case.prior.mean + states @ case.prior.factor.T - tested
    relative = np.linalg.norm(error, axis=1) / np.linalg.norm(tested)
    middle = int(np.argsort(relative)[len(relative) // 2])
    n_kept = max(1, case.modes_above(gamma))
    projection = case.projection(tested, n_kept)
    odd_parts = [odd_part(field, grid) for field in (tested, error[middle])]
    return FieldStudy(
        reference=tested,
        estimate=tested + error[middle],
        projection=projection,
        errors=relative,
        shown=float(relative[middle]),
        load_error=np.stack(
            [_load_errors(error, tested, case.internal, grid, reading) for reading in readings], axis=-1
        ),
        odd_fraction=np.array([np.linalg.norm(odd) for odd in odd_parts]) / np.linalg.norm(tested),
    )


def _load_errors(
    error: FloatArray, tested: FloatArray, internal: float, grid: SurfaceGrid, reading: LoadReading
) -> FloatArray:
    """Return (n, 5) relative errors of the coefficients; q_inf and reference lengths cancel."""
    loads = load_operator(grid, reading.moment_station)
    true = loads @ (tested if reading.absolute else tested - internal)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative: FloatArray = np.abs(error @ loads.T / true)
    # Where symmetry makes a load 0 there is no relative error.
    relative[:, np.abs(true) < 1e-9 * np.abs(true).max()] = np.nan
    return relative


def odd_part(field: FloatArray, grid: SurfaceGrid) -> FloatArray:
    """Return the part (.., n_p) of a field (n_p,) or fields (n, n_p) that is odd in y and odd in z."""
    return symmetric_part(field.T, grid_mirrors(grid), even_in_y=False, even_in_z=False).T
