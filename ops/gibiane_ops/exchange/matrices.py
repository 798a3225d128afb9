"""SORTIR 'MAT': a matrix for another program (Matrix Market)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from gibiane.builtins.text import output_path
from gibiane.forms import Arg, Key
from gibiane.registry import Context, extend
from gibiane.values import RIGIDITE
from gibiane_ops.values.rigidite import Rigidite
from gibiane_ops.values.system import build


@extend("SORTIR").form(
    Key("MAT", "a matrix", required=True),
    Key("MM", "format of Matrix Market, the only one", name="market"),
    Key("ASSE", "assembled, the only way", name="whole"),
    Arg("k", RIGIDITE, "matrix and conditions"),
)
def _matrix(ctx: Context, mat: bool, market: bool, whole: bool, k: Rigidite) -> None:
    """Write the matrix of a RIGIDITE; conditions stand below and beside it, with a block of zeros."""
    from scipy.io import mmwrite

    system = build(ctx, k, bilateral=True)
    matrix = system.K
    if system.C.shape[0]:
        matrix = sp.block_array([[system.K, system.reactions.T], [system.C, None]], format="csr")
    path = output_path(ctx, ".mtx")
    order = " ".join(system.names)
    comment = (
        f" rows: {order} of node 1, {order} of node 2, ...; {len(system.nodes)} nodes, {system.C.shape[0]} conditions"
    )
    symmetry = "symmetric" if system.symmetric else "general"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # round-off of the assembly would make the two halves differ in the last digit
        kept = sp.coo_array((matrix + matrix.T) / 2 if system.symmetric else matrix)
        mmwrite(path, kept, comment=comment, symmetry=symmetry, precision=17)
    except OSError as failure:
        ctx.cannot_write(path, failure)
    if ctx.option("ECHO") >= 1:
        ctx.write(f" SORTIR : {path.as_posix()}, {np.shape(matrix)[0]} lignes")
