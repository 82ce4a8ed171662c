"""Standard deviations of further parameters of the flow from a user's mapping sharpen the nonlinear estimate."""

import struct
from collections.abc import Mapping
from math import isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deflected_shape import NAME, known_map
from float_rack import rack_cycle, rack_layout
from shape_case import N_D

from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause
from strainfmu.cosim.estimators.source import open_step
from strainfmu.cosim.estimators.step import StepResult, parameter_names_of, parameter_std_names_of
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.flight_tables import evaluate
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.estimator.map.nonlinear_map import with_known

FINS, Q, STD = 0x300, 0.7 * 6.5**2 * 4000.0, 0.05
STATE = np.array([6.5, 0.03, 0.01, np.log(4000.0)])


def layout_of(
    entry: Any, n_gauges: int = N_D, std_names: tuple[str, ...] = (f"parameter_std.{NAME}",)
) -> InputLayout:
    """Return the frames of the gauges, and the fins with their deviation, by ``entry`` of [parameter]."""
    lines = [f"BO_ {FINS} Fins: 8 A"]
    lines += [' SG_ fin : 0|32@1- (1,0) [0|0] "deg" B', ' SG_ sigma : 32|32@1- (1,0) [0|0] "deg" B']
    lines += [f"SIG_VALTYPE_ {FINS} fin : 1;", f"SIG_VALTYPE_ {FINS} sigma : 1;"]
    names = {"parameter_names": [f"parameter.{NAME}"], "parameter_std_names": std_names}
    return rack_layout(n_gauges, lines, {"parameter": {NAME: entry}}, **names)


def cycle(core: Machine, strain: np.ndarray, k: int, fins: tuple[float, float] | None) -> Result:
    """Return the result of cycle ``k``; ``fins`` None for no frame of them."""
    return rack_cycle(core, strain, k, [] if fins is None else [(FINS, struct.pack("<ff", *fins))])


def readings(deflection: float) -> np.ndarray:
    manifold = known_map().manifold
    assert manifold is not None
    at = with_known(manifold, np.array([deflection]), np.zeros(1))
    return np.asarray(evaluate(at.tables, STATE[None]).value[0, :N_D])


@pytest.mark.parametrize("is_signal", [False, True])
def test_a_bridge_estimates_as_python_does(is_signal: bool, tmp_path: Path) -> None:
    """By a map; tests/golden gives a bridge FMUs of such maps."""
    save_inverse_map(known_map(), tmp_path / "map.h5")
    entry = {"signal": "Fins.fin", "std": "Fins.sigma" if is_signal else STD}
    tracker, random, sizes = Estimator(known_map()), np.random.default_rng(1), []
    with open_step(tmp_path / "map.h5") as ready:
        assert parameter_names_of(ready.step) == (f"parameter.{NAME}",)
        assert parameter_std_names_of(ready.step) == (f"parameter_std.{NAME}",)
        core = Machine(layout_of(entry), ready.step, BridgeSettings(), start=0.0, dynamic_pressure=Q)
        for k in range(45):
            strain = readings(1.0) + known_map().noise_std * random.normal(size=N_D)
            # Known; without its deviation, or lost.
            is_known = k < 20
            fins = (1.0, STD if is_known else nan) if is_signal or is_known else None
            result = cycle(core, strain, k, fins)
            if not is_known and k < 34:
                continue  # held for some cycles
            known: Mapping[str, Any] = (
                {"parameters": {NAME: 1.0}, "parameters_std": {NAME: STD}} if is_known else {}
            )
            expected = tracker.track(strain, Q, **known)
            if k < 10 or k == 34:
                continue
            assert result.health == expected.health
            assert (result.other_inputs[f"parameter_std.{NAME}"] == pytest.approx(STD)) == (
                is_known or not is_signal
            )
            np.testing.assert_allclose(result.coefficients, expected.coefficients, rtol=1e-4, atol=1e-6)
            np.testing.assert_allclose(result.coefficients_std, expected.coefficients_std, rtol=2e-4)
            assert bool(result.causes & Cause.NAVIGATION) == (not is_known)
            sizes.append(expected.other_coefficients_std[0])
    assert sizes[0] < 0.92 * sizes[-1]


def test_a_deviation_that_cannot_be_is_not_stated() -> None:
    given: list[dict[str, float]] = []

    def step(strain: np.ndarray, dynamic_pressure: float, step_size: float, **further: float) -> StepResult:
        given.append(further)
        return StepResult(np.zeros(5), np.ones(5), 0, 1.0)

    step.other_inputs = (f"parameter.{NAME}", f"parameter_std.{NAME}")  # type: ignore[attr-defined]  # read by name
    layout = layout_of({"signal": "Fins.fin", "std": "Fins.sigma"}, 2)
    core = Machine(layout, step, BridgeSettings(), start=0.0, dynamic_pressure=Q)
    values = [0.5] * 5 + [0.25, -0.5, nan, 1e9, 2.0]
    for k, value in enumerate(values):
        cycle(core, 1e-6 * np.array([100.0 + k, 200.0 + k % 3]), k, (1.5, value))
    found = [one[f"parameter_std.{NAME}"] for one in given][-5:]
    assert (found[0], found[-1]) == (0.25, 2.0)
    assert all(isnan(value) for value in found[1:-1])
    assert [one[f"parameter.{NAME}"] for one in given][-5:] == [1.5] * 5


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"signal": "Fins.fin", "std": -1.0}, r"parameter.fin_deg: std: expected 'Message.Signal' or a number"),
        ({"signal": "Fins.fin", "std": True}, "a number from 0 on, got True"),
        ({"signal": "Fins.fin", "std": nan}, "a number from 0 on, got nan"),
        ({"signal": "Fins.fin", "std": "Fins.flap"}, "no signal 'flap' in frame 'Fins'"),
        ({"signal": "Fins.fin", "std": "Fins.fin"}, "signal 'Fins.fin' found for both"),
        ({"std": 1.0}, "parameter.fin_deg: expected 'signal' and 'std', got std"),
        ({"signal": "Fins.fin", "sigma": 1.0}, "expected 'signal' and 'std', got signal, sigma"),
    ],
)
def test_wrong_deviations_are_refused(entry: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        layout_of(entry, 1)


def test_an_estimator_that_takes_no_deviation_refuses_one() -> None:
    with pytest.raises(InputError, match="std: expected none, the estimator does not take it"):
        layout_of({"signal": "Fins.fin", "std": 0.1}, 1, std_names=())
    assert layout_of({"signal": "Fins.fin"}, 1, std_names=()).constants == ()
