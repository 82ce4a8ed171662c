"""One step of the estimator: from Python, native FMU in a C host, and a cycle of the bus around it."""

import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from fault_injection import FaultySender
from fmpy import extract
from synthetic_vehicle import synthetic_inverse_map

from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import Identifiers, profile_layout
from strainfmu.cosim.estimators.source import open_step
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.estimator.reference.linear import estimate as estimate_by_reference
from strainfmu.fmu.checks.step_cost import host_costs
from strainfmu.fmu.export import export_estimator

N_GAUGES = 54
LOST = 3
CYCLE_TIME = 0.01


class PythonStep:
    """``Estimator.track`` with all gauges and without three; 10,000 samples at once; 1,000 by the reference."""

    def setup(self) -> None:
        inverse_map = synthetic_inverse_map(n_gauges=N_GAUGES)
        self.inverse_map, self.estimator = inverse_map, Estimator(inverse_map)
        self.strain, self.pressure = inverse_map.mean_strain, inverse_map.nominal_dynamic_pressure
        self.samples, self.used = np.tile(self.strain, (10_000, 1)), np.ones(N_GAUGES, dtype=bool)
        self.pressures = np.full(1_000, self.pressure)
        self.broken = self.strain.copy()
        self.broken[:LOST] = np.nan
        self.estimator.track(self.broken, self.pressure)  # prepares the later steps without these gauges

    def time_all_gauges(self) -> None:
        self.estimator.track(self.strain, self.pressure)

    def time_gauges_lost(self) -> None:
        self.estimator.track(self.broken, self.pressure)

    def time_10000_samples(self) -> None:
        self.estimator.estimate(self.samples, self.pressure)

    def time_1000_samples_of_the_reference(self) -> None:
        std = self.inverse_map.dynamic_pressure_error * self.pressures
        estimate_by_reference(
            self.inverse_map,
            rows=self.samples[:1_000],
            used=self.used,
            dynamic_pressure=self.pressures,
            pressure_std=std,
        )


class NativeStep:
    """The native FMU in a C host: set the strains, step, get coefficients and health; needs a C compiler."""

    unit = "s"
    timeout = 300

    def setup_cache(self) -> list[float]:
        with tempfile.TemporaryDirectory() as folder:
            inverse_map, fmu = synthetic_inverse_map(n_gauges=N_GAUGES), Path(folder) / "estimator.fmu"
            save_inverse_map(inverse_map, Path(folder) / "map.h5")
            export_estimator(Path(folder) / "map.h5", fmu)
            unzipped = Path(extract(str(fmu), str(Path(folder) / "unzipped")))
            costs = list(host_costs(fmu, unzipped, inverse_map).values())
        return costs or [float("nan")] * 5

    def track_bare_product(self, costs: list[float]) -> float:
        return costs[0]

    def track_step(self, costs: list[float]) -> float:
        return costs[1]

    def track_step_at_another_dynamic_pressure(self, costs: list[float]) -> float:
        return costs[2]

    def track_step_with_a_gauge_that_does_not_fit(self, costs: list[float]) -> float:
        return costs[3]

    def track_instantiation(self, costs: list[float]) -> float:
        return costs[4]


class BusCycles:
    """100 cycles of 54 strains on CAN FD in virtual time: decoded, checked, judged and estimated."""

    n_cycles = 100

    def setup(self) -> None:
        inverse_map = synthetic_inverse_map(n_gauges=N_GAUGES)
        names = [f"gauge {i}" for i in range(N_GAUGES)]
        self.layout = profile_layout("fd64", names, cycle_time=CYCLE_TIME, identifiers=Identifiers())
        sender, random = FaultySender(self.layout, []), np.random.default_rng(1)
        self.cycles = []
        for number in range(self.n_cycles):
            strain = inverse_map.mean_strain + 1e-6 * random.normal(size=N_GAUGES)
            self.cycles.append(sender.cycle(number, number * CYCLE_TIME, strain, 9e4 + number))
        self.stack = ExitStack()
        folder = Path(self.stack.enter_context(tempfile.TemporaryDirectory()))
        save_inverse_map(inverse_map, folder / "map.h5")
        export_estimator(folder / "map.h5", folder / "estimator.fmu")
        self.step: Callable = self.stack.enter_context(open_step(folder / "estimator.fmu")).step

    def teardown(self) -> None:
        self.stack.close()

    def time_100_cycles(self) -> None:
        core = Machine(self.layout, self.step, BridgeSettings(), start=0.0)
        for number, frames in enumerate(self.cycles):
            for frame in frames:
                core.receive(frame)
            core.advance((number + 0.99) * CYCLE_TIME)
