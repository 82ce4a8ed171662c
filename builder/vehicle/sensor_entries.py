"""The section [sensors] of the vehicle file: flush ports, inertial unit, load cells beside the strain gauges."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from builder.vehicle.sections import Section, Station

Percent = Annotated[float, Field(ge=0.0, le=100.0)]
RollAngle = Annotated[float, Field(ge=-360.0, le=360.0)]
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
    distance from the centre of mass, ``center_x_m``. ``inertia_kg_m2`` is that about y and z. Errors of mass,
    inertia and centre are common to all readings; ``accelerometer_gain_percent`` and ``angular_gain_percent`` are
    of each on its own. ``thrust_std_N`` is the error of the thrust that is taken off. Without ``angular`` there
    are no angular accelerations.
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


class Sensors(Section):
    """Sensors beside the strain gauges, in the same estimate of the linear estimator.

    Inertial unit and load cells feel base pressure and friction, which are no pressure on the fore-body: both are
    nuisances. The base has ``base_pressure_ratio`` times p_inf with a standard deviation of
    ``base_pressure_percent`` of p_inf, on the reference area or ``base_area_m2``; friction adds ``friction_C_A``
    with ``friction_C_A_std``.
    """

    ports: Ports | None = None
    imu: InertialUnit | None = None
    load_cells: LoadCells | None = None
    base_pressure_ratio: float = Field(default=1.0, ge=0.0, le=10.0)
    base_pressure_percent: float = Field(default=20.0, ge=0.0, le=1000.0)
    base_area_m2: float | None = Field(default=None, ge=0.0, le=1e6)
    friction_C_A: float = Field(default=0.0, ge=0.0, le=1.0)
    friction_C_A_std: float = Field(default=0.005, ge=0.0, le=1.0)

    @model_validator(mode="after")
    def _one_at_least(self) -> Sensors:
        if self.ports is None and self.imu is None and self.load_cells is None:
            raise ValueError("expected ports, imu or load_cells, got none of them")
        return self
