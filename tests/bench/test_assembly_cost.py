"""General assembly of the stiffness (no use of elements being equal), and its memory."""

from importlib.util import find_spec

import numpy as np
import pytest

from gibiane_ops.kernels import assembly, elasticity
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.materials import isotropic

E, NU = 210000.0, 0.3


def scikit_fem(points, cells):
    """Return a function that assembles the same matrix with scikit-fem."""
    from skfem import Basis, ElementHex1, ElementVector, MeshHex
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    # scikit-fem numbers the corners of a hexahedron in another order
    order = [0, 4, 3, 1, 7, 5, 2, 6]
    mesh = MeshHex(np.ascontiguousarray(points.T), np.ascontiguousarray(cells[:, order].T))
    form = linear_elasticity(*lame_parameters(E, NU))
    return lambda: form.assemble(Basis(mesh, ElementVector(ElementHex1()), intorder=3))


@pytest.mark.bench
def test_stiffness_of_cubes(bench, sizes, make_grid):
    for n in (n for n in sizes if n < 9):
        points, cells = make_grid(8 * n, 8 * n, 8 * n)
        D = isotropic(E, NU)

        def ours(points=points, cells=cells, D=D):
            stiffness = elasticity.element_stiffness(shape("CUB8"), points[cells], D)
            return assembly.assemble(len(points), 3, [(cells, stiffness)])

        size = f"{len(cells)} CUB8"
        A = np.random.default_rng(0).standard_normal((2000, 2000))
        peers = {"NumPy A @ B, 2000": lambda A=A: A @ A}
        bench.compare("assembly", size, ours, peers, aim=15)
        if find_spec("skfem"):
            bench.compare("assembly", size, ours, {"scikit-fem": scikit_fem(points, cells)}, aim=0.1, rounds=1)
        else:
            bench.skipped("scikit-fem", "scikit-fem")
        bench.memory("assembly", size, ours, 1500)
        assert ours().shape == (3 * len(points),) * 2
