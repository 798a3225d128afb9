"""BLAS on one thread where matrices are small and many."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from gibiane_ops.kernels.estimate import stars
from gibiane_ops.kernels.estimate.simplices import simplices
from gibiane_ops.kernels.estimate.stars import Improver
from gibiane_ops.kernels.threads import one_thread


def blas_threads():
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


@pytest.fixture
def two_threads():
    with one_thread(), threadpool_limits(2, user_api="blas"):
        if max(blas_threads()) < 2:
            pytest.skip("a BLAS without threads")
        yield


def test_threads_are_as_before_afterwards(two_threads):
    before = blas_threads()
    with one_thread():
        assert set(blas_threads()) == {1}
    assert blas_threads() == before
    with pytest.raises(ZeroDivisionError), one_thread():
        1 / 0  # noqa: B018
    assert blas_threads() == before


def test_stars_are_solved_on_one_thread(two_threads, monkeypatch):
    seen, factored = [], stars._factored
    monkeypatch.setattr(stars, "_factored", lambda A: (seen.append(blas_threads()), factored(A))[1])
    mesh = simplices(np.vstack([np.zeros(3), np.eye(3), np.ones(3)]), np.array([[0, 1, 2, 3], [1, 2, 3, 4]]))
    tau = np.zeros((len(mesh.nodes), 3, 3))
    stress = np.ones((2, 6))
    free = np.broadcast_to(np.eye(3), (len(mesh.nodes), 3, 3)).copy()
    Improver(mesh, stress, np.broadcast_to(np.eye(6), (2, 6, 6)), free).sweep(tau)
    assert seen
    assert all(set(each) == {1} for each in seen)
    assert max(blas_threads()) == 2
