"""The estimator of a map as a folder of C sources, for computers without FMI: what the folder holds.

``fmus/c`` has the files that are the same for every map. The sources come from the native library,
without the fronts of FMI and what serves them alone.
"""

from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from string import Template

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES, AIR_DATA_UNITS, NAVIGATION, SAMPLE_INPUTS
from strainfmu.estimator.core import Core, Layout, Series
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap
from strainfmu.estimator.map.validity import parameter_names_of
from strainfmu.estimator.other_loads import names_of
from strainfmu.estimator.resource.map_file import native_resource
from strainfmu.estimator.settings import SETTING_INPUTS
from strainfmu.estimator.signal_names import (
    COEFFICIENT_ARRAY,
    LOAD_NAMES,
    STRAIN,
    TEMPERATURE,
    THRUST,
    OperatingSettings,
)
from strainfmu.files import check_new_folder
from strainfmu.fmu.native.sources import ARITHMETIC_FLAGS, compiled_files, model_sources
from strainfmu.fmu.reference_run.run import ReferenceRun, reference_run
from strainfmu.interface.parameter_variables import parameter_names, parameter_std_names
from strainfmu.interface.sensor_variables import place_text, reading_names, reading_units, temperature_names
from strainfmu.version import __version__

FILES = ("example.c", "map_data.h", "measure.c", "samples.h")
"""Files of ``fmus/c`` that the folder holds as they are."""

WARNING_FLAGS = ("-Wall", "-Wextra", "-Wconversion", "-Werror")


_LINE_SIZE = 118

_INPUTS = {
    STRAIN: "[m/m]",
    "sensor": "in the units below",
    **{signal.name: f"[{signal.unit}]{signal.note}" for signal in SAMPLE_INPUTS},
    TEMPERATURE: "[K]",
    THRUST: "[N] 0 while the engine is off; not given: sensors that it moves are left out",
    "parameter": "flow parameters",
    "parameter_std": "their standard deviations, with which the estimate follows them",
}
"""What the fields of a sample are, by name."""

_SETTINGS = {
    **{signal.name: signal.note for signal in SETTING_INPUTS},
    **vars(OperatingSettings()),
}

_OUTPUTS = {
    COEFFICIENT_ARRAY: f"[1] {', '.join(COEFFICIENT_NAMES)}",
    "coefficients_std": "[1] their standard deviations",
    "loads": "[N, N, N, N m, N m]",
    "loads_std": "their standard deviations",
    "health": "state, as below",
    "load_factor": "[1] axial, normal, side force over the weight of the stated mass",
    "usable": "1 if health is OK or DEGRADED: loads may be used with their standard deviations",
    "chi_square": "[1] of the residual",
    "chi_square_limit": "[1] above it health is INCONSISTENT",
    "valid_gauges": "number of sensors in use",
    "suspect_gauge": "number of the sensor that does not fit, from 1; 0: none",
    "suspects": "number of sensors that may be the one that does not fit",
    "envelope_score": "[sigma] beyond what the map covers; negative inside",
    "degrees_of_freedom": "of chi_square; 0: nothing checks the estimate",
    "iterations": "of Gauss and Newton, sl_size(handle, SL_ITERATIONS) at most; 0 without tables",
    "air_data": ", ".join(f"{name} [{unit}]" for name, unit in zip(AIR_DATA_NAMES, AIR_DATA_UNITS, strict=True)),
    "air_data_std": "their standard deviations",
    "is_identified": "of each: 1 if strain and air data determine it, 0 if only the ranges of the map do",
    "air_data_used": f"1 or 0: {', '.join(NAVIGATION)}",
    "is_linear": "1 if the loads are the linear estimator's: strain fits no flight of the tables",
    "other_loads": "[N, N m] behind the five",
    "other_loads_std": "their standard deviations",
    "other_coefficients": "[1] of the same",
    "other_coefficients_std": "their standard deviations",
    "parameter_score": "[1] of each flow parameter, above 1 outside its range",
}


def check_folder_path(path: Path) -> None:
    """Refuse to write the folder under a name that is taken, or is of an FMU.

    Raises
    ------
    InputError
        It is.
    """
    if path.suffix == ".fmu":
        raise InputError(f"{path}: expected the name of a new folder for kind c, got the name of an FMU")
    check_new_folder(path)


def c_entries(inverse_map: InverseMap, content_hash: str) -> dict[str, bytes]:
    """Return what the folder of ``inverse_map`` holds, content by name.

    Raises
    ------
    InputError
        The compiled estimator cannot read the map.
    NoCoreError
        No library of the compiled estimator serves this machine.
    """
    resource = native_resource(inverse_map, content_hash)
    core, run = Core(resource), reference_run(inverse_map)
    sources = model_sources("estimator")
    folder = resources.files("fmus").joinpath("c")
    return {
        **sources,
        **{name: folder.joinpath(name).read_bytes() for name in FILES},
        "map_data.c": _map_data(resource),
        "positions.h": _positions_header(core),
        "samples.c": _samples(core, run.time, input_records(inverse_map, core.inputs, run)),
        "CMakeLists.txt": _cmake_lists(compiled_files(sources)),
        "README.txt": _readme(inverse_map, content_hash, core).encode(),
    }


