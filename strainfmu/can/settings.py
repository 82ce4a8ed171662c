"""Limits and times of the bridge. docs/reference/can.md states them for its users."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from strainfmu.errors import InputError
from strainfmu.estimator.setting_inputs import OF_READINGS

SHORTEST_CYCLE, LONGEST_CYCLE = 1e-4, 10.0
"""Limits of an input's nominal period [s]. No bus carries shorter ones; a status of longer ones is useless."""

LARGEST_CLOCK_RATE = 1e-2
"""Largest difference of the rates of two clocks [s/s]; what differs more is no clock."""


def checked_cycle_time(cycle_time: float, where: str) -> float:
    """Return ``cycle_time`` [s].

    Raises
    ------
    InputError
        It is not within SHORTEST_CYCLE and LONGEST_CYCLE; ``where`` names the entry in the message.
    """
    if not SHORTEST_CYCLE <= cycle_time <= LONGEST_CYCLE:
        raise InputError(f"{where}: {1e3 * cycle_time:g} ms found, 0.1 to 10,000 ms allowed")
    return cycle_time


@dataclass(frozen=True, kw_only=True)
class StateMachineSettings:
    """Limits of the E2E state machine: AUTOSAR's E2E_SMConfigType.

    Attributes
    ----------
    window_size : number of checks in the window (WindowSize).
    min_ok_init, min_ok_valid, min_ok_invalid : minimum number of good checks in the window to become or stay
        VALID.
    max_error_init, max_error_valid, max_error_invalid : maximum number of bad checks in it.
    """

    window_size: int = 10
    min_ok_init: int = 3
    max_error_init: int = 1
    min_ok_valid: int = 1
    max_error_valid: int = 2
    min_ok_invalid: int = 3
    max_error_invalid: int = 1


RESTARTS = ("confirm", "accept")


@dataclass(frozen=True, kw_only=True)
class StatedLimits:
    """Limits of one bridge that a user may state, in cycles of the input's nominal period unless a unit is stated.

    Attributes
    ----------
    max_age : maximum age of strains that are used, and maximum time for which a whole cycle may repeat itself,
        longer where quiet gauges do so by chance.
    stuck_cycles : equal raw values in a row after which a gauge is left out; 0 turns this check and the checks of
        frames and the whole cycle off, for signals that are constant by nature; None: as the gauge's noise allows.
    zero_cycles : exact zeros in a row after which a gauge is left out; None: as the gauge's noise allows.
    gauge_noise : standard deviation of the gauges' noise at rest [m/m]; None: what the estimator was made with.
    clock_rate : known rate by which the sender's clock runs slower than ours [s/s].
    clock_tolerance : largest difference of its rate from that [s/s]; a delay that grows faster is age.
    hidden_age : largest sum of delays that is taken for drift of the sender's clock [s]; from then on results are
        UNCONFIRMED, and what grows beyond it is age.
    learn_time : time over which the rate of the sender's clock is measured [s]; a delay that grows steadily for so
        long counts as rate. 0: never.
    max_uncertainty : largest uncertainty of the age of results that are VALID [s]; None: no limit.
    synchronised : largest difference of the sender's clock from ours [s] if both are synchronised, else None.
    synchronised_shift : synchronised time less our monotonic clock [s].
    restart : one of RESTARTS: a sender whose time has jumped needs a proof that it is no recording (confirm), or
        is taken for restarted after jump_confirmations cycles (accept).
    period_tolerance : largest difference of the sender's period from the stated one, as a fraction of it; results
        beyond it are UNCONFIRMED.
    """

    max_age: float = 5.0
    stuck_cycles: int | None = None
    zero_cycles: int | None = None
    gauge_noise: float | None = None
    clock_rate: float = 0.0
    clock_tolerance: float = 1e-4
    hidden_age: float = 0.01
    learn_time: float = 600.0
    max_uncertainty: float | None = None
    synchronised: float | None = None
    synchronised_shift: float = 0.0
    restart: str = "confirm"
    period_tolerance: float = 0.2


