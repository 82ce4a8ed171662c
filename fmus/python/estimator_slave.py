"""The estimator as a PythonFMU slave: strains and dynamic pressure in; coefficients and health out.

The export copies this file into the FMU and renames the package ``strainfmu`` in its imports to the copy
that lies next to it, so that FMUs of different maps or versions never share a module in one process.
An exception that reaches PythonFMU's wrapper kills the FMU, so nothing here raises once the map is loaded.
"""

from __future__ import annotations

import json
from base64 import b64decode, b64encode
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, INERTIAL_NAMES, QSource
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros, zero_fault
from strainfmu.estimator.map.inverse_map import groups_of_outputs, load_inverse_map
from strainfmu.estimator.settings import EstimatorSettings, setting_fault
from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT
from strainfmu.estimator.tare import EdgeTare, KnownStrain
from strainfmu.fmu.python.stop_time import stop_fault
from strainfmu.fmu.python.wrapper_exit import let_go_at_exit
from strainfmu.interface.estimator_variables import (
    PARAMETERS,
    estimator_interface,
    output_values,
    time_constant_fault,
)
from strainfmu.interface.fmi_variables import Variable, value_references
from strainfmu.interface.input_names import (
    FLOW_INPUTS,
    LAST_INPUTS,
    NAVIGATION_INPUTS,
    given_to_fmu,
    known_values,
    lone_angle,
)
from strainfmu.interface.parameter_variables import parameter_names, parameter_std_names
from strainfmu.interface.sensor_variables import THRUST, temperature_names
from strainfmu.interface.zero_variables import TARE, TARE_STATE, zero_in_use_names, zero_names


