"""Cost of one step of each kind of estimator FMU, through FMPy and in a C host."""

import ctypes
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.systems.instance import import_fmpy, safe_temporary_parent
from strainfmu.errors import StrainfmuError
from strainfmu.estimator.map.inverse_map import (
    COEFFICIENT_NAMES,
    InverseMap,
    load_inverse_map,
    save_inverse_map,
)
from strainfmu.estimator.map.sensors import refuse_sensors
from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.fmi_variables import value_references

KINDS = {
    "native FMI 2.0": ExportOptions(),
    "native FMI 3.0": ExportOptions(fmi_version="3"),
    "python FMI 2.0": ExportOptions(kind="python"),
}

SCALED_FIELDS = (
    "gauge_error_product",
    "common_error",
    "mean_product",
    "fixed_strain",
    "fixed_load",
    "thermal",
)
"""Fields of a map that form "absolute" has none of, or does not use."""

REPEATS = 501
"""Short batches of steps in the C host, of which the median is one that no other program has slowed down."""

_FIRST_STRAIN = 27
_FIRST_ARRAY = 13
"""Value references of the strains in FMI 2.0 and 3.0."""


def step_costs(map_path: Path, time_per_call: Callable[[Callable[[], object]], float]) -> dict[str, float]:
    """Return the time per step [s] of FMUs of the map: set all strains, step, get the coefficients.

    Each through FMPy's calls with lists, and through the bare C functions with arrays made once; the native kind
    also in a C host, where a C compiler is found, next to the bare product in C.
    """
    inverse_map = load_inverse_map(map_path)
    refuse_sensors(inverse_map.sensors, f"{map_path}: cost of a step")
    costs = {}
    with tempfile.TemporaryDirectory(prefix="strainfmu_", dir=safe_temporary_parent()) as folder:
        for name, options in KINDS.items():
            fmu = Path(folder) / f"{name.replace(' ', '_').replace('.', '_')}.fmu"
            export_estimator(map_path, fmu, options)
            unzipped = fmu.with_suffix("")
            import_fmpy().extract(str(fmu), str(unzipped))
            instance = slave_of(fmu, unzipped)
            for how, step in steps_of(instance, inverse_map).items():
                costs[f"{name}, {how}"] = time_per_call(step)
            instance.terminate()
            instance.freeInstance()
            if options == ExportOptions():
                costs |= host_costs(fmu, unzipped, inverse_map)
        linear = replace(inverse_map, manifold=None)
        if inverse_map.manifold is not None:
            costs |= _other_costs(linear, Path(folder), "linear")
        if inverse_map.follows_pressure:
            # Weights that do not follow q_inf.
            nothing: dict[str, Any] = dict.fromkeys(SCALED_FIELDS)
            costs |= _other_costs(replace(linear, form="absolute", **nothing), Path(folder), "form absolute")
    return costs


def _other_costs(inverse_map: InverseMap, folder: Path, name: str) -> dict[str, float]:
    """Return the times in a C host of another map than the one in question, called ``name``."""
    source, fmu = folder / f"{name}.h5", folder / f"{name}.fmu"
    save_inverse_map(inverse_map, source)
    export_estimator(source, fmu, ExportOptions())
    import_fmpy().extract(str(fmu), str(fmu.with_suffix("")))
    costs = host_costs(fmu, fmu.with_suffix(""), inverse_map)
    return {f"{row}, {name}": cost for row, cost in costs.items() if "step" in row or "fit" in row}


def slave_of(fmu: Path, unzipped: Path) -> Any:
    """Return a slave of FMPy past its initialization."""
    fmpy = import_fmpy()
    description = fmpy.read_model_description(str(fmu))
    second = description.fmiVersion == "2.0"
    if second:
        from fmpy.fmi2 import FMU2Slave as Slave
    else:
        from fmpy.fmi3 import FMU3Slave as Slave
    instance = Slave(
        guid=description.guid or description.instantiationToken,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=str(unzipped),
        instanceName="bench",
    )
    instance.instantiate()
    if second:
        instance.setupExperiment()
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    return instance


