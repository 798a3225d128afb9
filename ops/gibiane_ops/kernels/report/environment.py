"""What a computation ran on: versions, machine, date."""

from __future__ import annotations

import os
import platform
import sys
from datetime import UTC, datetime
from importlib import metadata

from gibiane_ops.kernels.report.words import said

PACKAGES = ("gibiane", "numpy", "scipy", "gmsh", "meshio", "rslab", "pyamg", "pypardiso", "matplotlib", "pyvista")


def environment_rows(language: str = "en") -> list[tuple[str, str]]:
    """List what a reader needs to judge measured times, and to do the run again.

    Parameters
    ----------
    language : {'en', 'fr'}

    Returns
    -------
    list of (str, str)
        Name and value: date, machine, cores and memory, threads, versions of Python and of the packages that are here.
    """
    rows = [
        (said("Date (UTC)", language), datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S")),
        (said("System", language), platform.platform()),
        (said("Processor", language), _processor()),
        (said("Cores", language), str(os.cpu_count() or said("unknown", language))),
    ]
    memory = _memory()
    if memory:
        rows.append((said("Memory", language), f"{memory / 2**30:.1f} GiB"))
    rows += [(name, os.environ[name]) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS") if name in os.environ]
    rows.append(("Python", sys.version.split()[0]))
    for name in PACKAGES:
        try:
            rows.append((name, metadata.version(name)))
        except metadata.PackageNotFoundError:
            rows.append((name, said("not installed", language)))
    return rows


def _processor() -> str:
    """Return the name of the processor; Linux tells it in a file only."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            for line in lines:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        return platform.processor() or platform.machine()
    return platform.machine()


def _memory() -> int:
    """Return the memory of the machine in bytes, 0 where it is not known."""
    if not hasattr(os, "sysconf") or "SC_PHYS_PAGES" not in os.sysconf_names:
        return 0
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
