"""Work done by Dask workers: processes on this machine, or the workers of a scheduler elsewhere.

A worker needs this package installed, and no file of the user's.
"""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeVar

from builder.aero.engine import Engine, Flow, FlowKey
from builder.reporting import Note
from strainfmu.errors import FlowReachError, InputError, StrainfmuError
from strainfmu.files import fingerprint

if TYPE_CHECKING:
    from distributed import Client

Argument = TypeVar("Argument")
Result = TypeVar("Result")

CONNECT_TIMEOUT = 10.0
"""Time to reach a scheduler [s]."""
WORKER_TIMEOUT = 60.0
"""Time that a scheduler may be without any worker [s]."""
LOOK_INTERVAL = 2.0
"""Time between looks at the scheduler while no flow comes [s]."""
MEMORY_LIMIT = "1.8 GiB"
"""Of one local worker."""


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


def solve_on_dask(
    engine: Engine, keys: list[FlowKey], address: str | None, workers: int, note: Note
) -> Generator[SolvedFlow | FailedFlow, None, None]:
    """Solve flows on ``workers`` local processes, or on the scheduler at ``address``; errors as :func:`on_dask`.

    The engine travels with each flow, so that a worker can join at any time.
    """
    return on_dask(partial(solve_one, engine), keys, address, workers, note)


def on_dask(
    function: Callable[[Argument], Result],
    arguments: Sequence[Argument],
    address: str | None,
    workers: int,
    note: Note,
    memory_limit: str = MEMORY_LIMIT,
) -> Generator[Result, None, None]:
    """Yield ``function`` of each of ``arguments``, as they end, from ``workers`` local processes, each of at most
    ``memory_limit``, or from the scheduler at ``address``.

    The work of a worker that dies goes to others (Dask's ``allowed-failures``, 3 deaths for one argument).

    Raises
    ------
    InputError
        ``address`` is not the address of a scheduler.
    StrainfmuError
        Dask is not installed, the scheduler cannot be reached or is lost, it has no worker, or an argument ended
        its worker too often.
    """
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise StrainfmuError("work on workers needs dask: pip install 'strainfmu[campaign]'") from error
    module = getattr(function, "func", function).__module__
    with ExitStack() as stack:
        stack.enter_context(_silence())
        if address is None:
            client = stack.enter_context(_local_client(workers, memory_limit, module))
            note(f"{workers} local processes")
        else:
            client = stack.enter_context(_remote_client(address))
            note(f"scheduler {address}, {len(client.nthreads())} workers")
        finished: SimpleQueue[Any] = SimpleQueue()
        futures = [client.submit(function, argument, pure=False) for argument in arguments]
        stack.callback(_abandon, client, futures)
        for future in futures:
            future.add_done_callback(finished.put)
        where = address or "local workers"
        for _ in arguments:
            future = _next(finished, client, where, note)
            yield _result(future, where)
            future.release()


def _result(future: Any, where: str) -> Any:
    """Return what a worker returned, or raise an error in the user's terms."""
    from distributed import KilledWorker

    try:
        result = future.result()
    except CancelledError as error:
        raise StrainfmuError(f"{where}: the scheduler was lost; start again to go on") from error
    except KilledWorker as error:
        raise StrainfmuError(
            f"{where}: {error.allowed_failures + 1} workers died over one task; out of memory?"
        ) from error
    except (ModuleNotFoundError, RuntimeError) as error:
        # Dask wraps what a scheduler cannot import.
        cause = error if isinstance(error, ModuleNotFoundError) else error.__cause__
        if not isinstance(cause, ModuleNotFoundError):
            raise
        raise StrainfmuError(
            f"{where}: '{cause.name}' is not installed there, strainfmu[campaign] must be"
        ) from error
    return result


@contextmanager
def _local_client(workers: int, memory_limit: str, module: str) -> Iterator[Client]:
    """Start worker processes that listen on loopback only, one thread each, without dashboard; they begin with the
    import of the ``module`` of their work."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # any free port: the usual one may be another cluster's
            memory_limit=memory_limit,
            silence_logs=logging.CRITICAL,
            preload=[module],
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


@contextmanager
def _remote_client(address: str) -> Iterator[Client]:
    from distributed import Client
    from distributed.comm import parse_address, parse_host_port

    try:
        # Before the client, which on a busy machine may run out of time before it looks at the port.
        _, location = parse_address(address, strict=True)
        parse_host_port(location)
        client = Client(address, timeout=CONNECT_TIMEOUT)
    except ValueError as error:
        raise InputError(f"--scheduler: '{address}' found, must be like tcp://host:8786") from error
    except OSError as error:
        raise StrainfmuError(f"{address}: no Dask scheduler answers there") from error
    with client:
        yield client


def _next(finished: SimpleQueue[Any], client: Client, where: str, note: Note) -> Any:
    """Return the next finished future, while the scheduler is there and has workers."""
    without_worker = 0.0
    while True:
        try:
            return finished.get(timeout=LOOK_INTERVAL)
        except Empty:
            if client.status not in ("running", "connecting"):
                raise StrainfmuError(f"{where}: the scheduler was lost; start again to go on") from None
            if client.status == "running" and client.nthreads():
                without_worker = 0.0
                continue
            if not without_worker:
                note(f"{where}: no worker at present, waiting for one")
            without_worker += LOOK_INTERVAL
            if without_worker > WORKER_TIMEOUT:
                raise StrainfmuError(f"{where}: no worker for {WORKER_TIMEOUT:.0f} s") from None


def _abandon(client: Client, futures: list[Any]) -> None:
    """Take back what has not been solved, as far as the scheduler still listens."""
    with suppress(Exception):
        client.cancel(futures, force=True)


@contextmanager
def _silence() -> Iterator[None]:
    """Keep Dask's loggers quiet meanwhile: what matters is raised as an error."""
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in ("distributed", "tornado")]
    levels = {name: logging.getLogger(name).level for name in names}
    try:
        for name in names:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)
