"""Task of a campaign's worker; it needs this package installed, and no file of the user's."""

from __future__ import annotations

import signal
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from builder.aero.engine import Engine, Flow, FlowKey
from strainfmu.errors import FlowReachError
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


@dataclass(frozen=True)
class FailedFlow:
    """One flow that is outside the engine's reach, as a worker hands it back.

    Attributes
    ----------
    key : the flow it is.
    cause : why, in one line.
    fingerprint : as in :class:`SolvedFlow`.
    """

    key: FlowKey
    cause: str
    fingerprint: str


def solve_one(engine: Engine, key: FlowKey) -> SolvedFlow | FailedFlow:
    """Solve the flow ``key``, or say why it is outside the engine's reach."""
    start, digest = perf_counter(), fingerprint(engine.inputs())
    try:
        flow = engine.solve(key)
    except FlowReachError as error:
        return FailedFlow(key, str(error), digest)
    return SolvedFlow(flow, digest, perf_counter() - start)


def dask_setup(worker: Any) -> None:
    """Prepare a local worker process (a hook of Dask's ``preload``).

    Ctrl-C in a terminal reaches every process there. The campaign answers it and ends its workers itself.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
