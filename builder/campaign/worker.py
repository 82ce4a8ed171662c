"""Task of a campaign's worker; it needs this package installed, and no file of the user's."""

from __future__ import annotations

import signal
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from builder.aero.engine import Engine, Flow, FlowKey
from strainfmu.files import fingerprint


@dataclass(frozen=True, eq=False)
class SolvedFlow:
    """One flow as a worker hands it back.

    Attributes
    ----------
    flow : the flow.
    fingerprint : of the engine's inputs as the worker has them; another version of the solver has another.
    seconds : time it took [s].
    """

    flow: Flow
    fingerprint: str
    seconds: float


def solve_one(engine: Engine, key: FlowKey) -> SolvedFlow:
    """Solve the flow ``key``.

    Raises
    ------
    FlowReachError
        The flow is outside the engine's reach.
    """
    start = perf_counter()
    flow = engine.solve(key)
    return SolvedFlow(flow, fingerprint(engine.inputs()), perf_counter() - start)


def dask_setup(worker: Any) -> None:
    """Prepare a local worker process (a hook of Dask's ``preload``).

    Ctrl-C in a terminal reaches every process there. The campaign answers it and ends its workers itself.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
