"""Schedulers of flows: threads of this process, local processes, or the workers of a Dask scheduler."""

from collections.abc import Callable, Generator, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing
from dataclasses import dataclass
from importlib.util import find_spec

from builder.aero.engine import Engine, FlowKey
from builder.aero.engines.registry import ENGINES
from builder.campaign.dask_workers import FailedFlow, SolvedFlow, solve_on_dask, solve_one
from builder.processors import processors
from builder.reporting import Note
from strainfmu.errors import FlowReachError, StrainfmuError
from strainfmu.files import fingerprint

FEW_FLOWS = 200
"""Fewer flows than this are solved in threads: each local process starts, and where the solver is not compiled yet
compiles it, which takes longer than they save."""


@dataclass(frozen=True)
class Scheduling:
    """Who solves the flows.

    Attributes
    ----------
    address : a Dask scheduler (``tcp://host:port``), or None for this machine.
    workers : local processes; 0 for threads of this process; None for as many as there are cores: processes, or
        threads where flows are few or cheap.
    """

    address: str | None = None
    workers: int | None = None


def solve_flows(
    engine: Engine,
    keys: Iterable[FlowKey],
    scheduling: Scheduling | None = None,
    note: Note | None = None,
    failed: Callable[[FailedFlow], None] | None = None,
) -> Generator[SolvedFlow, None, None]:
    """Solve each flow once and hand it over as soon as it is solved, in any order.

    The one place where flows are computed. Local processes are spawned: a script that calls this needs the usual
    ``if __name__ == "__main__":``.

    Parameters
    ----------
    note : takes one line about where the flows are solved.
    failed : takes each flow that is outside the engine's reach, and the others go on; without it the first one is
        an error.

    Raises
    ------
    FlowReachError
        A flow is outside the engine's reach, and there is no ``failed``; the others are abandoned.
    StrainfmuError
        The scheduler cannot be reached or is lost, or a worker has another version of the solver.
    """
    missing = sorted(set(keys))
    if not missing:
        return
    scheduling = scheduling or Scheduling()
    note = note or (lambda text: None)
    cores = processors()
    if scheduling.address is None and _in_this_process(engine, len(missing), scheduling):
        solved = _solve_in_threads(engine, missing, cores, note)
    else:
        workers = min(scheduling.workers or cores, len(missing))
        solved = solve_on_dask(engine, missing, scheduling.address, workers, note)
    expected = fingerprint(engine.inputs())
    with closing(solved):
        for result in solved:
            if result.fingerprint != expected:
                where = scheduling.address or "this machine"
                raise StrainfmuError(
                    f"{where}: a worker has another version of the {engine.name} engine; install this "
                    "strainfmu on every worker"
                )
            if isinstance(result, SolvedFlow):
                yield result
            elif failed is None:
                raise FlowReachError(result.cause)
            else:
                failed(result)


def _in_this_process(engine: Engine, n_flows: int, scheduling: Scheduling) -> bool:
    if scheduling.workers is not None:
        return scheduling.workers == 0
    kind = ENGINES.get(engine.name)
    cheap = kind is not None and not kind.long_work
    return cheap or n_flows < FEW_FLOWS or find_spec("distributed") is None


def _solve_in_threads(
    engine: Engine, keys: list[FlowKey], n_threads: int, note: Note
) -> Generator[SolvedFlow | FailedFlow, None, None]:
    """Solve in threads: the compiled solver releases the interpreter lock, so they run side by side."""
    note(f"{min(n_threads, len(keys))} threads of this process")
    with ThreadPoolExecutor(max_workers=n_threads) as pool:
        futures = [pool.submit(solve_one, engine, key) for key in keys]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
