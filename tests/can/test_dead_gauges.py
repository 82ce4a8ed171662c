"""All gauges at exactly zero, and readings beyond the range of the gauges: none of them is a strain."""

import numpy as np
import pytest
from can_case import CYCLE, OWN, SIZES, Ears, Projection, Truth, layout_of, mixed_layout
from fault_injection import FaultySender

from strainfmu.can.frame_layout import InputLayout
from strainfmu.can.machine import Machine, Result
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import REASONS, Cause, Quality

pytestmark = pytest.mark.fast

Q = 9e4


def flown(
    layout: InputLayout, strains: list[np.ndarray], q: float = Q, step: Projection | None = None
) -> list[Result]:
    """Return the results of a bridge that is sent ``strains`` [m/m] of successive cycles at q_inf ``q`` [Pa]."""
    core = Machine(layout, step or Projection(layout.n_gauges), BridgeSettings(), start=0.0, own=[OWN.key])
    sender, results = FaultySender(layout, [], OWN), list[Result]()
    ears = Ears(sender)
    for number, strain in enumerate(strains):
        for frame in sender.cycle(number, number * CYCLE, strain, q):
            results += ears.hear(core.receive(frame))
        results += ears.hear(core.advance((number + 0.99) * CYCLE))
    return results


@pytest.mark.parametrize(
    "layout", [*map(layout_of, SIZES, SIZES.values()), mixed_layout()], ids=lambda one: one.name
)
def test_zeros_from_the_start_are_no_strains(layout: InputLayout) -> None:
    """Every cycle, also while the count of single gauges allows their zeros."""
    results = flown(layout, [np.zeros(layout.n_gauges)] * 12)
    assert results
    assert not any(result.quality.has_coefficients for result in results)
    for result in results[4:]:  # until then frames are not trusted, and q_inf is not known
        assert Cause.GAUGE_INVALID in result.causes
    reasons = [{REASONS[reason] for reason in result.reasons} for result in results]
    # Slow frames take longer until they are trusted.
    assert {"exactly zero"} in reasons or {"exactly zero", "frame not trusted"} in reasons


def test_a_flight_that_passes_to_zeros_is_invalid_at_once_and_heals() -> None:
    """Strains that are little but noise, whose own pace may well take single gauges to zero."""
    layout, random = layout_of("fd64", 8), np.random.default_rng(4)
    strains = [3e-6 * random.normal(size=8) for _ in range(60)]
    results = flown(layout, [*strains[:30], *[np.zeros(8)] * 2, *strains[32:]])
    quality = {round(result.time / CYCLE): result.quality for result in results}
    assert quality[29] is Quality.VALID
    assert quality[30] is quality[31] is Quality.INVALID
    assert quality[59] is Quality.VALID


def test_gauges_at_rest_may_read_zero() -> None:
    """Air at rest, stated as such: there are no coefficients, and no gauge is blamed for few zeros."""
    layout = layout_of("fd64", 8)
    results = flown(layout, [np.zeros(8)] * 4, q=0.0)
    assert results
    assert all(Cause.GAUGE_INVALID not in result.causes for result in results)


def test_a_gauge_beyond_the_range_that_the_estimator_states_is_named() -> None:
    layout, truth = layout_of("fd64", 8), Truth(8, 1)
    step = Projection(8)
    strains = [truth.cycle(k)[0].copy() for k in range(12)]
    for strain in strains[6:]:
        strain[2] += 1.6e-3
    assert flown(layout, strains, step=step)[-1].quality is Quality.VALID
    step.sensor_range = 2e-3  # type: ignore[attr-defined]  # as estimators of maps have it
    last = flown(layout, strains, step=step)[-1]
    assert last.quality is Quality.DEGRADED
    reasons = [REASONS[reason] for reason in last.reasons]
    assert reasons == ["", "", "beyond sensor range", "", "", "", "", ""]