def steps_of(instance: Any, inverse_map: InverseMap) -> dict[str, Callable[[], object]]:
    """Return the two ways to step an FMU of either version, by :func:`slave_of`."""
    n, m = inverse_map.n_gauges, len(COEFFICIENT_NAMES)
    values, dll, component = inverse_map.mean_strain.tolist(), instance.dll, instance.component
    strain, values_out = (ctypes.c_double * n)(*values), (ctypes.c_double * m)()
    sizes: tuple[tuple[int, ...], tuple[int, ...]]
    if hasattr(instance, "setFloat64"):  # FMI 3.0: strains and coefficients are an array each
        flags, last = [ctypes.c_bool() for _ in range(3)], ctypes.c_double()
        calls = dll.fmi3SetFloat64, dll.fmi3DoStep, dll.fmi3GetFloat64
        going_on = (True, *(ctypes.byref(flag) for flag in flags), ctypes.byref(last))
        inputs, outputs, sizes = [_FIRST_ARRAY], [0], ((n,), (m,))
        put, take = instance.setFloat64, lambda references: instance.getFloat64(references, nValues=m)
    else:
        calls, going_on = (dll.fmi2SetReal, dll.fmi2DoStep, dll.fmi2GetReal), (1,)
        inputs, outputs, sizes = [*range(_FIRST_STRAIN, _FIRST_STRAIN + n)], [*range(m)], ((), ())
        put, take = instance.setReal, instance.getReal
    c_inputs, c_outputs = ((ctypes.c_uint * len(places))(*places) for places in (inputs, outputs))
    set_values, do_step, get_values = calls

    def with_lists() -> None:
        put(inputs, values)
        instance.doStep(0.0, 1e-3)
        take(outputs)

    def with_arrays() -> None:
        set_values(component, c_inputs, len(inputs), strain, *sizes[0])
        do_step(component, 0.0, 1e-3, *going_on)
        get_values(component, c_outputs, len(outputs), values_out, *sizes[1])

    return {"FMPy, lists": with_lists, "arrays made once": with_arrays}


def host_costs(fmu: Path, unzipped: Path, inverse_map: InverseMap) -> dict[str, float]:
    """Return the times [s] of bare product, steps and instantiation in a C host; none without a C compiler.

    Steps are at one dynamic pressure, the same with the filter, if any, and, with tables, from the state after
    initialization; then at another one than the step before, the same with the first gauge far off, and the first
    and the other one with zeros and all temperature sensors of the map.

    Raises
    ------
    StrainfmuError
        The host cannot be compiled, or fails.
    """
    libraries = sorted((unzipped / "binaries" / "linux64").glob("*.so"))
    if not sys.platform.startswith("linux") or not libraries:
        return {}
    description = import_fmpy().read_model_description(str(fmu))
    program = compiled(unzipped / "step_time")
    if program is None:
        return {}
    resources = (unzipped / "resources").as_uri()
    pressure, n = inverse_map.nominal_dynamic_pressure, inverse_map.n_gauges
    strains = [repr(value) for part in strain_parts(inverse_map) for value in part.tolist()]
    names = value_references(estimator_interface(inverse_map))
    thermal = inverse_map.thermal
    sensors = (thermal.n_sensors, thermal.reference_temperature)
    numbers = (pressure, names.get(FILTER_TIME_CONSTANT, 0), REPEATS, names["zero[1]"], *sensors)
    values = [repr(number) for number in numbers]
    times = run([str(program), "usual", str(libraries[0]), description.guid, resources, *values, *strains])
    seconds = np.array(times.split(), dtype=float).tolist()
    product, step, varied, faulty, warm, warm_varied, cold, filtered, instantiation = seconds
    more = f"with zeros and {sensors[0]} temperatures"
    searched = inverse_map.manifold is not None
    costs = {
        f"C host: bare product 5 x {n}": product,
        f"C host, native FMI 2.0: set {n}, step, get 5 and health ({step / product:.1f} x in C)": step,
        f"C host, native FMI 2.0: a step with the filter ({filtered / step:.2f} x)": filtered,
        "C host, native FMI 2.0: the first step, with a search of the tables": cold if searched else np.nan,
        "C host, native FMI 2.0: instantiate": instantiation,
        "C host, native FMI 2.0: the same, q_inf another in every step": varied,
        "C host, native FMI 2.0: the same, and a gauge that does not fit": faulty,
        f"C host, native FMI 2.0: a step {more} ({warm / step:.2f} x)": warm,
        f"C host, native FMI 2.0: the same {more}, other q_inf ({warm_varied / varied:.2f} x)": warm_varied,
    }
    return {name: cost for name, cost in costs.items() if np.isfinite(cost)}


def strain_parts(inverse_map: InverseMap) -> tuple[FloatArray, FloatArray]:
    """Return (n,) strains of the mean pressure: those that do not follow q_inf, and those that do."""
    if inverse_map.form == "absolute":
        return inverse_map.mean_strain, np.zeros(inverse_map.n_gauges)
    return inverse_map.fixed_strain, inverse_map.mean_strain - inverse_map.fixed_strain


def compiled(program: Path) -> Path | None:
    """Return ``program``, made of ``fmus/bench/step_time.c``; None without a C compiler.

    Raises
    ------
    StrainfmuError
        The compiler reports an error.
    """
    compiler = next((path for path in map(shutil.which, ("cc", "gcc", "clang")) if path), None)
    if compiler is None:
        return None
    headers = Path(import_fmpy().__file__).parent / "c-code"
    with as_file(files("fmus").joinpath("bench", "step_time.c")) as source:
        run([compiler, "-O2", f"-I{headers}", str(source), "-o", str(program), "-ldl"])
    return program


def run(command: list[str]) -> str:
    """Return what a command writes.

    Raises
    ------
    StrainfmuError
        It fails, or takes longer than five minutes.
    """
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    if done.returncode:
        raise StrainfmuError(f"{Path(command[0]).name}: exit code {done.returncode}: {done.stderr.strip()[-200:]}")
    return done.stdout
