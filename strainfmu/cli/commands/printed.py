"""What commands print: lines as they are, without markup and breaks."""

from time import perf_counter

from rich.console import Console


def say(*lines: str) -> None:
    """Print lines."""
    for line in lines:
        Console().print(line, highlight=False, markup=False, soft_wrap=True)


def say_finished(written: object, start: float) -> None:
    """Print what was written since ``start`` of :func:`~time.perf_counter`, and the time."""
    say(f"{written}: {perf_counter() - start:.1f} s in all")
