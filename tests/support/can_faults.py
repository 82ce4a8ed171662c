"""Faults of sensors, senders, gateways and buses: their kinds, when each acts, and random sequences of them.

Names follow ISO 26262-6 (annex D) and IEC 61784-3 where they have one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from strainfmu.errors import InputError


class FaultKind(Enum):
    """Kinds of faults; the values are the names on the command line."""

    LOSS = "loss"
    """Single frames are lost."""
    SILENCE = "silence"
    """The sender is off."""
    REPETITION = "repetition"
    """Frames are sent twice or more often."""
    SEQUENCE = "sequence"
    """Frames of a cycle come after the first of the next."""
    REPLAY = "replay"
    """A recorded earlier cycle is inserted."""
    LENGTH = "length"
    """Frames with other lengths."""
    FORMAT = "format"
    """Classic frames for CAN FD frames and the other way round."""
    IDENTIFIER_WIDTH = "identifier-width"
    """29 bit identifiers for 11 bit ones and the other way round."""
    CORRUPTION = "corruption"
    """Up to three bits are flipped."""
    BURST_ERROR = "burst-error"
    """Bits within eight neighbouring ones are flipped."""
    MASQUERADE = "masquerade"
    """Frames of another sender, with another DataID, on our identifiers."""
    CONFIGURATION = "configuration"
    """A sender with another assignment of gauges."""
    DELAY = "delay"
    """A gateway holds frames back, then releases them in order."""
    FREEZE = "freeze"
    """The sender sends the same strains again and again, with new counters and times."""
    PARTIAL_FREEZE = "partial-freeze"
    """All gauges but one do not change any more, or the gauges of one frame."""
    MIXED_RATES = "mixed-rates"
    """One frame of strains comes in every fifth cycle alone."""
    STUCK_GAUGE = "stuck-gauge"
    """One gauge does not change any more."""
    ZERO_GAUGE = "zero-gauge"
    """One gauge reads exactly zero, as amplifiers send on an error."""
    NO_VALUE = "no-value"
    """Gauges report "not available"."""
    OUT_OF_RANGE = "out-of-range"
    """A gauge is at the end of its converter's range; a float is 2.0E15."""
    JUMP = "jump"
    """A gauge jumps by more than a structure can."""
    SENDER_STATUS = "sender-status"
    """The sender reports that its values are not to be used, and sends wrong ones."""
    BABBLING = "babbling"
    """A node fills one of our identifiers with garbage."""
    UNKNOWN_IDENTIFIER = "unknown-identifier"
    """A node fills the bus with unknown identifiers."""
    OWN_IDENTIFIER = "own-identifier"
    """The bridge's own frames come back."""
    ERROR_FRAMES = "error-frames"
    """The controller reports errors, on identifiers that look like ours."""
    BUS_OFF = "bus-off"
    """The controller goes off the bus."""
    REMOTE_FRAMES = "remote-frames"
    """Requests on our identifiers."""
    RESTART = "restart"
    """The sender is restarted: counter and clock begin at zero."""
    CLOCK_JUMP = "clock-jump"
    """The sender's clock jumps ahead."""
    JITTER = "jitter"
    """Frames are late by a fraction of a cycle."""
    PRESSURE_SILENCE = "pressure-silence"
    """The dynamic pressure is not sent."""
    PRESSURE_NONE = "pressure-none"
    """The dynamic pressure is "not available"."""
    NAVIGATION_SILENCE = "navigation-silence"
    """Mach number and altitude are not sent."""
    NAVIGATION_NONE = "navigation-none"
    """Mach number and altitude are "not available"."""
    CREEP = "creep"
    """The delay grows little by little, as in the queue of a gateway that is a little too slow."""
    RECORDING = "recording"
    """The sender is off, and what it sent before is sent again in order: a recording, taken for a restart."""
    SECOND_BRIDGE = "second-bridge"
    """Another bridge sends results on our identifiers."""
    CONFLICT = "conflict"
    """Another sender repeats frames with the same counter, other strains and a CRC that fits."""
    FORGERY = "forgery"
    """Frames are altered and their CRC computed again, by somebody without the key. Authenticated frames alone."""
    EARLIER_RUN = "earlier-run"
    """Frames of an earlier run of the same sender come instead of the present ones. Authenticated frames alone."""


NEED_A_KEY = frozenset({FaultKind.FORGERY, FaultKind.EARLIER_RUN})
"""Faults that nothing but authentication finds: they act on authenticated frames alone."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One fault from cycle ``start`` on for ``cycles`` cycles; ``seed`` determines all that is random in it."""

    kind: FaultKind
    start: int
    cycles: int
    seed: int = 0

    def is_active(self, cycle: int) -> bool:
        """Return whether the fault acts in ``cycle``."""
        return self.start <= cycle < self.start + self.cycles


def random_faults(
    n_faults: int, kinds: tuple[FaultKind, ...], seed: int, gap: int, longest: int = 12, first: int = 40
) -> list[Fault]:
    """Return ``n_faults`` faults one after the other, ``gap`` cycles apart; a fifth of the time two at once."""
    if not kinds:
        raise InputError("faults: expected at least one kind, got none")
    random = np.random.default_rng(seed)
    faults: list[Fault] = []
    start = first
    while len(faults) < n_faults:
        cycles = int(random.integers(1, longest + 1))
        for _ in range(2 if random.random() < 0.2 and len(faults) + 1 < n_faults else 1):
            kind = kinds[int(random.integers(len(kinds)))]
            faults.append(Fault(kind=kind, start=start, cycles=cycles, seed=int(random.integers(1 << 31))))
        start += cycles + gap
    return faults


SETTLING_CYCLES = 40
"""Cycles without faults at the start, in which the bridge comes to trust its input."""


def planned_faults(
    kinds: Sequence[str], n_faults: int, seed: int, n_cycles: int, is_authenticated: bool = False
) -> list[Fault]:
    """Return ``n_faults`` faults of ``kinds`` (all that act if there are none), spread over ``n_cycles``.

    Raises
    ------
    InputError
        There is no such kind, it does not act on these frames, or the flight is too short for so many.
    """
    known = {kind.value: kind for kind in FaultKind if is_authenticated or kind not in NEED_A_KEY}
    for name in kinds:
        if name in {kind.value for kind in FaultKind} - set(known):
            raise InputError(f"fault: '{name}' acts on authenticated frames alone; state --profile fd64-sec")
        if name not in known:
            raise InputError(f"fault: expected one of {', '.join(known)}, got '{name}'")
    if n_faults == 0:
        return []
    longest = 12
    gap = (n_cycles - SETTLING_CYCLES) // n_faults - longest
    if gap < 1:
        minimum = SETTLING_CYCLES + n_faults * (longest + 1)
        raise InputError(f"faults: expected at least {minimum} cycles for {n_faults} of them, got {n_cycles}")
    chosen = tuple(known[name] for name in kinds) or tuple(known.values())
    return random_faults(n_faults, chosen, seed=seed, gap=gap, longest=longest, first=SETTLING_CYCLES)
