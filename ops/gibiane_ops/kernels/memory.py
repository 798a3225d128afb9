"""How much memory a process may still take."""

from __future__ import annotations

from pathlib import Path

GROUP = Path("/sys/fs/cgroup")


def available_memory() -> float:
    """Return the memory that this process may still take, bytes; infinity where the system does not say.

    Notes
    -----
    The least of what the machine has free, of what a container leaves, and of the limit of the process.
    """
    return min(_free(), _group(GROUP), _limit())


def _free() -> float:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return next(int(line.split()[1]) * 1024.0 for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        return float("inf")


def _group(folder: Path) -> float:
    """Read the limit of a control group (second version), less what it uses."""
    try:
        most = (folder / "memory.max").read_text(encoding="ascii").strip()
        if most == "max":
            return float("inf")
        used = float((folder / "memory.current").read_text(encoding="ascii"))
        stat = dict(line.split() for line in (folder / "memory.stat").read_text(encoding="ascii").splitlines())
        # files that are only cached are given up when memory is asked for
        return max(float(most) - used + float(stat.get("inactive_file", 0)), 0.0)
    except (OSError, ValueError):
        return float("inf")


def _limit() -> float:
    try:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    except (ImportError, OSError):
        return float("inf")
    return float(limit) if limit > 0 else float("inf")