def input_columns(inverse_map: InverseMap, inputs: Layout) -> dict[str, tuple[str, ...]]:
    """Return the names of an FMU's inputs behind each field of a sample."""
    n, readings = inverse_map.n_strain_gauges, reading_names(inverse_map)
    arrays = {
        STRAIN: readings[:n],
        "sensor": readings[n:],
        TEMPERATURE: temperature_names(inverse_map.thermal),
        "parameter": parameter_names(inverse_map),
        "parameter_std": parameter_std_names(inverse_map),
    }
    return {field: arrays.get(field, (field,)) for field, part in inputs.items() if part.stop > part.start}


def input_records(inverse_map: InverseMap, inputs: Layout, run: ReferenceRun) -> FloatArray:
    """Return (n, n_inputs) the samples of a reference run."""
    records = np.full((len(run.time), max(part.stop for part in inputs.values())), np.nan)
    records[:, inputs[THRUST]] = 0.0
    for field, names in input_columns(inverse_map, inputs).items():
        for place, name in enumerate(names, start=inputs[field].start):
            if name in run.inputs:
                records[:, place] = run.inputs[name]
    return records


def bounds(core: Core) -> str:
    """Return what a flight computer must set aside for a map, as one line."""
    iterations = f"{core.most_iterations} iterations in a step" if core.most_iterations else "no iterations"
    return (
        f"map {len(core.resource):,} bytes, constant; a handle {core.memory_size:,} bytes; stack at most "
        f"{core.stack_size:,} bytes; at most {iterations}; time of the worst step: build/measure on the target"
    )


def bounds_in(folder: Path) -> str:
    """Return the line of :func:`bounds` in the README.txt of ``folder``."""
    lines = (folder / "README.txt").read_text(encoding="utf-8").splitlines()
    return lines[lines.index("MEMORY") + 1].strip()


def _positions_header(core: Core) -> bytes:
    """Return ``positions.h``: places of fields and named values of a sample, results and settings; sizes."""
    elements = {
        COEFFICIENT_ARRAY: COEFFICIENT_NAMES,
        "loads": LOAD_NAMES,
        "air_data": AIR_DATA_NAMES,
        "air_data_used": [f"{name}_used" for name in NAVIGATION],
    }
    elements |= {
        f"{name}_std": [f"{element}_std" for element in elements[name]]
        for name in (COEFFICIENT_ARRAY, "loads", "air_data")
    }
    lines = [
        "/* Positions of values in the records of this map, and its sizes: README.txt has the meaning. */",
        "",
        "#ifndef POSITIONS_H",
        "#define POSITIONS_H",
    ]
    for record, layout in (("IN", core.inputs), ("OUT", core.outputs), ("SET", core.settings)):
        fields = {name: part for name, part in layout.items() if part.stop > part.start}
        places = {name: part.start for name, part in fields.items()}
        for name, part in fields.items():
            places |= dict(zip(elements.get(name, ()), range(part.start, part.stop), strict=False))
        constants = [f"SL_{record}_{name.upper()} = {place}" for name, place in places.items()]
        size = max(part.stop for part in fields.values())
        lines += ["", "enum {", *(f"    {name}," for name in constants), f"    SL_{record}_SIZE = {size}", "};"]
    sizes = {
        "ROWS": core.n_rows,
        "ITERATIONS": core.most_iterations,
        "STACK": core.stack_size,
        "MEMORY": core.memory_size,
    }
    lines += [
        "",
        "/* Of sl_size: sensors, iterations of a step, bytes of stack and of a buffer of sl_open_in. */",
        "enum {",
    ]
    lines += [",\n".join(f"    SL_{name}_SIZE = {size}" for name, size in sizes.items()), "};", "", "#endif", ""]
    return "\n".join(lines).encode()


def _map_data(resource: bytes) -> bytes:
    """Return ``map_data.c``."""
    text = f"""\
#include "map_data.h"

#if defined(__GNUC__)
__attribute__((aligned(16)))
#endif
const unsigned char sl_map_data[] = {{
{_lines(map(str, resource))}
}};

const size_t sl_map_size = sizeof sl_map_data;
"""
    return text.encode()


def _samples(core: Core, time: FloatArray, inputs: FloatArray) -> bytes:
    """Return ``samples.c``, with what ``core`` makes of the samples one after another."""
    outputs = core.series(Series.TRACK, inputs, time=time)
    text = f"""\
#include "samples.h"

#include <math.h>

const size_t sl_sample_count = {len(time)};
{_array("sl_sample_time", time)}
{_array("sl_sample_input", inputs)}
{_array("sl_sample_output", outputs)}"""
    return text.encode()


