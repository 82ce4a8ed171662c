"""The artefact ``map.h5``: everything that turns strain into loads, and what it was made from.

Model: d = m + A q + e with cov(e) = Gamma; m is the strain of the mean pressure. Case 1: A = Z V with the kept
POD modes V, q free [Pa]. Case 2: A = Z F with the factor F of the prior covariance, q standard normal [1]. The
estimate q = T d + k, k = -T m, minimises |L^-1 (d - m - A q)|^2 + gamma |q|^2, L L' = Gamma (Pham et al., eq.
segmented-ls-solution). The loads are f = M q + f_mean and what the residual reveals of load outside the states.

Errors are columns: e = e_g + N y and the load outside the states g = N_f y, with cov(e_g) = Gamma_g and y standard
normal; so Gamma = Gamma_g + N N'. A column may have strain and no load, load and no strain, or both, as the column
of a truncated mode. Columns that strain one gauge alone, as errors of its gain, are one number a gauge,
:attr:`InverseMap.own_error_strain`. The file holds primary quantities alone. The compiled core computes what
follows from them as it opens a map; :mod:`strainfmu.estimator.reference.gain` gives gains and covariances to
reports.

Errors of gain, stiffness, wall, gauge position and layout roll grow with strain, which is nearly linear in the
coefficients C that the step has estimated. The weights have them at their mean over the snapshots; with c = [1, C]
the rest is of sum_ab (c_a c_b - mean of c_a c_b) H_ab, H_ab = diag(sum_t D_tai D_tbi) + sum_t E_ta E_tb'. D_t is a
term that is independent from gauge to gauge, E_t one that all gauges have in common, both per standard deviation
(:func:`~strainfmu.estimator.reference.linear.excess_covariance`).

Form "absolute" is the paper's: the model holds as it stands. In form "dynamic_pressure" it holds at the nominal
dynamic pressure; :mod:`strainfmu.estimator.reference.linear` has it at others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import BoolArray, FloatArray, common_to_pairs
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.map.schema import (
    BOUNDS,
    COVARIANCE,
    FROM_0,
    NO_BOUNDS,
    POSITIVE,
    UNIQUE,
    MapRecord,
    Sizes,
    entries,
    entry,
    has_no_values,
    left_out,
)
from strainfmu.estimator.map.sensors import (
    HingeLines,
    InertiaMap,
    SensorRows,
    ThermalMap,
    no_temperature,
    strain_rows,
    with_inertia,
)
from strainfmu.estimator.notebook import html_table
from strainfmu.estimator.numerics import product, row_squares
from strainfmu.estimator.other_loads import FIVE_LOADS, LoadGroup, is_moment, load_groups, number_of
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES as COEFFICIENT_NAMES
from strainfmu.estimator.signal_names import LOAD_NAMES as LOAD_NAMES
from strainfmu.estimator.signal_names import LOAD_UNITS as LOAD_UNITS
from strainfmu.estimator.valid_ranges import valid_ranges
from strainfmu.files import build_time
from strainfmu.records import load_record, save_record

SCHEMA = "strainfmu.inverse_map"
SCHEMA_VERSION = 10

CASES = (1, 2)
"""Least squares on POD modes; low-rank Gaussian prior."""

FORMS = PER_PRESSURE, ABSOLUTE = (DYNAMIC_PRESSURE, "absolute")
"""Strain in proportion to q_inf, for any altitude; the paper's, for the pressure level of the snapshots."""

PAIRS = tuple((a, b) for a in range(6) for b in range(a, 6))
"""The 21 products c_a c_b of c = [1, C_A, C_N, C_Y, M_P, M_Y], a <= b."""

DENSE_GAUGES, MOST_DENSE_GAUGES = 512, 2_000
"""Gauges up to which the linear estimator computes with matrices of all gauges, and may do so."""

FIELD = ("field_mean", "field_modes", "point", "triangle")
"""Fields of the pressure on the surface, of which a map has all or none."""

