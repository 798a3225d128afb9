"""SAUV and REST: a session, or some of its objects, in a file."""

from __future__ import annotations

from pathlib import Path

from gibiane.binding import Operands
from gibiane.forms import Arg, Key
from gibiane.nodes import Literal, Name
from gibiane.registry import Context, operator
from gibiane.values import MOT
from gibiane_ops.values.archive import Archive, BadArchive, NotSaveable, write_archive
from gibiane_ops.values.nodes import node_store
from gibiane_ops.values.texts import rebuilt

EXTENSION = ".gibi.zip"
# What every session begins with, and what concerns one run only.
GIVEN = {"VRAI", "FAUX", "D", "C"}
OPTIONS = ("DIME", "MODE", "ELEM", "DENS")

SAUV = operator(
    "SAUVER",
    topic="files",
    summary="save objects in a file",
    notice="Writes the objects named, or every object of the session when none is, to the file that OPTI 'SAUV' names "
    "(" + EXTENSION + " is added when it has no extension). Objects that share nodes or other objects share them "
    "again after REST. The file is a zip archive of a text and of arrays; reading it runs nothing. 'LABEL' keeps a "
    "text in it; 'MUET' writes no message.",
    example="OPTI DIME 2 ELEM SEG2 ; L = DROI 3 (0 0) (1 0) ; T = TABL ; T.1 = L ;\n"
    "OPTI 'SAUV' 'mesh' ; SAUV L T ; OPTI 'REST' 'mesh' ; REST ; MESS (NBEL T.1) (EGA L T.1) ;",
    see=["RESTITUER", "SORTIR"],
)
REST = operator(
    "RESTITUER",
    topic="files",
    summary="take back what SAUV saved",
    notice="Gives the objects of the file that OPTI 'REST' names their names again: all of them, or those named. Nodes "
    "come in addition to those of the session. OPTI DIME, MODE, ELEM and DENS take the values of the file when the "
    "dimension is not set yet.",
    example="OPTI 'SAUV' 'numbers' ; X = 3.5 ; SAUV X ; X = 0. ; OPTI 'REST' 'numbers' ; REST X ; MESS X ;",
    see=["SAUVER", "LIRE"],
)


def _path(ctx: Context, option: str) -> Path:
    name = ctx.session.options.get(option)
    if not name:
        ctx.fail(19, "no file is set", option=option, hint="OPTI '{option}' 'name' ; first")
    path = Path(f"fort.{name}" if isinstance(name, int) else str(name))
    return path if path.suffix else path.with_name(path.name + EXTENSION)


def _names(ctx: Context, q: Operands) -> tuple[list[str], str, bool]:
    """Read names of objects as they are written, not their values; and the label."""
    names: list[str] = []
    label, silent = "", False
    while q.values:
        node = q.nodes[0]
        ctx.places["name"] = node
        word = str(q.values[0])[:4] if isinstance(q.values[0], str) else ""
        if word == "MUET":
            silent = True
        elif word == "LABE":
            del q.values[0], q.nodes[0]
            label = str(q.need(MOT, "the label"))
            continue
        elif isinstance(node, Name):
            names.append(node.name)
        elif isinstance(node, Literal) and isinstance(q.values[0], str):
            names.append(q.values[0].upper())
        else:
            ctx.fail(6, "the name of an object is wanted here", at="name", hint="a value without a name has no place")
        del q.values[0], q.nodes[0]
    return list(dict.fromkeys(names)), label, silent


@SAUV.stream(
    Key("LABEL", "text kept in the file", Arg("text", MOT)),
    Key("MUET", "no message"),
    syntax="('LABEL' text:MOT) ('MUET') (name...)",
)
def _sauv(ctx: Context, q: Operands) -> None:
    wanted, label, silent = _names(ctx, q)
    path = _path(ctx, "SAUV")
    visible = ctx.session.names()
    for name in wanted:
        if name not in visible:
            ctx.fail(9, "there is no object {name}", at="name", name=name)
    chosen = {
        name: value
        for name, value in visible.items()
        if (name in wanted if wanted else name not in GIVEN and name.isidentifier())
    }
    options = {name: ctx.option(name) for name in OPTIONS}
    try:
        write_archive(path, chosen, node_store(ctx), options, label)
    except NotSaveable as failure:
        ctx.fail(39, "a {type} cannot be saved", type=failure.type_name, hint="SAUV with the names of the others")
    except OSError as failure:
        ctx.cannot_write(path, failure)
    if not silent and ctx.option("ECHO") >= 1:
        ctx.write(f" SAUV : {len(chosen)} objets dans {path.as_posix()}")


@REST.stream(Key("MUET", "no message"), syntax="('MUET') (name...)")
def _rest(ctx: Context, q: Operands) -> None:
    wanted, _, silent = _names(ctx, q)
    path = _path(ctx, "REST")
    if not path.is_file():
        ctx.fail(1130, "the file {path} cannot be opened", path=path.as_posix())
    try:
        archive = Archive(path)
        _check(ctx, archive, wanted)
        found = archive.restore(ctx, node_store(ctx), rebuilt)
    except BadArchive as failure:
        ctx.fail(
            "G501",
            "the file {path} cannot be restored: {reason}",
            path=path.as_posix(),
            reason=str(failure),
            hint="REST reads what SAUV has written",
        )
    except OSError as failure:
        ctx.fail(1130, "the file {path} cannot be opened", path=path.as_posix(), reason=failure.strerror)
    if not ctx.option("DIME"):
        ctx.session.options.update({n: v for n, v in archive.options.items() if n in OPTIONS})
    for name in wanted or archive.names:
        ctx.session.assign(name, found[name])
    if not silent and ctx.option("ECHO") >= 1:
        ctx.write(f" REST : {len(wanted or archive.names)} objets de {path.as_posix()}")


def _check(ctx: Context, archive: Archive, wanted: list[str]) -> None:
    for name in wanted:
        if name not in archive.names:
            known = " ".join(archive.names[:10])
            ctx.fail(9, "the file holds no object {name}", name=name, known=known, hint="it holds {known}")
    own, other = int(ctx.option("DIME")), archive.options.get("DIME")
    if own and other and own != other:
        ctx.fail(
            12,
            "the file was saved with OPTI DIME {other}, this session has DIME {own}",
            own=own,
            other=other,
            hint="REST before OPTI DIME, or in another session",
        )
