"""``strainfmu bench`` steps every kind of FMU in every way it names."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.fmu.step_cost import step_costs

pytestmark = pytest.mark.fast


def test_every_kind_is_stepped(synthetic: SyntheticFiles) -> None:
    """No time is asserted: the steps run, and the rows are there."""
    calls = []

    def once(step: Callable[[], object]) -> float:
        calls.append(step())
        return 1e-6

    costs = step_costs(synthetic.map_1, once)
    for kind in ("native FMI 2.0", "native FMI 3.0", "python FMI 2.0"):
        assert costs[f"{kind}, FMPy, lists"] == costs[f"{kind}, arrays made once"] == 1e-6
    assert len(calls) == 6
    host = [name for name in costs if name.startswith("C host")]
    assert len(host) in (0, 4)  # none where there is no C compiler
    assert all(costs[name] > 0.0 for name in host)
    assert not host or f"C host: bare product 5 x {N_GAUGES}" in host
