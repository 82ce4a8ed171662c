"""Results as a bridge publishes them to the page, and the publisher."""

from __future__ import annotations

from typing import Any

import numpy as np

from strainfmu.can.bridge.displays.page_message import EstimatorFacts, GaugePosition
from strainfmu.can.bridge.displays.publisher import BridgeReports, Publisher
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.frames.account import FrameAccount
from strainfmu.can.cycle.states.bus_state import BusState
from strainfmu.can.cycle.states.quality import Cause, Quality


def result(quality: Quality = Quality.VALID, value: float = 0.5, **further: Any) -> CycleResult:
    strain = np.array([1e-6, np.nan, -3e-6])
    full = np.full(5, value)
    valid = np.isfinite(strain)
    return CycleResult(
        time=1.0,
        quality=quality,
        causes=Cause.PARTIAL_CYCLE,
        valid=valid,
        strain=strain,
        dynamic_pressure=9e4,
        age=0.002,
        coefficients=full,
        **further,
    )


OUTSIDE = {"health": 7, "mach_number": 6.02, "altitude": 20_100.0, "envelope_score": 4.26}


def publisher(port: int, rate: float = 1e4, score_limit: float | None = None) -> Publisher:
    positions = [GaugePosition(name, 0.5, 90.0 * k) for k, name in enumerate("abc")]
    return Publisher(
        ("127.0.0.1", port),
        positions,
        rate=rate,
        reports=BridgeReports(account=FrameAccount, bus_state=lambda: BusState.ERROR_ACTIVE),
        facts=EstimatorFacts(score_limit=score_limit),
    )
