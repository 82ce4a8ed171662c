"""Measurements of the causes behind the differences from the source, one cause at a time."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from builder.reports.findings.prior_observability import grid_mirrors, symmetric_part
from builder.reproduce.case_1 import PUBLISHED_STRAIN, case_1_map, pod_of, study_case_1
from builder.reproduce.case_2 import Case2Map, case_2_map, odd_part
from builder.reproduce.paper_readings import READINGS, SHIPPED, Reading
from builder.reproduce.protocol import EXAMPLES, MODES, NOISE_FREE_GAMMA, P1, SEED
from builder.reproduce.setups import INDEPENDENT, Pressures, SetUp, noise_sigma
from builder.reproduce.strain_models import StrainModel
from builder.structure.observability import SYMMETRIES, smooth_response, symmetry_responses
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.linear.pressure_modes import LowRankPrior, PressureModes, prior_of_snapshots
from strainfmu.linear.state_map import relative_condition

SMOOTH_DEGREE = 6
"""Degree in x of the pressures that resolve the symmetry classes."""

EXAMPLE = list(EXAMPLES).index("m5_a6_b6")


@dataclass(frozen=True, kw_only=True)
class ReadingRow:
    """The result of one reading of the layout with one model.

    Attributes
    ----------
    model, reading : names.
    k_1, k_2 : relative condition numbers with the Euclidean POD.
    area_ratio : K1/K2 with the area-weighted POD.
    median_1, median_2 : median field error of Case 1 [1], Euclidean; NaN where not computed.
    """

    model: str
    reading: str
    k_1: float
    k_2: float
    area_ratio: float
    median_1: float
    median_2: float

    @property
    def ratio(self) -> float:
        """K1/K2."""
        return self.k_1 / self.k_2


def relative_condition_of(model: StrainModel, modes: PressureModes, names: list[str]) -> float:
    """Return K of the gauges ``names`` in the source's scaling (|d| = 100 um/m per gauge, q of unit rms norm)."""
    z = model.operator_of(names) @ modes.modes[:, :MODES]
    scale = float(np.linalg.norm(modes.coefficient_std[:MODES]))
    return relative_condition(
        z, strain_norm=PUBLISHED_STRAIN * np.sqrt(len(names)), state_norm=1.0, state_scale=scale
    ).value


def reading_rows(models: Mapping[str, StrainModel], pressures: Pressures) -> list[ReadingRow]:
    """Return K and Case 1's medians for the eight readings of the rows, model by model."""
    euclidean, area = pod_of(pressures.p1, None), pod_of(pressures.p1, pressures.weights)
    rows = []
    for model in models.values():
        sigma = noise_sigma(model, pressures.p1 - pressures.internal)
        setup = SetUp(key=model.name, inversion=model, data=model, sigma=sigma)
        for reading in READINGS:
            names = [reading.configuration(number) for number in (1, 2)]
            medians = [_median(euclidean, setup, layout, pressures) for layout in names]
            rows.append(_reading_row(model, reading.name, names, (euclidean, area), medians))
    return rows


def _median(modes: PressureModes, setup: SetUp, names: list[str], pressures: Pressures) -> float:
    case = case_1_map(modes, setup, names, pressures.internal)
    study = study_case_1(case, pressures, pressures.p1, P1.conditions)
    return float(np.median(study.field_error))


def span_row(span: str, model: StrainModel, pressures: Pressures, reading: Reading) -> ReadingRow:
    """Return K of one reading with rows of another ``span``."""
    euclidean, area = pod_of(pressures.p1, None), pod_of(pressures.p1, pressures.weights)
    names = [reading.configuration(number) for number in (1, 2)]
    return _reading_row(model, f"{reading.name}, stations {span}", names, (euclidean, area), [np.nan, np.nan])


def _reading_row(
    model: StrainModel,
    label: str,
    names: list[list[str]],
    pod: tuple[PressureModes, PressureModes],
    medians: list[float],
) -> ReadingRow:
    """Return a row; ``names`` and ``medians`` by configuration, ``pod`` Euclidean and weighted by area."""
    k, by_area = ([relative_condition_of(model, modes, layout) for layout in names] for modes in pod)
    return ReadingRow(
        model=model.name,
        reading=label,
        k_1=k[0],
        k_2=k[1],
        area_ratio=by_area[0] / by_area[1],
        median_1=medians[0],
        median_2=medians[1],
    )


@dataclass(frozen=True, kw_only=True)
class HoopRow:
    """Hoop and axial strains of one model against the Fourier model, over P1.

    Attributes
    ----------
    model : name.
    hoop_gain, axial_gain : least-squares factor on the Fourier model's strain [1].
    hoop_error, axial_error : rms difference over sigma of the Fourier model [1].
    """

    model: str
    hoop_gain: float
    axial_gain: float
    hoop_error: float
    axial_error: float


def hoop_rows(models: Mapping[str, StrainModel], true: StrainModel, pressures: Pressures) -> list[HoopRow]:
    """Compare strains of the models over P1 with the strains of ``true``, gauges of Configuration 2."""
    net = pressures.p1 - pressures.internal
    sigma = noise_sigma(true, net)
    names = SHIPPED.configuration(2)
    rows = []
    for model in models.values():
        ratios = []
        for kind in ("hoop", "axial"):
            chosen = [name for name in names if name.startswith(kind)]
            strain, expected = net @ model.operator_of(chosen).T, net @ true.operator_of(chosen).T
            ratios.append((np.sum(strain * expected) / np.sum(expected**2), np.std(strain - expected) / sigma))
        rows.append(
            HoopRow(
                model=model.name,
                hoop_gain=float(ratios[0][0]),
                axial_gain=float(ratios[1][0]),
                hoop_error=float(ratios[0][1]),
                axial_error=float(ratios[1][1]),
            )
        )
    return rows


