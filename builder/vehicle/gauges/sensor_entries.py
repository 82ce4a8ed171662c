"""The section [sensors] of the vehicle file: sensors other than strain gauges."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, field_validator, model_validator

from builder.vehicle.gauges.layout import DIRECTION
from builder.vehicle.toml.toml_sections import Section, Station, one_line

Percent = Annotated[float, Field(ge=0.0, le=100.0)]
RollAngle = Annotated[float, Field(ge=-360.0, le=360.0)]
DirectionPart = Annotated[float, Field(ge=DIRECTION.low, le=DIRECTION.high)]
SensorName = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(one_line)]
KINDS_OF_SENSOR = ("ports", "imu", "angular_accelerometers", "load_cells", "displacement", "fibre")
ROTATION = ("inertia_kg_m2", "center_x_m", "inertia_percent", "center_std_mm")
"""Entries of the body's rotation, whose errors inertial unit and angular accelerometers have in common."""
LARGEST_FIBRE = 2000
"""Points of all fibres."""
Component = Literal["axial", "normal", "side", "pitch", "yaw"]


class Ports(Section):
    """Flush ports: surface pressure less the pressure inside the body [Pa], at ``x_m`` and all roll angles listed.

    ``gain_percent`` is the error of each port in proportion to its reading, ``range_Pa`` the largest of them.
    """

    x_m: Station
    roll_deg: list[RollAngle] = Field(min_length=1, max_length=100)
    std_Pa: float = Field(ge=1e-3, le=1e7)
    range_Pa: float = Field(ge=1.0, le=1e8)
    gain_percent: Percent = 0.0

    @model_validator(mode="after")
    def _each_once(self) -> Ports:
        if len(set(self.roll_deg)) < len(self.roll_deg):
            raise ValueError(f"roll_deg: expected each once, got {self.roll_deg}")
        return self


class InertialUnit(Section):
    """Accelerometers along x, y, z [m/s2] and angular acceleration about y and z [rad/s2], from angular rates.

    Accelerometers read the specific force where the unit is: total load over mass, and angular acceleration times
    distance from the centre of mass, ``center_x_m``. ``inertia_kg_m2`` is the moment of inertia about y and z.
    Errors of mass, inertia and centre are common to all readings; ``accelerometer_gain_percent`` and
    ``angular_gain_percent`` are independent from reading to reading. ``thrust_std_N`` is the error of the thrust
    that is subtracted. Without ``angular`` there are no angular accelerations.
    """

    x_m: Station
    mass_kg: float = Field(ge=1e-3, le=1e7)
    center_x_m: Station
    inertia_kg_m2: float = Field(ge=1e-6, le=1e12)
    accelerometer_std_m_per_s2: float = Field(default=0.01, ge=1e-6, le=1e3)
    accelerometer_gain_percent: Percent = 0.5
    accelerometer_range_m_per_s2: float = Field(default=1e3, ge=0.1, le=1e6)
    angular: bool = True
    angular_std_rad_per_s2: float = Field(default=0.01, ge=1e-6, le=1e4)
    angular_gain_percent: Percent = 0.5
    angular_range_rad_per_s2: float = Field(default=1e3, ge=0.1, le=1e6)
    mass_percent: Percent = 0.5
    inertia_percent: Percent = 0.5
    center_std_mm: float = Field(default=1.0, ge=0.0, le=1e4)
    thrust_std_N: float = Field(default=0.0, ge=0.0, le=1e8)


class AngularAccelerometers(Section):
    """Angular accelerometers about y (pitch) and z (yaw) [rad/s2], which need no inertial unit.

    Entries of mass properties as of :class:`InertialUnit`. ``std_rad_per_s2``, ``gain_percent`` and
    ``range_rad_per_s2`` are the noise of each reading, its error in proportion, and the largest of them.
    """

    x_m: Station
    axes: list[Literal["pitch", "yaw"]] = Field(default=["pitch", "yaw"], min_length=1, max_length=2)
    inertia_kg_m2: float = Field(ge=1e-6, le=1e12)
    center_x_m: Station
    std_rad_per_s2: float = Field(ge=1e-6, le=1e4)
    range_rad_per_s2: float = Field(ge=0.1, le=1e6)
    gain_percent: Percent = 0.5
    inertia_percent: Percent = 0.5
    center_std_mm: float = Field(default=1.0, ge=0.0, le=1e4)

    @model_validator(mode="after")
    def _each_once(self) -> AngularAccelerometers:
        if len(set(self.axes)) < len(self.axes):
            raise ValueError(f"axes: expected each once, got {self.axes}")
        return self


class LoadCells(Section):
    """Load cells between the body and its support: load of the air on the body about ``station_m`` [N, N m]."""

    station_m: Station
    components: list[Component] = Field(min_length=1, max_length=5)
    force_std_N: float = Field(ge=1e-6, le=1e8)
    moment_std_N_m: float = Field(ge=1e-6, le=1e8)
    force_range_N: float = Field(ge=1e-3, le=1e9)
    moment_range_N_m: float = Field(ge=1e-3, le=1e9)
    gain_percent: Percent = 0.1

    @model_validator(mode="after")
    def _each_once(self) -> LoadCells:
        if len(set(self.components)) < len(self.components):
            raise ValueError(f"components: expected each once, got {self.components}")
        return self