_ROUND_OFF = 1e-6
"""Largest relative difference between numbers that are equal but for round-off."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class InverseMap(MapRecord, where="inverse map"):
    """A finished inverse map for n_d gauges and n_q pressure states.

    Loads are outputs, n_f of them: the five of :data:`LOAD_NAMES` [N, N, N, N m, N m], then the loads of the
    groups in :attr:`load_groups` (:mod:`strainfmu.estimator.other_loads`), the rolling moment of the body first.
    n_f is 5 where that is zero, as of a body of revolution, and no other loads are wanted. A load that is known to
    be zero has rows of zeros. Coefficients are the five of :data:`COEFFICIENT_NAMES`.

    Data that a map does not have are neutral: zeros, no rows, no bounds. A caller leaves them out, or gives an
    array without values; a file leaves them out, too.
    """

    # fmt: off
    vehicle: str = entry(meaning="name of the vehicle and what it stands for", unit="")
    case: int = entry(meaning="1, least squares on POD modes, or 2, low-rank Gaussian prior", unit="",
        allowed=CASES)
    gauge_names: tuple[str, ...] = entry("n_d", "", "names, unique", rule=UNIQUE)
    gauge_position: FloatArray = entry("n_d 3", "m", "position in body axes")
    gauge_direction: FloatArray = entry("n_d 3", "1", "unit vectors of the measured strain in body axes")
    noise_std: FloatArray = entry("n_d", "m/m", "sigma, standard deviation of the noise of each gauge",
        place="tare.noise_std", stored="n_strains", rule=POSITIVE)
    state_operator: FloatArray = entry("n_d n_q", "(m/m)/state",
        "A; the unit of a state is Pa in Case 1, 1 in Case 2", place="linear.state_operator", stored="n_q n_d")
    gauge_covariance: FloatArray = entry("n_d n_d", "(m/m)^2",
        "Gamma_g, covariance of the errors that have no columns: gauge noise, and all that does not follow q_inf",
        place="linear.gauge_covariance", rule=COVARIANCE)
    error_strain: FloatArray = entry("n_d k", "m/m",
        "N, strain of each error that has a column per standard deviation, at the nominal dynamic pressure",
        place="linear.error_strain", stored="k n_d")
    error_load: FloatArray = entry("n_f k", "N, N.m", "N_f, loads of the errors of error_strain",
        place="linear.error_load", stored="k 5")
    regularisation: float = entry(meaning="gamma, 0 in Case 1, positive in Case 2", place="linear.regularisation",
        low=0.0)
    load_per_state: FloatArray = entry("n_f n_q", "N/state, N.m/state",
        "M, loads of each state: G C_map V or G C_map F", place="linear.load_per_state", stored="n_q 5")
    load_of_mean: FloatArray = entry("n_f", "N, N.m", "f_mean, loads of the mean pressure",
        place="linear.load_of_mean", stored="5")
    mean_strain: FloatArray = entry("n_d", "m/m", "m, strain of the mean pressure", place="linear.mean_strain")
    strain_range: FloatArray = entry("n_d", "m/m", "largest |strain| over the snapshots")
    coefficient_range: FloatArray = entry("5 2", "1", "smallest and largest coefficient over the snapshots")
    reference_area: float = entry(unit="m2", meaning="S", rule=POSITIVE)
    reference_length: float = entry(unit="m", meaning="L", rule=POSITIVE)
    nominal_dynamic_pressure: float = entry(unit="Pa", meaning="mean q_inf of the snapshots",
        place="settings.dynamic_pressure", rule=POSITIVE)
    provenance: dict[str, Any] = field(default_factory=dict)
    field_mean: NDArray[np.float32] = entry("n_p", "Pa",
        "pressure at the nodes is field_mean + field_modes q; no nodes: no field", neutral=0, dtype="f4")
    field_modes: NDArray[np.float32] = entry("n_p n_q", "Pa/state", "see field_mean", neutral=0, dtype="f4")
    field_std: NDArray[np.float32] = entry("n_p", "Pa",
        "standard deviation of pressure that no state holds, as of truncated modes", neutral=0, dtype="f4",
        rule=FROM_0)
    field_is_net: bool = entry(meaning="1 if the field is p - p_inf", neutral=False, default=False)
    point: NDArray[np.float32] = entry("n_p 3", "m", "nodes of the surface of the field", neutral=0, dtype="f4")
    triangle: NDArray[np.int32] = entry("n_t 3", "1", "its triangles, numbers of nodes", neutral=0, dtype="i4")
    form: str = entry(unit="", meaning="dynamic_pressure or absolute", default="absolute", allowed=FORMS)
    fixed_strain: FloatArray = entry("n_d", "m/m",
        "d_0, strain that does not follow q_inf, as by an internal pressure that is not the ambient one",
        neutral=0.0, group="fixed")
    fixed_load: FloatArray = entry("n_f", "N, N.m", "f_0, the same of loads; both are part of the mean",
        neutral=0.0, group="fixed")
    own_error_strain: FloatArray = entry("n_d", "m/m",
        "standard deviation of each gauge's own errors that grow with the pressure, besides error_strain",
        neutral=0.0, rule=FROM_0)
    zero_offset: FloatArray = entry("n_d", "m/m",
        "reading of each strain gauge without strain by the calibration; subtracted unless others are given",
        neutral=0.0, place="settings.zero_offset", stored="n_strains")
    gauge_error_product: FloatArray = entry("21 n_d", "(m/m)^2",
        "errors that follow the current strain: sum of D_a D_b over the terms of each gauge, doubled for a < b",
        neutral=0.0, group="errors at strain", place="scaled_errors.of_gauge")
    common_error: FloatArray = entry("n_e 6 n_d", "m/m", "E of each such term that all gauges have in common",
        neutral=0.0, group="errors at strain", place="scaled_errors.common")
    mean_product: FloatArray = entry("21", "1", "mean of c_a c_b over the snapshots", neutral=0.0,
        group="errors at strain", place="scaled_errors.mean_product")
    dynamic_pressure_error: float = entry(
        meaning="standard deviation of q_inf over q_inf, where the caller states none", default=0.0,
        place="linear.dynamic_pressure_error", low=0.0, high=1.0)
    chi_square_scale: float = entry(
        meaning="factor on the detection threshold of chi-square, from data of a truth model", default=1.0,
        place="linear.chi_square_scale", rule=POSITIVE)
    outlier_scale: float = entry(meaning="the same on the threshold of the square of the largest |z|", default=1.0,
        place="linear.outlier_scale", rule=POSITIVE)
    level_slope: float = entry(
        meaning="a: the thresholds follow r (1 - a + a r), r the expected chi-square over the one at the mean",
        neutral=0.0, default=0.0, place="linear.level_slope", low=0.0, high=1.0)
    envelope_direction: FloatArray = entry("m 5", "1", "half-spaces of the coefficients, n'C <= envelope_limit",
        neutral=0.0, place="envelope.direction", stored="5 m")
    envelope_limit: FloatArray = entry("m", "1", "see envelope_direction", neutral=0.0, place="envelope.limit")
    envelope_score_limit: float = entry(meaning="standard deviations beyond them that count as outside",
        default=3.0, place="envelope.score_limit", rule=POSITIVE)
    dynamic_pressure_range: FloatArray = entry("2", "Pa", "validity, -inf to inf without limits",
        neutral=NO_BOUNDS, rule=BOUNDS)
    mach_number_range: FloatArray = entry("2", "1", "validity", neutral=NO_BOUNDS, rule=BOUNDS)
    altitude_range: FloatArray = entry("2", "m", "validity", neutral=NO_BOUNDS, rule=BOUNDS)
    sensors: SensorRows = entry(unit="",
        meaning="what the rows measure; other fields hold all rows as strain, readings over ``sensors.scale``",
        neutral=lambda m: strain_rows(len(m.gauge_names)), record=SensorRows)
    section_station: FloatArray = entry("n_s", "m", "x of the sections, rising; may be empty", default=np.zeros(0))
    hinge_lines: HingeLines | None = entry(unit="",
        meaning="lines of the hinge moments; None where none are wanted", default=None, record=HingeLines)
    bending_lines: HingeLines | None = entry(unit="",
        meaning="the same of bending moments of the part ahead of a station, points on the axis there",
        default=None, record=HingeLines)
    thermal: ThermalMap = entry(unit="",
        meaning="modes of the wall's temperature and sensors of it; no modes where the map knows of none",
        neutral=lambda m: no_temperature(m.gauge_covariance), record=ThermalMap)
    inertia: InertiaMap | None = entry(unit="", meaning="modes of the vehicle's inertia, and what measures them",
        default=None, record=InertiaMap)
    manifold: ManifoldMap | None = entry(unit="", meaning="tables of the nonlinear estimator for the same gauges",
        default=None, record=ManifoldMap)
    # fmt: on

    def __post_init__(self) -> None:
        missing = [name for name in FIELD if has_no_values(getattr(self, name))]
        if 0 < len(missing) < len(FIELD):
            names = ", ".join(missing)
            raise InputError(f"inverse map: {names} missing, the pressure field needs {', '.join(FIELD)}")
        _check_number_of_loads(self)
        super().__post_init__()

    def sizes(self) -> Sizes:
        """Return the lengths by which neutral arrays are made."""
        n_d, n_q, n_f = self.n_gauges, self.state_operator.shape[-1], self.n_loads
        return {
            "n_d": n_d,
            "n_q": n_q,
            "n_f": n_f,
            "n_p": 0 if has_no_values(self.field_mean) else len(self.field_mean),
        }

    def contradictions(self) -> Iterator[str]:
        """Yield what is wrong between fields, each of which is right by itself, and what is allowed."""
        gamma, is_free, n_d, n_q = self.regularisation, self.case == 1, self.n_gauges, self.n_states
        n_p, n_aux, manifold = len(self.field_mean), n_d - self.n_strain_gauges, self.manifold
        if not (gamma == 0.0 if is_free else 0.0 < gamma < np.inf):
            yield f"regularisation is {gamma}, must be {'0' if is_free else 'positive'} in Case {self.case}"
        if self.follows_pressure and gamma not in (0.0, 1.0):
            yield f"regularisation is {gamma}, must be 1 (0 in Case 1) in form 'dynamic_pressure'"
        if is_free and n_d <= n_q:
            yield f"{n_d} gauges for {n_q} states found, health needs at least one gauge more"
        if self.errors_follow_strain and not self.mean_product.any():
            yield "mean_product is 0, must be given where gauge_error_product or common_error is not 0"
        if len(self.triangle) and not (self.triangle.min() >= 0 and self.triangle.max() < n_p):
            yield f"triangle names nodes outside 0 .. {n_p - 1}"
        if manifold is not None:
            surface = manifold.surface_field
            if surface is not None and self.has_field and surface.n_nodes != n_p:
                yield f"pressure_field has {surface.n_nodes} nodes, must have {n_p}"
            if len(manifold.sensor_gain_std) != n_aux:
                yield f"tables of {len(manifold.sensor_gain_std)} auxiliary sensors, must be of {n_aux}"
        scaled = self.own_error_strain**2 + row_squares(self.error_strain)
        total = np.diag(self.gauge_covariance) + scaled
        if not np.all(total >= (1.0 - _ROUND_OFF) * self.noise_std**2):
            yield "gauge_covariance has variances below noise_std squared, must hold the gauge noise"
        if n_d > MOST_DENSE_GAUGES and not self.is_low_rank:
            yield (
                f"{n_d} gauges found, must be {MOST_DENSE_GAUGES} at most with tables, temperature, inertia, "
                "auxiliary sensors, other loads than the five, a full covariance of the gauges or form 'absolute'"
            )
        whitened = self.state_operator / self.noise_std[:, None]
        size = np.linalg.norm(whitened, axis=0)
        if is_free and not (np.all(size > 0.0) and np.linalg.matrix_rank(whitened / size) == n_q):
            yield "state_operator does not identify the states: its columns are dependent"

    def _repr_html_(self) -> str:
        method = {1: "least squares on POD modes", 2: "low-rank Gaussian prior"}[self.case]
        rows = [
            ("method", f"Case {self.case}, {method}"),
            ("gauges", f"{self.n_gauges}"),
            ("pressure states", f"{self.n_states}"),
            *((valid.quantity, valid.text) for valid in valid_ranges(self)),
        ]
        return html_table(f"Inverse map: {self.vehicle}", ("", ""), rows)

    def without_tables(self) -> InverseMap:
        """Return this map for the linear estimator alone; the map itself where it has no tables."""
        return self if self.manifold is None else replace(self, manifold=None)

    @property
    def n_gauges(self) -> int:
        """Number of gauges n_d, auxiliary sensors among them."""
        return len(self.gauge_names)

    @property
    def n_strain_gauges(self) -> int:
        """Number of strain gauges, the first rows; all of them in a map without auxiliary sensors."""
        return self.sensors.n_strain_gauges

    @property
    def n_states(self) -> int:
        """Number of pressure states n_q."""
        return self.state_operator.shape[1]

    @property
    def n_loads(self) -> int:
        """Number of loads n_f."""
        return self.load_of_mean.size

    @property
    def has_other_loads(self) -> bool:
        """Whether loads follow the five."""
        return self.n_loads > len(LOAD_NAMES)

    @cached_property
    def load_groups(self) -> tuple[LoadGroup, ...]:
        """Groups of the loads behind the five, in the order of their rows; a map may leave all of them out."""
        return load_groups(self)

    @property
    def is_moment(self) -> BoolArray:
        """(n_f,) whether each load is a moment [N m]; the others are forces [N]."""
        of_five = [unit == "N m" for unit in LOAD_UNITS]
        return np.append(of_five, is_moment(self.load_groups))[: self.n_loads]

    @cached_property
    def references(self) -> FloatArray:
        """(n_f,) S of forces and S L of moments [m2, m3]: loads are coefficients times q_inf times these."""
        return self.reference_area * np.where(self.is_moment, self.reference_length, 1.0)

    @property
    def outside_score(self) -> float:
        """Score from which an estimate is outside of what the map holds for."""
        return self.envelope_score_limit if self.manifold is None else self.manifold.outside_score

    @property
    def follows_pressure(self) -> bool:
        """Whether strain, loads and errors but the gauges' own follow the dynamic pressure."""
        return self.form == PER_PRESSURE

    @property
    def has_field(self) -> bool:
        """Whether the map holds the pressure on the surface."""
        return len(self.field_mean) > 0

    @property
    def has_auxiliary_sensors(self) -> bool:
        """Whether some rows are no strain gauges."""
        return self.n_strain_gauges < self.n_gauges

    @property
    def has_temperature(self) -> bool:
        """Whether the map has modes of the wall's temperature."""
        return self.thermal.n_modes > 0

    @property
    def has_masses(self) -> bool:
        """Whether the map has modes of the vehicle's inertia."""
        return self.inertia is not None

    @cached_property
    def thermal_and_inertia(self) -> ThermalMap:
        """Modes of the wall's temperature, then modes of inertia and of vibration, with all that measures them.

        Channels follow the temperatures as sensors, and read channels above the reference temperature. The gauges
        are no warmer by modes of inertia. Nothing measures vibration.
        """
        return self.thermal if self.inertia is None else with_inertia(self.thermal, self.inertia)

    @property
    def errors_follow_strain(self) -> bool:
        """Whether some errors follow the current strain."""
        return bool(self.gauge_error_product.any() or self.common_error.any())

    # What follows from the fields.

    @cached_property
    def is_low_rank(self) -> bool:
        """Whether the linear estimator computes by columns of errors instead of matrices of all gauges.

        So it does for more than :data:`DENSE_GAUGES` strain gauges in form "dynamic_pressure" whose errors that do
        not scale are independent but for one that all have in common, without tables, temperature, inertia or
        other loads than the five.
        """
        return (
            self.n_gauges > DENSE_GAUGES
            and self.follows_pressure
            and self.manifold is None
            and not (self.thermal_and_inertia.n_modes or self.has_auxiliary_sensors or self.has_other_loads)
            and self.common_variance >= 0.0
            and bool(np.all(self.gauge_variance > 0.0))
            and common_to_pairs(self.gauge_covariance) is not None
        )

    @property
    def common_variance(self) -> float:
        """Covariance of the errors of the first two gauges that do not scale [(m/m)^2]."""
        return float(self.gauge_covariance[0, 1])

    @cached_property
    def gauge_variance(self) -> FloatArray:
        """(n_d,) variances of errors that do not scale, less :attr:`common_variance` [(m/m)^2]."""
        return np.diag(self.gauge_covariance) - self.common_variance

    @cached_property
    def noise_covariance(self) -> FloatArray:
        """(n_d, n_d) Gamma, Gamma_g and :attr:`scaled_covariance` [(m/m)^2], of the strain that no state holds."""
        return self.gauge_covariance + self.scaled_covariance

    @cached_property
    def scaled_covariance(self) -> FloatArray:
        """(n_d, n_d) N N' and the gauges' own errors that grow with the pressure [(m/m)^2].

        In the same bits on every machine, as everything that FMUs hold.
        """
        return np.diag(self.own_error_strain**2) + product(self.error_strain, self.error_strain.T)

    @cached_property
    def strain_load_covariance(self) -> FloatArray:
        """(n_d, n_f) X = N N_f' [(m/m) (N, N m)], of strain and load that no state holds."""
        return product(self.error_strain, self.error_load.T)

    @property
    def residual_degrees_of_freedom(self) -> int:
        """Expected value of the chi-square of the residual of all gauges."""
        return self.n_gauges - (self.n_states if self.case == 1 else 0)


