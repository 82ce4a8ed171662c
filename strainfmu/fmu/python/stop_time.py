"""The stop time of an experiment, as ``fmus/native/core/instance.c`` has it."""

_ROUNDING = 1e-2
"""Largest error of the end of the last step, as a fraction of its size."""


def stop_fault(time: float, step_size: float, stop_time: float | None) -> str:
    """Return why a step from ``time`` [s] ends behind ``stop_time``, None for none; "" where it does not."""
    end = time + step_size
    if stop_time is None or end - stop_time <= _ROUNDING * step_size:
        return ""
    return f"the step ends at {end:.9g} s, behind the stop time of the experiment, {stop_time:.9g} s"
