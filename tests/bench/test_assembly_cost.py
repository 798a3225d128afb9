"""Time and memory of the stiffness of 33 280 CUB8."""

import resource
import sys
import time

import numpy as np
import pytest

from gibiane_ops.kernels import assembly
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.materials import isotropic


@pytest.mark.bench
def test_stiffness_of_33280_cubes() -> None:
    counts = (32, 32, 33)
    size = [n + 1 for n in counts]
    points = np.stack(np.meshgrid(*[np.arange(n, dtype=float) for n in size], indexing="ij"), -1).reshape(-1, 3)
    points += 0.1 * np.random.default_rng(0).uniform(-1, 1, points.shape)
    number = np.arange(len(points)).reshape(size)
    corners = shape("CUB8").ref_nodes > 0
    cells = np.stack(
        [number[tuple(slice(int(c), int(c) + n) for c, n in zip(corner, counts, strict=True))] for corner in corners],
        -1,
    ).reshape(-1, 8)
    D = isotropic(210000.0, 0.3)
    unit = 1024 if sys.platform == "linux" else 1
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    start = time.perf_counter()
    K = assembly.assemble(len(points), 3, [(cells, assembly.element_stiffness(shape("CUB8"), points[cells], D))])
    elapsed = time.perf_counter() - start
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit - before
    print(f"{len(cells)} CUB8: {elapsed:.2f} s, {grown / 1e6:.0f} Mbyte, {K.nnz} entries")
    assert elapsed < 2.5
    assert grown < 600e6
