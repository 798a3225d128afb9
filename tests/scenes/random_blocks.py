"""Stacks of plane blocks drawn at random, with contact between them, on nested meshes of triangles."""

import io
from dataclasses import dataclass

import numpy as np

from gibiane import Session
from gibiane_ops.values.champs import ChPoint
from gibiane_ops.values.maillage import Maillage
from gibiane_ops.values.nodes import node_store

NAMES = ["UX", "UY"]


@dataclass(frozen=True)
class Answer:
    """`potential`: of the displacement, which the exact one makes least. `energy`: the integral of stress by strain."""

    potential: float
    energy: float
    table: dict


def triangles(xs, ys, random):
    """Nodes and triangles of a box, inner nodes moved, diagonals drawn."""
    points = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1)
    step = min(np.diff(xs).min(), np.diff(ys).min())
    points[1:-1, 1:-1] += random.uniform(-0.25, 0.25, points[1:-1, 1:-1].shape) * step
    n = np.arange(len(xs) * len(ys)).reshape(len(xs), len(ys))
    a, b, c, d = (part.ravel() for part in (n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]))
    first = random.random(len(a)) < 0.5
    cells = [np.where(first, each, other) for each, other in ((a, a), (b, b), (c, d), (a, b), (c, c), (d, d))]
    return points.reshape(-1, 2), np.concatenate([np.stack(cells[:3], axis=1), np.stack(cells[3:], axis=1)])


def edges(cells):
    """The three edges of each triangle, and which one of the distinct edges each is."""
    every = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
    distinct, inverse = np.unique(np.sort(every, axis=1), axis=0, return_inverse=True)
    return every, distinct, inverse.ravel()


def halved(points, cells):
    """Each triangle in four."""
    _, distinct, inverse = edges(cells)
    a, b, c = cells.T
    ab, bc, ca = len(points) + inverse.reshape(3, -1)
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.vstack([points, points[distinct].mean(axis=1)]), np.concatenate([np.stack(p, axis=1) for p in parts])


