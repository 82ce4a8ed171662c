"""Periods and time-outs of mapped frames: each its own; what makes no sense together is refused.

A cycle has the period of the fastest frames of strains. Slower ones are held: their last strains are used until
new ones come or their time-out is over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from strainfmu.can.settings import checked_cycle_time
from strainfmu.can.wire.dbc_lookup import MappedDatabase
from strainfmu.can.wire.frame_layout import InputFrame
from strainfmu.errors import InputError

PERIODS_HELD = 2.0
"""Own periods for which a slow signal is held where the mapping states no time-out."""

_HOLD = "hold"

_MUCH = 1.5
"""Ratio of two periods from which on they are not the same."""


def cycle_time_of(file: MappedDatabase, frames: Sequence[InputFrame]) -> float:
    """Return the period of a cycle [s]: the mapping's, otherwise the period of the fastest frames of strains.

    Raises
    ------
    InputError
        Neither states one, or frames differ and are not to be held.
    """
    stated = file.milliseconds("cycle_time_ms")
    if stated is not None:
        return checked_cycle_time(stated, f"{file.name}: cycle_time_ms")
    periods = [frame.layout.cycle_time for frame in frames]
    known = [period for period in periods if period is not None]
    if not known or len(known) < len(periods):
        raise InputError(
            f"{file.name}: expected cycle_time_ms: the DBC file gives the frames of strains no common one"
        )
    if max(known) > _MUCH * min(known):
        _check_hold(file, frames, min(known))
    elif len(set(known)) > 1:
        raise InputError(
            f"{file.name}: expected cycle_time_ms: the DBC file gives the frames of strains no common one"
        )
    return checked_cycle_time(min(known), f"{file.name}: cycle time of the DBC file")


def with_rates(file: MappedDatabase, frames: Sequence[InputFrame], cycle_time: float) -> tuple[InputFrame, ...]:
    """Return the ``frames`` of strains, those held that are slower than the cycle [s], with their time-outs.

    Raises
    ------
    InputError
        A period does not fit to the cycle, or an entry of the mapping would not be used.
    """
    slow = _check_hold(file, frames, cycle_time)
    if len(slow) == len(frames):
        raise InputError(
            f"{file.name}: cycle_time_ms: expected the period of a frame of strains, got {1e3 * cycle_time:g}; "
            f"the fastest has {_ms(min(slow, key=lambda frame: frame.layout.cycle_time or 0.0))}"
        )
    fast = [frame for frame in frames if frame not in slow]
    for frame in slow:
        _check_same_clock(file, frame, fast[0])
    for frame in fast:
        if frame.layout.cycle_time is not None and frame.layout.cycle_time * _MUCH < cycle_time:
            raise InputError(
                f"{file.name}: frame '{frame.layout.name}': a period of {_ms(frame)} found, it would come more "
                f"than once in a cycle of {1e3 * cycle_time:g} ms; state cycle_time_ms = {_ms(frame)[:-3]}, or "
                "its true period under [period_ms]"
            )
    held = {frame.layout.name for frame in slow}
    return tuple(
        replace(frame, hold=file.timeout(frame, PERIODS_HELD)) if frame.layout.name in held else frame
        for frame in frames
    )


def _check_hold(file: MappedDatabase, frames: Sequence[InputFrame], cycle_time: float) -> list[InputFrame]:
    """Return the frames that are slower than the cycle; refuse them unless the mapping says what to do."""
    slow = [f for f in frames if f.layout.cycle_time is not None and f.layout.cycle_time > _MUCH * cycle_time]
    choice = file.entry("slow_strains")
    if choice not in (None, _HOLD):
        raise InputError(f"{file.name}: slow_strains: expected '{_HOLD}', got {str(choice)[:40]!r}")
    if slow and choice is None:
        raise InputError(
            f"{file.name}: frame '{slow[0].layout.name}': a period of {_ms(slow[0])} found in a cycle of "
            f"{1e3 * cycle_time:g} ms; state slow_strains = '{_HOLD}', so that its last strains are used "
            "meanwhile, or its true period under [period_ms]"
        )
    if choice is not None and not slow:
        raise InputError(
            f"{file.name}: slow_strains: expected a frame of strains that is slower than the cycle of "
            f"{1e3 * cycle_time:g} ms, got none"
        )
    return slow


def _check_same_clock(file: MappedDatabase, slow: InputFrame, fast: InputFrame) -> None:
    """Refuse a held frame whose sample time cannot be compared with the others' sample time."""
    if slow.sample_time is None or fast.sample_time is None:
        return
    lengths = [frame.layout.signals[frame.sample_time or 0].length for frame in (slow, fast)]
    if slow.tick != fast.tick or lengths[0] != lengths[1]:
        raise InputError(
            f"{file.name}: sample_time.{slow.layout.name}: expected unit and length of '{fast.layout.name}', "
            f"{fast.tick:g} s and {lengths[1]} bits, got {slow.tick:g} s and {lengths[0]} bits"
        )


def _ms(frame: InputFrame) -> str:
    """Return the period of a frame in words."""
    return f"{1e3 * (frame.layout.cycle_time or 0.0):g} ms"