@dataclass(frozen=True, kw_only=True)
class BridgeSettings(StatedLimits):
    """All limits and times of one bridge, in cycles of the input's nominal period unless a unit is stated.

    Attributes
    ----------
    deadline : from the first frame of a cycle until the cycle is closed, complete or not.
    pressure_max_age : maximum age of q_inf that is used.
    navigation_max_age : maximum age of Mach number and altitude that are used.
    sensor_max_age : maximum age of readings of auxiliary sensors, and of thrust, that are used.
    timeout : silence after which results are STALE; from then on one is sent every cycle.
    invalid_after : silence after which results are INVALID.
    max_delta : maximum step of an E2E counter that is accepted.
    state_machine : limits of the E2E state machine.
    zero_jump : a fall to exactly zero by more than this [m/m] and three times the last change counts at once.
    rate_limit : maximum change from one value to the next [m/m].
    sensor_range : maximum |strain| [m/m], whatever the layout allows; the estimator's where that is smaller.
    heal_cycles : good values in a row after which a gauge is used again.
    jump_tolerance : by how much the delay of a cycle may be below the smallest one so far.
    jump_confirmations : cycles in a row that confirm a jump of the sender's clock.
    startup_time : largest time that a sender's clock shows at its start [s].
    alarm_cycles : cycles for which a second bridge is reported after its last frame.
    second_sender_cycles : cycles for which a second sender is reported after its last frame; longer if it is heard
        again.
    late_cycles : cycles of late frames only, after which the sender is taken to have been restarted.
    burst, rate : frames of one identifier that are accepted at once, and per cycle for long.
    """

    deadline: float = 0.5
    pressure_max_age: float = 10.0
    navigation_max_age: float = 10.0
    sensor_max_age: float = 2.0
    timeout: float = 3.0
    invalid_after: float = 30.0
    max_delta: int = 3
    state_machine: StateMachineSettings = field(default_factory=StateMachineSettings)
    zero_jump: float = 2e-6
    rate_limit: float = 2e-3
    sensor_range: float = 0.05
    heal_cycles: int = 3
    jump_tolerance: float = 1.0
    jump_confirmations: int = 3
    startup_time: float = 0.2
    alarm_cycles: float = 10.0
    second_sender_cycles: float = 20.0
    late_cycles: int = 3
    burst: float = 64.0
    rate: float = 3.0

    def __post_init__(self) -> None:
        ages = ("max_age", "pressure_max_age", "navigation_max_age", "sensor_max_age")
        for name in ("deadline", *ages, "timeout", "rate_limit", OF_READINGS):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise InputError(f"{name}: expected a positive number, got {getattr(self, name):g}")
        if self.restart not in RESTARTS:
            raise InputError(f"restart: expected one of {', '.join(RESTARTS)}, got '{self.restart}'")
        if self.stuck_cycles is not None and self.stuck_cycles < 0:
            raise InputError(f"stuck_cycles: expected 0 for never or a positive number, got {self.stuck_cycles}")
        if self.zero_cycles is not None and self.zero_cycles < 1:
            raise InputError(f"zero_cycles: expected a positive number, got {self.zero_cycles}")
        for name in (
            "period_tolerance",
            "clock_tolerance",
            "hidden_age",
            "learn_time",
            "max_uncertainty",
            "synchronised",
            "startup_time",
            "alarm_cycles",
            "second_sender_cycles",
        ):
            if not (getattr(self, name) or 0.0) >= 0.0:
                raise InputError(f"{name}: expected 0 or a positive number, got {getattr(self, name):g}")
        if not abs(self.clock_rate) <= LARGEST_CLOCK_RATE:
            raise InputError(f"clock_rate: expected at most {LARGEST_CLOCK_RATE:g} s/s, got {self.clock_rate:g}")
        if self.gauge_noise is not None and not 0.0 < self.gauge_noise < float("inf"):
            raise InputError(f"gauge_noise: expected a positive number, got {self.gauge_noise:g}")
        if self.deadline >= 1.0:
            raise InputError(f"deadline: expected less than 1 cycle, got {self.deadline:g} cycles")

    @classmethod
    def of(cls, stated: StatedLimits) -> BridgeSettings:
        """Return the settings with the limits that a user has stated."""
        return cls(**{one.name: getattr(stated, one.name) for one in fields(StatedLimits)})

    @property
    def accepts_restart(self) -> bool:
        """A restarted sender needs no proof."""
        return self.restart == "accept"

    @property
    def recovery_cycles(self) -> int:
        """Cycles after the end of any fault on the bus within which results are VALID again.

        The sum of: the window of the E2E state machine, which errors must leave; the cycles that detect a restart
        of the sender and trust it again; the cycles that heal a gauge; one each for the counter and the open
        cycle.
        """
        machine = self.state_machine
        restart = self.late_cycles + self.jump_confirmations + machine.min_ok_init + 1
        return machine.window_size + restart + self.heal_cycles + 2
