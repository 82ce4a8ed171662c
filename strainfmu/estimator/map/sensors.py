"""Sensors of a map: its rows, the lines of its moments, and sensors of temperature and motion.

**Rows** all have the unit m/m inside. The row of another sensor than a strain gauge is divided by its scale, so
that its own noise equals the noise of a typical gauge: rows of Pa, m/s2 and m/m together would cost most of the
digits of every covariance.

**Temperature** of the wall causes strain of the gauges, which is subtracted as far as sensors measure it.
The rise above the reference is a sum of modes with amplitudes a, a priori independent with standard deviations s
(:mod:`strainfmu.estimator.reference.readings` has what gauges and sensors read of them). Without sensors the modes
are nuisances, which the gauges' covariance of the map holds already.

**Inertia.** Material at r from the unit moves against a specific force f + dw/dt x r + w x (w x r), with the
specific force f of the unit (acceleration without gravity) and the angular rates w. Its inertia causes the strain
Phi a of the gauges. The amplitudes a are the :data:`CHANNELS`: f, dw/dt about y and z, and the products
P = w w' - w'w 1 of w x (w x r) = P r. Inertia modes are modes of temperature, each with its own sensor:
:func:`with_inertia` joins both. Modes of vibration have no sensors: the input ``vibration`` states their standard
deviation, in steps of the root of 2, instead of the map's.

In free flight strain per pressure has the inertia of the motion that the pressure causes: Phi of f and dw/dt is
then 0 for the masses of the model, and nothing counts twice.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.map.schema import COVARIANCE, POSITIVE, UNIQUE, UNIT_VECTORS, MapRecord, Sizes, entry
from strainfmu.estimator.signal_names import FORCE, MOMENT
from strainfmu.estimator.signal_names import STRAIN as STRAIN

KINDS = (
    STRAIN,
    "pressure",
    "acceleration",
    "angular acceleration",
    FORCE,
    MOMENT,
    "displacement",
    "fibre strain",
)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SensorRows(MapRecord, where="sensors"):
    """What the n_d rows of a map measure."""

    # fmt: off
    kind: tuple[str, ...] = entry("n_d", "", "strain or another kind of sensor", allowed=KINDS)
    unit: tuple[str, ...] = entry("n_d", "", "unit of the readings")
    scale: FloatArray = entry("n_d", "unit/(m/m)", "reading per row; 1 for strain", place="sensors.scale",
        stored="n_others", rule=POSITIVE)
    largest: FloatArray = entry("n_d", "unit",
        "largest |reading| of a working sensor; of strain the estimator's setting counts", place="sensors.largest",
        stored="n_others", rule=POSITIVE)
    thrust_response: FloatArray = entry("n_d", "unit/N", "reading per thrust, forward along the axis",
        place="sensors.thrust_response", stored="n_others")
    # fmt: on

    def contradictions(self) -> Iterator[str]:
        """Yield what is wrong with the order of the rows."""
        if self.kind and not (STRAIN in self.kind and np.all(self.is_strain[: self.n_strain_gauges])):
            yield "expected strain gauges, then the other sensors, got another order"

    @property
    def is_strain(self) -> BoolArray:
        """(n_d,) which rows are strain gauges."""
        return np.array([kind == STRAIN for kind in self.kind], dtype=bool)

    @property
    def n_strain_gauges(self) -> int:
        """Number of strain gauges, whose rows come first."""
        return self.kind.count(STRAIN)

    @property
    def follows_thrust(self) -> BoolArray:
        """(n_d,) which readings thrust moves."""
        return self.thrust_response != 0.0

    def without_thrust(self, readings: ArrayLike, thrust: ArrayLike) -> FloatArray:
        """Return ``readings`` (n_d,) or (k, n_d) less what ``thrust`` [N], a number or (k,), makes of them.

        Thrust that is NaN leaves NaN in the readings that it moves, and the others alone.
        """
        corrected, moved = np.array(readings, dtype=float), self.follows_thrust
        corrected[..., moved] -= np.asarray(thrust, dtype=float)[..., None] * self.thrust_response[moved]
        return corrected


def strain_rows(n: int) -> SensorRows:
    """Return the rows of a map of ``n`` strain gauges alone."""
    same = np.ones(n)
    return SensorRows(kind=(STRAIN,) * n, unit=("m/m",) * n, scale=same, largest=same, thrust_response=np.zeros(n))


def shown_units(rows: SensorRows) -> list[tuple[float, str]]:
    """Return for each row of a map the factor from m/m to what users see, and its unit.

    Strain is shown in um/m, another sensor's reading in its own unit.
    """
    shown = zip(rows.kind, rows.scale.tolist(), rows.unit, strict=True)
    return [(1e6, "um/m") if kind == STRAIN else (scale, unit) for kind, scale, unit in shown]


def refuse_sensors(rows: SensorRows, what: str) -> None:
    """Refuse a map with sensors that are no strain gauges."""
    kinds = sorted(set(rows.kind) - {STRAIN})
    if kinds:
        raise InputError(f"{what}: expected a map of strain gauges alone, got one with {', '.join(kinds)} sensors")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class HingeLines(MapRecord, where="hinge_lines"):
    """Hinge lines, each of a region of the surface."""

    # fmt: off
    name: tuple[str, ...] = entry("n_h", "", "unique names", rule=UNIQUE)
    region: tuple[str, ...] = entry("n_h", "", "names of the regions by the vehicle file")
    point: FloatArray = entry("n_h 3", "m", "a point of each line in body axes")
    direction: FloatArray = entry("n_h 3", "1",
        "its direction, a unit vector in body axes; moments are right-handed about it", rule=UNIT_VECTORS)
    # fmt: on


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ThermalMap(MapRecord, where="thermal"):
    """Temperature modes of a map for n_d gauges, k modes and n_t sensors."""

    # fmt: off
    reference_temperature: float = entry(unit="K", meaning="at which zeros, gauge factors and modulus hold",
        place="thermal.reference_temperature")
    prior_std: FloatArray = entry("k", "K", "s, standard deviation of each mode's amplitude",
        place="thermal.prior_std", rule=POSITIVE)
    mode_strain: FloatArray = entry("n_d k", "1/K", "Phi, what gauges read of each mode per amplitude",
        place="thermal.mode_strain")
    gauge_operator: FloatArray = entry("n_d k", "1", "B, temperature of the gauges per amplitude",
        place="thermal.gauge_operator")
    sensor_names: tuple[str, ...] = entry("n_t", "", "names of the sensors", dtype=str)
    sensor_operator: FloatArray = entry("n_t k", "1", "C, temperature of the sensors per amplitude",
        place="thermal.sensor_operator")
    sensor_std: FloatArray = entry("n_t", "K", "standard deviations of the sensors' errors",
        place="thermal.sensor_std", rule=POSITIVE)
    apparent_strain: FloatArray = entry("j", "1/K, 1/K^2 ..", "coefficients of p, of rise^1 to rise^j",
        place="thermal.apparent_strain")
    gauge_factor_slope: float = entry(unit="1/K", meaning="g", place="thermal.gauge_factor_slope")
    modulus_slope: float = entry(unit="1/K", meaning="m", place="thermal.modulus_slope")
    isothermal_covariance: FloatArray = entry("n_d n_d", "(m/m)^2", "the map's gauge_covariance without the modes",
        place="thermal.isothermal_covariance", rule=COVARIANCE)
    # fmt: on

    @property
    def is_empty(self) -> bool:
        """Whether there are no modes and no sensors."""
        return not (self.n_modes or self.n_sensors)

    @property
    def linear_strain(self) -> FloatArray:
        """(n_d, k) what gauges read of each mode per amplitude, the data sheet's first term with it [(m/m)/K]."""
        first = self.apparent_strain[0] if len(self.apparent_strain) else 0.0
        return np.asarray(self.mode_strain + first * self.gauge_operator)

    @property
    def n_modes(self) -> int:
        """Number of temperature modes k."""
        return len(self.prior_std)

    @property
    def n_sensors(self) -> int:
        """Number of sensors n_t."""
        return len(self.sensor_names)


