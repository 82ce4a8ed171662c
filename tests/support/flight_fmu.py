"""The native library with a map that has tables over the flight state, and random flights of such a map."""

from ctypes import c_int, c_size_t
from dataclasses import dataclass, field

import numpy as np
from flight_maps import MACH, N_D
from flight_maps import whole_map as whole_map
from raw_fmu import N_OUTPUTS, N_SCALARS, OK, Fmu2

from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.input_names import FLOW_INPUTS, NAVIGATION_INPUTS

FIRST = N_OUTPUTS + 2 * N_D + N_SCALARS
"""Value reference of the first variable that other maps do not have."""

N_INPUTS, N_REALS, N_FLAGS = 3, 14, 11
FILTER = FIRST + N_INPUTS + N_REALS + N_FLAGS + 2 * N_D + 1
"""Value reference of the filter's time constant, behind the zeros; temperatures stand before it."""


@dataclass(frozen=True, kw_only=True)
class FlightSample:
    """One set of inputs; ``flow`` by name of the input, not known if it is not there; ``temperature`` [K]."""

    strain: np.ndarray
    valid: np.ndarray
    flow: dict[str, float] = field(default_factory=dict)
    temperature: np.ndarray | None = None


def random_flight(inverse_map: InverseMap, steps: int, seed: int) -> list[FlightSample]:
    """Strains along a random motion inside the tables, with gauge noise and all of navigation."""
    manifold = inverse_map.manifold
    assert manifold is not None
    random = np.random.default_rng(seed)
    root = np.linalg.cholesky(manifold.gauge_covariance)
    incidence, phi = random.uniform(0.0, 0.9 * manifold.incidence_limit), random.uniform(0.0, 2.0 * np.pi)
    state = np.array([random.uniform(*MACH[[0, -1]]), incidence * np.cos(phi), incidence * np.sin(phi), 0.0])
    state[3] = np.log(random.uniform(2e3, 2e4))
    samples = []
    for _ in range(steps):
        state = state + random.normal(size=4) * [0.002, 0.001, 0.001, 0.002]
        strain = evaluate(manifold.tables, state[None]).value[0, :N_D] + root @ random.normal(size=N_D)
        pressure = float(np.exp(state[3]))
        flow = {
            "mach_number": state[0] + 0.05 * random.normal(),
            "static_pressure": pressure * (1.0 + 0.02 * random.normal()),
            "dynamic_pressure": 0.7 * state[0] ** 2 * pressure * (1.0 + 0.01 * random.normal()),
        }
        samples.append(FlightSample(strain=strain, valid=np.ones(N_D, dtype=bool), flow=flow))
    return samples


class FlightFmu(Fmu2):
    """An instance whose map has tables."""

    def give(self, sample: FlightSample) -> None:
        """Set all inputs."""
        flow = [sample.flow.get(name, 0.0) for name in FLOW_INPUTS]
        self.set_strain(sample.strain)
        self.set_valid(sample.valid)
        assert self.set_scalars(0, *flow) == OK
        further = [sample.flow.get(name, 0.0) for name in NAVIGATION_INPUTS[:N_INPUTS]]
        assert self.set_reals(range(FIRST, FIRST + N_INPUTS), further) == OK

    def advance(self, sample: FlightSample, time: float = 0.0, size: float = 0.01) -> np.ndarray:
        """All outputs after a step over ``size`` from ``time`` [s]."""
        self.give(sample)
        assert self.step(time, size) == OK, self.messages
        return self.all_outputs()

    def filter(self, time_constant: float) -> int:
        """Set the filter's time constant [s]; the status."""
        return self.set_reals([FILTER], [time_constant])

    def all_outputs(self) -> np.ndarray:
        """(52,) those of every map, air data and their deviations, flags."""
        reals = range(FIRST + N_INPUTS, FIRST + N_INPUTS + N_REALS)
        flags = range(reals.stop, reals.stop + N_FLAGS)
        values = (c_int * N_FLAGS)()
        assert self.call("GetBoolean", self.references(flags), c_size_t(N_FLAGS), values) == OK, self.messages
        return np.concatenate([self.outputs(), self.get_reals(reals), values[:]])
