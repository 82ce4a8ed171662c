"""The artefact ``map.h5``: everything that turns strain into loads, and what it was made from.

Model: d = m + A q + e with cov(e) = Gamma; m is the strain of the mean pressure. Case 1: A = Z V with the kept
POD modes V, q free [Pa]. Case 2: A = Z F with the factor F of the prior covariance, q standard normal [1]. The
estimate q = T d + k, k = -T m, minimises |L^-1 (d - m - A q)|^2 + gamma |q|^2, L L' = Gamma (Pham et al., eq.
segmented-ls-solution). The loads are f = M q + f_mean and what the residual reveals of load outside the states.

Errors are columns: e = e_g + N y and the load outside the states g = N_f y, with cov(e_g) = Gamma_g and y standard
normal; so Gamma = Gamma_g + N N'. A column may have strain and no load, load and no strain, or both, as the column
of a truncated mode. The file holds primary quantities alone. The compiled core computes what follows from them as
it opens a map; :mod:`strainfmu.estimator.reference.gain` gives gains and covariances to reports.

Form "absolute" is the paper's: the model holds as it stands. In form "dynamic_pressure" it holds at the nominal
dynamic pressure; at s times that, d = d_0 + s (m - d_0 + A q + N y) + e_g and f = f_0 + s (..)
(:mod:`strainfmu.estimator.reference.linear`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.estimator.map.hinge_lines import UNITS as HINGE_UNITS
from strainfmu.estimator.map.hinge_lines import HingeLines
from strainfmu.estimator.map.inertia import UNITS as INERTIA_UNITS
from strainfmu.estimator.map.inertia import InertiaMap, with_inertia
from strainfmu.estimator.map.inverse_map_checks import PER_PRESSURE, check_arrays, check_groups, check_inverse_map
from strainfmu.estimator.map.neutral import (
    fill,
    neutral_arrays,
    neutral_fields,
    neutral_parts,
    no_indices,
    no_numbers,
    no_singles,
)
from strainfmu.estimator.map.sensors import UNITS as SENSOR_UNITS
from strainfmu.estimator.map.sensors import SensorRows, strain_rows
from strainfmu.estimator.map.temperature import UNITS as THERMAL_UNITS
from strainfmu.estimator.map.temperature import ThermalMap, no_temperature
from strainfmu.estimator.numerics.fixed_order import product
from strainfmu.estimator.other_loads import LoadGroup, is_moment, load_groups, names_of
from strainfmu.estimator.setting_inputs import OF_AREA, OF_LENGTH
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES as COEFFICIENT_NAMES
from strainfmu.estimator.signal_names import LOAD_NAMES as LOAD_NAMES
from strainfmu.estimator.signal_names import LOAD_UNITS as LOAD_UNITS
from strainfmu.estimator.tables.manifold_map import UNITS as MANIFOLD_UNITS
from strainfmu.estimator.tables.manifold_map import ManifoldMap
from strainfmu.records import OPTIONAL, inner_record, load_record, save_record

SCHEMA = "strainfmu.inverse_map"
SCHEMA_VERSION = 10

DEFAULT_SCORE_LIMIT = 3.0
"""Standard deviations beyond the envelope that count as outside, where the map states no other."""


@dataclass(frozen=True, kw_only=True, eq=False)
class InverseMap:
    """A finished inverse map for n_d gauges and n_q pressure states.

    Loads are outputs, n_f of them: the five of :data:`LOAD_NAMES` [N, N, N, N m, N m], then the loads of the
    groups in :attr:`load_groups` (:mod:`strainfmu.estimator.other_loads`), the rolling moment of the body first.
    n_f is 5 where that is zero, as of a body of revolution, and no other loads are wanted. A load that is known to
    be zero has rows of zeros. Coefficients are the five of :data:`COEFFICIENT_NAMES`.

    Attributes
    ----------
    vehicle : name of the vehicle and what it stands for.
    case : 1, least squares on POD modes, or 2, low-rank Gaussian prior.
    gauge_names : n_d names, unique.
    gauge_position : (n_d, 3) position in body axes [m].
    gauge_direction : (n_d, 3) unit vectors of the measured strain.
    noise_std : (n_d,) standard deviation sigma of each gauge's noise [m/m].
    state_operator : (n_d, n_q) A [(m/m)/state]; the unit of a state is Pa in Case 1, 1 in Case 2.
    gauge_covariance : (n_d, n_d) Gamma_g [(m/m)^2], of the errors that have no columns; they do not follow q_inf.
    error_strain, error_load : (n_d, k) N [m/m] and (n_f, k) N_f [N, N m], strain and load of each error per
        standard deviation, at the nominal dynamic pressure.
    regularisation : gamma [1], 0 in Case 1, positive in Case 2.
    load_per_state : (n_f, n_q) M, G C_map V or G C_map F [N/state, N m/state].
    load_of_mean : (n_f,) f_mean, loads of the mean pressure [N, N m].
    mean_strain : (n_d,) m, strain of the mean pressure [m/m].
    strain_range : (n_d,) largest |strain| over the snapshots [m/m].
    coefficient_range : (5, 2) smallest and largest coefficient over the snapshots.
    reference_area : S [m2].
    reference_length : L [m].
    nominal_dynamic_pressure : mean q_inf of the snapshots [Pa].
    provenance : what the map was built from: settings, versions, hashes, the flight envelope.
    field_mean, field_modes : (n_p,) [Pa] and (n_p, n_q) [Pa/state], p = field_mean + field_modes q. A map
        without a pressure field has n_p = 0 nodes.
    field_std : (n_p,) standard deviation of the pressure that no state holds, as of truncated modes [Pa].
    field_is_net : whether that field is p - p_inf.
    point, triangle : (n_p, 3) [m] and (n_t, 3), the surface of that field.
    form : one of :data:`FORMS`.
    fixed_strain, fixed_load : (n_d,) d_0 [m/m] and (n_f,) f_0 [N, N m], which do not follow q_inf, as the effects
        of an internal pressure that is not the ambient one; part of ``mean_strain`` and ``load_of_mean``. 0 for
        none.
    zero_offset : (n_d,) reading of each strain gauge without strain [m/m], by the map's calibration; 0 without
        one. Estimators subtract it unless other zero offsets are given; its errors are part of the noise.
    gauge_error_product : (21, n_d) [(m/m)^2], common_error : (n_t, 6, n_d) [m/m], mean_product : (21,) [1], see
        :class:`~strainfmu.estimator.map.proportional_errors.ErrorModel`; 0 and no terms where no error follows the
        current strain.
    dynamic_pressure_error : standard deviation of q_inf relative to q_inf, where the caller states none [1].
    chi_square_scale, outlier_scale : factors on the alarm levels of chi-square and of the square of the largest
        |z|, from data of an independent model [1].
    level_slope : a, 0 to 1; these levels are in proportion to r (1 - a + a r), r the expected chi-square over that
        at the mean strain.
    envelope_direction, envelope_limit : (n, 5) [1] and (n,) half-spaces of the coefficients; n = 0 for none.
    envelope_score_limit : standard deviations beyond them that count as outside [1].
    dynamic_pressure_range, mach_number_range, altitude_range : (2,) [Pa, 1, m] of validity; -inf to inf where
        nothing bounds them.
    sensors : what the rows measure. All other fields hold the rows as strain, readings over ``sensors.scale``.
    section_station : (n_s,) x of the sections [m], rising; none where no sections are wanted.
    hinge_lines : lines about which the map gives hinge moments; None where none are wanted.
    bending_lines : the same of bending moments of the part ahead of a station, points on the axis there.
    thermal : modes of the wall's temperature and sensors of it; of a map that knows of none, no modes.
    inertia : modes of the vehicle's inertia, and what measures them; None of a map that knows of none.
    manifold : tables of the nonlinear estimator for the same gauges; None in a map for the linear one alone.

    Data that a map does not have are neutral: zeros, no rows, no bounds (:mod:`strainfmu.estimator.map.neutral`).
    A caller leaves them out, or gives an array without values.
    """

    vehicle: str
    case: int
    gauge_names: tuple[str, ...]
    gauge_position: FloatArray
    gauge_direction: FloatArray
    noise_std: FloatArray
    state_operator: FloatArray
    gauge_covariance: FloatArray
    error_strain: FloatArray
    error_load: FloatArray
    regularisation: float
    load_per_state: FloatArray
    load_of_mean: FloatArray
    mean_strain: FloatArray
    strain_range: FloatArray
    coefficient_range: FloatArray
    reference_area: float
    reference_length: float
    nominal_dynamic_pressure: float
    provenance: dict[str, Any] = field(default_factory=dict)
    field_mean: NDArray[np.float32] = field(default_factory=no_singles, metadata=OPTIONAL)
    field_modes: NDArray[np.float32] = field(default_factory=no_singles, metadata=OPTIONAL)
    field_std: NDArray[np.float32] = field(default_factory=no_singles, metadata=OPTIONAL)
    field_is_net: bool = field(default=False, metadata=OPTIONAL)
    point: NDArray[np.float32] = field(default_factory=no_singles, metadata=OPTIONAL)
    triangle: NDArray[np.int32] = field(default_factory=no_indices, metadata=OPTIONAL)
    form: str = "absolute"
    fixed_strain: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    fixed_load: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    zero_offset: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    gauge_error_product: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    common_error: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    mean_product: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    dynamic_pressure_error: float = 0.0
    chi_square_scale: float = 1.0
    outlier_scale: float = 1.0
    level_slope: float = field(default=0.0, metadata=OPTIONAL)
    envelope_direction: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    envelope_limit: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    envelope_score_limit: float = DEFAULT_SCORE_LIMIT
    dynamic_pressure_range: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    mach_number_range: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    altitude_range: FloatArray = field(default_factory=no_numbers, metadata=OPTIONAL)
    sensors: SensorRows = field(
        default_factory=lambda: strain_rows(0), metadata=OPTIONAL | inner_record(SensorRows, SENSOR_UNITS)
    )
    section_station: FloatArray = field(default_factory=no_numbers)
    hinge_lines: HingeLines | None = field(default=None, metadata=inner_record(HingeLines, HINGE_UNITS))
    bending_lines: HingeLines | None = field(default=None, metadata=inner_record(HingeLines, HINGE_UNITS))
    thermal: ThermalMap = field(
        default_factory=lambda: no_temperature(np.zeros((0, 0))),
        metadata=OPTIONAL | inner_record(ThermalMap, THERMAL_UNITS),
    )
    inertia: InertiaMap | None = field(default=None, metadata=inner_record(InertiaMap, INERTIA_UNITS))
    manifold: ManifoldMap | None = field(default=None, metadata=inner_record(ManifoldMap, MANIFOLD_UNITS))

    def __post_init__(self) -> None:
        check_groups(self)
        fill(self, neutral_arrays(self))
        check_arrays(self)
        fill(self, neutral_parts(self))
        check_inverse_map(self)

    def _repr_html_(self) -> str:
        from strainfmu.estimator.map.map_html import map_html

        return map_html(self)

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
        return len(self.load_of_mean)

    @property
    def has_other_loads(self) -> bool:
        """Whether loads follow the five."""
        return self.n_loads > len(LOAD_NAMES)

    @cached_property
    def load_groups(self) -> tuple[LoadGroup, ...]:
        """Groups of the loads behind the five, in the order of their rows; a map may leave all of them out."""
        return load_groups(self)

    @property
    def load_names(self) -> tuple[str, ...]:
        """n_f names of the loads, in their order."""
        return (*LOAD_NAMES, *names_of(self.load_groups))[: self.n_loads]

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
        """Whether the map knows what the wall's temperature strains."""
        return self.thermal.n_modes > 0

    @property
    def has_masses(self) -> bool:
        """Whether the map knows what the vehicle's inertia strains."""
        return self.inertia is not None

    @cached_property
    def modes(self) -> ThermalMap:
        """Modes of the wall's temperature, then modes of inertia, with all that measures them."""
        return with_inertia(self.thermal, self.inertia)

    @property
    def errors_follow_strain(self) -> bool:
        """Whether some errors follow the current strain."""
        return bool(self.gauge_error_product.any() or self.common_error.any())

    # What follows from the fields.

    @cached_property
    def noise_covariance(self) -> FloatArray:
        """(n_d, n_d) Gamma = Gamma_g + N N' [(m/m)^2], of the strain that no state holds.

        In the same bits on every machine, as everything that FMUs hold.
        """
        return self.gauge_covariance + product(self.error_strain, self.error_strain.T)

    @cached_property
    def strain_load_covariance(self) -> FloatArray:
        """(n_d, n_f) X = N N_f' [(m/m) (N, N m)], of strain and load that no state holds."""
        return product(self.error_strain, self.error_load.T)

    @property
    def residual_degrees_of_freedom(self) -> int:
        """Expected value of the chi-square of the residual of all gauges."""
        return self.n_gauges - (self.n_states if self.case == 1 else 0)


