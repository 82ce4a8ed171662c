"""Flow parameters that are known with a deviation, in the native library: the numbers of Python."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from damaged_resource import refusal
from deflected_shape import NAME, known_map
from deflected_shape import flights as flights_of_shape
from raw_fmu import OK, Fmu2, write_resource

from strainfmu.estimator.air_inputs import AIR_DATA_NAMES
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.interface.estimator_variables import estimator_interface, output_values
from strainfmu.interface.fmi_variables import value_references
from strainfmu.interface.input_names import NOT_KNOWN

pytestmark = pytest.mark.fast

VALUE, STD = f"parameter.{NAME}", f"parameter_std.{NAME}"
Known = tuple[float, float]
STATED: tuple[Known, ...] = (
    (1.7, 0.05),
    (-3.2, 1.0),
    (0.4, np.nan),
    (2.5, 0.0),
    (NOT_KNOWN, 0.1),
    (-1.1, 0.0),
    (7.0, 0.5),  # out of its range, and used
    (13.0, 0.5),  # too far out
    (np.nan, 0.1),
    (2.0, -1.0),
    (2.0, np.inf),
    (np.inf, 0.2),
    (-3.9, 1e200),
)
"""Values and deviations as a host gives them."""

NAMES = ("C_A", "C_N", "C_Y", "M_P", "M_Y", "M_R", "moment.pitch", "moment.yaw", "moment.roll")
AIR_DATA = tuple(f"air_data.{name}" for name in AIR_DATA_NAMES)
REALS = (
    *(f"{sigma}{name}" for sigma in ("", "sigma.") for name in (*NAMES, *AIR_DATA)),
    *("health.chi_square", "health.chi_square_limit", f"health.outside.{NAME}"),
)


@cache
def flights() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Strain (k, n_d), q_inf (k,), M (k,) and deflection (k,) of a few flights."""
    snapshots, strain, flow = flights_of_shape()
    return strain, flow["dynamic_pressure"], flow["mach_number"], snapshots.condition[:, -1]


class Pair:
    """An instance and the estimator in Python, fed alike."""

    def __init__(self, inverse_map: InverseMap, folder: Path) -> None:
        interface = estimator_interface(inverse_map)
        self.reference = value_references(interface)
        self.names = [one.name for one in interface if one.causality == "output" and one.name != "tare_state"]
        resources = write_resource(inverse_map, folder)
        self.fmu = Fmu2(resources.as_uri(), inverse_map.n_gauges, logging=True)
        self.fmu.start()
        self.estimator = Estimator(inverse_map)

    def set(self, **values: float) -> None:
        self.set_all(values)

    def set_all(self, values: dict[str, float]) -> None:
        assert self.fmu.set_reals([self.reference[name] for name in values], [*values.values()]) == OK

    def give(self, flight: int, known: Known) -> None:
        strain, pressure, mach, _ = flights()
        self.fmu.set_strain(strain[flight])
        self.set_all({"dynamic_pressure": pressure[flight], "mach_number": mach[flight]})
        self.set_all(dict(zip((VALUE, STD), known, strict=True)))

    def get(self, *names: str) -> np.ndarray:
        return self.fmu.get_reals([self.reference[name] for name in names])

    def step(self, flight: int, known: Known) -> Estimate:
        """Both take a step; all outputs are the same."""
        self.give(flight, known)
        assert self.fmu.step() == OK
        strain, pressure, mach, _ = flights()
        value, std = (np.nan if one == NOT_KNOWN else one for one in known)
        found = self.estimator.track(
            strain[flight],
            pressure[flight],
            mach_number=mach[flight],
            parameters={NAME: value},
            parameters_std={NAME: std if std > 0.0 else np.nan},
        )
        expected = dict(zip(self.names, output_values(found, with_other_loads=True), strict=True))
        assert self.fmu.get_integers([self.reference["health.state"]])[0] == expected["health.state"]
        np.testing.assert_array_equal(self.get(*REALS), [expected[name] for name in REALS], err_msg=f"{known}")
        return found


