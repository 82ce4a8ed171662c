"""The same work by this package and by others, in one run: ``strainfmu bench --peers``."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.metadata import version
from itertools import count
from math import nan
from os import PathLike
from pathlib import Path
from time import process_time
from typing import Any

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.can.dbc_files import database_of
from strainfmu.can.dbc_writer import dbc_text
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame
from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import profile_layout
from strainfmu.cli.bench import time_per_call
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.systems.instance import import_fmpy, safe_temporary_parent
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.estimator.map.sensors import refuse_sensors
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.estimator.reference.gain import load_gain
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.fmu.checks.step_cost import slave_of, steps_of
from strainfmu.fmu.export import export_estimator
from strainfmu.fmu.python.package import imports_put_back
from strainfmu.recorded.run import estimate_file
from strainfmu.version import __version__

SAMPLES = 100_000
"""Samples in one call, and of the recording."""

TRAINING, PIECE = 2_000, 8_192
"""Samples that a regression learns from; rows that are read at once."""

CYCLES, CYCLE_TIME, PROFILE = 100, 0.01, "fd64"
"""Cycles on the bus, a new state of the receiver ahead of the first one."""

TIME_CONSTANT = 1.0
"""Of the filters [s]."""

DEGREES_OF_FREEDOM = 100_000
"""Smallest size of the three-dimensional structure."""

MODULES = {"scikit-learn": "sklearn", "python-can": "can", "PythonFMU": "pythonfmu"}
"""Modules of packages that have another name."""

SLAVE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Empty(Fmi2Slave):
    def __init__(self, **given):
        super().__init__(**given)
        for count, letter, causality in (({n}, "u", Fmi2Causality.input), (5, "y", Fmi2Causality.output)):
            for k in range(count):
                setattr(self, f"{{letter}}{{k}}", 0.0)
                self.register_variable(Real(f"{{letter}}{{k}}", causality=causality))

    def do_step(self, time, step_size):
        return True
"""
"""A slave of PythonFMU that computes nothing, for n gauges."""


@dataclass(frozen=True, kw_only=True)
class PeerRow:
    """What a program needs for a task.

    Attributes
    ----------
    task, program : in words; the program with its version.
    gives : what it gives.
    seconds : processor time for each sample, cycle or step, or for the whole task [s]; of the structure time by
        the clock; NaN where it was left out.
    reason : why it was left out.
    """

    task: str
    program: str
    gives: str
    seconds: float = nan
    reason: str = ""


def bench_peers(folder: str | PathLike[str] = "demo") -> list[PeerRow]:
    """Time the same work by this package and by others, in one process one after another.

    The linear estimator counts. The first row of each task is this package's.

    Parameters
    ----------
    folder : folder of a finished demo: its map and its FMUs are timed.

    Raises
    ------
    InputError
        The map is missing, damaged, or has auxiliary sensors.
    StrainfmuError
        Something that this package needs for a task is not installed.
    """
    path = Path(folder) / "map.h5"
    inverse_map = load_inverse_map(path).without_tables()
    refuse_sensors(inverse_map.sensors, f"{path}: bench --peers")
    rows = list[PeerRow]()
    with tempfile.TemporaryDirectory(prefix="strainfmu_", dir=safe_temporary_parent()) as temporary:
        case = _Case(inverse_map, Path(temporary))
        for task in (_samples, _filter, _bus, _recording, _steps, _structure):
            with ExitStack() as stack:
                rows += task(case, stack)
    return rows


class _Case:
    """A linear map with a file, and strains about its mean."""

    def __init__(self, inverse_map: InverseMap, folder: Path) -> None:
        self.inverse_map, self.folder, self.path = inverse_map, folder, folder / "map.h5"
        save_inverse_map(inverse_map, self.path)
        self.n, self.q = inverse_map.n_gauges, inverse_map.nominal_dynamic_pressure
        self.estimator, self.strain = Estimator(inverse_map), inverse_map.mean_strain
        self.gain: FloatArray = load_gain(inverse_map)[FIVE_LOADS]

    @cached_property
    def series(self) -> FloatArray:
        random = np.random.default_rng(0)
        return np.asarray(self.strain + self.inverse_map.noise_std * random.normal(size=(SAMPLES, self.n)))