def _units(case: int) -> dict[str, str]:
    """Return the unit of each field; a state is a pressure in Case 1 and a number in Case 2."""
    state = "Pa" if case == 1 else "1"
    return {
        "gauge_position": "m",
        "gauge_direction": "1",
        "noise_std": "m/m",
        "state_operator": f"(m/m)/{state}",
        "load_per_state": f"N/{state}, N.m/{state}",
        "load_of_mean": "N, N.m",
        "mean_strain": "m/m",
        "strain_range": "m/m",
        "coefficient_range": "1",
        OF_AREA: "m2",
        OF_LENGTH: "m",
        "nominal_dynamic_pressure": "Pa",
        "gauge_covariance": "(m/m)^2",
        "error_strain": "m/m",
        "error_load": "N, N.m",
        "fixed_strain": "m/m",
        "fixed_load": "N, N.m",
        "zero_offset": "m/m",
        "gauge_error_product": "(m/m)^2",
        "common_error": "m/m",
        "dynamic_pressure_range": "Pa",
        "altitude_range": "m",
        "section_station": "m",
        "field_mean": "Pa",
        "field_modes": f"Pa/{state}",
        "field_std": "Pa",
        "point": "m",
    }


def save_inverse_map(inverse_map: InverseMap, path: str | PathLike[str]) -> str:
    """Write ``inverse_map`` to ``path`` atomically and return its content hash.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """
    units, left_out = _units(inverse_map.case), neutral_fields(inverse_map)
    return save_record(inverse_map, Path(path), SCHEMA, SCHEMA_VERSION, units, left_out)


def load_inverse_map(path: str | PathLike[str]) -> InverseMap:
    """Read and check a map.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version.
    """
    return load_record(InverseMap, Path(path), SCHEMA, SCHEMA_VERSION)
