"""The vehicle on its trajectory as a PythonFMU slave: true coefficients and noisy strains out.

The export copies this file into the FMU and renames the package ``strainfmu`` in its imports to the copy
that lies next to it, so that FMUs of different models or versions never use the same module in one process.
An exception that reaches PythonFMU's wrapper kills the FMU, so nothing here raises once the model is loaded.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from strainfmu.cosim.models.flight_model import evaluate, load_flight_model
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.errors import InputError
from strainfmu.fmu.python.stop_time import stop_fault
from strainfmu.fmu.python.wrapper_exit import let_go_at_exit
from strainfmu.interface.fmi_variables import value_references
from strainfmu.interface.plant_variables import plant_interface


class PlantSlave(Fmi2Slave):
    """One instance of the plant; its state is the time, the parameters and the noise generator.

    Values lie in one array in the order of their value references: outputs, noise_std, seed. Noise is drawn
    once for every communication point, so reading twice gives the same strain, and a seed the same run.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        resources = Path(self.resources)
        self.modelName = json.loads((resources / "fmu.json").read_text("utf-8"))["model_identifier"]
        let_go_at_exit(resources, self.modelName)
        self._model = load_flight_model(resources / "flight_model.h5")
        self._trajectory = load_trajectory(resources / "trajectory.csv")
        interface = plant_interface(self._model)
        references = value_references(interface)
        self._n_variables = len(interface)
        self._names = [variable.name for variable in interface]
        self._noise_std, self._seed = references["noise_std"], references["seed"]
        self._values = np.array([variable.start or 0.0 for variable in interface], dtype=float)
        self._time = 0.0
        self._stop_time: float | None = None
        self._outdated, self._initialized, self._held = True, False, False
        self._restart_noise()

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Begin at ``start_time`` [s] and take the stop time [s], None for none."""
        self._time, self._stop_time = start_time, stop_time
        self._outdated = True

    def exit_initialization_mode(self) -> None:
        """From here on the parameters, which are fixed, stay as they are."""
        self._initialized = True

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Fly to the end of the step; False (fmi2Discard) outside the envelope and beyond the stop time.

        FMI asks for fmi2Error beyond it, which PythonFMU has no way to return.
        """
        if fault := stop_fault(current_time, step_size, self._stop_time):
            self.log(fault, Fmi2Status.error)
            return False
        self._time = current_time + step_size
        self._noise = self._generator.standard_normal(self._model.n_gauges)
        self._outdated = True
        return self._update()

    def get_real(self, vrs: list[int]) -> list[float]:
        """Return the values of Real variables, NaN for a value reference that does not exist."""
        self._update()
        if vrs and (min(vrs) < 0 or max(vrs) >= self._n_variables):
            self.log(f"a valueReference of {vrs} does not exist", Fmi2Status.error)
            return [float(self._values[vr]) if 0 <= vr < self._n_variables else float("nan") for vr in vrs]
        return self._values[vrs].tolist() if vrs else []

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set ``noise_std`` before the start; what cannot be set is logged and left alone."""
        self._set(vrs, values, self._noise_std)

    def get_integer(self, vrs: list[int]) -> list[int]:
        """Return ``seed``; any other value reference is logged and read as 0."""
        for vr in vrs:
            if vr != self._seed:
                self.log(f"valueReference {vr} is no Integer", Fmi2Status.error)
        return [int(self._values[self._seed]) if vr == self._seed else 0 for vr in vrs]

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set ``seed`` before the start, and begin its noise; what cannot be set is logged and left alone."""
        self._set(vrs, values, self._seed)
        if not self._initialized:
            self._restart_noise()

    def _set(self, vrs: list[int], values: list[Any], allowed: int) -> None:
        """Set the one variable of a type that may be set."""
        for vr, value in zip(vrs, values, strict=True):
            if vr != allowed:
                self.log(f"valueReference {vr} cannot be set", Fmi2Status.error)
            elif self._initialized:
                self.log(f"{self._names[vr]} is fixed: it cannot be set after initialization", Fmi2Status.error)
            elif not 0.0 <= value < float("inf"):
                self.log(f"{self._names[vr]}: {value} found, must not be negative", Fmi2Status.error)
            else:
                self._values[vr] = value
                self._outdated = True

    def _restart_noise(self) -> None:
        """Begin the noise of the seed."""
        self._generator = np.random.Generator(np.random.PCG64(int(self._values[self._seed])))
        self._noise = self._generator.standard_normal(self._model.n_gauges)

    def _update(self) -> bool:
        """Compute the outputs if something changed; NaN and False outside the envelope."""
        if not self._outdated:
            return True
        if self._time > self._trajectory.stop_time and not self._held:
            self._held = True
            text = f"the trajectory ends at {self._trajectory.stop_time:g} s: its last condition is held"
            self.log(text, Fmi2Status.warning)
        condition = self._trajectory.condition_at(self._time)
        try:
            point = evaluate(self._model, condition, self._time)
        except InputError as error:
            self.log(str(error), Fmi2Status.error)
            self._values[: self._noise_std] = np.nan
            return False
        strain = point.strain + self._values[self._noise_std] * self._noise * self._model.noise_scale
        self._values[: self._noise_std] = np.concatenate(
            (point.coefficients, strain, (point.dynamic_pressure,), condition.as_tuple())
        )
        self._outdated = False
        return True

    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "time": self._time,
            "parameters": self._values[self._noise_std :].tolist(),
            "generator": self._generator.bit_generator.state,
            "noise": self._noise.tolist(),
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        try:
            time, noise = float(state["time"]), np.array(state["noise"], dtype=float)
            self._values[self._noise_std :] = state["parameters"]
            self._generator.bit_generator.state = state["generator"]
            self._time, self._noise = time, noise.reshape(self._model.n_gauges)
        except (KeyError, TypeError, ValueError) as error:
            self.log(f"no state of this FMU: {error!r}", Fmi2Status.error)
        self._outdated = True