@pytest.fixture
def pair(tmp_path: Path) -> Pair:
    return Pair(known_map(), tmp_path)


def test_as_in_python_step_by_step(pair: Pair) -> None:
    deflection, used = flights()[3], set[tuple[bool, str]]()
    for k, known in enumerate((*STATED, *STATED[::-1])):
        flight = k % len(deflection)
        found = pair.step(flight, known if k % 4 else (deflection[flight], 0.1))
        used.add((bool(found.is_linear), found.health.name))
    assert {(False, "OK"), (False, "OUTSIDE")} <= used


def test_what_is_not_stated_changes_no_bit(pair: Pair, tmp_path: Path) -> None:
    """The numbers of a map without these tables, before and after a deviation is stated."""
    manifold = known_map().manifold
    assert manifold is not None
    without = Pair(replace(known_map(), manifold=replace(manifold, parameters=None)), tmp_path / "without")
    assert STD not in without.reference
    for flight, known in ((0, (1.0, 0.0)), (1, (1.0, np.nan)), (2, (-2.0, -0.5))):
        pair.give(flight, known)
        without.fmu.set_strain(flights()[0][flight])
        without.set(dynamic_pressure=flights()[1][flight], mach_number=flights()[2][flight])
        without.set_all({VALUE: known[0]})
        bits = [one.get(*REALS).tobytes() for one in (pair, without)]
        pair.give(flight, (known[0], 0.1))
        assert pair.get(*REALS).tobytes() != bits[1]
        pair.give(flight, known)
        bits.append(pair.get(*REALS).tobytes())
        assert bits[0] == bits[1] == bits[2]


def test_derivatives_by_strain_and_by_what_is_stated(pair: Pair) -> None:
    """Differences of the outputs, each once its steps have ended, with the tables about what is stated."""
    strain, _, _, deflection = flights()
    unknowns = [pair.reference[name] for name in ("C_A", "C_N", "C_Y", "M_P", "M_Y", "M_R")]
    gauges = [pair.reference[f"strain[{i + 1}]"] for i in range(len(strain[0]))]
    by_strain = np.random.default_rng(1).normal(size=len(strain[0])) * 1e-7
    stated = [pair.reference[VALUE], pair.reference[STD]]
    for knowns, direction in ((gauges, by_strain), (stated, np.array([1.0, 0.0])), (stated, np.array([0.0, 0.1]))):
        pair.give(0, (deflection[0], 0.1))
        ended(pair)
        found, centre, ends = pair.fmu.derivative(unknowns, knowns, direction), pair.fmu.get_reals(knowns), []
        for sign in (1.0, -1.0):
            assert pair.fmu.set_reals(knowns, centre + sign * 1e-3 * direction) == OK
            ends.append(ended(pair).fmu.get_reals(unknowns))
        expected = (ends[0] - ends[1]) / 2e-3
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-5 * np.abs(expected).max())
    pair.give(0, (deflection[0], np.nan))
    assert pair.fmu.step() == OK
    assert pair.fmu.derivative(unknowns, stated[::-1], [1.0, 1.0]).tolist() == [0.0] * 6


def ended(pair: Pair) -> Pair:
    """Step until a repeated sample changes nothing any more."""
    for _ in range(40):
        assert pair.fmu.step() == OK
    return pair


def test_tables_of_other_parameters_are_refused(tmp_path: Path) -> None:
    """The ranges are of one more than the tables."""
    more = {**known_map().provenance["parameters"], "flap_deg": [0.0, 1.0]}
    held = replace(known_map(), provenance={**known_map().provenance, "parameters": more})
    resources = write_resource(held, tmp_path)
    assert "'parameter_tables.mean': expected the parameters of the map" in refusal(
        Fmu2(resources.as_uri(), held.n_gauges)
    )
