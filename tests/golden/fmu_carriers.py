"""FMUs as carriers of streams: samples in by the names of their variables, the fields that they offer out."""

import ctypes
from collections.abc import Mapping, Sequence
from ctypes import byref, c_bool, c_double, c_int, c_int32, c_int64, c_size_t
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
from comparison import WHOLE
from estimator_carrier import in_part
from inputs import Inputs, Results
from raw_fmu import OK, Fmu2, Fmu3, this_platform

from strainfmu.estimator.air_inputs import AIR_DATA_NAMES, ANGLE_ERROR, MEASURED_ANGLES, STD
from strainfmu.estimator.arguments import EXACT
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.validity import flow_parameters
from strainfmu.estimator.other_loads import LoadArray
from strainfmu.estimator.settings import default_settings
from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT
from strainfmu.interface.estimator_variables import LOADS, estimator_arrays, estimator_interface
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable
from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX, PREFIX, STD_PREFIX
from strainfmu.interface.sensor_variables import reading_names
from strainfmu.interface.zero_variables import TARE, TARE_STATE, zero_names

LAST_STEP = 0.01
"""Length of the step of the last sample [s]; others reach to the next sample."""

NAVIGATION = ("mach_number", "static_pressure", "dynamic_pressure")
TABLES = ("parameter_score", "other_loads", "other_loads_std")
"""Fields that have two axes even where a map has one column of them."""


class Places:
    """Value references and places of the variables of the FMU of a map.

    Attributes
    ----------
    outputs, inputs : names, elements of arrays one by one.
    """

    def __init__(self, inverse_map: InverseMap, arrays: bool) -> None:
        """List the variables of FMI 3.0 with ``arrays``, else those of FMI 2.0."""
        scalars = estimator_interface(inverse_map)
        self._variables: Sequence[Variable] = estimator_arrays(scalars) if arrays else scalars
        self._type = {one.name: one.fmi_type for one in scalars}
        self._groups = inverse_map.load_groups
        self.outputs = [one.name for one in scalars if one.causality == "output" and one.name != TARE_STATE]
        self.inputs = [one.name for one in scalars if one.causality == "input" and one.name != TARE]
        self.parameters = [one.name for one in scalars if one.causality == "parameter"]

    def references(self, causality: str, fmi_type: str) -> list[int]:
        """Return the value references of the inputs, parameters or outputs of a type."""
        return [
            number
            for number, one in enumerate(self._variables)
            if (one.causality, one.fmi_type) == (causality, fmi_type) and one.name not in (TARE, TARE_STATE)
        ]

    def typed(self, names: Sequence[str], fmi_type: str) -> np.ndarray:
        """Return the places of those of a type among ``names``."""
        return np.flatnonzero([self._type[name] == fmi_type for name in names])

    def fields(self) -> dict[str, list[int]]:
        """Return the places among the outputs of each field that they hold."""
        place = {name: number for number, name in enumerate(self.outputs)}
        return {
            field: [place[name] for name in outputs]
            for field, outputs in self._outputs_of_fields().items()
            if outputs and place.keys() >= set(outputs)
        }

    def _outputs_of_fields(self) -> dict[str, list[str]]:
        loads = [name for group in self._groups for name in LoadArray(group, False, False).outputs]
        air = [f"air_data.{name}" for name in AIR_DATA_NAMES]
        with_std = {
            "coefficients": [*COEFFICIENTS],
            "loads": [*LOADS],
            "other_loads": loads,
            "M_R": ["M_R"],
            "air_data": air,
        }
        numbers = ("chi_square", "chi_square_limit", "valid_gauges", "suspect_gauge", "suspects", "envelope_score")
        return {
            **with_std,
            **{f"{field}_std": [f"sigma.{name}" for name in outputs] for field, outputs in with_std.items()},
            **{name: [f"health.{name}"] for name in numbers},
            "health": ["health.state"],
            "is_linear": ["health.linear_loads"],
            "is_identified": [f"identified.{name}" for name in air],
            "air_data_used": [f"navigation_used.{name}" for name in NAVIGATION],
            "parameter_score": [name for name in self.outputs if name.startswith(OUTSIDE_PREFIX)],
        }