def no_temperature(gauge_covariance: FloatArray) -> ThermalMap:
    """Return no modes and no sensors, for gauges whose errors have ``gauge_covariance`` (n_d, n_d) [(m/m)^2]."""
    none, of_gauges = np.zeros(0), np.zeros((len(gauge_covariance), 0))
    return ThermalMap(
        reference_temperature=0.0,
        prior_std=none,
        mode_strain=of_gauges,
        gauge_operator=of_gauges,
        sensor_names=(),
        sensor_operator=np.zeros((0, 0)),
        sensor_std=none,
        apparent_strain=none,
        gauge_factor_slope=0.0,
        modulus_slope=0.0,
        isothermal_covariance=gauge_covariance,
    )


CHANNELS = ("f_x", "f_y", "f_z", "dw_y/dt", "dw_z/dt", "P_xx", "P_yy", "P_zz", "P_xy", "P_xz", "P_yz")
"""Names of the amplitudes for people; units m/s2, rad/s2, rad2/s2."""

SPECIFIC_FORCE = slice(0, 3)
"""Place of the specific force among the channels; own weight on the ground acts by it alone."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class InertiaMap(MapRecord, where="inertia"):
    """Inertia modes of a map for n_d gauges, one for each of the k :data:`CHANNELS`, and modes of vibration."""

    # fmt: off
    prior_std: FloatArray = entry("k", "m/s2, rad/s2, rad2/s2",
        "s, standard deviations of the channels where they are not measured", rule=POSITIVE)
    sensor_std: FloatArray = entry("k", "m/s2, rad/s2, rad2/s2",
        "standard deviations of the errors of measured channels", rule=POSITIVE)
    mode_strain: FloatArray = entry("n_d k", "(m/m)/(m/s2), (m/m)/(rad/s2), (m/m)/(rad2/s2)",
        "Phi, strain of the gauges per channel")
    rest_covariance: FloatArray = entry("n_d n_d", "(m/m)^2",
        "the map's gauge_covariance without modes of inertia, vibration and temperature")
    vibration_strain: FloatArray = entry("n_d v", "1",
        "strain of the gauges by each mode of vibration, over the strain of the gauge that it strains most")
    vibration_std: float = entry(unit="m/m", meaning="standard deviation of each mode where it is not known",
        rule=POSITIVE)
    vehicle_mass: float | None = entry(unit="kg",
        meaning="mass of the whole vehicle in flight, for load factor and specific forces; None where not stated",
        default=None, place="vehicle.mass", rule=POSITIVE, member="vehicle_mass")
    # fmt: on

    def sizes(self) -> Sizes:
        """Return the number of the channels."""
        return {"k": len(CHANNELS)}


def with_inertia(thermal: ThermalMap, inertia: InertiaMap) -> ThermalMap:
    """Return ``thermal`` with the modes of ``inertia``, as :attr:`InverseMap.thermal_and_inertia` has them."""
    k, n_t, n, v = len(CHANNELS), thermal.n_sensors, thermal.n_modes, inertia.vibration_strain.shape[1]
    operator = np.zeros((n_t + k, n + k + v))
    operator[:n_t, :n], operator[n_t:, n : n + k] = thermal.sensor_operator, np.eye(k)
    strain = np.hstack([inertia.mode_strain, inertia.vibration_strain])
    return replace(
        thermal,
        prior_std=np.concatenate([thermal.prior_std, inertia.prior_std, np.full(v, inertia.vibration_std)]),
        mode_strain=np.hstack([thermal.mode_strain, strain]),
        gauge_operator=np.hstack([thermal.gauge_operator, np.zeros_like(strain)]),
        sensor_names=(*thermal.sensor_names, *CHANNELS),
        sensor_operator=operator,
        sensor_std=np.append(thermal.sensor_std, inertia.sensor_std),
        isothermal_covariance=inertia.rest_covariance,
    )
