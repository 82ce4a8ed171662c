"""AUTOSAR's E2E state machine (E2E_SMCheck): whether the communication of one frame can be trusted.

Source: AUTOSAR PRS_E2EProtocol (document 849), section on the E2E state machine: one window, in which OK
and OKSOMELOST count as good, ERROR counts as bad, all others count as neither.
"""

from __future__ import annotations

from collections import deque
from enum import Enum

from strainfmu.can.e2e.check import USABLE, E2EStatus
from strainfmu.can.settings import StateMachineSettings


class E2EState(Enum):
    """State of the communication; data are used in VALID alone."""

    NO_DATA = "NODATA"
    INIT = "INIT"
    VALID = "VALID"
    INVALID = "INVALID"


_OK, _VALID = E2EStatus.OK, E2EState.VALID


class E2EStateMachine:
    """NODATA -> INIT -> VALID <-> INVALID over the statuses of successive checks."""

    def __init__(self, settings: StateMachineSettings) -> None:
        self._settings = settings
        self._window: deque[E2EStatus] = deque()
        self._ok = self._errors = 0
        self._size = settings.window_size
        self.state = E2EState.NO_DATA
        self.is_steady = False
        """A window full of good checks stays one with another: it changes nothing."""

    def reset(self) -> None:
        """Forget all checks, as after a restart of the sender or of the bus."""
        self._window.clear()
        self._ok = self._errors = 0
        self.state, self.is_steady = E2EState.NO_DATA, False

    def add(self, status: E2EStatus) -> E2EState:
        """Take in the status of one check and return the state."""
        if status is _OK and self.is_steady:
            return self.state  # what leaves the window counts as what enters it
        limits = self._settings
        if self.state is E2EState.NO_DATA:
            if status not in (E2EStatus.ERROR, E2EStatus.NO_NEW_DATA):
                self.state = E2EState.INIT
            return self.state
        self._slide(status)
        ok, errors = self._ok, self._errors
        if self.state is E2EState.INIT:
            if errors > limits.max_error_init:
                self.state = E2EState.INVALID
            elif ok >= limits.min_ok_init:
                self.state = E2EState.VALID
        elif self.state is E2EState.VALID:
            if errors > limits.max_error_valid or ok < limits.min_ok_valid:
                self.state = E2EState.INVALID
        elif errors <= limits.max_error_invalid and ok >= limits.min_ok_invalid:
            self.state = E2EState.VALID
        self.is_steady = self._ok == self._size and self.state is _VALID
        return self.state

    def _slide(self, status: E2EStatus) -> None:
        """Take ``status`` into the window, and the oldest out of it if it is full."""
        self._window.append(status)
        self._ok += status in USABLE
        self._errors += status is E2EStatus.ERROR
        if len(self._window) > self._settings.window_size:
            oldest = self._window.popleft()
            self._ok -= oldest in USABLE
            self._errors -= oldest is E2EStatus.ERROR
