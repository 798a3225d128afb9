"""Kernel errors to diagnostics: one table, so that every operator words a failure the same way."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from gibiane.registry import Context
from gibiane_ops.kernels import errors as k


@contextmanager
def worded(ctx: Context, *, at: str | None = None) -> Iterator[None]:
    """Turn kernel errors raised inside into diagnostics about operand `at`."""
    try:
        yield
    except k.InvertedElement as failure:
        first = int(failure.ids[0])
        where = ", ".join("(" + " ".join(f"{x:g}" for x in corner) + ")" for corner in failure.corners[0][:4])
        ctx.fail(
            195,
            "{count} {shape} with a negative or zero Jacobian: elements {numbers}; element {number}, Jacobian {value}, "
            "corners {where}",
            at=at,
            count=len(failure.ids),
            shape=failure.shape,
            numbers=" ".join(str(int(i) + 1) for i in failure.ids[:6]) + (" ..." if len(failure.ids) > 6 else ""),
            number=first + 1,
            value=f"{failure.volumes[0]:.4g}",
            where=where,
            hint="its sides cross, or its corners are aligned"
            if failure.corners.shape[2] == 2
            else "its corners lie in one plane: move a node, or take the element out (DIFF)"
            if failure.volumes[0] == 0 and failure.shape == "TET4"
            else "its nodes turn the wrong way: ORIE turns elements round, INVE lines",
        )
    except k.BadValue as failure:
        ctx.fail(
            41,
            "{what} = {value} is out of bounds: {limit}",
            at=at,
            what=failure.what,
            value=failure.value,
            limit=failure.limit,
        )
    except k.MissingPackage as failure:
        ctx.fail(
            "G201",
            "the package {package} is not installed",
            package=failure.package,
            install=failure.install,
            hint="{install}",
        )
    except k.MissingSystemLibrary as failure:
        ctx.fail(
            "G202",
            "the system library {library} is missing",
            library=failure.library,
            package=failure.debian_package,
            hint="on Debian: apt install {package}",
        )
    except k.ContradictoryConditions as failure:
        rows = ", ".join(str(int(r) + 1) for r in failure.rows[:4])
        ctx.fail(
            "G407",
            "conditions contradict each other (rows {rows}, by {gap})",
            at=at,
            rows=rows,
            gap=f"{failure.residual:.3g}",
            hint="two conditions prescribe different values of the same unknowns",
        )
    except k.EmptyContact as failure:
        ctx.fail(
            "G401",
            "no contact pair: {reason}",
            at=at,
            reason=failure.reason,
            hint="do the two surfaces touch, and is the first the master, the second the slave?",
        )
    except k.UnsupportedLaw as failure:
        ctx.fail(
            251,
            "{method} treats {known} only",
            at=at,
            method=failure.method,
            known=failure.known,
            hint="the default method 'NEWT' treats every law",
        )
    except k.TooLarge as failure:
        ctx.fail(
            "G414",
            "{what} would need {needed} of memory, the limit is {limit}",
            at=at,
            what=failure.what,
            needed=f"{failure.needed / 1e9:.3g} GB",
            limit=f"{failure.limit / 1e9:.3g} GB",
            hint="coarsen the contact surfaces, or model a half or a quarter of a symmetric scene",
        )
    except k.MeshingFailed as failure:
        ctx.fail(27, "the mesher failed: {reason}", at=at, reason=failure.reason)
    except k.UnreadableFile as failure:
        ctx.fail(
            "G501",
            "the file {path} cannot be read: {reason}",
            at=at,
            path=failure.path,
            reason=failure.reason,
            hint="is the format right, and the file whole?",
        )
