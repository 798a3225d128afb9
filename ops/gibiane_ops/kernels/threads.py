"""Threads of BLAS and LAPACK."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any


@contextmanager
def one_thread() -> Iterator[None]:
    """Let BLAS and LAPACK run on one thread inside, on as many as before afterwards.

    For many factorisations of small dense matrices, a few hundred unknowns each: OpenBLAS gives each of them to all
    cores, whose threads wait for one another far longer than they compute, above all on a busy machine.

    Cost
    ----
    A tenth of a millisecond; some milliseconds the first time.
    """
    with _pools().limit(limits=1, user_api="blas"):
        yield


@lru_cache(maxsize=1)
def _pools() -> Any:
    # NumPy and SciPy each bring an OpenBLAS: both must be there to be found.
    import scipy.linalg.lapack  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