def _array(name: str, values: FloatArray) -> str:
    return f"\nconst double {name}[] = {{\n{_lines(map(_number, values.ravel().tolist()))}\n}};\n"


def _number(value: float) -> str:
    """Return a constant of C with the bits of ``value``."""
    if np.isnan(value):
        return "NAN"
    return repr(value) if np.isfinite(value) else f"{'-' if value < 0.0 else ''}INFINITY"


def _lines(constants: Iterable[str]) -> str:
    """Return constants with a comma behind each, in lines."""
    lines, line = list[str](), ""
    for constant in constants:
        if len(line) + len(constant) >= _LINE_SIZE:
            lines.append(line)
            line = ""
        line += f"{constant},"
    return "\n".join([*lines, line])


def _cmake_lists(source_files: Sequence[str]) -> bytes:
    """Return ``CMakeLists.txt``."""
    files = "\n".join(f"  {name}" for name in source_files)
    text = f"""\
# The library strainload, example and measure: cmake -S . -B build && cmake --build build

cmake_minimum_required(VERSION 3.13)
set(CMAKE_C_FLAGS_RELEASE "-O2 -DNDEBUG" CACHE STRING "Flags of build type Release")
project(strainload LANGUAGES C)
option(WARNINGS_ARE_ERRORS "A warning of the compiler ends the build" ON)
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release)
endif()
set(CMAKE_C_STANDARD 99)
set(CMAKE_C_EXTENSIONS OFF)

# The first two, and no -ffast-math, are what equal bits need.
add_compile_options({" ".join(ARITHMETIC_FLAGS)} -ffunction-sections -fdata-sections)
add_compile_options({" ".join(flag for flag in WARNING_FLAGS if flag != "-Werror")})
if(WARNINGS_ARE_ERRORS)
  add_compile_options(-Werror)
endif()

add_library(strainload STATIC map_data.c
{files}
)
target_include_directories(strainload PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
target_link_libraries(strainload PUBLIC m)

add_executable(example example.c samples.c)
target_link_libraries(example PRIVATE strainload)

# On systems with threads, whose stacks it measures.
if(UNIX)
  find_package(Threads REQUIRED)
  add_executable(measure measure.c samples.c)
  target_link_libraries(measure PRIVATE strainload Threads::Threads)
  if(NOT APPLE)
    target_compile_definitions(measure PRIVATE WRAPPED)
    target_link_options(measure PRIVATE -Wl,--wrap=malloc,--wrap=calloc,--wrap=free)
  endif()
endif()
"""
    return text.encode()


def _readme(inverse_map: InverseMap, content_hash: str, core: Core) -> str:
    """Return ``README.txt``."""
    template = Template(resources.files("fmus").joinpath("c", "README.txt").read_text(encoding="utf-8"))
    inputs = dict(_INPUTS)
    inputs["parameter"] += f": {', '.join(parameter_names_of(inverse_map))}"
    outputs = dict(_OUTPUTS)
    outputs["other_loads"] += f": {', '.join(names_of(inverse_map.load_groups))}"
    title = f"Loads from strain: {inverse_map.vehicle}"
    return template.substitute(
        vehicle=inverse_map.vehicle,
        underline="=" * len(title),
        version=__version__,
        content_hash=content_hash,
        estimator="linear" if inverse_map.manifold is None else "nonlinear",
        n_gauges=inverse_map.n_gauges,
        map_size=len(core.resource),
        most_iterations=core.most_iterations,
        bounds=bounds(core),
        flags=" ".join(("-std=c99", "-O2", *ARITHMETIC_FLAGS)),
        n_inputs=core.n_inputs,
        inputs=_record(core.inputs, inputs),
        sensors=_sensors(inverse_map),
        n_outputs=core.n_outputs,
        outputs=_record(core.outputs, outputs),
        health=", ".join(f"{state.value} {state.name}" for state in HealthState),
        n_settings=max(part.stop for part in core.settings.values()),
        settings=_record(core.settings, _SETTINGS),
    )


def _record(layout: Layout, meanings: Mapping[str, str]) -> str:
    """Return the fields of a record in lines: positions, name, meaning."""
    return "\n".join(
        f"  {_positions(part):>10}  {name:30}{meanings[name]}"
        for name, part in layout.items()
        if part.stop > part.start
    )


def _positions(part: slice) -> str:
    last = part.stop - 1
    return str(last) if part.start == last else f"{part.start} .. {last}"


def _sensors(inverse_map: InverseMap) -> str:
    """Return the sensors in lines: position, name, place, unit."""
    units = list(reading_units(inverse_map).values())
    lines = []
    for k, (name, (x, y, z)) in enumerate(
        zip(inverse_map.gauge_names, inverse_map.gauge_position.tolist(), strict=True)
    ):
        unit = "m/m" if k < inverse_map.n_strain_gauges else units[k - inverse_map.n_strain_gauges]
        lines.append(f"  {k:>10}  {name:30}[{unit}] at {place_text(x, y, z)}")
    return "\n".join(lines)