def _row(
    task: str, package: str, gives: str, make: Callable[[], Callable[[], object]], per: int = 1, **effort: int
) -> PeerRow:
    """Return the row of what ``make`` returns, whose call does ``per`` times the task."""
    is_ours = package == "strainfmu"
    try:
        import_module(MODULES.get(package, package))
    except ImportError:
        return PeerRow(task=task, program=package, gives=gives, reason="not installed")
    program = f"{package} {__version__ if is_ours else version(package)}"
    seconds = time_per_call(make(), clock=process_time, **effort) / per
    return PeerRow(task=task, program=program, gives=gives, seconds=seconds)


def _samples(case: _Case, _: ExitStack) -> Iterator[PeerRow]:
    inverse_map, estimator, q = case.inverse_map, case.estimator, case.q
    loads, everything = "five loads", "loads, sigma, health"
    single, many = f"one sample, {case.n} gauges", f"{SAMPLES:,} samples in one call, each"
    long: Any = {"per": SAMPLES, "repeats": 5, "calls": 1}

    def least_squares() -> Callable[[], object]:
        weight = 1.0 / inverse_map.noise_std
        prior = np.sqrt(inverse_map.regularisation) * np.eye(inverse_map.n_states)
        rows = np.vstack([weight[:, None] * inverse_map.state_operator, prior])
        per_state, none = inverse_map.load_per_state[FIVE_LOADS], np.zeros(inverse_map.n_states)

        def solve() -> object:
            residual = weight * (case.strain - inverse_map.mean_strain)
            return per_state @ np.linalg.lstsq(rows, np.concatenate([residual, none]), rcond=None)[0]

        return solve

    def ridge(strain: FloatArray) -> Callable[[], object]:
        training = case.series[:TRAINING]
        model = import_module("sklearn.linear_model").Ridge()
        model.fit(1e6 * training, estimator.estimate(training, q).loads)
        return lambda: model.predict(1e6 * strain)

    yield _row(single, "strainfmu", everything, lambda: lambda: estimator.track(case.strain, q))
    yield _row(single, "numpy", f"{loads}, by lstsq", least_squares)
    yield _row(single, "scikit-learn", f"{loads}, by Ridge", lambda: ridge(case.strain[None]))
    yield _row(many, "strainfmu", everything, lambda: lambda: estimator.estimate(case.series, q), **long)
    yield _row(many, "numpy", f"{loads}, one product", lambda: lambda: case.series @ case.gain.T, **long)
    yield _row(many, "scikit-learn", f"{loads}, by Ridge", lambda: ridge(case.series), **long)


def _filter(case: _Case, _: ExitStack) -> Iterator[PeerRow]:
    task, inverse_map = f"one filtered sample, {case.n} gauges", case.inverse_map

    def ours() -> Callable[[], object]:
        estimator, cycles = case.estimator.filter(TIME_CONSTANT), count()
        return lambda: estimator.track(case.strain, case.q, time=CYCLE_TIME * next(cycles))

    def kalman() -> Callable[[], object]:
        n_states = inverse_map.n_states
        made = import_module("filterpy.kalman").KalmanFilter(dim_x=n_states, dim_z=case.n)
        made.H, made.R = inverse_map.state_operator, inverse_map.noise_covariance
        made.F, made.Q = np.eye(n_states), CYCLE_TIME / TIME_CONSTANT * np.eye(n_states)

        def step() -> None:
            made.predict()
            made.update(case.strain - inverse_map.mean_strain)

        return step

    yield _row(task, "strainfmu", "loads, sigma, health", ours)
    yield _row(task, "filterpy", "states, covariance", kalman)


def _bus(case: _Case, stack: ExitStack) -> Iterator[PeerRow]:
    names = [f"gauge {i}" for i in range(case.n)]
    layout = profile_layout(PROFILE, names, cycle_time=CYCLE_TIME)
    encoder, cycles = StrainEncoder(layout, session=1), list[list[Frame]]()
    for number in range(CYCLES):
        time = number * CYCLE_TIME
        made = encoder.encode(case.strain, case.q, number, time)
        cycles.append([frame.with_data(frame.data, time) for frame in made])
    task = f"a cycle of {case.n} strains in {len(cycles[0])} frames of {PROFILE}"
    ready = stack.enter_context(open_step(case.path))

    def ours() -> Callable[[], object]:
        def run() -> None:
            machine = Machine(layout, ready.step, BridgeSettings(), start=0.0)
            for number, frames in enumerate(cycles):
                for frame in frames:
                    machine.receive(frame)
                machine.advance((number + 0.99) * CYCLE_TIME)

        return run

    def decoded() -> Callable[[], object]:
        text = dbc_text([frame.layout for frame in layout.frames], "bench")
        database = database_of(text, "bench")
        return lambda: [database.decode_message(frame.identifier, frame.data) for frame in cycles[0]]

    def passed() -> Callable[[], object]:
        can = import_module("can")
        ends = [stack.enter_context(can.Bus("strainfmu bench", interface="virtual")) for _ in range(2)]
        messages = [
            can.Message(
                arbitration_id=frame.identifier,
                data=frame.data,
                is_fd=frame.is_fd,
                is_extended_id=frame.is_extended,
            )
            for frame in cycles[0]
        ]

        def run() -> None:
            for message in messages:
                ends[0].send(message)
            for _ in messages:
                ends[1].recv(0.0)

        return run

    yield _row(task, "strainfmu", "checks, loads, sigma, health", ours, per=CYCLES, repeats=5, calls=1)
    yield _row(task, "python-can", "frames sent and received", passed)
    yield _row(task, "cantools", "strains", decoded)


