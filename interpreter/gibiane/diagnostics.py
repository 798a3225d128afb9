"""Diagnostics as data, the table of codes, and the one renderer with carets."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gibiane.source import Span, expand_tabs

NOTE, WARNING, ERROR, FATAL = 0, 1, 2, 3
LEVEL_WORDS = {"en": ("note", "warning", "error", "error"), "fr": ("note", "attention", "erreur", "erreur")}

# Cast3M's numbers keep their level (2 unless listed); what Cast3M does not number has a G code.
LEVELS: dict[str, int] = {
    "0": NOTE,
    "5": FATAL,
    "12": FATAL,
    "129": NOTE,
    "G301": NOTE,
    "G411": NOTE,
    "G413": WARNING,
    "G415": WARNING,
    "G416": WARNING,
    "G417": WARNING,
    "G418": NOTE,
    "G419": WARNING,
    "G420": WARNING,
    "G900": FATAL,
}
G_CODES = {
    "G101": "illegal character or binary input",
    "G102": "input ends inside a string, a parenthesis or an instruction",
    "G103": "calls nested too deeply",
    "G201": "an optional package is missing",
    "G202": "a system library is missing",
    "G301": "a word where a value was probably meant",
    "G401": "contact zone without pairs",
    "G402": "contact surfaces do not face each other",
    "G403": "initial penetration",
    "G404": "a solid is held only by contact, or can move freely",
    "G405": "contact cannot balance the tangential load",
    "G406": "contact statuses cycle",
    "G407": "conditions contradict each other",
    "G409": "conditions left aside",
    "G410": "prescribed error out of reach",
    "G411": "estimate not guaranteed",
    "G413": "several contact solutions",
    "G414": "too large for the memory",
    "G415": "solution of an ill-conditioned system",
    "G416": "result of an approximate contact law",
    "G417": "slips beyond the facets of the start",
    "G418": "contact stopped early because the user asked for it",
    "G419": "flat elements in a new mesh",
    "G420": "elements of different degrees that nothing ties",
    "G501": "file cut or of unknown format",
    "G601": "workers of a study are lost",
    "G602": "no cluster answers",
    "G900": "internal failure",
}


_AN = re.compile(r"\ba (?=(?:ANNULE|ENTIER|EVOLUTIO|OBJET)\b)")


@dataclass(frozen=True)
class Text:
    """A sentence as template and fields, worded in the reader's language when shown."""

    template: str
    fields: Mapping[str, Any] = field(default_factory=dict)

    def render(self, lang: str = "en") -> str:
        """Return the sentence in language `lang` ("en" or "fr")."""
        template = self.template
        if lang == "fr":
            from gibiane.messages_fr import FRENCH

            template = FRENCH.get(template, template)
        if not self.fields:
            return template
        shown = {k: v.render(lang) if isinstance(v, Text) else v for k, v in self.fields.items()}
        text = template.format(**shown)
        return _AN.sub("an ", text) if lang == "en" else text


def joined(texts: Sequence[Text], separator: str) -> Text | None:
    """Put sentences one after the other, each once; None when there is none."""
    unlike = list({text.render(): text for text in texts}.values())
    names = [f"t{i}" for i in range(len(unlike))]
    return (
        Text(separator.join("{" + name + "}" for name in names), dict(zip(names, unlike, strict=True)))
        if unlike
        else None
    )


@dataclass(frozen=True)
class Label:
    """What one operand is, said under its carets."""

    span: Span
    text: Text


@dataclass
class Diagnostic:
    """One message: code, level, who speaks, what happened, where, and what to do."""

    code: str
    sentence: Text
    operator: str | None = None
    level: int = ERROR
    span: Span | None = None
    labels: list[Label] = field(default_factory=list)
    forms: list[str] = field(default_factory=list)
    hint: Text | None = None
    notes: list[Text] = field(default_factory=list)
    more: str | None = None
    trace: list[tuple[str, Span]] = field(default_factory=list)


class GibianeError(Exception):
    """An error of the script, carrying its diagnostic."""

    def __init__(self, diagnostic: Diagnostic) -> None:
        super().__init__(diagnostic.sentence.render())
        self.diagnostic = diagnostic


def level_of(code: str) -> int:
    """Return the level (0 note, 1 warning, 2 error, 3 fatal) of a code."""
    return LEVELS.get(code, ERROR)


def make(
    code: int | str,
    template: str,
    *,
    operator: str | None = None,
    span: Span | None = None,
    labels: Sequence[Label] = (),
    hint: str | None = None,
    level: int | None = None,
    **fields: Any,
) -> Diagnostic:
    """Build a diagnostic from a code, a sentence template and its fields (shared with the hint)."""
    key = str(code)
    return Diagnostic(
        code=key,
        sentence=Text(template, fields),
        operator=operator,
        level=level_of(key) if level is None else level,
        span=span,
        labels=list(labels),
        hint=Text(hint, fields) if hint else None,
    )


def error(code: int | str, template: str, **options: Any) -> GibianeError:
    """Build the exception of a diagnostic made with :func:`make`."""
    return GibianeError(make(code, template, **options))


_COLOURS = {"red": "31;1", "yellow": "33;1", "blue": "34;1", "cyan": "36", "bold": "1"}
_WORDS_FR = {"form": "forme", "hint": "conseil", "note": "note", "more": "voir", "in": "dans"}