def _check_number_of_loads(inverse_map: InverseMap) -> None:
    """Check that the loads are the five, or these with the loads of every group."""
    groups, n_loads = inverse_map.load_groups, inverse_map.load_of_mean.size
    sizes = {group.family: group.size for group in groups if group.family.is_listed}
    allowed = FIVE_LOADS.stop + number_of(groups)
    if n_loads != allowed and (sizes or n_loads != FIVE_LOADS.stop):
        counts = ", ".join(f"{size} {family.singular}s" for family, size in sizes.items())
        words = f"{allowed} for {counts}" if sizes else f"{FIVE_LOADS.stop} or {allowed}"
        raise InputError(f"inverse map: load_of_mean has {n_loads} loads, must be {words}")


def save_inverse_map(inverse_map: InverseMap, path: str | PathLike[str], built: str = "") -> str:
    """Write ``inverse_map`` to ``path`` atomically and return its content hash.

    ``built`` is the time of its build, "" for now; FMUs state it.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """
    state = "Pa" if inverse_map.case == 1 else "1"
    units = {name: stated.unit.replace("state", state) for name, stated in entries(inverse_map).items()}
    built = built or build_time()
    return save_record(inverse_map, Path(path), SCHEMA, SCHEMA_VERSION, units, left_out, built_at=built)


