"""Where jobs are done: here, in processes of this machine (joblib), or on a cluster (Dask).

An engine takes jobs one by one and yields results as they come; neither the jobs nor the results are ever all in
memory. A worker that dies takes nothing along but the job it was at, which is done again.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import chain, islice
from typing import Any

from cartctl.bench.jobs import Job
from cartctl.bench.perform import Result, perform
from cartctl.errors import BenchError, MissingDependencyError

Engine = Callable[[Iterable[Job]], Iterator[Result]]
AHEAD = 3  # jobs in flight for each worker: enough that none waits, few enough to stay small
DEATHS = 3  # of a pool without a result between them: then it is not by chance


def here(jobs: Iterable[Job]) -> Iterator[Result]:
    """One after the other, in this process."""
    for job in jobs:
        yield perform(job)


def _deaf(job: Job) -> Result:
    """A job in a process of its own. A terminal's Ctrl-C reaches all processes; only the one in charge answers it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return perform(job)


def processes(workers: int) -> Engine:
    """In that many processes of this machine, at least two, one BLAS thread each."""

    def engine(jobs: Iterable[Job]) -> Iterator[Result]:
        from joblib import Parallel, delayed
        from joblib.externals.loky.process_executor import BrokenProcessPool

        waiting: dict[str, Job] = {}
        deaths = 0

        def handed_out(source: Iterable[Job]) -> Iterator[Any]:
            for job in source:
                waiting[job.key] = job
                yield delayed(_deaf)(job)

        _hush_loky()
        stream = iter(jobs)
        while True:
            again = list(waiting.values())
            waiting.clear()
            pool = Parallel(
                n_jobs=workers, backend="loky", return_as="generator_unordered", batch_size=1,
                pre_dispatch=AHEAD * workers,
            )  # fmt: skip
            made = pool(handed_out(chain(again, stream)))
            try:
                for result in made:
                    waiting.pop(result.row["key"], None)
                    deaths = 0
                    yield result
                return
            except BrokenProcessPool:
                deaths += 1
                if deaths >= DEATHS:
                    at = ", ".join(f"{j.scenario.name} by {j.method.name}" for j in islice(waiting.values(), 4))
                    raise BenchError(
                        f"worker processes died {deaths} times without a result, at work on {at}; all finished runs "
                        "are kept. Leave the culprit out, or run with --workers 1 to see how it dies"
                    ) from None
            finally:
                made.close()

    return engine


@cache
def _hush_loky() -> None:
    """A pool that is cut short may have its table emptied under its own thread, which then dies with a traceback.

    For good, and beforehand: joblib empties the table before anybody hears of the interrupt.
    """
    usual = threading.excepthook

    def hook(what: threading.ExceptHookArgs) -> None:
        if what.exc_type is KeyError and what.thread is not None and what.thread.name == "ExecutorManagerThread":
            return
        usual(what)

    threading.excepthook = hook


def cluster(address: str) -> Engine:
    """On the Dask scheduler at that address; its workers need cartctl. Raises MissingDependencyError, BenchError."""
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise MissingDependencyError("--dask needs dask.distributed: pip install 'cartctl[dask]'") from None
    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise BenchError(
            f"--dask is {address!r}: no scheduler answers there ({type(error).__name__}); start one by "
            "`dask scheduler`, and workers by `dask worker ADDRESS --nthreads 1`"
        ) from None
    return on_client(client)


def on_client(client: Any) -> Engine:
    """On the workers of a distributed.Client, a few jobs ahead for each; it is closed at the end."""

    def engine(jobs: Iterable[Job]) -> Iterator[Result]:
        from distributed import as_completed

        stream = iter(jobs)

        def submit(job: Job) -> Any:
            return client.submit(perform, job, key=f"{job.key}-{os.urandom(4).hex()}", pure=False, retries=DEATHS)

        try:
            most = AHEAD * max(1, sum(client.nthreads().values()))
            running = as_completed([submit(job) for job in islice(stream, most)], loop=client.loop)
            for future in running:
                try:
                    result = future.result()
                except Exception as error:
                    raise BenchError(
                        f"a job was lost on the cluster ({type(error).__name__}: {error}); all finished runs are "
                        "kept, the same command goes on"
                    ) from None
                for job in islice(stream, 1):
                    running.add(submit(job))
                future.release()
                yield result
        finally:
            client.close()

    return engine
