"""Frames of results and of states that no machine has made, by the compiled code that composes a machine's own."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from strainfmu.can.frame import Frame
from strainfmu.can.frame_layout import FrameLayout
from strainfmu.can.machine import Result
from strainfmu.can.quality import NUMBER_OF, BusState, FrameAccount
from strainfmu.can.result_frames import FIRST_OTHER, OF_DETAIL, OF_RESULT, OF_STATUS, output_names
from strainfmu.can.result_frames import ResultFrames as Composed
from strainfmu.can.signals import ACCOUNT, BRIDGE, PLACES, RESULT, functions, pointer
from strainfmu.cosim.estimators.exchange import Record

_STATE_BYTES = 1 << 15


@dataclass(frozen=True, eq=False, kw_only=True)
class BridgeStatus:
    """What the frames of a bridge's status say."""

    time: float
    bus_state: BusState
    last: Result | None
    last_valid: Result | None
    account: FrameAccount
    cycles: int
    send_failures: int
    reconnects: int


class ResultFrames:
    """Composes frames of any result and status, each with its own counter."""

    def __init__(self, layouts: Sequence[FrameLayout], configuration: int, first: int = 0) -> None:
        self._library, self._bridge, self._names = functions(), Record(BRIDGE), output_names(layouts)
        state = np.zeros(_STATE_BYTES, dtype=np.uint8)
        self._result = state[PLACES["result"] :][: RESULT.itemsize].view(RESULT)[0]
        self._account = state[PLACES["account"] :][: ACCOUNT.itemsize].view(ACCOUNT)[0]
        self._output = np.zeros(FIRST_OTHER + len(self._names) + 1)
        self._bridge.set(state=state, output=self._output)
        self._composed = Composed(self._bridge, layouts, configuration, first, self._names)
        self._last = self._bridge.record["last"].view(np.uint8).view(np.float64)[:8]
        self._numbers = self._bridge.record["last"].view(np.uint8)[120:].view(np.uint64)

    def of_result(self, result: Result) -> list[Frame]:
        """Return the frames of a result, with its details where it has causes above bit 15."""
        self._set(result)
        assert self._library.sb_compose(pointer(self._bridge.record)) < 0
        return self._frames(OF_RESULT, *[OF_DETAIL] * bool(int(result.causes) >> 16))

    def of_status(self, status: BridgeStatus) -> list[Frame]:
        """Return the frames of a status, and the details of its last result."""
        record, account = self._bridge.record, status.account
        self._bridge.record["last"] = np.zeros(1, dtype="V136")
        counters = np.ctypeslib.as_array(
            (ctypes.c_uint8 * int(record["n_frames"][0])).from_address(int(record["counter"][0]))
        )
        for result in (status.last_valid, status.last):
            kept = counters.copy()
            if result is not None:
                self.of_result(result)
            counters[:] = kept
        self._numbers[0] = status.cycles
        self._account["received"] = account.received
        for kind, number in NUMBER_OF.items():
            self._account["count"][number] = account.classes[kind]
        record["bus_state"], record["send_failures"] = status.bus_state, status.send_failures
        record["reconnects"] = status.reconnects
        now = ctypes.byref(ctypes.c_double(status.time))
        assert self._library.sb_compose_status(pointer(record), now) < 0
        return self._frames(OF_STATUS, OF_DETAIL)

    def _frames(self, *kinds: int) -> list[Frame]:
        return [frame.with_data(bytes(data)) for kind in kinds for frame, data in self._composed.of_kind[kind]]

    def _set(self, result: Result) -> None:
        given, record, output = self._result, self._bridge.record, self._output
        for name in ("time", "age", "held", "usable"):
            given[name] = getattr(result, name)
        given["uncertainty"], given["quality"] = result.age_uncertainty, int(result.quality)
        given["causes"] = int(result.causes)
        given["sample_time"] = -1 if result.sample_time is None else result.sample_time
        given["counter"] = -1 if result.counter is None else result.counter
        is_stepped = result.quality.has_coefficients or result.health is not None
        record["is_stepped"], record["n_gauges"] = is_stepped, int(result.valid.sum())
        record["health"] = -1 if result.health is None else result.health
        record["pressure"] = result.dynamic_pressure
        output[:5], output[5:10], output[10] = result.coefficients, result.coefficients_std, result.chi_square
        output[FIRST_OTHER:-1] = [result.other_outputs.get(name, nan) for name in self._names]