def render(diag: Diagnostic, *, colour: bool = False, lang: str = "en") -> str:
    """Render a diagnostic with source line, carets, forms, hint and chain of calls."""

    def paint(text: str, name: str) -> str:
        return f"\x1b[{_COLOURS[name]}m{text}\x1b[0m" if colour else text

    def word(english: str) -> str:
        return _WORDS_FR[english] if lang == "fr" else english

    head_colour = "red" if diag.level >= ERROR else "yellow" if diag.level == WARNING else "cyan"
    kind = LEVEL_WORDS[lang][diag.level]
    who = f"{diag.operator}: " if diag.operator else ""
    lines = [paint(f"{kind}[{diag.code}]", head_colour) + paint(f": {who}{diag.sentence.render(lang)}", "bold")]
    margin = ""
    if diag.span is not None:
        labels = diag.labels or [Label(diag.span, Text(""))]
        margin = " " * len(str(max(label.span.line for label in labels)))
        lines.append(f"{margin}{paint('-->', 'blue')} {diag.span.source.name}:{diag.span.line}:{diag.span.column}")
        lines.extend(_excerpt(labels, margin, lang, paint))
    lines.extend(f"{margin} {paint('=', 'blue')} {word('form')}: {shortened(form)}" for form in diag.forms)
    for note in diag.notes:
        lines.append(f"{margin} {paint('=', 'blue')} {word('note')}: {note.render(lang)}")
    if diag.hint:
        lines.append(f"{margin} {paint('=', 'blue')} {word('hint')}: {diag.hint.render(lang)}")
    if diag.more:
        lines.append(f"{margin} {paint('=', 'blue')} {word('more')}: {diag.more}")
    for where in _calls(diag.trace):
        lines.append(f"{margin} {paint('=', 'blue')} {word('in')}: {where}")
    return "\n".join(lines)


def _calls(trace: list[tuple[str, Span]]) -> list[str]:
    """Return the calls from inner to outer, equal ones in a row counted, a long chain cut in its middle."""
    counted: list[list[Any]] = []
    for name, span in trace:
        where = f"{name} ({span.source.name}:{span.line})"
        if counted and counted[-1][0] == where:
            counted[-1][1] += 1
        else:
            counted.append([where, 1])
    shown = [where if count == 1 else f"{where} x {count}" for where, count in counted]
    return shown if len(shown) <= 12 else [*shown[:6], "...", *shown[-5:]]


LONGEST = 110  # columns of a form of an operator that are shown


def shortened(form: str, width: int = LONGEST) -> str:
    """Return a form of an operator no wider than `width`: its last optional operands left out, "..." for them.

    Of the first one left out, a choice of keywords, those stay that have room. What is not optional stays.
    """
    parts: list[str] = []
    for piece in form.removesuffix(" ;").split(" "):
        if parts and parts[-1].count("(") > parts[-1].count(")"):
            parts[-1] += " " + piece
        else:
            parts.append(piece)
    if len(form) <= width:
        return form
    out, at = "", len(parts)
    while len(" ".join(parts)) + len(" ... ;") > width:
        last = next((i for i in range(len(parts) - 1, -1, -1) if parts[i].startswith("(")), None)
        if last is None:
            break
        out, at = parts.pop(last), last
    choices = out.strip("()").split("|") if " " not in out else []
    room = width - len(" ".join(parts)) - len(" (|...) ... ;")
    while choices and len("|".join(choices)) > room:
        choices.pop()
    if len(choices) > 1:
        parts.insert(at, f"({'|'.join(choices)}|...)")
    return " ".join([*parts, "... ;"])


WIDEST = 160  # columns of a source line that are shown; of a longer one, what stands round the place


def _excerpt(labels: Sequence[Label], margin: str, lang: str, paint: Any) -> list[str]:
    """Source lines of the labels, each label with carets on a line of its own."""
    bar = paint("|", "blue")
    lines = [f"{margin} {bar}"]
    shown = 0
    for label in sorted(labels, key=lambda item: item.span.start):
        span = label.span
        raw = span.source.line(span.line)
        text, column = expand_tabs(raw, span.column)
        text = text.rstrip()
        is_wide = len(text) > WIDEST
        cut = max(column - WIDEST // 2, 0) if is_wide else 0
        if span.line != shown or is_wide:
            number = paint(str(span.line).rjust(len(margin)), "blue")
            piece = text[cut : cut + WIDEST]
            lines.append(f"{number} {bar} {'...' + piece[3:] if cut else piece}{'...' if is_wide else ''}")
            shown = span.line
        column -= cut
        room = min(len(raw) - span.column + 1, WIDEST - column + 1)
        width = max(1, min(span.end - span.start, room))
        caption = label.text.render(lang)
        lines.append(
            f"{margin} {bar} {' ' * (column - 1)}{paint('^' * width, 'red')}{' ' + caption if caption else ''}"
        )
    return lines


def nearest(word: str, known: Sequence[str], limit: int = 2) -> str | None:
    """Return the known word closest to `word` within `limit` edits (a swap counts one), or None."""
    best, best_distance = None, limit + 1
    upper = word.upper()
    for candidate in known:
        if abs(len(candidate) - len(upper)) >= best_distance:
            continue
        distance = _edits(upper, candidate.upper(), best_distance)
        if distance < best_distance:
            best, best_distance = candidate, distance
    return best if best_distance <= min(limit, len(upper) // 3) else None


def _edits(a: str, b: str, stop: int) -> int:
    previous2: list[int] = []
    previous = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        row = [i]
        for j, y in enumerate(b, 1):
            cost = min(previous[j] + 1, row[-1] + 1, previous[j - 1] + (x != y))
            if i > 1 and j > 1 and x == b[j - 2] and a[i - 2] == y:
                cost = min(cost, previous2[j - 2] + 1)
            row.append(cost)
        if min(row) > stop:
            return stop + 1
        previous2, previous = previous, row
    return previous[-1]
