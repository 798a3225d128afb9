"""Who runs the cases of a study: worker processes of this machine, or a Dask cluster.

Both give answers as they come. A worker that dies loses the case it had; that case is run again, by another one.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from importlib import import_module
from typing import Any

from gibiane_ops.assistants.study import Answer, run_case

# A worker takes its share of the cores: the libraries that it calls read these when they are loaded.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")
DEATHS = 3  # losses of a worker, without a case finished in between, after which the study is given up

Answers = Iterator[tuple[int, Answer]]


class WorkersLost(Exception):
    """Workers die again and again: `cases` are those that no worker has finished."""

    def __init__(self, cases: Sequence[int], reason: str) -> None:
        super().__init__(reason)
        self.cases = list(cases)
        self.reason = reason


def local(study: bytes, numbers: Sequence[int], workers: int, make_session: Callable[..., Any]) -> Answers:
    """Run cases on worker processes of this machine; yield (case, answer) as they come.

    Raises
    ------
    WorkersLost
        When processes die three times without finishing a case in between (memory, most often).
    """
    from concurrent.futures import FIRST_COMPLETED, wait
    from concurrent.futures.process import BrokenProcessPool

    waiting = list(numbers)
    deaths = 0
    while waiting:
        pool = None
        finished = False
        try:
            pool = _pool(min(workers, len(waiting)))  # a worker can die while it starts, too
            futures = {pool.submit(run_case, study, number, make_session): number for number in waiting}
            while futures:
                done, _ = wait(futures, return_when=FIRST_COMPLETED)
                for future in done:
                    answer = future.result()
                    number = futures.pop(future)
                    waiting.remove(number)
                    deaths = 0
                    yield number, answer
            finished = True
        except BrokenProcessPool as failure:
            deaths += 1
            if deaths >= DEATHS:
                raise WorkersLost(waiting, str(failure)) from failure
        finally:
            if pool is not None:
                if not finished:
                    _end(pool)
                pool.shutdown(wait=finished, cancel_futures=True)


def _pool(workers: int) -> Any:
    """Start worker processes, each with its share of the cores."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    share = str(max(1, (os.cpu_count() or 1) // workers))
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update({name: share for name in THREADS if before[name] is None})
    try:
        pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_end_with_parent)
        pool.submit(int).result()  # the processes exist now, with this environment
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
    return pool


def _end_with_parent() -> None:
    """End this worker when the process that asks is killed: nobody is left to take what it computes."""
    from multiprocessing import parent_process
    from threading import Thread

    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=watch, daemon=True).start()


def _end(pool: Any) -> None:
    """Stop the processes of a pool at once: what they are computing is not wanted any more."""
    for process in list((pool._processes or {}).values()):
        process.terminate()


def dask(study: bytes, numbers: Sequence[int], address: str, make_session: Callable[..., Any]) -> Answers:
    """Run cases on the Dask cluster at an address; yield (case, answer) as they come.

    Raises
    ------
    ImportError
        Without the package distributed.
    OSError
        When nobody answers at the address.
    WorkersLost
        When the scheduler gives a case up, since workers die of it.
    """
    distributed: Any = import_module("distributed")  # without types, and only on request

    with distributed.Client(address, timeout="5s") as client:
        waiting = list(numbers)
        losses = 0
        while waiting:
            # The study lies in the memory of one worker: when that one dies, it is sent again with what is missing.
            shared = client.scatter(study, hash=False)
            keys = {number: f"case-{number}-{shared.key}" for number in waiting}
            futures = {
                client.submit(run_case, shared, number, make_session, pure=False, key=keys[number]): number
                for number in waiting
            }
            try:
                for future in distributed.as_completed(futures):
                    number = futures[future]
                    answer = future.result()
                    waiting.remove(number)
                    losses = 0
                    yield number, answer
            except distributed.KilledWorker as failure:
                raise WorkersLost(waiting, str(failure)) from failure
            except CancelledError as failure:
                losses += 1
                if losses >= DEATHS:
                    raise WorkersLost(waiting, str(failure)) from failure
            finally:
                client.cancel([*futures, shared])