def load_inverse_map(path: str | PathLike[str]) -> InverseMap:
    """Read and check a map.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version.
    """
    return load_record(InverseMap, Path(path), SCHEMA, SCHEMA_VERSION)


def has_filter(inverse_map: InverseMap) -> bool:
    """Return whether FMUs of ``inverse_map`` can filter.

    All can but linear maps of gamma other than 1 in Case 2: the gain of these belongs to no law of the states that
    a filter could carry on.
    """
    return inverse_map.manifold is not None or inverse_map.case == 1 or inverse_map.regularisation == 1.0


def groups_of_outputs(inverse_map: InverseMap) -> tuple[LoadGroup, ...]:
    """Return the groups of loads that FMUs of the map state after the five.

    None but for maps with tables or in form "dynamic_pressure".
    """
    in_core = inverse_map.manifold is not None or inverse_map.follows_pressure
    return inverse_map.load_groups if inverse_map.has_other_loads and in_core else ()


def with_gauge_covariance(
    inverse_map: InverseMap, own: FloatArray, of_tables: FloatArray | None = None
) -> InverseMap:
    """Return ``inverse_map`` for gauges whose errors that do not scale have the covariance ``own`` (n_d, n_d).

    ``of_tables`` (n_d, n_d) is their covariance about the tables; None for the same. Ranges and alarm scales stay.
    """
    flight = inverse_map.manifold
    if flight is not None:
        flight = replace(flight, gauge_covariance=own if of_tables is None else of_tables)
    return replace(inverse_map, gauge_covariance=own, manifold=flight)
