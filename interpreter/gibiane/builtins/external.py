"""EXTE: run a command of the system, for those who allow it when they start the program."""

from __future__ import annotations

import os
import sys

from gibiane.forms import Arg
from gibiane.registry import Context, operator
from gibiane.values import ENTIER, FLOTTANT, MOT

EXTE = operator(
    "EXTERN",
    topic="language",
    summary="run a command of the system",
    notice="The words and numbers are joined by blanks and given to the system's shell; what the command "
    "writes is shown; `python` is the one that runs Gibiane. Refused unless the program was started "
    "with --allow-exec: a script from elsewhere could do anything.",
    example="OPTI ERRE IGNO ; EXTE 'date' ;",
    see=["OPTION"],
)


@EXTE.form(Arg("command", (MOT, ENTIER, FLOTTANT), "words of the command", many=True))
def _run(ctx: Context, command: list[str | int | float]) -> None:
    import subprocess  # slow to import, and seldom asked for

    text = " ".join(str(word) for word in command)
    if not ctx.option("EXEC"):
        ctx.fail(
            19,
            "commands of the system are not run: '{command}'",
            command=text,
            at="command",
            hint="start with gibiane --allow-exec if you trust the script",
        )
    ctx.session.out.flush()
    path = os.pathsep.join([os.path.dirname(sys.executable), os.environ.get("PATH", os.defpath)])
    environment = os.environ | {"PATH": path}
    done = subprocess.run(
        text, shell=True, capture_output=True, text=True, errors="replace", check=False, env=environment
    )
    for line in (done.stdout + done.stderr).splitlines():
        ctx.write(line)
    if done.returncode:
        ctx.fail(
            26, "the command ended with code {status}: '{command}'", status=done.returncode, command=text, at="command"
        )