class Fmi2Host:
    """An FMU of FMI 2.0: the native library, or that of an FMU."""

    def __init__(
        self, inverse_map: InverseMap, resources: Path, guid: str = "", library: ctypes.CDLL | None = None
    ) -> None:
        self.places = Places(inverse_map, arrays=False)
        self.fmu = Fmu2(resources.as_uri(), inverse_map.n_gauges, guid, library)
        assert self.fmu.instance.value is not None, self.fmu.messages
        self._began = False
        self._reals = self.places.references("input", "Real")
        self._whole = self.places.references("input", "Enumeration")
        self._parameters = self.places.references("parameter", "Real")
        self._outputs = {
            kind: (self.places.references("output", kind), self.places.typed(self.places.outputs, kind))
            for kind in ("Real", "Integer", "Enumeration", "Boolean")
        }

    def restart(self, parameters: np.ndarray) -> None:
        """Begin at time 0 with the values of all parameters."""
        if self._began:
            assert self.fmu.call("Reset") == OK
        self._began = True
        self.set_parameters(parameters)
        self.fmu.start()

    def set_parameters(self, parameters: np.ndarray) -> None:
        """Set all parameters, also between two steps."""
        assert self.fmu.set_reals(self._parameters, parameters) == OK, self.fmu.messages

    def give(self, numbers: np.ndarray, valid: np.ndarray) -> None:
        """Set all inputs."""
        fmu = self.fmu
        reals, whole = np.split(numbers, [len(numbers) - len(self._whole)])
        assert fmu.set_reals(self._reals, reals) == OK, fmu.messages
        assert fmu.set_integers(self._whole, whole.astype(int).tolist()) == OK, fmu.messages
        fmu.set_valid(valid)

    def step(self, time: float, size: float) -> np.ndarray:
        """Return all outputs after a step of ``size`` from ``time`` [s]."""
        assert self.fmu.step(time, size) == OK, self.fmu.messages
        return self.outputs()

    def outputs(self) -> np.ndarray:
        """Return all outputs."""
        fmu, found = self.fmu, np.empty(len(self.places.outputs))
        for kind, (references, places) in self._outputs.items():
            if references:
                found[places] = {"Real": fmu.get_reals, "Boolean": self._flags}.get(kind, fmu.get_integers)(
                    references
                )
        return found

    def _flags(self, references: Sequence[int]) -> np.ndarray:
        n, values = len(references), (c_int * len(references))()
        assert self.fmu.call("GetBoolean", self.fmu.references(references), c_size_t(n), values) == OK
        return np.array(values[:])


class Fmi3Host:
    """The native library by FMI 3.0."""

    KINDS = (
        ("Real", "Float64", c_double),
        ("Integer", "Int32", c_int32),
        ("Enumeration", "Int64", c_int64),
        ("Boolean", "Boolean", c_bool),
    )

    def __init__(self, inverse_map: InverseMap, resources: Path) -> None:
        self.places = Places(inverse_map, arrays=True)
        self.fmu = Fmu3(str(resources), inverse_map.n_gauges, guid="")
        assert self.fmu.instance.value is not None, self.fmu.messages
        self._began = False
        self._reals = self.places.references("input", "Real")
        self._whole = self.places.references("input", "Enumeration")
        self._valid = self.places.references("input", "Boolean")
        self._parameters = self.places.references("parameter", "Real")
        self._outputs = [
            (name, c_type, self.places.references("output", kind), self.places.typed(self.places.outputs, kind))
            for kind, name, c_type in self.KINDS
        ]

    def restart(self, parameters: np.ndarray) -> None:
        """As :meth:`Fmi2Host.restart`."""
        if self._began:
            assert self.fmu.call("Reset") == OK
        self._began = True
        self.set_parameters(parameters)
        self.fmu.start()

    def set_parameters(self, parameters: np.ndarray) -> None:
        """As :meth:`Fmi2Host.set_parameters`."""
        assert self.fmu.set("Float64", c_double, self._parameters, parameters) == OK, self.fmu.messages

    def give(self, numbers: np.ndarray, valid: np.ndarray) -> None:
        """As :meth:`Fmi2Host.give`."""
        fmu = self.fmu
        reals, whole = np.split(numbers, [len(numbers) - len(self._whole)])
        assert fmu.set("Float64", c_double, self._reals, reals) == OK, fmu.messages
        assert fmu.set("Int64", c_int64, self._whole, whole.astype(int)) == OK, fmu.messages
        assert fmu.set("Boolean", c_bool, self._valid, valid.tolist()) == OK, fmu.messages

    def step(self, time: float, size: float) -> np.ndarray:
        """As :meth:`Fmi2Host.step`."""
        flags, reached = [c_bool() for _ in range(3)], c_double()
        arguments = c_double(time), c_double(size), c_bool(True), *map(byref, flags), byref(reached)
        assert self.fmu.call("DoStep", *arguments) == OK, self.fmu.messages
        return self.outputs()

    def outputs(self) -> np.ndarray:
        """As :meth:`Fmi2Host.outputs`."""
        fmu, found = self.fmu, np.empty(len(self.places.outputs))
        for name, c_type, references, places in self._outputs:
            if references:
                status, found[places] = fmu.get(name, c_type, references, len(places))
                assert status == OK, fmu.messages
        return found