class EstimatorSlave(Fmi2Slave):
    """One instance of the estimator; its only state is its inputs and parameters, its tare, and the track of the
    last step where the map has tables over the flight state.

    Values lie in one array in the order of their value references. Outputs are computed when they are read, so
    they are right after initialization and after any set, without a step (FMI 2.0, section 4.2.4).
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        resources = Path(self.resources)
        self.modelName = json.loads((resources / "fmu.json").read_text("utf-8"))["model_identifier"]
        let_go_at_exit(resources, self.modelName)
        inverse_map = load_inverse_map(resources / "map.h5")
        self._estimator = Estimator(inverse_map)
        interface = estimator_interface(inverse_map)
        references = value_references(interface)
        self._names = [variable.name for variable in interface]
        self._of_type = {
            "Real": _indices(interface, "Real"),
            "Integer": _indices(interface, "Integer", "Enumeration"),
            "Boolean": _indices(interface, "Boolean"),
        }
        self._first_input, self._valid = references["strain[1]"], references["valid[1]"]
        self._pressure = references[DYNAMIC_PRESSURE]
        self._parameters = [references[name] for name in PARAMETERS]
        self._n_strains = inverse_map.n_strain_gauges
        self._thrust = references.get(THRUST)
        self._zeros = [references[name] for name in zero_names(self._n_strains)]
        self._zeros_outdated = False
        self._time_constant = references.get(FILTER_TIME_CONSTANT)
        self._has_other_loads = bool(groups_of_outputs(inverse_map))
        self._temperatures = [references[name] for name in temperature_names(inverse_map.thermal)]
        self._tare = EdgeTare(self._estimator.core, inverse_map, _known_strain(resources / "tare_known.json"))
        self._asked, self._tare_state = references[TARE], references[TARE_STATE]
        self._zeros_in_use = [references[name] for name in zero_in_use_names(self._n_strains)]
        estimated = (v.name for v in interface if v.causality == "output" and v.name != TARE_STATE)
        self._outputs = [references[name] for name in estimated]
        self._inputs = [references[v.name] for v in interface if v.causality in ("input", "parameter")]
        self._flow_parameters = [references[name] for name in parameter_names(inverse_map)]
        self._parameter_stds = [references[name] for name in parameter_std_names(inverse_map)]
        of_air = (*FLOW_INPUTS, *NAVIGATION_INPUTS, *LAST_INPUTS, *INERTIAL_NAMES)
        self._flow = {name: references[name] for name in of_air if name in references}
        self._values = np.array([variable.start or 0.0 for variable in interface], dtype=float)
        # Start values are no readings: a gauge whose input was never set is left out.
        self._is_set = np.zeros(self._valid - self._first_input, dtype=bool)
        # Real inputs, which go without a check of their values.
        self._free = (
            self._of_type["Real"].intersection(self._inputs).difference(self._parameters).difference(self._zeros)
        ).difference({self._time_constant})
        self._outdated = True
        # Outputs follow from what the last step left, None for nothing; they leave the other one.
        self._memory: bytes | None = None
        self._next: bytes | None = None
        self._stepped = False  # whether a step has taken them
        # Of the sample that the inputs are, and of the end of the last step.
        self._time, self._end = 0.0, 0.0
        self._stop_time: float | None = None
        self._angles_reported = False

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Take the stop time [s], None for none."""
        self._stop_time = stop_time

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Compute the outputs for the inputs at the end of the step; False (fmi2Discard) beyond the stop time.

        FMI asks for fmi2Error there, which PythonFMU has no way to return.
        """
        if fault := stop_fault(current_time, step_size, self._stop_time):
            self.log(fault, Fmi2Status.error)
            return False
        if self._stepped:
            self._before_change()
        self._follow_tare()
        self._outdated |= self._time != current_time
        self._time, self._end = current_time, current_time + step_size
        self._update()
        self._stepped = True
        self._report_angles()
        return True

    def _report_angles(self) -> None:
        """Log once that a measured angle does not count."""
        if not self._angles_reported and (text := lone_angle(self._flow_inputs())):
            self._angles_reported = True
            self.log(text, Fmi2Status.ok, "logEvents")

    def _follow_tare(self) -> None:
        """Take the flag and the readings of a step in."""
        is_up = bool(self._values[self._asked] != 0.0)
        if not (is_up or self._tare.is_up):
            return
        if not is_up:
            self._before_change()
        strain = self._values[self._first_input :][: self._n_strains]
        valid = self._values[self._valid :][: self._n_strains]
        in_use = (valid != 0.0) & (np.abs(strain) <= self._estimator.settings.sensor_range)
        in_use &= self._is_set[: self._n_strains]
        # At rest the dynamic pressure is 0.
        if self._tare.step(is_up, np.where(in_use, strain, np.nan), float(self._values[self._pressure])):
            self._zeros_outdated = True
        self._values[self._tare_state] = self._tare.state
        if self._tare.text:
            self.log(self._tare.text, Fmi2Status.ok, "logEvents")
            self._tare.text = ""

    def get_real(self, vrs: list[int]) -> list[float]:
        """Return the values of Real variables, NaN for a value reference that is none."""
        self._update()
        if self._are(vrs, "Real"):
            return self._values[vrs].tolist() if vrs else []
        return [float(self._values[vr]) if vr in self._of_type["Real"] else float("nan") for vr in vrs]

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set inputs and parameters; what cannot be set is logged and left alone."""
        self._before_change()
        self._note_set(vrs)
        if vrs and self._free.issuperset(vrs):
            self._values[vrs] = values
            return
        for vr, value in zip(vrs, values, strict=True):
            if self._is_settable(vr, "Real"):
                self._set_one(vr, value)

    def _note_set(self, vrs: list[int]) -> None:
        """Note which readings are set, until all are."""
        if not self._is_set.all():
            self._is_set[[vr - self._first_input for vr in vrs if self._first_input <= vr < self._valid]] = True

    def _set_one(self, vr: int, value: float) -> None:
        """Set an input or a parameter, with what follows from a parameter."""
        if vr in self._free:
            self._values[vr] = value
            return
        of_zero, of_filter = vr in self._zeros, vr == self._time_constant
        name = self._names[vr]
        if of_filter:
            fault = time_constant_fault(value)
        else:
            fault = zero_fault(name, value) if of_zero else setting_fault(name, value)
        if fault:
            self.log(fault, Fmi2Status.error)
            return
        is_other = self._values[vr] != value
        self._values[vr] = value
        if of_zero and is_other:
            self._tare.drop()
            self._values[self._tare_state] = self._tare.state
            self._zeros_outdated = True
        if not of_zero:
            self._apply_settings()

    def _apply_zeros(self) -> None:
        value, std = self._values[self._zeros[:-1]].reshape(2, -1)
        stated_zeros = GaugeZeros(value=value, std=std, common_std=float(self._values[self._zeros[-1]]))
        zeros = self._tare.zeros or stated_zeros
        self._values[self._zeros_in_use] = [*zeros.value, *zeros.std, zeros.common_std]
        self._estimator = self._estimator.with_zeros(zeros)
        self._zeros_outdated = False

    def _apply_settings(self) -> None:
        settings = EstimatorSettings(**dict(zip(PARAMETERS, self._values[self._parameters].tolist(), strict=True)))
        self._estimator = self._estimator.with_settings(settings)
        seconds = 0.0 if self._time_constant is None else float(self._values[self._time_constant])
        if seconds != self._estimator.filter_time_constant:
            self._estimator = self._estimator.filter(seconds)

    def get_integer(self, vrs: list[int]) -> list[int]:
        """Return health state and counts; any other value reference is logged and read as 0."""
        self._update()
        self._are(vrs, "Integer")
        return [int(self._values[vr]) if vr in self._of_type["Integer"] else 0 for vr in vrs]

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set the source of the dynamic pressure; anything else is logged and left alone."""
        self._before_change()
        for vr, value in zip(vrs, values, strict=True):
            if not self._is_settable(vr, "Integer"):
                continue
            if value in tuple(QSource):
                self._values[vr] = value
            else:
                self.log(f"{self._names[vr]}: {value} found, must be from 0 to {max(QSource):d}", Fmi2Status.error)

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """Return ``valid`` of gauges and flags; any other value reference is logged and read as false."""
        self._update()
        self._are(vrs, "Boolean")
        return [bool(self._values[vr]) if vr in self._of_type["Boolean"] else False for vr in vrs]

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """Set ``valid`` of gauges; any other value reference is logged and left alone."""
        self._before_change()
        for vr, value in zip(vrs, values, strict=True):
            if self._is_settable(vr, "Boolean"):
                self._values[vr] = bool(value)

    def _are(self, vrs: list[int], fmi_type: str) -> bool:
        """Return whether every value reference is of the type, and log if not."""
        if self._of_type[fmi_type].issuperset(vrs):
            return True
        self.log(f"a valueReference of {vrs} is no {fmi_type}", Fmi2Status.error)
        return False

    def _is_settable(self, vr: int, fmi_type: str) -> bool:
        """Return whether ``vr`` is an input or parameter of the type, and log if not."""
        if vr in self._of_type[fmi_type] and vr not in self._outputs:
            return True
        self.log(f"valueReference {vr} is no {fmi_type} input or parameter", Fmi2Status.error)
        return False

    def _update(self) -> None:
        """Compute the outputs if an input was set since."""
        if not self._outdated:
            return
        if self._zeros_outdated:
            self._apply_zeros()
        self._values[self._outputs] = output_values(self._estimate(), self._has_other_loads)
        self._outdated = False

    def _estimate(self) -> Estimate:
        flow = given_to_fmu(self._flow_inputs())
        (thrust,) = known_values([0.0 if self._thrust is None else float(self._values[self._thrust])])
        if self._memory is not None:
            self._estimator.memory = self._memory
        elif self._remembers:
            self._estimator.restart()
        estimate = self._estimator.track(
            self._values[self._first_input : self._valid],
            valid=(self._values[self._valid : self._pressure] != 0.0) & self._is_set,
            time=self._time,
            temperature=self._temperature(),
            thrust=thrust,
            parameters=self._given_parameters() or None,
            parameters_std=self._given_deviations() or None,
            **flow,
        )
        self._next = self._estimator.memory if self._remembers else None
        return estimate

    def _flow_inputs(self) -> dict[str, float]:
        """Return the inputs for flow and navigation by name."""
        return dict(zip(self._flow, self._values[[*self._flow.values()]].tolist(), strict=True))

    @property
    def _remembers(self) -> bool:
        """Whether estimates follow from the steps before, too."""
        return self._estimator.is_nonlinear or self._estimator.filter_time_constant > 0.0

    def _given_parameters(self) -> dict[str, float]:
        """Return the flow parameters by name, NaN where not known."""
        values = known_values(self._values[self._flow_parameters].tolist())
        return dict(zip(self._estimator.parameters.names, values, strict=True))

    def _given_deviations(self) -> dict[str, float]:
        """Return the standard deviations of flow parameters by name, NaN where not stated."""
        stds = self._values[self._parameter_stds]
        stated = np.where((stds > 0.0) & (stds < np.inf), stds, np.nan).tolist()
        return dict(zip(self._estimator.parameters.names, stated, strict=bool(stated)))

    def _temperature(self) -> np.ndarray | None:
        """Return (n_t,) what the sensors read [K], None of a map without any; the core knows which ones read."""
        return self._values[self._temperatures] if self._temperatures else None

    def _before_change(self) -> None:
        """Go on from the last step: what follows starts from the track that it left."""
        if self._stepped:
            self._update()
            self._memory = self._next
            self._stepped, self._time = False, self._end
        self._outdated = True

    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "inputs": self._values[self._inputs].tolist(),
            "is_set": self._is_set.astype(int).tolist(),
            "memory": None if self._memory is None else b64encode(self._memory).decode(),
            "times": [self._time, self._end],
            "stepped": int(self._stepped),
            TARE: b64encode(self._tare.saved()).decode(),
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        before, tare = self._values.copy(), self._tare.saved()
        try:
            memory = None if state["memory"] is None else b64decode(state["memory"], validate=True)
            stepped = bool(state["stepped"])
            time, end = map(float, state["times"])
            is_set = np.array(state["is_set"], dtype=bool).reshape(self._is_set.shape)
            self._values[self._inputs] = state["inputs"]
            self._apply_settings()
            self._tare.restore(b64decode(state[TARE], validate=True))
            self._apply_zeros()
        except (InputError, KeyError, TypeError, ValueError) as error:
            self._values = before
            self._tare.restore(tare)
            self._apply_settings()
            self._apply_zeros()
            self.log(f"no state of this FMU: {error!r}", Fmi2Status.error)
        else:
            self._memory, self._is_set = memory, is_set
            self._stepped, self._time, self._end = stepped, time, end
        self._values[self._tare_state] = self._tare.state
        self._outdated = True


def _known_strain(path: Path) -> KnownStrain | None:
    """Return what the export wrote of the loads that act while a tare is taken; None if it wrote none."""
    if not path.exists():
        return None
    value, std = json.loads(path.read_text(encoding="utf-8"))
    return KnownStrain(value=np.array(value, dtype=float), own_std=np.array(std, dtype=float))


def _indices(interface: Sequence[Variable], *types: str) -> frozenset[int]:
    """Return the value references of the variables of ``types``."""
    return frozenset(index for index, variable in enumerate(interface) if variable.fmi_type in types)
