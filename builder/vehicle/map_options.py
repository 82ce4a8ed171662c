"""The sections [map], [noise] and [calibration] of a vehicle file.

[calibration] states what drawing and workshop promise before a ground test.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, field_validator, model_validator

from builder.vehicle.toml.toml_sections import GAMMA, Altitude, FileName, Section, Station, one_line
from strainfmu.atmosphere import DEVIATION_OF_AIR
from strainfmu.estimator.map.inverse_map import FORMS, PER_PRESSURE
from strainfmu.linear.regularisation import RULES

if TYPE_CHECKING:
    Form = str
else:
    Form = Literal[FORMS]

SectionStation = Annotated[float, Field(gt=0.0, le=1000.0)]
Coordinate = Annotated[float, Field(ge=-1000.0, le=1000.0)]
Point = Annotated[
    tuple[Coordinate, Coordinate, Coordinate],
    BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value),
]
SHORTEST = 1e-6
"""Of the largest component of a direction: what is below counts as zero."""
StrainStd = Annotated[float, Field(ge=1e-6, le=1e4)]


ESTIMATORS = ("auto", "linear", "nonlinear")


def wrong_estimator(name: object) -> str | None:
    """Return why ``name`` is no estimator of a map, with the new name of an old one; None if it is one."""
    if name in ESTIMATORS:
        return None
    text = f"expected {', '.join(map(repr, ESTIMATORS[:-1]))} or {ESTIMATORS[-1]!r}, got {name!r}"
    return f"{text}, now called 'nonlinear'" if name == "manifold" else text


class Region(Section):
    """A region of the surface: what of it lies inside a box in body axes. Triangles at its faces are cut."""

    from_m: Point
    to_m: Point

    @model_validator(mode="after")
    def _has_room(self) -> Region:
        if not all(low < high for low, high in zip(self.from_m, self.to_m, strict=True)):
            raise ValueError(f"to_m: expected numbers above from_m {list(self.from_m)}, got {list(self.to_m)}")
        return self


class HingeMoment(Section):
    """Moment of the air on a region of the surface about a hinge line, right-handed about its direction.

    The line goes through ``point_m`` along ``direction``, of any length, both in body axes. The moment is the
    moment of the pressure less the internal pressure, on the surface of the vehicle file: a fin that turns counts
    where it is drawn. Over q_inf S L of [reference] it is the coefficient M_H.
    """

    name: Annotated[str, Field(min_length=1, max_length=60), AfterValidator(one_line)]
    region: str
    point_m: Point
    direction: Point

    @field_validator("direction")
    @classmethod
    def _points_somewhere(cls, value: Any) -> Any:
        if max(map(abs, value)) < SHORTEST:
            raise ValueError(f"expected a vector that is not zero, got {list(value)}")
        return value


class BendingMoment(Section):
    """Bending moment of the air on the part ahead of a station, as at a joint, in a plane through the axis.

    The plane is at ``roll_angle_deg`` from +z towards +y: at 0 the moment is positive as a nose-up pitching
    moment, at 90 as a nose-to-starboard yawing moment, about the point (``station_m``, 0, 0).
    """

    name: Annotated[str, Field(min_length=1, max_length=60), AfterValidator(one_line)]
    station_m: SectionStation
    roll_angle_deg: float = Field(default=0.0, ge=-360.0, le=360.0)


class MapEntry(Section):
    """The inverse map.

    ``case`` 1 solves for at most ``modes`` observable POD modes by least squares; 2 has the snapshots, or
    ``prior_modes`` POD modes, as a Gaussian prior. ``gamma`` of Case 2 is a number, or the rule that chooses it.
    ``inner_product`` is the inner product of the POD. ``keep_field`` writes the pressure field into the map.

    ``form`` "dynamic_pressure" models strain in proportion to q_inf, so that the map holds at every altitude of
    ``valid_altitude_km``; "absolute" is the paper's, for the pressure level of the snapshots. ``symmetry`` "full"
    uses every flow at every roll angle, which holds for a body of revolution; "listed" keeps the angles of the
    conditions with their signs. The map also gives section loads (axial force, shear, bending, torsion of the air
    on the part ahead) at ``section_stations_m``, rising, ``hinge_moments`` of ``regions`` of the surface about
    lines, and ``bending_moments`` at stations. ``alarm_levels`` "calibrated"
    measures the detection thresholds on flights of the truth model with installation errors drawn, where engine
    and structure allow; "always" also where its flows cost more than the build, as of sections by ``euler``;
    "nominal" takes the theoretical ones.

    ``estimator`` "nonlinear" adds tables over the flight state for the nonlinear estimator; the linear map stays
    in the file, for strain that does not fit them. "auto" makes both estimators where the file and the conditions
    allow tables, compares them on other flights and keeps the tables where the nonlinear one is better
    (:mod:`builder.pipeline.estimator_choice`).

    Model discrepancy has two parts. The numerical one follows from the campaign: interpolation, and the grid of
    the flow. ``model_form_percent`` is one standard deviation of the other: viscosity, real gas, leeward
    separation; 0 with ``model`` "paper" of [noise]. It sets the entries that are left out: a Gaussian process of
    ``discrepancy_percent`` of p_inf (left out: at 10 % 0.08 % of q_inf, at most 2 % of p_inf, in proportion), with
    correlation lengths of ``discrepancy_length`` times the body's length along it and ``discrepancy_roll_deg``
    round it; ``discrepancy_of_prior_percent`` of the snapshots' difference from their mean (left out: 0.3 times
    ``model_form_percent``); and ``discrepancy_of_overpressure_percent`` of the overpressure without incidence
    (left out: ``model_form_percent``), all over the body at once, which gauges determine poorly: it widens the
    standard deviations and corrects nothing. Of ``newtonian`` flow round sections or a surface
    ``discrepancy_of_leeward_percent`` (left out: 2.5 times ``model_form_percent``) of the difference between
    ambient pressure leeward and a Prandtl-Meyer expansion is an error too, also of the linear map. Of other flow,
    ``discrepancy_of_newtonian_percent`` (left out: ``model_form_percent``) of its difference from newtonian flow
    is an error of the nonlinear estimator, and of the linear map next to it.
    """

    form: Form = PER_PRESSURE
    symmetry: Literal["full", "listed"] = "full"
    alarm_levels: Literal["calibrated", "always", "nominal"] = "calibrated"
    estimator: Literal["auto", "linear", "nonlinear"] = "auto"
    valid_altitude_km: tuple[Altitude, Altitude] = (0.0, 40.0)
    section_stations_m: tuple[SectionStation, ...] = Field(default=(), max_length=50)
    regions: dict[str, Region] = Field(default_factory=dict)
    hinge_moments: list[HingeMoment] = Field(default_factory=list, max_length=50)
    bending_moments: list[BendingMoment] = Field(default_factory=list, max_length=50)
    modes: int = Field(default=5, ge=1, le=1000)
    case: Literal[1, 2] = 1
    inner_product: Literal["euclidean", "area"] = "euclidean"
    prior_modes: int | None = Field(default=None, ge=1, le=1_000_000)
    gamma: float | str = 1.0
    keep_field: bool = False
    model_form_percent: float = Field(default=10.0, ge=0.0, le=100.0)
    discrepancy_percent: float | None = Field(default=None, ge=0.0, le=100.0)
    discrepancy_length: float = Field(default=0.2, ge=0.02, le=2.0)
    discrepancy_roll_deg: float = Field(default=40.0, ge=10.0, le=180.0)
    discrepancy_of_prior_percent: float | None = Field(default=None, ge=0.0, le=100.0)
    discrepancy_of_overpressure_percent: float | None = Field(default=None, ge=0.0, le=100.0)
    discrepancy_of_leeward_percent: float | None = Field(default=None, ge=0.0, le=100.0)
    discrepancy_of_newtonian_percent: float | None = Field(default=None, ge=0.0, le=300.0)

    @property
    def follows_pressure(self) -> bool:
        """Whether strain is modelled in proportion to q_inf."""
        return self.form == PER_PRESSURE

    @field_validator("estimator", mode="before")
    @classmethod
    def _named_estimator(cls, value: Any) -> Any:
        if (reason := wrong_estimator(value)) is not None:
            raise ValueError(reason)
        return value

    @field_validator("case", mode="before")
    @classmethod
    def _no_truth_value(cls, value: Any) -> Any:
        if isinstance(value, bool):
            raise ValueError(f"expected 1 or 2, got {value!r}")
        return value

    @field_validator("gamma", mode="before")
    @classmethod
    def _number_or_rule(cls, value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value not in RULES and not (number and GAMMA.holds(value)):
            raise ValueError(f"expected {GAMMA} or one of {', '.join(RULES)}, got {value!r}")
        return value

    @field_validator("valid_altitude_km", "section_stations_m", mode="before")
    @classmethod
    def _tuple_of_numbers(cls, value: Any) -> Any:
        return tuple(value) if isinstance(value, list) else value

    @model_validator(mode="after")
    def _fits_form(self) -> MapEntry:
        if self.valid_altitude_km[0] >= self.valid_altitude_km[1]:
            raise ValueError(f"valid_altitude_km: expected two rising numbers, got {list(self.valid_altitude_km)}")
        stations = self.section_stations_m
        if any(not first < second for first, second in pairwise(stations)):
            raise ValueError(f"section_stations_m: expected rising numbers, got {list(stations)}")
        known, names = ", ".join(sorted(self.regions)) or "none", [hinge.name for hinge in self.hinge_moments]
        for number, hinge in enumerate(self.hinge_moments, start=1):
            if hinge.region not in self.regions:
                raise ValueError(
                    f"hinge_moments.{number}.region: expected one of [map.regions], {known}, got '{hinge.region}'"
                )
            if hinge.name in names[: number - 1]:
                raise ValueError(f"hinge_moments.{number}.name: expected another than before, got '{hinge.name}'")
        names = [bending.name for bending in self.bending_moments]
        for number, name in enumerate(names, start=1):
            if name in names[: number - 1]:
                raise ValueError(f"bending_moments.{number}.name: expected another than before, got '{name}'")
        if self.follows_pressure and self.gamma != 1.0:
            raise ValueError(f"gamma: expected 1 with form 'dynamic_pressure', got {self.gamma!r}")
        if self.estimator == "nonlinear" and not self.follows_pressure:
            raise ValueError(f"estimator: 'nonlinear' needs form 'dynamic_pressure', got '{self.form}'")
        return self


HARDWARE_ERRORS = (
    "gauge_gain_percent",
    "common_gain_percent",
    "gauge_position_mm",
    "gauge_orientation_deg",
    "layout_roll_deg",
    "wall_thickness_percent",
    "apparent_strain_um_per_m",
    "internal_pressure_percent",
    "dynamic_pressure_percent",
    "clamp_compliance_mm",
    "row_orientation_deg",
    "wall_harmonic_percent",
    "wall_taper_percent",
    "wall_second_harmonic_percent",
    "region_modulus_percent",
    "joint_softness_mm",
    "transverse_sensitivity_percent",
)
"""Entries of [noise] that are errors of the hardware, one standard deviation each."""


OWN_NOISE = ("percent_of_median_strain", "std_um_per_m", "std_of_gauges_um_per_m", "covariance_file")
"""Entries of [noise] for the noise of the gauges themselves; one of them is stated."""


class Noise(Section):
    """Errors of strain: gauge noise and installation errors.

    Gauge noise is given in one of four ways: relative to the snapshots' strains, as one standard deviation, one
    per gauge, or as the CSV file of a full covariance [(um/m)^2] next to the vehicle file. With ``model`` "paper"
    there is no other error. Every other entry is one standard deviation. Gain, position and orientation errors are
    independent from gauge to gauge. Common gain is of all gauges, as from Young's modulus or the lot's gauge
    factor; ``layout_roll_deg`` turns all gauges round the axis; apparent strain is the same for all, as an
    uncompensated temperature causes it. The clamp yields along and across the body as ``clamp_compliance_mm`` of
    the wall's material would, by default not at all. Internal pressure is in percent of p_inf.
    ``dynamic_pressure_percent`` is the error of q_inf where a sample states no other; ``navigation_mach_number``
    and ``navigation_static_pressure_percent`` are the errors of M and p_inf, ``standard_atmosphere_percent`` the
    error of p_inf by an altitude.

    ``row_orientation_deg`` turns all gauges at one roll angle. In each region of the section [calibration] the
    thickness of the wall may go as cosine and sine of the roll angle (``wall_harmonic_percent``) and of twice the
    roll angle (``wall_second_harmonic_percent``), grow from fore to aft (``wall_taper_percent``), and Young's
    modulus may differ (``region_modulus_percent``). Joints at ``calibration.joint_stations_m`` yield as
    ``joint_softness_mm`` of the wall's material would. Each gauge reads ``transverse_sensitivity_percent`` of the
    strain across it. These are 0 by default. Errors by region or joint need a
    body of revolution.

    ``nuisance_file`` is a CSV file next to the vehicle file with the strain of further modes, such as temperature
    distributions, at one standard deviation.
    """

    percent_of_median_strain: float | None = Field(default=None, ge=1e-6, le=100.0)
    of_layout: str | None = None
    std_um_per_m: StrainStd | None = None
    std_of_gauges_um_per_m: list[StrainStd] | None = Field(default=None, min_length=1)
    covariance_file: FileName | None = None
    model: Literal["default", "paper"] = "default"
    truncated_modes: bool = True
    nuisance_file: FileName | None = None
    gauge_gain_percent: float = Field(default=1.0, ge=0.0, le=100.0)
    common_gain_percent: float = Field(default=1.0, ge=0.0, le=100.0)
    gauge_position_mm: float = Field(default=1.0, ge=0.0, le=100.0)
    gauge_orientation_deg: float = Field(default=1.0, ge=0.0, le=90.0)
    layout_roll_deg: float = Field(default=0.5, ge=0.0, le=90.0)
    wall_thickness_percent: float = Field(default=1.0, ge=0.0, le=50.0)
    apparent_strain_um_per_m: float = Field(default=5.0, ge=0.0, le=1e4)
    internal_pressure_percent: float = Field(default=5.0, ge=0.0, le=1000.0)
    dynamic_pressure_percent: float = Field(default=1.0, ge=0.0, le=50.0)
    clamp_compliance_mm: float = Field(default=0.0, ge=0.0, le=1e3)
    row_orientation_deg: float = Field(default=0.0, ge=0.0, le=45.0)
    wall_harmonic_percent: float = Field(default=0.0, ge=0.0, le=50.0)
    wall_taper_percent: float = Field(default=0.0, ge=0.0, le=50.0)
    wall_second_harmonic_percent: float = Field(default=0.0, ge=0.0, le=50.0)
    region_modulus_percent: float = Field(default=0.0, ge=0.0, le=50.0)
    joint_softness_mm: float = Field(default=0.0, ge=0.0, le=1e3)
    transverse_sensitivity_percent: float = Field(default=0.0, ge=0.0, le=50.0)
    navigation_mach_number: float = Field(default=0.05, ge=1e-4, le=10.0)
    navigation_static_pressure_percent: float = Field(default=2.0, ge=1e-3, le=100.0)
    standard_atmosphere_percent: float = Field(default=100.0 * DEVIATION_OF_AIR, ge=1e-3, le=100.0)

    @model_validator(mode="before")
    @classmethod
    def _paper_has_no_hardware_errors(cls, values: Any) -> Any:
        if not isinstance(values, dict) or values.get("model") != "paper":
            return values
        return dict.fromkeys(HARDWARE_ERRORS, 0.0) | values

    @model_validator(mode="after")
    def _one_way(self) -> Noise:
        if sum(getattr(self, name) is not None for name in OWN_NOISE) != 1:
            raise ValueError(f"give either {' or '.join(OWN_NOISE)}, and only one of them")
        return self

    @model_validator(mode="after")
    def _paper_is_gauge_noise_alone(self) -> Noise:
        added = [name for name in HARDWARE_ERRORS if getattr(self, name) > 0.0]
        if self.model == "paper" and added:
            raise ValueError(f"model 'paper' is gauge noise alone, but {added[0]} is {getattr(self, added[0]):g}")
        if self.model == "paper" and self.nuisance_file is not None:
            raise ValueError(f"model 'paper' is gauge noise alone, but nuisance_file is '{self.nuisance_file}'")
        return self

    @property
    def moves_gauges(self) -> bool:
        """Whether gauges may sit or point differently than stated, or read strain across."""
        turns = self.gauge_orientation_deg, self.row_orientation_deg, self.layout_roll_deg
        return max(self.gauge_position_mm, self.transverse_sensitivity_percent, *turns) > 0.0

    def without_hardware_errors(self) -> Noise:
        """Return the same section with every error of the hardware set to 0."""
        return self.model_copy(update=dict.fromkeys(HARDWARE_ERRORS, 0.0))

    @property
    def with_truncated_modes(self) -> bool:
        """Whether truncated modes count as noise."""
        return self.truncated_modes and self.model == "default"


Percent = Annotated[float, Field(ge=0.0, le=50.0)]


class Calibration(Section):
    """Tolerances of the vehicle as built, one standard deviation each: the prior of `strainfmu calibrate`.

    Gain, orientation, position, transverse sensitivity and zero offset are independent from gauge to gauge; common
    gain and clocking error are of all gauges together. The default of the zero offset leaves it free. The wall's
    thickness is one number for each region of the wall, and so are cosine and sine part of its first harmonic
    round the body. The taper of a region, its extra thickness at the aft end, and both parts of the second
    harmonic are 0 unless the readings contradict. ``mass_percent`` is of the vehicle's own weight and inertia,
    ``region_mass_percent`` of each region's. The clamp yields along and across the body as ``clamp_compliance_mm``
    of the wall's material would under the same traction; its rigid motion gives no strain.
    ``region_modulus_percent`` is the error of Young's modulus of each region in addition to the common one.
    ``row_orientation_deg`` turns all gauges at one roll angle. Joints at ``joint_stations_m`` of the wall yield as
    ``joint_softness_mm`` of its material would in addition; there are none by default. ``wall_region_ends_m`` are
    the stations between the regions behind the solid tip; by default there are four regions of one length.
    """

    gauge_gain_percent: Percent = 1.0
    common_gain_percent: Percent = 2.0
    gauge_orientation_deg: float = Field(default=1.5, ge=0.0, le=45.0)
    gauge_position_mm: float = Field(default=1.0, ge=0.0, le=100.0)
    layout_roll_deg: float = Field(default=0.5, ge=0.0, le=45.0)
    transverse_sensitivity_percent: Percent = 1.0
    zero_um_per_m: float = Field(default=2000.0, ge=0.0, le=1e5)
    youngs_modulus_percent: Percent = 3.0
    wall_thickness_percent: Percent = 4.0
    wall_harmonic_percent: Percent = 2.0
    wall_taper_percent: Percent = 0.0
    wall_second_harmonic_percent: Percent = 0.0
    mass_percent: Percent = 3.0
    region_mass_percent: Percent = 0.0
    clamp_compliance_mm: float = Field(default=2.0, ge=0.0, le=1e3)
    region_modulus_percent: Percent = 0.0
    row_orientation_deg: float = Field(default=0.0, ge=0.0, le=45.0)
    joint_stations_m: tuple[Station, ...] = Field(default=(), max_length=50)
    joint_softness_mm: float = Field(default=5.0, ge=0.0, le=1e3)
    wall_region_ends_m: Annotated[list[Station], Field(max_length=50)] | None = None

    @model_validator(mode="after")
    def _ends_rise(self) -> Calibration:
        ends = self.wall_region_ends_m or []
        if any(b <= a for a, b in pairwise(ends)):
            raise ValueError(f"wall_region_ends_m: expected increasing stations, got {ends}")
        return self
