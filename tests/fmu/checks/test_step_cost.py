"""``strainfmu bench`` steps every kind of FMU in every way it names."""

from collections.abc import Callable
from pathlib import Path

import pytest
from scaled_maps import whole_scaled_map
from synthetic_vehicle import N_GAUGES, SyntheticFiles
from thermal_maps import with_temperature

from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.checks.step_cost import step_costs

pytestmark = pytest.mark.fast


@pytest.fixture(autouse=True)
def few_repeats(monkeypatch: pytest.MonkeyPatch) -> None:
    """No time is asserted: a few batches run every kind of step."""
    monkeypatch.setattr("strainfmu.fmu.checks.step_cost.REPEATS", 3)


def test_every_kind_is_stepped(synthetic: SyntheticFiles) -> None:
    """The steps run, and the rows are there."""
    calls = []

    def once(step: Callable[[], object]) -> float:
        calls.append(step())
        return 1e-6

    costs = step_costs(synthetic.map_1, once)
    for kind in ("native FMI 2.0", "native FMI 3.0", "python FMI 2.0"):
        assert costs[f"{kind}, FMPy, lists"] == costs[f"{kind}, arrays made once"] == 1e-6
    assert len(calls) == 6
    host = [name for name in costs if name.startswith("C host")]
    assert len(host) in (0, 8)  # none where there is no C compiler
    assert all(costs[name] > 0.0 for name in host)
    assert not host or f"C host: bare product 5 x {N_GAUGES}" in host


def test_form_absolute_and_temperature_stand_beside_the_other(tmp_path: Path) -> None:
    """In one run, so that their ratio does not depend on what else the machine does.

    Form "absolute" knows no temperature: beside it stands the map without.
    """
    whole = with_temperature(whole_scaled_map(1, seed=1, n=9, n_states=3))
    save_inverse_map(whole, tmp_path / "map.h5")
    host = [name for name in step_costs(tmp_path / "map.h5", lambda _: 1.0) if "C host" in name]
    varied = [name for name in host if "q_inf another" in name]
    assert len(varied) in (0, 2)
    assert not varied or varied[1] == f"{varied[0]}, form absolute"
    assert not host or any("temperature" in name for name in host)
