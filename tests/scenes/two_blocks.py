"""Scene of two elastic blocks in contact, for the tests: its condensed interface and the values that oracles hold."""

from functools import lru_cache

import numpy as np
import scipy.sparse as sp

from gibiane_ops.kernels.assembly import assemble, assemble_vector
from gibiane_ops.kernels.constraints import reduce_conditions
from gibiane_ops.kernels.contact.condense import condense
from gibiane_ops.kernels.contact.node_pairs import node_pairs
from gibiane_ops.kernels.contact.report import OPEN, SLIP
from gibiane_ops.kernels.elasticity import element_stiffness
from gibiane_ops.kernels.elements.table import shape
from gibiane_ops.kernels.integrals import pressure_load
from gibiane_ops.kernels.materials import isotropic
from gibiane_ops.kernels.topology import boundary

SIDES = {"T1": 50.0, "T2": 100.0, "T3": 150.0, "T4": 200.0}


def brick(low, high, n, start):
    """Nodes and CUB8 of a box with n elements along each side."""
    axes = [np.linspace(low[i], high[i], n + 1) for i in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = start + np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
    corner = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = np.stack([number[i : n + i, j : n + j, k : n + k].ravel() for i, j, k in corner], axis=1)
    return points, cells


class Blocks:
    """Upper cube on a lower cube of side 200, base clamped, pressure on the top; ``unit`` scales lengths."""

    def __init__(self, name, unit=1.0, stiffness=210000.0, pressure=3.125, rollers=False):
        self.name = name
        family, level = name.rstrip("h").split("_")
        side, n = SIDES[family], int(level)
        low, cells_low = brick(np.array([-100, -100, -200.0]), np.array([100, 100, 0.0]), 8 * n if side < 200 else n, 0)
        half = side / 2
        n_high = round(side / 25) * n if side < 200 else n
        high, cells_high = brick(np.array([-half, -half, 0.0]), np.array([half, half, side]), n_high, len(low))
        self.points = unit * np.vstack([low, high])
        self.side = unit * side
        points = self.points
        cub8, D = shape("CUB8"), isotropic(stiffness, 0.3, "TRID")
        blocks = []
        for cells in (cells_low, cells_high):
            one = element_stiffness(cub8, points[cells[:1]], D)
            blocks.append((cells, np.broadcast_to(one, (len(cells), 24, 24))))
        self.K = assemble(len(points), 3, blocks)
        upper, lower = (boundary([("CUB8", cells)])["QUA4"].nodes for cells in (cells_high, cells_low))

        def facets(skin, z):
            return skin[np.abs(points[skin][:, :, 2] - unit * z).max(axis=1) < 1e-6 * unit]

        top = facets(upper, side)
        if name.endswith("h"):
            top = top[points[top].mean(axis=1)[:, 0] > 0]
        self.top = top
        self.F = assemble_vector(len(points), 3, [(top, pressure_load(shape("QUA4"), points[top], pressure))]).ravel()
        self.slave, self.master = facets(upper, 0), facets(lower, 0)
        self.pairs = node_pairs(points, [("QUA4", self.slave)], [("QUA4", self.master)])
        base = np.flatnonzero(np.abs(points[:, 2] + 200 * unit) < 1e-6 * unit)
        dofs = 3 * base + 2 if rollers else (3 * base[:, None] + np.arange(3)).ravel()
        if rollers:
            first = base[np.argmin(points[base, 0] + points[base, 1])]
            second = base[np.argmin(points[base, 1] - points[base, 0])]
            dofs = np.r_[dofs, 3 * first, 3 * first + 1, 3 * second + 1]
        self.reduction = fixing(dofs, 3 * len(points))
        self.tied = condense(self.K, self.pairs, self.reduction, points=self.points)
        self.interface = self.tied.interface(self.F)

    def node(self, x, y, z, among=None):
        among = np.arange(len(self.points)) if among is None else among
        return int(among[np.argmin(np.abs(self.points[among] - [x, y, z]).sum(axis=1))])

    def observed(self, state):
        """Values that the oracle holds."""
        a, H = self.side / 2, self.side
        U = self.interface.expand(state.w).reshape(-1, 3)
        slave = self.pairs.pairs[:, 0]
        top_corner, corner = self.node(a, a, H), self.node(a, a, 0, slave)
        slip = np.linalg.norm(state.w[:, 1:], axis=1)
        friction = np.linalg.norm(state.r[:, 1:], axis=1)
        normal = -state.r[:, 0]
        centre_pair = int(np.flatnonzero(slave == self.node(0, 0, 0, slave))[0])
        corner_pair = int(np.flatnonzero(slave == corner)[0])
        displacement = {
            "uz_top_centre": U[self.node(0, 0, H), 2],
            "uz_top_corner": U[top_corner, 2],
            "uz_cont_centre_up": U[self.node(0, 0, 0, slave), 2],
            "uz_cont_corner_up": U[corner, 2],
            "uz_cont_mid_up": U[self.node(a, 0, 0, slave), 2],
            "ux_top_corner": U[top_corner, 0],
            "ux_cont_corner_up": U[corner, 0],
            "max_slip": slip.max(),
            "max_gap": -state.w[:, 0].min(),
            "slip_corner": slip[corner_pair],
        }
        force = {
            "sum_Fn": normal.sum(),
            "sum_abs_Ft": friction.sum(),
            "sum_Fx": self.interface.to_global(state.r)[:, 0].sum(),
            "fn_centre": normal[centre_pair],
            "fn_corner": normal[corner_pair],
            "ft_corner": friction[corner_pair],
        }
        count = {
            "n_closed": int((state.status != OPEN).sum()),
            "n_slip": int((state.status == SLIP).sum()),
            "n_open": int((state.status == OPEN).sum()),
            "ncontact": len(slave),
            "ndof": len(self.F),
        }
        return displacement, force, count


def fixing(dofs, n):
    dofs = np.unique(dofs)
    return reduce_conditions(sp.csr_array((np.ones(len(dofs)), (np.arange(len(dofs)), dofs)), (len(dofs), n)))


@lru_cache(maxsize=8)
def blocks(name):
    return Blocks(name)


@lru_cache(maxsize=4)
def load_push(name, part, on_top):
    """Vertical load plus a horizontal force, a part of the vertical one."""
    scene = blocks(name)
    F = scene.F.copy()
    N = -F.sum()
    if on_top:
        F[0::3] += part * -F[2::3]
    else:
        slave = scene.pairs.pairs[:, 0]
        F[3 * slave] += part * N / len(slave)
    return scene.tied.interface(F), N