def python_host(inverse_map: InverseMap, fmu: Path, folder: Path) -> Fmi2Host:
    """Return the host of the Python FMU at ``fmu``, unzipped to ``folder``."""
    description = fmpy.read_model_description(str(fmu))
    fmpy.extract(str(fmu), str(folder))
    (path,) = (folder / "binaries" / this_platform()).glob(f"{description.coSimulation.modelIdentifier}.*")
    return Fmi2Host(inverse_map, folder / "resources", description.guid, ctypes.CDLL(str(path)))


def by_fmu(
    host: Fmi2Host | Fmi3Host,
    inverse_map: InverseMap,
    inputs: Inputs,
    mode: str,
    seconds: float,
    changes: Mapping[int, float] | None = None,
) -> Results:
    """Return what an FMU gives; in mode ``each`` one with memory begins again for every sample.

    ``changes`` are other time constants of the filter from a sample on [s].
    """
    parameters = values_of_parameters(host.places, inverse_map, inputs, seconds if mode == "filter" else 0.0)
    changed = {
        k: values_of_parameters(host.places, inverse_map, inputs, one) for k, one in (changes or {}).items()
    }
    reals = values_of_inputs(host.places, inverse_map, inputs)
    sizes = np.append(np.diff(inputs.time), LAST_STEP)
    begins_again = mode == "each" and inverse_map.manifold is not None
    host.restart(parameters)
    rows = []
    for k, valid in enumerate(inputs.valid):
        if begins_again and k > 0:
            host.restart(parameters)
        if k in changed:
            host.set_parameters(changed[k])
        time = 0.0 if begins_again else float(inputs.time[k])
        host.give(reals[k], valid)
        rows.append(host.step(time, float(sizes[k])))
    return fields_of(host.places, dict(zip(host.places.outputs, np.array(rows).T, strict=True)))


def fields_of(places: Places, outputs: Mapping[str, np.ndarray]) -> Results:
    """Return the fields that ``outputs`` (k,) by name hold whole."""
    found = {}
    for field, columns in places.fields().items():
        names = [places.outputs[column] for column in columns]
        if outputs.keys() >= set(names):
            one = len(names) == 1 and field not in TABLES
            values = outputs[names[0]] if one else np.column_stack([outputs[name] for name in names])
            found[field] = values.astype(np.int16) if field in WHOLE else values
    return in_part(found)


def values_of_parameters(places: Places, inverse_map: InverseMap, inputs: Inputs, seconds: float) -> np.ndarray:
    """Return the values of all parameters."""
    zeros = zero_names(inverse_map.n_strain_gauges)
    offsets = inputs.zero if inputs.zero.size else np.zeros(len(zeros))
    value = {**vars(replace(default_settings(inverse_map), **inputs.settings)), FILTER_TIME_CONSTANT: seconds}
    value |= dict(zip(zeros, offsets, strict=True))
    return np.array([value[name] for name in places.parameters])


def values_of_inputs(places: Places, inverse_map: InverseMap, inputs: Inputs) -> np.ndarray:
    """Return (k, n) the values of all real inputs, NaN where the stream gives none, then of enumerations."""
    column, unknown = columns(inverse_map, inputs), np.full(len(inputs), np.nan)
    real, whole = (
        [column.get(places.inputs[place], unknown) for place in places.typed(places.inputs, kind)]
        for kind in ("Real", "Enumeration")
    )
    return np.column_stack([*real, *map(np.nan_to_num, whole)])


def columns(inverse_map: InverseMap, inputs: Inputs) -> dict[str, np.ndarray]:
    """Return (k,) the values of the inputs that the stream gives, by name; readings first.

    In a stream a standard deviation of 0 is exact; to an FMU it is one that is not given. Angles without one
    have 1 deg in a stream and do not count in an FMU.
    """
    column = dict(zip(reading_names(inverse_map), inputs.strain.T, strict=True))
    column |= {**inputs.flow, "thrust": inputs.thrust}
    column |= {f"temperature[{i + 1}]": one for i, one in enumerate(inputs.temperature.T)}
    names = flow_parameters(inverse_map).names
    for prefix, values in ((PREFIX, inputs.parameter), (STD_PREFIX, inputs.parameter_std)):
        if values.shape[1]:
            column |= {f"{prefix}{name}": one for name, one in zip(names, values.T, strict=True)}
    for (
        name
    ) in MEASURED_ANGLES:  # without a standard deviation, which is 1 deg in Python, they do not count in an FMU
        if (std := column.get(f"{name}{STD}")) is not None:
            column[f"{name}{STD}"] = np.where(np.isnan(std), ANGLE_ERROR, std)
    is_std = {name: name.endswith("_std") or name.startswith(STD_PREFIX) for name in column}
    return {name: np.where(is_std[name] & (one == 0.0), EXACT, one) for name, one in column.items()}
