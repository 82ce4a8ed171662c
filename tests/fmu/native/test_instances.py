"""Many instances in one process, and several threads: nothing is shared."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from agreement import random_samples
from native_case import NativeCase
from raw_fmu import OK, Fmu2

pytestmark = pytest.mark.fast


def run(fmu: Fmu2, case: NativeCase, seed: int, steps: int = 30) -> list[bytes]:
    """Outputs of every step, in bytes."""
    seen = []
    for k, sample in enumerate(random_samples(case.inverse_map, steps, seed)):
        fmu.set_strain(sample.strain)
        fmu.set_valid(sample.valid)
        fmu.set_scalars(0, *sample.flow)
        assert fmu.step(0.1 * k, 0.1) == OK
        seen.append(fmu.outputs().tobytes())
    return seen


def test_two_hundred_instances_interleaved(cases: dict[str, NativeCase]) -> None:
    # Of two maps, in turn; freed in an order of its own.
    both = [cases["few gauges"], cases["case 2, gamma 1"]]
    instances = [(both[k % 2], Fmu2(both[k % 2].uri, both[k % 2].n).start()) for k in range(200)]
    samples = {k: list(random_samples(both[k].inverse_map, 5, seed=8)) for k in range(2)}
    for step in range(5):
        outputs: dict[int, set[bytes]] = {0: set(), 1: set()}
        for k, (_, fmu) in enumerate(instances):
            sample = samples[k % 2][step]
            fmu.set_strain(sample.strain)
            fmu.set_valid(sample.valid)
            fmu.set_scalars(0, *sample.flow)
        for k, (_, fmu) in enumerate(instances):
            assert fmu.step(0.1 * step, 0.1) == OK
            outputs[k % 2].add(fmu.outputs().tobytes())
        assert [len(seen) for seen in outputs.values()] == [1, 1]
    for k in np.random.default_rng(1).permutation(200):
        instances[k][1].free()


def test_threads(cases: dict[str, NativeCase]) -> None:
    # ctypes releases the interpreter's lock during each call.
    case = cases["case 1"]

    def work(seed: int) -> list[bytes]:
        fmu = Fmu2(case.uri, case.n).start()
        seen = run(fmu, case, seed % 2)
        fmu.free()
        return seen

    with ThreadPoolExecutor(8) as pool:
        results = list(pool.map(work, range(16)))
    assert all(result == results[k % 2] for k, result in enumerate(results))
    assert results[0] != results[1]


def test_masks_in_any_order_give_the_same(case: NativeCase) -> None:
    # More masks than the cache holds: what it drops and computes again is the same to the bit.
    samples = list(random_samples(case.inverse_map, 150, seed=9))
    outputs = []
    for order in (range(150), reversed(range(150)), np.random.default_rng(2).permutation(150)):
        fmu, seen = Fmu2(case.uri, case.n).start(), {}
        for k in order:
            fmu.set_strain(samples[k].strain)
            fmu.set_valid(samples[k].valid)
            fmu.set_scalars(0, *samples[k].flow)
            seen[int(k)] = fmu.outputs().tobytes()
        outputs.append(seen)
        fmu.free()
    assert outputs[0] == outputs[1] == outputs[2]