@dataclass(frozen=True, kw_only=True)
class CrimeRow:
    """The field at M5 a6 b6 without noise, gamma 1e-6: map of one model, data of another.

    Attributes
    ----------
    inversion, data : names of the models.
    field_error : [1].
    odd_error : its part that is odd both in y and in z [1].
    odd_strain : |Z_p F_oo| / |Z_p F|, fraction of the prior's strain in the map that its doubly odd part causes
        [1].
    """

    inversion: str
    data: str
    field_error: float
    odd_error: float
    odd_strain: float


def crime_rows(
    pairs: list[tuple[StrainModel, StrainModel]],
    names: list[str],
    prior: LowRankPrior,
    pressures: Pressures,
    grid: SurfaceGrid,
) -> list[CrimeRow]:
    """Estimate the example without noise for every pair of models (map, data); the prior holds the condition."""
    tested, rows = pressures.examples[EXAMPLE], []
    odd_factor = odd_part(prior.factor.T, grid).T
    for inversion, data in pairs:
        setup = SetUp(
            key=INDEPENDENT,
            inversion=inversion,
            data=data,
            sigma=noise_sigma(inversion, pressures.p1 - pressures.internal),
        )
        case = case_2_map(prior, setup, names, pressures.internal)
        error = _noise_free_error(case, tested)
        size = float(np.linalg.norm(tested))
        rows.append(
            CrimeRow(
                inversion=inversion.name,
                data=data.name,
                field_error=float(np.linalg.norm(error)) / size,
                odd_error=float(np.linalg.norm(odd_part(error, grid))) / size,
                odd_strain=float(
                    np.linalg.norm(inversion.operator_of(names) @ odd_factor) / np.linalg.norm(case.state_operator)
                ),
            )
        )
    return rows


def _noise_free_error(case: Case2Map, tested: FloatArray) -> FloatArray:
    solved = case.with_gamma(NOISE_FREE_GAMMA)
    states = solved.strain_gain @ (case.data_operator @ (tested - case.internal)) + solved.state_offset
    error: FloatArray = case.prior.mean + case.prior.factor @ states - tested
    return error


@dataclass(frozen=True, kw_only=True)
class ClassRow:
    """Response of one layout to one symmetry class of pressures.

    Attributes
    ----------
    model, layout, symmetry : names.
    response : maximum strain norm per rms pressure [1/Pa].
    rank : number of singular values above 1 % of the maximum of all classes.
    prior_fraction : fraction of the prior's variance in the class [1].
    """

    model: str
    layout: str
    symmetry: str
    response: float
    rank: int
    prior_fraction: float


def class_rows(
    model: StrainModel, layouts: Mapping[str, list[str]], prior: LowRankPrior, grid: SurfaceGrid, area: FloatArray
) -> list[ClassRow]:
    """Return the four symmetry classes of each layout; ``area`` (n_p,) is the area of the nodes [m2]."""
    point = np.column_stack(
        [
            np.repeat(grid.x, grid.n_roll),
            np.outer(grid.radius, np.sin(grid.roll_angle)).ravel(),
            np.outer(grid.radius, np.cos(grid.roll_angle)).ravel(),
        ]
    )
    every = smooth_response(model.operator, point, area, SMOOTH_DEGREE)
    fractions = _class_fractions(prior, grid)
    rows = []
    for layout, names in layouts.items():
        responses = symmetry_responses(every.at_gauges(np.array(model.indices(names))))
        rows += [
            ClassRow(
                model=model.name,
                layout=layout,
                symmetry=str(response.symmetry),
                response=response.norm,
                rank=response.rank,
                prior_fraction=fractions[str(response.symmetry)],
            )
            for response in responses
        ]
    return rows


def _class_fractions(prior: LowRankPrior, grid: SurfaceGrid) -> dict[str, float]:
    """Return the fraction of the prior's variance in each symmetry class."""
    mirrors, total = grid_mirrors(grid), float(np.sum(prior.factor**2))
    parts = ((kind, symmetric_part(prior.factor, mirrors, kind.even_in_y, kind.even_in_z)) for kind in SYMMETRIES)
    return {str(kind): float(np.sum(part**2)) / total for kind, part in parts}


@dataclass(frozen=True, kw_only=True)
class ScatterRow:
    """The eigenvalues when every pressure of every snapshot has an independent error.

    Attributes
    ----------
    model : name.
    scatter : standard deviation of that error over the pressure [1].
    above : number of eigenvalues above 1e-6, the gamma of the noise-free example.
    decay : lambda_1 / lambda_8.
    smallest : smallest eigenvalue.
    """

    model: str
    scatter: float
    above: int
    decay: float
    smallest: float


def scatter_rows(
    model: StrainModel, names: list[str], pressures: Pressures, scatters: list[float]
) -> list[ScatterRow]:
    """Return the eigenvalues of Case 2 with scattered snapshots.

    Our conditions share flows, exactly rolled. Results on one mesh per condition have no such relation.
    """
    sigma = noise_sigma(model, pressures.p1 - pressures.internal)
    setup, rows = SetUp(key=model.name, inversion=model, data=model, sigma=sigma), []
    for scatter in scatters:
        error = np.random.default_rng(SEED).normal(size=pressures.p2.shape)
        prior = prior_of_snapshots(pressures.p2 * (1.0 + scatter * error))
        values = case_2_map(prior, setup, names, pressures.internal).spectrum.eigenvalues
        above = int(np.sum(values > NOISE_FREE_GAMMA))
        rows.append(
            ScatterRow(
                model=model.name,
                scatter=scatter,
                above=above,
                decay=float(values[0] / values[7]),
                smallest=float(values[-1]),
            )
        )
    return rows
