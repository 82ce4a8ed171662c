"""Results as a bridge publishes them to the page, and the publisher."""

from copy import copy
from typing import Any

import numpy as np

from strainfmu.can.machine import Result
from strainfmu.can.page_message import EstimatorFacts, GaugePosition
from strainfmu.can.publisher import Publisher
from strainfmu.can.quality import Cause, FrameAccount, Quality
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE


def result(quality: Quality = Quality.VALID, value: float = 0.5, **further: Any) -> Result:
    strain = np.array([1e-6, np.nan, -3e-6])
    full = np.full(5, value)
    valid = np.isfinite(strain)
    return Result(
        time=1.0,
        quality=quality,
        causes=Cause.PARTIAL_CYCLE,
        usable=quality in (Quality.VALID, Quality.UNPROTECTED, Quality.DEGRADED),
        valid=valid,
        strain=strain,
        dynamic_pressure=9e4,
        age=0.002,
        coefficients=full,
        **further,
    )


def altered(result: Result, **changed: Any) -> Result:
    """Return a result with what is ``changed``."""
    duplicate = copy(result)
    for name, value in changed.items():
        setattr(duplicate, name, value)
    return duplicate


OUTSIDE = {"health": 7, "mach_number": 6.02, "altitude": 20_100.0, "other_outputs": {ENVELOPE_SCORE: 4.26}}


def publisher(port: int, rate: float = 1e4, score_limit: float | None = None) -> Publisher:
    positions = [GaugePosition(name, 0.5, 90.0 * k) for k, name in enumerate("abc")]
    return Publisher(
        ("127.0.0.1", port),
        positions,
        rate=rate,
        account=FrameAccount,
        facts=EstimatorFacts(score_limit=score_limit),
    )
