"""The variables of every FMU, made from the interface that the FMUs are made of: directive ``fmu-variables``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from generated_text import GeneratedText
from sphinx.application import Sphinx

from strainfmu.cosim.models.autopilot import AutopilotSettings, autopilot_interface
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import no_temperature, strain_rows
from strainfmu.interface.enumerations import HEALTH_ITEMS, TARE_ITEMS, Items
from strainfmu.interface.estimator_variables import estimator_arrays, estimator_interface
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.plant_variables import FlightStart, Motion, native_plant_interface

TYPES_OF_FMI_3 = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean"}


@dataclass(frozen=True)
class OneGauge:
    """What the interfaces read of a map and of a flight model, for one gauge in place of n."""

    n_gauges: int = 1
    n_strain_gauges: int = 1
    gauge_names: tuple[str, ...] = ("NAME",)
    gauge_position: Any = field(default_factory=lambda: np.array([[1.0, 0.0, -0.1]]))
    gauge_roll_angle: Any = field(default_factory=lambda: np.array([np.pi]))
    noise_std: Any = field(default_factory=lambda: np.array([2.4e-7]))
    zero_offset: Any = field(default_factory=lambda: np.zeros(1))
    strain_range: Any = field(default_factory=lambda: np.array([1e-4]))
    coefficient_range: Any = field(default_factory=lambda: np.tile([-1.0, 1.0], (5, 1)))
    reference_area: float = 0.108
    reference_length: float = 0.371
    nominal_dynamic_pressure: float = 1e5
    dynamic_pressure_error: float = 0.01
    form: str = "dynamic_pressure"
    follows_pressure: bool = True
    case: int = 1
    manifold: None = None
    n_loads: int = 5
    has_other_loads: bool = False
    has_auxiliary_sensors: bool = False
    has_temperature: bool = False
    has_masses: bool = False
    section_station: Any = field(default_factory=lambda: np.zeros(0))
    thermal: Any = field(default_factory=lambda: no_temperature(np.eye(1)))
    sensors: Any = field(default_factory=lambda: strain_rows(1))
    envelope_score_limit: float = 1.5
    residual_degrees_of_freedom: int = 49
    provenance: dict[str, float] = field(default_factory=lambda: {"moment_station_m": 2.0})


def interfaces() -> dict[str, Sequence[Variable]]:
    """Return the variables of every FMU by its name."""
    one: Any = OneGauge()
    estimator = estimator_interface(cast(InverseMap, one))
    start = FlightStart(mach_number=6.0, altitude=20e3)
    return {
        "estimator": estimator,
        "estimator of FMI 3.0": estimator_arrays(estimator),
        "plant": native_plant_interface(one, Motion.SHORT_PERIOD, start),
        "autopilot": autopilot_interface(one, start, AutopilotSettings()),
    }


def variable_table(interface: Sequence[Variable], *, arrays: bool = False) -> str:
    """Return one table of a whole interface, in MyST Markdown; ``arrays``: as FMI 3.0 has it."""
    rows = ["| variable | | unit | shown in | type | |", "|---|---|---|---|---|---|"]
    for variable in interface:
        name = variable.name.replace("[1]", "[i]")
        kind = variable.declared_type or (TYPES_OF_FMI_3[variable.fmi_type] if arrays else variable.fmi_type)
        if variable.dimension is not None:
            kind += f" [{'n' if variable.dimension == 1 else variable.dimension}]"
        symbol = f" {variable.symbol.replace('_', chr(92) + '_')}" if variable.symbol else ""
        causality = variable.causality
        if causality == "parameter":
            causality = f"{variable.variability} parameter"
        rows.append(
            f"| `{name}`{symbol} | {causality} | {variable.unit or ''} | {variable.display_unit or ''} | {kind} | "
            f"{_description(variable)} |"
        )
    return "\n".join(rows)


def _description(variable: Variable) -> str:
    """Return the description; what is the example's alone stands for that of a map."""
    text = variable.description.replace("x = 1 m", "x = ...").replace("roll angle 180 deg", "roll angle ...")
    text = text.replace("|", "\\|").replace("OUTSIDE above 1.5", "OUTSIDE above the map's limit")
    text = text.replace("takes 0.01 of", "takes the map's fraction of")
    return text.replace("49 expected", "n - r expected in Case 1").replace("NAME", "of that number")


def states_table(variable: str, items: Items) -> str:
    """Return the states of an enumeration."""
    rows = [f"| value | `{variable}` | |", "|---|---|---|"]
    return "\n".join([*rows, *(f"| {int(state)} | `{state.name}` | {text} |" for state, text in items)])


class FmuVariables(GeneratedText):
    """The table of one FMU, named by the argument; ``health`` and ``tare`` give states."""

    required_arguments = 1
    final_argument_whitespace = True
    source = "strainfmu.interface"

    def text(self) -> str:
        """Return the table."""
        name = self.arguments[0]
        if name == "health":
            return states_table("health.state", HEALTH_ITEMS)
        if name == "tare":
            return states_table("tare_state", TARE_ITEMS)
        return variable_table(interfaces()[name], arrays="3.0" in name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("fmu-variables", FmuVariables)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
