"""The estimator as a PythonFMU slave: strains and dynamic pressure in; coefficients and health out.

The export copies this file into the FMU and renames the package ``strainfmu`` in its imports to the copy
that lies beside it, so that FMUs of different maps or versions never share a module in one process.
An exception that reaches PythonFMU's wrapper kills the FMU, so nothing here raises once the map is loaded.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, parse

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from strainfmu.estimator import LARGEST_SENSOR_RANGE, Estimator, LoadEstimate
from strainfmu.health import HealthState
from strainfmu.interface import estimator_interface, value_references
from strainfmu.inverse_map import load_inverse_map


class EstimatorSlave(Fmi2Slave):
    """One instance of the estimator; its only state is its inputs.

    Values lie in one array in the order of their value references: outputs, then strains, then dynamic
    pressure. Outputs are computed when they are read, so they are right after initialization and after
    any set, without a step (FMI 2.0, section 4.2.4).
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        resources = Path(self.resources)
        self.modelName = json.loads((resources / "fmu.json").read_text("utf-8"))["model_identifier"]
        inverse_map = load_inverse_map(resources / "map.h5")
        # The interface states no range: every finite strain counts.
        self._estimator = Estimator(inverse_map, LARGEST_SENSOR_RANGE)
        interface = estimator_interface(inverse_map)
        references = value_references(interface)
        self._n_variables = len(interface)
        self._health = references["health.state"]
        self._first_strain = references["strain[1]"]
        self._dynamic_pressure = references["dynamic_pressure"]
        self._values = np.array([variable.start or 0.0 for variable in interface], dtype=float)
        self._outdated = True

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """Return the model description that the export laid beside this file (packaging only)."""
        return parse(Path(self.resources) / "model_description.xml").getroot()

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Compute the outputs for the inputs at the end of the step."""
        self._update()
        return True

    def get_real(self, vrs: list[int]) -> list[float]:
        """Return the values of Real variables, NaN for a value reference that does not exist."""
        self._update()
        if not self._known(vrs):
            return [float(self._values[vr]) if 0 <= vr < self._n_variables else float("nan") for vr in vrs]
        return self._values[vrs].tolist()

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set inputs; value references of outputs or of nothing are logged and left alone."""
        self._outdated = True
        if vrs and self._first_strain <= min(vrs) and max(vrs) < self._n_variables:
            self._values[vrs] = values
            return
        for vr, value in zip(vrs, values, strict=True):
            if self._first_strain <= vr < self._n_variables:
                self._values[vr] = value
            else:
                self.log(f"valueReference {vr} is no Real input", Fmi2Status.error)

    def get_integer(self, vrs: list[int]) -> list[int]:
        """Return the health state; any other value reference is logged and read as 0."""
        self._update()
        for vr in vrs:
            if vr != self._health:
                self.log(f"valueReference {vr} is no Integer or Enumeration", Fmi2Status.error)
        return [int(self._values[self._health]) if vr == self._health else 0 for vr in vrs]

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Log the attempt: the estimator has no Integer input."""
        self.log(f"valueReferences {vrs} are no Integer inputs", Fmi2Status.error)

    def _known(self, vrs: list[int]) -> bool:
        """Tell whether every value reference exists, and log if not."""
        if not vrs or (min(vrs) >= 0 and max(vrs) < self._n_variables):
            return True
        self.log(f"a valueReference of {vrs} does not exist", Fmi2Status.error)
        return False

    def _update(self) -> None:
        """Compute the outputs if an input was set since."""
        if not self._outdated:
            return
        strain = self._values[self._first_strain : self._dynamic_pressure]
        estimate = self._estimator.estimate(strain, float(self._values[self._dynamic_pressure]))
        self._values[: self._first_strain] = self._outputs(estimate)
        self._outdated = False

    def _outputs(self, estimate: LoadEstimate) -> np.ndarray:
        """Return the outputs in the order of the interface.

        The interface has no state for an estimate that goes without a gauge, and none for a single suspect.
        """
        limit = self._estimator.chi_square_limit
        if not estimate.valid.all():
            nothing = np.full(self._first_strain, np.nan)
            nothing[[self._health, self._health + 2]] = HealthState.INVALID, limit
            return nothing
        health = HealthState.OK if estimate.health is HealthState.SUSPECT else estimate.health
        return np.concatenate(
            (
                estimate.coefficients,
                estimate.coefficients_std,
                estimate.loads,
                estimate.loads_std,
                (float(health), estimate.chi_square, limit),
            )
        )

    def _get_fmu_state(self) -> dict[str, Any]:
        return {"inputs": self._values[self._first_strain :].tolist()}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        try:
            self._values[self._first_strain :] = state["inputs"]
        except (KeyError, TypeError, ValueError) as error:
            self.log(f"no state of this FMU: {error!r}", Fmi2Status.error)
        self._outdated = True
