"""Benchmarks: ours and the peers run in turn, in one process; the table and a JSON file hold times and ratios.

No time is asserted: machines differ, and a busy one is slower. GIBIANE_BENCH_N chooses the sizes of the two-block scene
(2 3 by default; 2 3 4 goes up to 110 000 unknowns and needs a few minutes and 3 Gbyte).
"""

from __future__ import annotations

import gc
import json
import os
import platform
import statistics
import time
import tracemalloc
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gibiane_ops.kernels.elements.table import shape

ROOT = Path(__file__).parents[2]
PACKAGES = ("numpy", "scipy", "rslab", "pyamg", "pypardiso", "scikit-sparse", "scikit-fem", "kvxopt", "lark")
HEAD = ("what", "size", "ours s", "peer", "peer s", "ratio", "aim")


class Bench:
    """Times of a run, row by row."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []
        self.notes: list[str] = []

    def compare(
        self,
        what: str,
        size: str,
        ours: Callable[[], object],
        peers: Mapping[str, Callable[[], object]],
        *,
        aim: float | None = None,
        rounds: int = 3,
        best_of: bool = False,
        scale: float = 1.0,
    ) -> None:
        """Run ours and the peers in turn and keep the median time of each; every time is stored.

        `aim` is the ratio wanted; with `best_of` it is that to the fastest peer; `scale` is how many units of work
        ours does for one of the peers.
        """
        runs = {"": ours, **peers}
        found: dict[str, list[float]] = {name: [] for name in runs}
        for _ in range(rounds):
            for name, run in runs.items():
                gc.collect()
                start = time.perf_counter()
                run()
                found[name].append(time.perf_counter() - start)
        times = {name: statistics.median(each) for name, each in found.items()}
        own = times.pop("") / scale
        fastest = min(times, key=lambda name: times[name], default="")
        for name, seconds in times.items() or [("", None)]:
            row = {"what": what, "size": size, "ours": own, "peer": name, "peer_time": seconds}
            row["ratio"] = None if seconds is None else own / seconds
            row["aim"] = aim if not best_of or name == fastest else None
            row["times"] = {"ours": found[""], "peer": found.get(name, [])}
            self.rows.append(row)

    def skipped(self, peer: str, package: str) -> None:
        """Say that a peer is not installed."""
        note = f"{peer} left out: {package} is not installed"
        if note not in self.notes:
            self.notes.append(note)

    def memory(self, what: str, size: str, run: Callable[[], object], aim: float) -> None:
        """Note the peak of memory that a run takes, in Mbyte, beyond what there was."""
        gc.collect()
        tracemalloc.start()
        run()
        peak = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        self.notes.append(f"{what}, {size}: peak of {peak:.0f} Mbyte (aim: below {aim:.0f})")

    def table(self) -> str:
        """Return the rows as text."""
        lines = [HEAD]
        for row in self.rows:
            ratio = "" if row["ratio"] is None else f"{row['ratio']:.2f}"
            peer = "" if row["peer_time"] is None else f"{row['peer_time']:.4g}"
            aim = "" if row["aim"] is None else f"<= {row['aim']:g}"
            if aim and row["ratio"] > row["aim"]:
                aim += "  missed"
            lines.append((row["what"], row["size"], f"{row['ours']:.4g}", row["peer"], peer, ratio, aim))
        widths = [max(len(line[i]) for line in lines) for i in range(len(HEAD))]
        return "\n".join(
            "  ".join(text.ljust(w) for text, w in zip(line, widths, strict=True)).rstrip() for line in lines
        )


@pytest.fixture(scope="session")
def bench(request: pytest.FixtureRequest) -> Any:
    """Collect the rows of the session, then print and store them."""
    found = Bench()
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    yield found
    if not found.rows and not found.notes:
        return
    capture = request.config.pluginmanager.getplugin("capturemanager")
    with capture.global_and_fixture_disabled():
        print("\n\n" + found.table())
        print("\n".join(found.notes))
    folder = ROOT / "bench-results"
    folder.mkdir(exist_ok=True)
    machine = f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
    content = {
        "date": time.strftime("%Y-%m-%dT%H:%M:%S"),
        "machine": machine,
        "load_before": load,
        "threads": os.environ.get("OMP_NUM_THREADS", ""),
        "packages": {name: _version(name) for name in PACKAGES},
        "rows": found.rows,
        "notes": found.notes,
    }
    path = folder / f"{time.strftime('%Y%m%d-%H%M%S')}.json"
    path.write_text(json.dumps(content, indent=1), encoding="utf-8")


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


@pytest.fixture(scope="session")
def sizes() -> list[int]:
    """Return the sizes of the two-block scene."""
    return [int(n) for n in os.environ.get("GIBIANE_BENCH_N", "2 3").split()]


def grid(*counts: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes and elements of a box (a rectangle) of CUB8 (QUA4) of unit size, a little distorted."""
    size = [n + 1 for n in counts]
    points = np.stack(np.meshgrid(*[np.arange(n, dtype=float) for n in size], indexing="ij"), -1).reshape(-1, len(size))
    points = points + 0.1 * np.random.default_rng(0).uniform(-1, 1, points.shape)
    number = np.arange(len(points)).reshape(size)
    corners = shape("CUB8" if len(counts) == 3 else "QUA4").ref_nodes > 0
    cells = [
        number[tuple(slice(int(c), int(c) + n) for c, n in zip(corner, counts, strict=True))] for corner in corners
    ]
    return points, np.stack(cells, -1).reshape(-1, len(corners))


@pytest.fixture(scope="session")
def make_grid() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Return `grid`."""
    return grid
