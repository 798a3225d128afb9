"""Three readers of the declarations: the text of INFO, OPERATORS.md, and the words for completion."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

from gibiane import cast3m, registry
from gibiane.diagnostics import G_CODES, nearest
from gibiane.registry import Context, Operator

WIDTH = 100


def describe(op: Operator) -> str:
    """Return the notice of an operator as plain text."""
    lines = [f"{op.name}: {op.summary}", ""]
    for form in op.all_forms():
        lines.extend(_wrapped(form.usage(op.name), "   ", "      "))
    operands = {a.name: (a, "|".join(a.types)) for f in op.forms for a in f.args if a.doc}
    keys = {k.words: k for f in op.forms for k in f.keys if k.doc}
    if operands or keys:
        lines.append("")
    lines.extend(f"   {name:<12} {types:<20} {arg.doc}".rstrip() for name, (arg, types) in operands.items())
    for words, key in keys.items():
        shown = "|".join(f"'{w}'" for w in words)
        lines.append(f"   {shown:<12} {'':<20} {key.doc}".rstrip())
    if op.notice:
        lines.append("")
        for paragraph in op.notice.splitlines():
            lines.extend(_wrapped(paragraph))
    if op.example:
        lines.extend(["", "Example:", *("   " + line for line in op.example.splitlines())])
    if op.see:
        lines.extend(["", "See also: " + ", ".join(op.see)])
    if op.source:
        lines.append(f"Source: {op.source}")
    return "\n".join(lines)


def _wrapped(text: str, first: str = "", others: str = "") -> list[str]:
    return textwrap.wrap(
        text, WIDTH, initial_indent=first, subsequent_indent=others, break_long_words=False, break_on_hyphens=False
    )


def header(word: str, text: str) -> str:
    """Return the comment that a procedure file begins with: its notice."""
    lines = []
    for line in text.splitlines():
        if not line.startswith(("*", "$$$$")):
            break
        lines.append(line.removeprefix("*").removeprefix(" ") if line.startswith("*") else f"{word}: a procedure")
    return "\n".join(lines).strip()


def notice(ctx: Context, word: str, node: Any) -> str:
    """Return the notice that INFO prints for a word: an operator, a procedure in a file or the code of a message."""
    op = registry.find(word)
    if op is not None:
        return describe(op)
    source = ctx.session.library.find(word) if word.isidentifier() else None
    if source is not None:
        return header(word, source.text)
    if word.upper() in G_CODES:
        return f"{word.upper()}: {G_CODES[word.upper()]}"
    ctx.places["word"] = node
    missing = cast3m.meant(word)
    if missing is not None:
        name, near = missing
        ctx.fail(
            251,
            "{name} of Cast3M is not available yet",
            at="word",
            name=name,
            near=near,
            hint="the nearest thing here: {near}" if near else None,
        )
    close = nearest(word, registry.spellings())
    ctx.fail(
        9,
        "there is no operator {word}",
        at="word",
        word=word,
        close=close,
        hint="did you mean {close}?" if close else "gibiane docs lists the operators",
    )


def operators() -> list[Operator]:
    """Return every operator, loaded, by topic and name."""
    found = {id(op): op for name in registry.names() if (op := registry.find(name)) is not None}
    for op in found.values():
        op.all_forms()
    return sorted(found.values(), key=lambda op: (op.topic, op.name))


def markdown(missing: Mapping[str, str]) -> str:
    """Return OPERATORS.md: every operator with its forms, keywords and example.

    `missing` holds the names of Cast3M that are not here, each with what is nearest, or "".
    """
    lines = ["# Operators", "", "Made from the declarations by `gibiane docs`; do not edit.", ""]
    ops = operators()
    topics = sorted({op.topic for op in ops})
    for topic in topics:
        links = ", ".join(f"[{op.name}](#{_anchor(op.name)})" for op in ops if op.topic == topic)
        lines.append(f"- **{topic}**: {links}")
    for topic in topics:
        lines.extend(["", f"## {topic}"])
        for op in ops:
            if op.topic == topic:
                lines.extend(_section(op))
    lines.extend(_missing(missing))
    return "\n".join(lines) + "\n"


def _missing(names: Mapping[str, str]) -> list[str]:
    """List the names of Cast3M that are not here: operators first, of at most four letters, then procedures."""
    lines = ["", "## Not here", "", f"Of Cast3M 2024, {len(names)} names are not here; calling one gives error 251."]
    near = sorted(name for name, text in names.items() if text)
    lines += ["", "| name | nearest here |", "| --- | --- |", *(f"| {name} | {names[name]} |" for name in near)]
    listed = list(names)
    first = next((i for i, name in enumerate(listed) if len(name) > 4), len(listed))
    for kind, part in (("operators", listed[:first]), ("procedures", listed[first:])):
        words = [f"`{name}`" for name in sorted(part) if not names[name]]
        wrapped = textwrap.wrap(" ".join(words), 120, break_on_hyphens=False)
        lines += ["", f"With nothing near them, {kind} ({len(words)}):", "", *wrapped]
    return lines


_SYMBOLS = {
    "+": "plus",
    "-": "minus",
    "*": "times",
    "/": "over",
    "**": "power",
    "<": "less",
    ">": "more",
    "<EG": "less-or-equal",
    ">EG": "more-or-equal",
}


def _anchor(name: str) -> str:
    return _SYMBOLS.get(name, name.lower())


def _section(op: Operator) -> list[str]:
    lines = [
        "",
        f'### <a id="{_anchor(op.name)}"></a>`{op.name}`',
        "",
        f"{op.summary[0].upper()}{op.summary[1:]}.",
        "",
        "```",
    ]
    lines.extend(form.usage(op.name) for form in op.forms)
    lines.extend(["```", ""])
    keys = {k.words: k for f in op.forms for k in f.keys if k.doc}
    for words, key in keys.items():
        shown = " | ".join(f"`'{w}'`" for w in words)
        lines.append(f"- {shown}: {key.doc}")
    if keys:
        lines.append("")
    if op.notice:
        lines.extend([op.notice.replace("\n", "\n\n"), ""])
    if op.example:
        lines.extend(["```", op.example, "```"])
    if op.see:
        lines.extend(["", "See also: " + ", ".join(op.see)])
    if op.source:
        lines.extend(["", f"Source: {op.source}."])
    return lines