class Blocks:
    """What is drawn; `law` is UNILATERAL or TRESCA, on an obstacle or between blocks."""

    def __init__(self, seed):
        draw = np.random.default_rng(seed)
        self.law = draw.choice(["TRESCA", "TRESCA", "UNILATERAL"])
        self.obstacle = draw.random() < 0.25
        self.mode = draw.choice(["PLAN DEFO", "PLAN CONT"])
        self.left = draw.random() < 0.6
        n = int(draw.integers(2, 6))
        xs = np.sort(np.r_[0, 1, (np.arange(1, n) + draw.uniform(-0.3, 0.3, n - 1)) / n])
        self.blocks, y, low, high = [], 0.0, 0, n
        for rank in range(1 if self.obstacle else int(draw.integers(2, 4))):
            if rank and draw.random() < 0.6:
                low, high = low, int(draw.integers(low + 1, high + 1))
            height = draw.uniform(0.3, 1.2)
            ys = np.linspace(y, y + height, int(draw.integers(2, 6)))
            mesh = triangles(xs[low : high + 1], ys, draw)
            self.blocks.append(
                (mesh, (xs[low], xs[high], y, y + height), 10 ** draw.uniform(0, 2), draw.uniform(0, 0.45))
            )
            y += height
        self.pressure = 10 ** draw.uniform(-3, -1.5) * np.array([1, draw.uniform(0, 1) * (draw.random() < 0.5)])
        size = self.pressure[0]
        self.bound = size * 10 ** draw.uniform(-2, 0.5) * np.array([1, draw.uniform(-1, 1) * (draw.random() < 0.4)])
        self.shear = size * draw.uniform(-0.5, 0.5) * (draw.random() < 0.5)
        self.weight = size * draw.uniform(-1, 1, 2) * (draw.random() < 0.4)
        self.base = size * draw.uniform(-1, 1, 3) * (not self.obstacle and draw.random() < 0.3)
        self.gap = size * draw.uniform(0, 0.05) * (draw.random() < 0.25)

    def solve(self, halvings):
        """Solve and estimate on the mesh halved some times."""
        self.out = io.StringIO()
        session = Session(out=self.out, err=self.out)
        assert session.run_text(f"OPTI DIME 2 ELEM TRI3 MODE {self.mode} ;") == 0
        store, names = node_store(session), session.globals.names
        solids, script = [], []
        for rank, (mesh, box, young, nu) in enumerate(self.blocks):
            for _ in range(halvings):
                mesh = halved(*mesh)
            cells = store.add(mesh[0])[mesh[1]]
            every, _, inverse = edges(cells)
            solids.append((cells, every[np.bincount(inverse)[inverse] == 1], box))
            names[f"V{rank}"] = Maillage.of(store, "TRI3", cells)
            script.append(f"M{rank} = MODE V{rank} 'MECANIQUE' 'ELASTIQUE' ;")
            script.append(f"A{rank} = MATE M{rank} 'YOUN' {young!r} 'NU' {nu!r} ;")
        X = store.coords[:, :2].copy()

        def side(rank, axis, value, within=(-np.inf, np.inf)):
            found = solids[rank][1]
            on = (np.abs(X[found][:, :, axis] - value) < 1e-9) & (X[found][:, :, 0] > within[0] - 1e-9)
            return found[(on & (X[found][:, :, 0] < within[1] + 1e-9)).all(axis=1)]

        def field(values, nodes, components=("SCAL",)):
            return ChPoint.from_table(store, list(components), nodes, np.asarray(values).reshape(len(nodes), -1))

        def line(coefficients, nodes):
            return coefficients[0] * (1 + coefficients[1] * (X[nodes, 0] - 0.5))

        held = []
        for rank, (_, _, box) in enumerate(solids):
            if self.left or rank or self.obstacle:
                names[f"L{rank}"] = Maillage.of(store, "SEG2", side(rank, 0, box[0 if self.left else rank % 2]))
                held.append(f"(BLOQ 'UX' L{rank})")
        imposed = ""
        if not self.obstacle:
            names["BASE"] = Maillage.of(store, "SEG2", side(0, 1, 0.0))
            nodes = np.unique(side(0, 1, 0.0))
            x = X[nodes, 0]
            names["UB"] = field(np.stack([self.base[0] * x, self.base[1] + self.base[2] * x], axis=1), nodes, NAMES)
            script.append("CLB = BLOQ 'DEPL' BASE ;")
            held.append("CLB")
            imposed = "ET (DEPI CLB UB)"
        top = side(len(solids) - 1, 1, solids[-1][2][3])
        names["TOP"] = Maillage.of(store, "SEG2", top)
        nodes = np.unique(top)
        names["P"] = field(line(self.pressure, nodes), nodes)
        forces = np.zeros(X.shape)
        length = np.linalg.norm(X[top[:, 1]] - X[top[:, 0]], axis=1)
        traction = np.stack([np.full(top.shape, self.shear), -line(self.pressure, top)], axis=2)
        np.add.at(forces, top, np.einsum("e,ab,ebi->eai", length / 6, np.array([[2, 1], [1, 2]]), traction))
        for cells, _, _ in solids:
            np.add.at(
                forces, cells, (np.linalg.det(X[cells][:, 1:] - X[cells][:, :1]) / 6)[:, None, None] * self.weight
            )
        names["F"] = ChPoint.from_table(store, ["FX", "FY"], np.arange(len(X)), forces, "DISCRET")
        joints = [(-1, 0)] if self.obstacle else [(rank - 1, rank) for rank in range(1, len(solids))]
        faces = []
        for rank, (below, above) in enumerate(joints):
            box = solids[above][2]
            slave = side(above, 1, box[2])
            master = side(below, 1, box[2], box[:2]) if below >= 0 else store.add([[2, box[2]], [-1, box[2]]])[None]
            faces.append((slave, master, below < 0))
            nodes = np.unique(slave)
            names[f"S{rank}"], names[f"MS{rank}"] = (Maillage.of(store, "SEG2", each) for each in (slave, master))
            names[f"G{rank}"] = field(line(self.bound, nodes), nodes)
            law = "'FROTTANT' 'TRESCA'" if self.law == "TRESCA" else "'UNILATERAL'"
            rigid = "'RIGIDE'" if below < 0 else ""
            script.append(f"C{rank} = MODE MS{rank} S{rank} 'CONTACT' {law} {rigid} ;")
            bound = f"'SEUI' G{rank}" if self.law == "TRESCA" else ""
            script.append(f"D{rank} = MATE C{rank} {bound} 'JEU' {float(self.gap)!r} ;")

        def joined(letter, count):
            return " ET ".join(f"{letter}{rank}" for rank in range(count))

        script += [
            f"MO = {joined('M', len(solids))} ; MA = {joined('A', len(solids))} ; CL = {' ET '.join(held)} ;",
            f"MC = {joined('C', len(joints))} ; MATC = {joined('D', len(joints))} ; RC J = RIGI MC MATC ;",
            f"U = RESO ((RIGI MO MA) ET CL ET RC) (F ET J {imposed}) ; SIG = SIGM MO MA U ;",
            f"SX = {float(self.shear)!r} 0. ; FV = {float(self.weight[0])!r} {float(self.weight[1])!r} ;",
            "E = ERREUR 'CONTACT' 'RDC' 'TABL' MO SIG MA MC MATC U (REAC RC U) CL 'PRES' P TOP 'FSUR' SX TOP",
            "  'VOLU' FV ;",
        ]
        if session.run_text("\n".join(script)):
            return None
        found = session.names()
        U = found["U"].table(NAMES, np.arange(len(X)))
        energy = sum(self._energy(X[cells], U[cells], rank) for rank, (cells, _, _) in enumerate(solids))
        friction = sum(self._friction(X, U, *face) for face in faces) if self.law == "TRESCA" else 0.0
        keys = ("GARANTI", "ABSOLUE", "INFERIEURE", "SUPERIEURE")
        table = {key: found["E"].get(key) for key in keys if found["E"].has(key)}
        return Answer(energy / 2 - float((forces * U).sum()) + friction, energy, table)

    def _energy(self, X, u, rank):
        young, nu = self.blocks[rank][2:]
        edge = X[:, 1:] - X[:, :1]
        gradient = np.linalg.solve(edge, u[:, 1:] - u[:, :1])
        e = np.stack([gradient[:, 0, 0], gradient[:, 1, 1], gradient[:, 0, 1] + gradient[:, 1, 0]], axis=1)
        if self.mode == "PLAN DEFO":
            young, nu = young / (1 - nu**2), nu / (1 - nu)
        D = young / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
        return float(np.einsum("m,mi,ij,mj->", np.linalg.det(edge) / 2, e, D, e))

    def _friction(self, X, U, slave, master, rigid):
        """The integral of the bound times the length of the slip, which is linear along each facet."""
        at, weight = np.polynomial.legendre.leggauss(24)
        at, nodes = (at + 1) / 2, np.unique(master)
        other = nodes[np.abs(X[nodes, 0][None, None] - X[slave, 0][:, :, None]).argmin(axis=2)] if not rigid else None
        slip = U[slave, 0] - (U[other, 0] if not rigid else 0.0)
        x = X[slave, 0]
        place, slide = (v[:, :1] + (v[:, 1:] - v[:, :1]) * at for v in (x, slip))
        bound = self.bound[0] * (1 + self.bound[1] * (place - 0.5))
        return float((np.abs(x[:, 1] - x[:, 0])[:, None] * bound * np.abs(slide) @ (weight / 2)).sum())