class DisplacementPoint(Section):
    """One displacement sensor: a point of the inner surface, and the direction in body axes that it reads."""

    name: SensorName | None = None
    x_m: Station
    roll_deg: RollAngle
    direction: list[DirectionPart] = Field(min_length=3, max_length=3)

    @property
    def label(self) -> str:
        """Name of the sensor's reading."""
        return self.name or f"displacement_{self.x_m:g}m_{self.roll_deg:g}deg"

    @field_validator("direction")
    @classmethod
    def _has_length(cls, value: list[float]) -> list[float]:
        if not any(value):
            raise ValueError(f"expected a vector, got {value}")
        return value


class Displacements(Section):
    """Displacement of points of the wall against the support [m]: lasers, photogrammetry, transducers.

    ``std_um``, ``gain_percent`` and ``range_mm`` are the noise of each reading, its error in proportion, and the
    largest of them.
    """

    point: list[DisplacementPoint] = Field(min_length=1, max_length=1000)
    std_um: float = Field(ge=1e-3, le=1e6)
    range_mm: float = Field(ge=1e-3, le=1e5)
    gain_percent: Percent = 0.1

    @model_validator(mode="after")
    def _each_once(self) -> Displacements:
        labels = [point.label for point in self.point]
        for label in labels:
            if labels.count(label) > 1:
                raise ValueError(f"point: expected each name once, got '{label}' twice; give them names")
        return self


class Fibre(Section):
    """Optical fibres along the inner surface: ``count`` points of strain on each, at the roll angles listed.

    Readings of a fibre have an error in proportion in common, ``gain_percent``, and an offset by temperature,
    ``drift_um_per_m``; ``std_um_per_m`` is the noise of each point.
    """

    first_x_m: Station
    last_x_m: Station
    count: int = Field(ge=2, le=500)
    roll_deg: list[RollAngle] = Field(min_length=1, max_length=100)
    std_um_per_m: float = Field(ge=1e-6, le=1e5)
    range_um_per_m: float = Field(ge=1e-3, le=1e6)
    gain_percent: Percent = 1.0
    drift_um_per_m: float = Field(default=0.0, ge=0.0, le=1e5)

    @model_validator(mode="after")
    def _a_length(self) -> Fibre:
        if self.last_x_m <= self.first_x_m:
            raise ValueError(f"last_x_m: expected a station behind {self.first_x_m:g}, got {self.last_x_m:g}")
        if len(set(self.roll_deg)) < len(self.roll_deg):
            raise ValueError(f"roll_deg: expected each once, got {self.roll_deg}")
        if self.count * len(self.roll_deg) > LARGEST_FIBRE:
            raise ValueError(f"count: expected at most {LARGEST_FIBRE} points in all, got more")
        return self


class Sensors(Section):
    """Sensors in addition to the strain gauges.

    Inertial unit and load cells also respond to base pressure and friction, which are errors here. The base has
    ``base_pressure_ratio`` times p_inf with a standard deviation of ``base_pressure_percent`` of p_inf, on the
    reference area or ``base_area_m2``; friction adds ``friction_C_A`` with
    ``friction_C_A_std``.
    """

    ports: Ports | None = None
    imu: InertialUnit | None = None
    angular_accelerometers: AngularAccelerometers | None = None
    load_cells: LoadCells | None = None
    displacement: Displacements | None = None
    fibre: Fibre | None = None
    base_pressure_ratio: float = Field(default=1.0, ge=0.0, le=10.0)
    base_pressure_percent: float = Field(default=20.0, ge=0.0, le=1000.0)
    base_area_m2: float | None = Field(default=None, ge=0.0, le=1e6)
    friction_C_A: float = Field(default=0.0, ge=0.0, le=1.0)
    friction_C_A_std: float = Field(default=0.005, ge=0.0, le=1.0)

    @model_validator(mode="after")
    def _one_at_least(self) -> Sensors:
        if all(getattr(self, name) is None for name in KINDS_OF_SENSOR):
            raise ValueError(f"expected {' or '.join(KINDS_OF_SENSOR)}, got none of them")
        return self

    @model_validator(mode="after")
    def _one_body(self) -> Sensors:
        if self.imu is not None and self.angular_accelerometers is not None:
            for name in ROTATION:
                expected, stated = (getattr(sensor, name) for sensor in (self.imu, self.angular_accelerometers))
                if stated != expected:
                    raise ValueError(
                        f"angular_accelerometers.{name}: expected {expected:g} of imu, got {stated:g}"
                    )
        return self

    @property
    def of_structure(self) -> list[str]:
        """Names of the entries whose readings follow from the structure, as strain does."""
        return [name for name in ("displacement", "fibre") if getattr(self, name) is not None]