def _recording(case: _Case, _: ExitStack) -> Iterator[PeerRow]:
    task, path = f"an HDF5 recording of {SAMPLES:,} samples", case.folder / "recording.h5"
    with h5py.File(path, "w") as file:
        file["gauge_names"] = [name.encode() for name in case.inverse_map.gauge_names]
        file["time"], file[DYNAMIC_PRESSURE] = CYCLE_TIME * np.arange(SAMPLES), np.full(SAMPLES, case.q)
        file.create_dataset(STRAIN, data=case.series, chunks=(min(4096, SAMPLES), case.n))

    def product() -> None:
        with h5py.File(path) as file:
            for first in range(0, SAMPLES, PIECE):
                file[STRAIN][first : first + PIECE] @ case.gain.T

    def ours() -> object:
        return estimate_file(case.path, path, path.with_name("loads.h5"), columns="plain")

    once = {"repeats": 3, "calls": 1}
    yield _row(task, "strainfmu", "checks, a file of loads, sigma, health", lambda: ours, **once)
    yield _row(task, "h5py", "five loads, one product", lambda: product, **once)


def _steps(case: _Case, stack: ExitStack) -> Iterator[PeerRow]:
    fmpy, task = import_fmpy(), f"a step of an FMU through FMPy {version('fmpy')}: set {case.n}, get 5"

    def instance(fmu: Path) -> Any:
        made = slave_of(fmu, Path(fmpy.extract(str(fmu), str(fmu.with_suffix("")))))
        stack.callback(made.freeInstance)
        stack.callback(made.terminate)
        return made

    def ours() -> Callable[[], object]:
        export_estimator(case.path, case.folder / "estimator.fmu")
        return steps_of(instance(case.folder / "estimator.fmu"), case.inverse_map)["FMPy, lists"]

    def empty() -> Callable[[], object]:
        script = case.folder / "empty.py"
        script.write_text(SLAVE.format(n=case.n))
        with imports_put_back():
            import_module("pythonfmu").FmuBuilder.build_FMU(str(script), dest=str(case.folder))
        made, values = instance(case.folder / "Empty.fmu"), case.strain.tolist()
        inputs, outputs = list(range(case.n)), list(range(case.n, case.n + 5))

        def step() -> None:
            made.setReal(inputs, values)
            made.doStep(0.0, 1e-3)
            made.getReal(outputs)

        return step

    yield _row(task, "strainfmu", "loads, sigma, health", ours)
    yield _row(task, "PythonFMU", "nothing, an empty step", empty)
    yield PeerRow(
        task=task, program="Reference-FMUs Feedthrough", gives="its input", reason="no package installs it"
    )


def _structure(_: _Case, __: ExitStack) -> Iterator[PeerRow]:
    from builder.reports.growth import growth_rows
    from builder.structure.solid.linear_solvers import CYCLIC
    from builder.vehicle.file import IC3X

    programs = {CYCLIC: f"strainfmu {__version__}, cyclic", "superlu": f"SuperLU of scipy {version('scipy')}"}
    for row in growth_rows(IC3X, [*programs], [DEGREES_OF_FREEDOM]):
        yield PeerRow(
            task=f"strain per pressure by the clock, at least {DEGREES_OF_FREEDOM:,} degrees of freedom",
            program=programs[row.solver],
            gives=f"{row.n_gauges} gauges, {row.n_dof:,} of them, {row.peak_memory / 2**30:.2g} GiB",
            seconds=row.seconds,
        )
