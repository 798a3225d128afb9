"""What an iteration leaves behind: its residuals, and how many statuses each step has changed."""

from __future__ import annotations

import numpy as np

from gibiane_ops.kernels.arrays import IntArray


class History(list[float]):
    """Residual after each iteration, relative.

    Attributes
    ----------
    changes : list of int
        Pairs whose status is not that of the iteration before, for each; all pairs that are not stuck for the first.
    """

    def __init__(self) -> None:
        super().__init__()
        self.changes: list[int] = []
        self._before: IntArray | None = None

    def add(self, residual: float, status: IntArray) -> None:
        """Add an iteration.

        Parameters
        ----------
        residual : float
        status : (n,) int64
            0 open, 1 stick, 2 slip.
        """
        before = np.ones_like(status) if self._before is None else self._before
        self.append(float(residual))
        self.changes.append(int(np.count_nonzero(status != before)))
        self._before = status.copy()
