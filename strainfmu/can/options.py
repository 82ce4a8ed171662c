"""The settings of a bridge: limits and times, and options as a user states them."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from pathlib import Path

from strainfmu.can.profiles import Identifiers
from strainfmu.errors import InputError
from strainfmu.estimator.settings import OF_READINGS

SHORTEST_CYCLE, LONGEST_CYCLE = 1e-4, 10.0
"""Limits of an input's nominal period [s]. No bus carries shorter ones; a status of longer ones is useless."""

E2E_WINDOW, E2E_GOOD = 10, 3
"""Checks in the window of the E2E state machine, and good ones with which a frame is trusted, as in bus.h."""


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


RESTARTS = ("confirm", "accept")


@dataclass(frozen=True, kw_only=True)
class StatedLimits:
    """Limits of one bridge that a user may state, in cycles of the input's nominal period unless a unit is stated.

    Attributes
    ----------
    max_age : maximum age of strains that are used, and maximum time for which a whole cycle may repeat itself,
        longer where quiet gauges do so by chance.
    deadline : from the first frame of a cycle until the cycle is closed, complete or not.
    stuck_cycles : equal raw values in a row after which a gauge is left out; 0 turns this check and the checks of
        frames and the whole cycle off, for signals that are constant by nature; None: as the gauge's noise allows.
    clock_tolerance : largest difference of the rates of two clocks [s/s]; a delay that grows faster is age.
    synchronised : largest difference of the sender's clock from ours [s] if both are synchronised, else None.
    synchronised_shift : synchronised time less our monotonic clock [s].
    restart : one of RESTARTS: a sender whose time has jumped needs a proof that it is no recording (confirm), or
        is taken for restarted after late_cycles cycles (accept).
    """

    max_age: float = 5.0
    deadline: float = 0.5
    stuck_cycles: int | None = None
    clock_tolerance: float = 1e-4
    synchronised: float | None = None
    synchronised_shift: float = 0.0
    restart: str = "confirm"


@dataclass(frozen=True, kw_only=True)
class BridgeSettings(StatedLimits):
    """All limits and times of one bridge, in cycles of the input's nominal period unless a unit is stated.

    Attributes
    ----------
    pressure_max_age : maximum age of q_inf that is used.
    navigation_max_age : maximum age of Mach number and altitude that are used.
    sensor_max_age : maximum age of readings of auxiliary sensors, and of thrust, that are used.
    timeout : silence after which results are STALE; from then on one is sent every cycle.
    invalid_after : silence after which results are INVALID.
    zero_jump : a fall to exactly zero by more than this [m/m] and three times the last change counts at once.
    rate_limit : maximum change from one value to the next [m/m].
    sensor_range : maximum |strain| [m/m], whatever the layout allows; the estimator's where that is smaller.
    heal_cycles : good values in a row after which a gauge is used again.
    alarm_cycles : cycles for which a second bridge is reported after its last frame.
    second_sender_cycles : cycles for which a second sender is reported after its last frame; longer if it is heard
        again.
    late_cycles : cycles of late frames only, or of another time, after which the sender is taken to have been
        restarted.
    period_tolerance : largest difference of the sender's period from the stated one, as a fraction of it.
    burst, rate : frames of one identifier that are accepted at once, and per cycle for long.
    """

    pressure_max_age: float = 10.0
    navigation_max_age: float = 10.0
    sensor_max_age: float = 2.0
    timeout: float = 3.0
    invalid_after: float = 30.0
    zero_jump: float = 2e-6
    rate_limit: float = 2e-3
    sensor_range: float = 0.05
    heal_cycles: int = 3
    alarm_cycles: float = 10.0
    second_sender_cycles: float = 20.0
    late_cycles: int = 3
    period_tolerance: float = 0.2
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
        for name in ("clock_tolerance", "synchronised", "alarm_cycles", "second_sender_cycles"):
            if not (getattr(self, name) or 0.0) >= 0.0:
                raise InputError(f"{name}: expected 0 or a positive number, got {getattr(self, name):g}")
        if self.deadline >= 1.0:
            raise InputError(f"deadline: expected less than 1 cycle, got {self.deadline:g} cycles")

    @classmethod
    def of(cls, stated: StatedLimits) -> BridgeSettings:
        """Return the settings with the limits that a user has stated."""
        return cls(**{limit.name: getattr(stated, limit.name) for limit in fields(StatedLimits)})

    @property
    def recovery_cycles(self) -> int:
        """Cycles after the end of any fault on the bus within which results are VALID again.

        The sum of: the window of the E2E state machine, which errors must leave; the cycles that detect a restart
        of the sender and trust it again; the cycles that heal a gauge; one each for the counter and the open
        cycle.
        """
        restart = 2 * self.late_cycles + E2E_GOOD + 1
        return E2E_WINDOW + restart + self.heal_cycles + 2


RESULT_FORMS = ("fd", "classic-le")

PUBLISH_RATE = 20.0
"""Largest number of results per second that go to displays where none is stated; a page draws fewer."""


@dataclass(frozen=True, kw_only=True)
class BridgeOptions(StatedLimits):
    """Options of a user, with the limits that may be stated; times in seconds.

    Attributes
    ----------
    bus_options : "key=value" of the interface.
    log_channel : of a log whose frames are read, as the file names it; None: all, where each identifier has one.
    profile : of the input where no ``dbc`` is given, with ``cycle_time`` [s] and ``identifiers.base``.
    dbc, mapping : the user's DBC file and its mapping, both or none.
    dynamic_pressure : fixed [Pa], or None to take it from its frame.
    result_form : one of RESULT_FORMS, None for the input's.
    key_file : key of profile fd64-sec, None of others.
    freshness_file : where the freshness value is remembered across runs, None for next to the key.
    zeros : file of what the gauges read without strain (zeros.toml), None for what the FMU was exported with.
    tare : map of the same gauges, with which tares are taken on command; None: they are not.
    tare_cycles : window of a tare [cycles].
    tare_known : file of the strains of the loads that act meanwhile, in the form of zeros; None for none.
    tare_output : where its zeros are written, None for zeros.toml.
    """

    interface: str
    channel: str
    bus_options: tuple[str, ...] = ()
    log_channel: str | None = None
    profile: str = "fd64"
    dbc: Path | None = None
    mapping: Path | None = None
    cycle_time: float = 0.01
    identifiers: Identifiers = field(default_factory=Identifiers)
    dynamic_pressure: float | None = None
    result_form: str | None = None
    key_file: Path | None = None
    freshness_file: Path | None = None
    zeros: Path | None = None
    tare: Path | None = None
    tare_cycles: int = 500
    tare_known: Path | None = None
    tare_output: Path | None = None
