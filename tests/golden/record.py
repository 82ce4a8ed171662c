"""Record the golden files from the compiled core, or check them: ``kinds.py`` says what they hold."""

import argparse
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import draw
import draw_faults
from comparison import NEAR_THRESHOLD, WHOLE, differences
from estimator_carrier import by_estimator, estimator_for
from inputs import Inputs, Recorded, Results, recorded, rounded, write
from kinds import KINDS, STREAMS, Stream, map_of_kind, tolerance_of
from last_digits import perturbed

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState

NEAR = 1e4
"""Change of a map, over the one by another machine, that takes statistics within about 1e-6 of a threshold over
it."""

LARGEST = 3e-8
"""Change above which parts of a map that say the same would disagree."""

SEEDS = (1, 2)
"""Of such changes."""

OF_TOLERANCE = 0.2
"""Part of the tolerance that last digits may move a sample by."""

Apart = dict[str, tuple[float, str]]
"""Largest difference of each field, and where it is."""


def drawn(kind: str, stream: Stream) -> Inputs:
    """Return the inputs of ``stream``; of random samples those that hang by no digit and are near no threshold."""
    options = dict(stream.options)
    kept = options.get("n", 0) if stream.modes == ("each",) else 0
    if kept:
        options["n"] = kept + kept // 5 + 10
    function = getattr(draw, stream.draw, None) or getattr(draw_faults, stream.draw)
    inputs = rounded(function(map_of_kind(kind), stream.seed, **options))
    if not kept:
        return inputs
    expected = by_core(kind, inputs, "each", 0.0)
    moved = np.max([*moves(kind, inputs, "each", 0.0, expected).values()], axis=0)
    near = near_threshold(kind, inputs, "each", 0.0, expected)
    stands = np.flatnonzero((moved <= OF_TOLERANCE * tolerance_of(kind, "each")) & ~near)
    print(f"    {len(inputs) - len(stands)} of {len(inputs)} samples hang by a digit or are near a threshold")
    assert len(stands) >= kept, (
        f"{kind}: {len(stands)} of {len(inputs)} samples stand a change of their last digits"
    )
    return inputs.rows(stands[:kept])


@cache
def estimator_of(kind: str, seed: int = 0, size: float = 0.0) -> Estimator:
    """Return the estimator of the map of ``kind`` with last digits changed by ``size``, 0 for the map itself."""
    return Estimator(perturbed(map_of_kind(kind), seed, size) if size > 0.0 else map_of_kind(kind))


def by_core(kind: str, inputs: Inputs, mode: str, seconds: float, seed: int = 0, size: float = 0.0) -> Results:
    """Return what the compiled core makes of a stream, with last digits of the map changed by ``size``."""
    return by_estimator(estimator_for(estimator_of(kind, seed, size), inputs), inputs, mode, seconds)


def moves(kind: str, inputs: Inputs, mode: str, seconds: float, expected: Results) -> Results:
    """Return for each field the largest change (k,) of ``expected`` by other last digits of the map."""
    found = {name: np.zeros(len(inputs)) for name in expected}
    for seed in SEEDS:
        other = by_core(kind, inputs, mode, seconds, seed, KINDS[kind].digits)
        for name, values in differences(expected, other).items():
            found[name][: len(values)] = np.maximum(found[name][: len(values)], values)
    return found


def near_threshold(kind: str, inputs: Inputs, mode: str, seconds: float, expected: Results) -> np.ndarray:
    """Return (k,) whether a small change of the map changes a whole number of ``expected``, or what is known."""
    near, size = np.zeros(len(inputs), dtype=bool), min(NEAR * KINDS[kind].digits, LARGEST)
    for seed in SEEDS:
        other = by_core(kind, inputs, mode, seconds, seed, size)
        for name, values in differences(expected, other).items():
            near[: len(values)] |= values > 0.5 if name in WHOLE else np.isinf(values)
    return near


