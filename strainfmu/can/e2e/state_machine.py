"""AUTOSAR's E2E state machine (E2E_SMCheck): whether the communication of one frame can be trusted.

Source: AUTOSAR PRS_E2EProtocol (document 849), section on the E2E state machine: one window, in which OK
and OKSOMELOST count as good, ERROR counts as bad, all others count as neither.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from strainfmu.can.e2e.check import STATUSES, E2EStatus
from strainfmu.can.settings import StateMachineSettings
from strainfmu.can.wire.compiled import ARRAY, INTEGER, Record, function, pointer


class E2EState(Enum):
    """State of the communication; data are used in VALID alone."""

    NO_DATA = "NODATA"
    INIT = "INIT"
    VALID = "VALID"
    INVALID = "INVALID"


STATES = tuple(E2EState)
"""In the order of strainbus.h."""

VALID = STATES.index(E2EState.VALID)

_CODES = {status: code for code, status in enumerate(STATUSES)}
_LIMITS = (
    *("window_size", "min_ok_init", "max_error_init", "min_ok_valid", "max_error_valid"),
    *("min_ok_invalid", "max_error_invalid"),
)


class MachineRecord(Record):
    """The state of the communication of one frame for compiled code."""

    position = 8
    _fields_ = (
        *((name, INTEGER) for name in _LIMITS),
        ("window", ARRAY),
        *((name, INTEGER) for name in ("state", "next", "count", "ok", "errors")),
    )


class E2EStateMachine:
    """NODATA -> INIT -> VALID <-> INVALID over the statuses of successive checks, in compiled code."""

    def __init__(self, settings: StateMachineSettings) -> None:
        self.record = MachineRecord(
            **{name: getattr(settings, name) for name in _LIMITS},
            window=np.zeros(settings.window_size, dtype=np.uint8),
            **dict.fromkeys(("state", "next", "count", "ok", "errors"), 0),
        )
        self._at, self._add = pointer(self.record), function("sb_machine_add", MachineRecord)

    def reset(self) -> None:
        """Forget all checks, as after a restart of the sender or of the bus."""
        record = self.record
        record.state = record.next = record.count = record.ok = record.errors = 0

    @property
    def state(self) -> E2EState:
        """State of the communication."""
        return STATES[self.record.state]

    def add(self, status: E2EStatus) -> E2EState:
        """Take in the status of one check and return the state."""
        return STATES[self._add(self._at, _CODES[status])]
