"""Limits and times of the bridge, all in one place; docs/reference/can.md states them for its users."""

from __future__ import annotations

from dataclasses import dataclass, field

from strainfmu.errors import InputError

SHORTEST_CYCLE, LONGEST_CYCLE = 1e-4, 10.0
"""Nominal periods of an input [s]: no bus carries shorter ones; of longer ones a status is no use."""


def checked_cycle_time(cycle_time: float, where: str) -> float:
    """Return ``cycle_time`` [s].

    Raises
    ------
    InputError
        It is not within SHORTEST_CYCLE and LONGEST_CYCLE; ``where`` says whose it is.
    """
    if not SHORTEST_CYCLE <= cycle_time <= LONGEST_CYCLE:
        raise InputError(f"{where}: {1e3 * cycle_time:g} ms found, 0.1 to 10,000 ms allowed")
    return cycle_time


@dataclass(frozen=True, kw_only=True)
class StateMachineSettings:
    """AUTOSAR's E2E_SMConfigType.

    Attributes
    ----------
    window_size : checks that are looked back at (WindowSize).
    min_ok_init, min_ok_valid, min_ok_invalid : least number of good checks in the window to become or stay VALID.
    max_error_init, max_error_valid, max_error_invalid : largest number of bad ones.
    """

    window_size: int = 10
    min_ok_init: int = 3
    max_error_init: int = 1
    min_ok_valid: int = 1
    max_error_valid: int = 2
    min_ok_invalid: int = 3
    max_error_invalid: int = 1


@dataclass(frozen=True, kw_only=True)
class BridgeSettings:
    """Times are in cycles of the input's nominal period unless a unit is stated.

    Attributes
    ----------
    deadline : from the first frame of a cycle to when it is closed whether complete or not.
    max_age : largest age of strains that are used; also how long a whole cycle may repeat itself.
    pressure_max_age : largest age of q_inf that is used.
    timeout : silence after which results say STALE; then one goes out every cycle.
    invalid_after : silence after which they say INVALID.
    max_delta : largest step of an E2E counter that is believed.
    state_machine : limits of the E2E state machine.
    stuck_cycles : equal raw values in a row after which one gauge is left out; 0 for never, nor all of them.
    zero_cycles : exact zeros in a row after which one gauge is left out; 0 for never.
    zero_jump : a fall to exactly zero from more than this [m/m], and three times its last change, counts at once.
    rate_limit : largest change from one cycle to the next [m/m].
    sensor_range : largest |strain| [m/m], whatever the layout allows.
    heal_cycles : good values in a row after which a gauge is used again.
    jump_tolerance : how much earlier than ever before a cycle may come, by the sender's clock.
    jump_confirmations : cycles in a row that must follow a jump of the sender's clock before it counts.
    clock_drift : rate at which the smallest delay ever seen is forgotten [s/s]: above any clock's drift.
    late_cycles : cycles' worth of nothing but frames from the past, after which the sender was restarted.
    burst : frames of one identifier at once that are not yet babbling; ``rate`` per cycle for long.
    """

    deadline: float = 0.5
    max_age: float = 5.0
    pressure_max_age: float = 10.0
    timeout: float = 3.0
    invalid_after: float = 30.0
    max_delta: int = 3
    state_machine: StateMachineSettings = field(default_factory=StateMachineSettings)
    stuck_cycles: int = 25
    zero_cycles: int = 5
    zero_jump: float = 2e-6
    rate_limit: float = 2e-3
    sensor_range: float = 0.05
    heal_cycles: int = 3
    jump_tolerance: float = 1.0
    jump_confirmations: int = 3
    clock_drift: float = 2e-4
    late_cycles: int = 3
    burst: float = 64.0
    rate: float = 3.0

    def __post_init__(self) -> None:
        for name in ("deadline", "max_age", "pressure_max_age", "timeout", "rate_limit", "sensor_range"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise InputError(f"{name}: expected a positive number, got {getattr(self, name):g}")
        if self.stuck_cycles < 0:
            raise InputError(f"stuck_cycles: expected 0 for never or a positive number, got {self.stuck_cycles}")
        if self.deadline >= 1.0:
            raise InputError(f"deadline: expected less than 1 cycle, got {self.deadline:g} cycles")

    @property
    def recovery_cycles(self) -> int:
        """Cycles after the end of any fault on the bus within which results are VALID again.

        A window of the E2E state machine that errors have left, the cycles that it takes to find out that a sender
        was restarted and to believe it again, and one each for the counter's sequence and the open cycle.
        """
        machine = self.state_machine
        restart = self.late_cycles + self.jump_confirmations + machine.min_ok_init + 1
        return machine.window_size + restart + self.heal_cycles + 2