def record(name: str, again: bool) -> bool:
    """Record the file of the kind ``name``; return whether no sample hangs by a digit."""
    before, made, good = recorded(name), dict[str, Recorded](), True
    changed, moved = Apart(), Apart()
    print(f"\n{name}", flush=True)
    for title, stream in STREAMS[name].items():
        is_drawn = again or title not in before
        inputs = drawn(name, stream) if is_drawn else before[title].inputs
        results = {}
        for mode in stream.modes:
            where, of_stream = f"{title}/{mode}", (name, inputs, mode, stream.seconds)
            found = by_core(*of_stream)
            near = near_threshold(*of_stream, found)
            print(f"  {where:36s} {len(inputs):4d}  {_states(found)}", flush=True)
            by_digits = moves(*of_stream, found)
            _note(moved, by_digits, where)
            good &= _report("last digits", by_digits, tolerance_of(name, mode))
            if near.any():
                print(f"    near a threshold: {', '.join(map(str, np.flatnonzero(near)))}")
            if not is_drawn and mode in before[title].results:
                _note(changed, differences(before[title].results[mode], found), where)
            results[mode] = found | {NEAR_THRESHOLD: near.astype(np.int16)}
        made[title] = Recorded(inputs=inputs, results=results)
    write(name, made)
    recorded.cache_clear()
    _print(f"by {KINDS[name].digits:g} of the map", moved)
    _print("from the file before", {one: value for one, value in changed.items() if value[0] > 0.0})
    return good


def check(name: str) -> bool:
    """Print how far the core is from the file of ``name``, and what last digits move; whether both are small."""
    print(f"\n{name}", flush=True)
    apart, moved, good = Apart(), Apart(), True
    for title, one in recorded(name).items():
        for mode, expected in one.results.items():
            seconds, where = STREAMS[name][title].seconds, f"{title}/{mode}"
            found = by_core(name, one.inputs, mode, seconds)
            from_file, by_digits = differences(expected, found), moves(name, one.inputs, mode, seconds, found)
            _note(apart, from_file, where)
            _note(moved, by_digits, where)
            good &= _report(f"{where}: file", from_file, tolerance_of(name, mode))
            good &= _report(f"{where}: last digits", by_digits, tolerance_of(name, mode))
    _print("from the file", apart)
    _print(f"by {KINDS[name].digits:g} of the map", moved)
    return good


def _states(results: Results) -> str:
    numbers, counts = np.unique(results["health"], return_counts=True)
    return ", ".join(f"{HealthState(one).name} {count}" for one, count in zip(numbers, counts, strict=True))


def _note(apart: Apart, found: Results, where: str) -> None:
    for field, values in found.items():
        row = int(np.argmax(values)) if values.size else 0
        size = float(values[row]) if values.size else 0.0
        if field not in apart or size > apart[field][0]:
            apart[field] = (size, f"{where}[{row}]")


def _report(what: str, found: Results, tolerance: float) -> bool:
    """Print the samples that differ by more than ``tolerance``; whether there are none."""
    rows = sorted({int(row) for values in found.values() for row in np.flatnonzero(values > tolerance)})
    for row in rows:
        fields = {name: values[row] for name, values in found.items() if row < len(values)}
        off = ", ".join(f"{name} {size:.1e}" for name, size in fields.items() if size > tolerance)
        print(f"    {what}, sample {row}: {off}")
    return not rows


def _print(title: str, apart: Apart) -> None:
    if not apart:
        return
    print(f"  largest difference {title} [standard deviations]:")
    for field, (size, where) in sorted(apart.items(), key=lambda item: -item[1][0]):
        print(f"    {field:26s} {size:8.1e}  {where if size > 0.0 else ''}")


def main(arguments: Iterable[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(KINDS)}; all by default")
    parser.add_argument("--draw", action="store_true", help="draw the inputs again, too")
    parser.add_argument("--check", action="store_true", help="record nothing, compare with the files")
    given = parser.parse_args(arguments)
    unknown = set(given.kinds) - KINDS.keys()
    if unknown:
        parser.error(f"KIND: expected {', '.join(KINDS)}, got {', '.join(sorted(unknown))}")
    good = [check(name) if given.check else record(name, given.draw) for name in given.kinds or KINDS]
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
