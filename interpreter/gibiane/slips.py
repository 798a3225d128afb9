"""Slips of the pen that leave a correct-looking text: a lost `;` merges two instructions, a lost `'` swallows lines.

Grouping is dynamic, so almost any sequence of words is an instruction. What betrays a lost `;` is where words stand:
a block word, an assignment or a directive that begins a line inside an unfinished instruction. What betrays a lost
apostrophe is that the text ends inside a string; the line is then found from what the strings hold. Nothing here
may speak about a correct text.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from gibiane.diagnostics import Diagnostic, Label, Text, make
from gibiane.lexer import Token, tokens
from gibiane.nodes import Instr, Name
from gibiane.source import SourceText, Span


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


# How block words are written; the ones that are also handy names are held to stricter shapes below.
OPENING = _words("SI SINO SINON FINS FINSI REPE REPETER DEBP DEBPROC FINP FINPROC DEBM DEBMETH FINM FINMETH")
INNER = _words("RESP RESPRO RESPROC ARGU ARGUMENT")
LEAVING = _words("FIN QUIT QUITTE QUITTER ITER ITERER")
CONTROL = OPENING | INNER | LEAVING
ALONE = _words("SINO SINON FINS FINSI")
# Operators that only act: they give nothing, so they start instructions.
DIRECTIVES = _words(
    "MESS MESSAGE OPTI OPTION TRAC TRACE TRACER DESS DESSIN DESSINE DESSINER LIST LISTE LISTER DETR DETRUIT DETRUIRE "
    "MENA MENAGE ELIM ELIMINE ELIMINATION ERRE ERREUR SORT SORTIR SAUV SAUVER REST RESTITUER OBTE OBTENIR ACQU "
    "ACQUERIR SAUT SAUTER COMM TASS OUBL OUBLIER TITR TITRE PASAPAS EXEC UTIL UTILISATEUR INFO DENS DENSITE"
)
# Those that never are a keyword or the name of a colour, a file or a type in the middle of an instruction.
PLAIN = _words("MESS MESSAGE DETR DETRUIT QUITTER ITERER REPE REPETER DEBPROC FINPROC FINSI SINON OBTENIR")
_OPTION_WORDS = _words("DIME ELEM MODE ECHO ERRE SORT SAUV REST ACQU TRAC ISOV DENS DONN LANG")
_KEYWORDS_OF = {  # directive words that are keywords of these operators
    "OPTI": frozenset({"TRAC", "SORT", "SAUV", "REST", "ERRE", "ACQU", "TITR", "DENS", "LIST"}),
    "TRAC": frozenset({"TITR"}),
    "DESS": frozenset({"TITR"}),
    "VALE": frozenset({"DENS", "TRAC", "ERRE", "SORT"}),
}
_QUOTING = frozenset({"MOT", "MOTS", "TEXT", "TEXTE"})
_TRAC_DEVICES = _words("X PS PSC EPS EPSC OPEN MIF GIBI BMP PNG SVG")
_CONNECT = _words("EGA NEG ET OU")


class Habits:
    """What a text shows of its names: words that start its directives, names it assigns, names of its loops."""

    def __init__(self, program: Iterable[Instr] = ()) -> None:
        self.directives: Counter[str] = Counter()
        self.names: Counter[str] = Counter()
        self.loops: set[str] = set()
        self.own: Counter[str] = Counter()
        for instr in program:
            self.names.update(_given(instr))
            if instr.head is None and not instr.targets and instr.items and instr.bad is None:
                word = getattr(instr.items[0], "word", None) or getattr(instr.items[0], "value", None)
                if isinstance(word, str) and len(word) > 1:
                    self.directives[word] += 1
            elif instr.head in ("REPE", "DEBP", "DEBM"):
                self.loops.update(item.word for item in instr.items if hasattr(item, "word"))

    def assigns(self, word: str) -> bool:
        """Say whether an instruction other than the one looked at gives `word` a value."""
        return self.names[word] > self.own[word]

    def look_at(self, instr: Instr) -> None:
        """Leave out what this instruction itself seems to assign: it may be two."""
        self.own = Counter(_given(instr))


def _given(instr: Instr) -> Iterator[str]:
    yield from (target.name for target in instr.targets)
    if instr.head in ("DEBP", "DEBM", "ARGU"):
        yield from (item.word for item in instr.items if isinstance(item, Name))


def mark(source: SourceText, program: list[Instr], *, thorough: bool = False) -> None:
    """Set `bad` of the instructions in which a slip is certain; with `thorough` also where it is only very likely."""
    if ends_in_string(program):
        _mark_apostrophe(source, program)
    habits = Habits(program) if thorough else None
    for instr in program:
        comment = _foreign_comment(instr)
        if comment is not None:
            instr.bad = comment
        elif instr.bad is None or instr.bad.code in ("1014", "315"):
            if habits is not None:
                habits.look_at(instr)
            found = slip(instr, habits)
            if found is not None:
                instr.bad = found


def _foreign_comment(instr: Instr) -> Diagnostic | None:
    """Find an instruction that begins like a comment of another language, or with a * that is not in column 1."""
    text = instr.source.text
    mark = text[instr.start : instr.start + 2]
    if mark != "//":
        named = mark[:1] == "#" and mark[1:2].strip() and instr.bad is not None and instr.bad.code == "315"
        mark = mark[:1] if (mark[:1] in ("#", "*") and not named) or mark in ("! ", "!") else ""
    if not mark:
        return None
    return make(
        "G101",
        "an instruction cannot begin with {mark}",
        mark=mark,
        span=Span(instr.source, instr.start, instr.start + len(mark)),
        hint="a comment is a line with * in its first column; COMM 'text' ; may stand anywhere",
    )


# ---------------------------------------------------------------------------------------------- apostrophes


def ends_in_string(program: list[Instr]) -> bool:
    """Say whether the text of a program ends inside a string."""
    bad = program[-1].bad if program else None
    return bad is not None and bad.code == "G102" and "string" in bad.sentence.template


def _mark_apostrophe(source: SourceText, program: list[Instr]) -> None:
    at, end = apostrophe(source)
    first, last = Span(source, at, at + 1), Span(source, end, end + 1)
    labels = [Label(first, Text("this one may open or close a string by mistake"))]
    if last.line != first.line:
        labels.append(Label(last, Text("the string would go on after this")))
    found = make(
        "G102",
        "an apostrophe is missing on this line, or one is too many",
        span=first,
        labels=labels,
        hint="a string is closed by an apostrophe; inside a string an apostrophe is written twice",
    )
    for index, instr in enumerate(program):
        if instr.end > at:
            instr.bad = found
            instr.head = None
            del program[index + 1 :]  # what follows was read with strings and code exchanged
            return


def apostrophe(source: SourceText) -> tuple[int, int]:
    """Return where the lost or doubled apostrophe of a text with an odd number of them most likely is.

    A string that goes over the end of a line is suspicious if that line seems to end an instruction, or if what
    the next apostrophe cuts is the middle of a word. The first place is the apostrophe that opens that string, the
    second the end of the suspicious line.
    """
    is_open = False
    start = last = opened = 0
    lines = source.text.split("\n")
    for number, line in enumerate(lines):
        if not line.startswith(("*", "$$$$")):
            quotes = line.count("'")
            if quotes:
                last = start + line.rindex("'")
            if quotes % 2:
                is_open, opened = not is_open, last
            if is_open and _looks_inverted(line, quotes, lines, number + 1):
                return opened, start + max(len(line.rstrip()) - 1, 0)
        start += len(line) + 1
    return last, last


def _looks_inverted(line: str, quotes: int, lines: list[str], following: int) -> bool:
    tail = line[line.rindex("'") + 1 :] if quotes else line
    if tail.rstrip().endswith(";"):
        return True
    while following < len(lines) and lines[following].startswith("*"):
        following += 1
    after = lines[following] if following < len(lines) else ""
    if "'" not in after:
        return False
    at = after.index("'")
    if not tail.strip() and not after[:at].strip():
        return True
    return after[at + 1 : at + 2].isalnum() and not after[:at].strip()


# ---------------------------------------------------------------------------------------------- semicolons


def slip(instr: Instr, habits: Habits | None = None) -> Diagnostic | None:
    """Return the lost `;` inside an instruction, or None. Without `habits` only what is certain is told."""
    crossing = instr.source.text.find("\n", instr.start, instr.end) >= 0
    if not crossing and instr.head is None and instr.bad is None and habits is None:
        return None
    held = _held(instr)
    if len(held) < 2 or _word(held[0]) in ("COMM", "COMMENTAIRE"):
        return None
    found = _crowded_head(instr, held) if instr.head else None
    if found is None and crossing:
        found = _line_start(instr, held, habits)
    if found is None and habits is not None:
        found = _same_line(instr, held, habits)
    return found


def _held(instr: Instr) -> list[Token]:
    held: list[Token] = []
    for token in tokens(instr.source, {}, instr.start):
        if token.type == "SEMI" or token.start_pos >= instr.end:
            break
        held.append(token)
    return held


def _word(token: Token) -> str:
    """Return the word a token may be as an operator: unquoted in upper case, quoted as it is."""
    if token.type == "NAME":
        return str(token.value).upper()
    return str(token.value) if token.type == "STRING" else ""


def _report(instr: Instr, before: Token, token: Token, code: int | str = 153) -> Diagnostic:
    """Point at the end of one instruction and at the start of the next."""
    source = instr.source
    end = Span(source, before.end_pos - 1, before.end_pos)
    start = Span(source, token.start_pos, token.end_pos)
    labels = [Label(end, Text("the ; is missing after this")), Label(start, Text("another instruction begins here"))]
    return make(code, "a ; is missing between two instructions", span=end, labels=labels)


def _units(held: Sequence[Token]) -> list[Token]:
    """Return the first token of each value at the outer level: a word, a literal, a group, with its indices."""
    found: list[Token] = []
    depth = 0
    joined = False
    for token in held:
        if token.type == "RPAR":
            depth -= 1
            continue
        if depth == 0:
            if token.type == "ACCESS":
                joined = True
            elif not joined:
                found.append(token)
            else:
                joined = False
        if token.type == "LPAR":
            depth += 1
    return found


_ROOM = {"SI": 1, "SINO": 0, "FINS": 0, "FIN": 1, "QUIT": 1, "ITER": 1, "REPE": 2}


def _crowded_head(instr: Instr, held: list[Token]) -> Diagnostic | None:
    """Find what follows a block word beyond what it takes: the `;` after it is lost."""
    room = _ROOM.get(str(instr.head))
    if room is None or any(t.type == "EQUAL" for t in held):
        return None
    units = _units(held)
    if room and any(t.type == "SYMBOL" or _word(t) in _CONNECT for t in units):
        return None  # `SI A > B`: a fault of another kind, told when it runs
    if len(units) > room + 1 and _word(units[0])[:4] == instr.head:
        extra = units[room + 1]
        return _report(instr, held[held.index(extra) - 1], extra)
    return None


def _line_start(instr: Instr, held: list[Token], habits: Habits | None) -> Diagnostic | None:
    """Find what begins a line inside the instruction and can only begin an instruction."""
    locate = instr.source.locate
    base = _indent(instr.source, held[0])
    depth = 0
    equals = 0
    for i, token in enumerate(held):
        if token.type == "LPAR":
            depth += 1
        elif token.type == "RPAR":
            depth -= 1
        elif token.type == "EQUAL":
            equals += 1
        if i == 0 or token.type not in ("NAME", "STRING", "ACCESS"):
            continue
        before = held[i - 1]
        if before.type in ("ACCESS", "EQUAL") or locate(before.end_pos - 1)[0] == locate(token.start_pos)[0]:
            continue
        word = _word(token)
        rest = held[i + 1 : i + 3]
        if _assigns(held, i):
            if equals or not _could_be_targets(held[:i], habits):
                return _report(instr, before, token, 1014 if equals else 315)
            continue
        if depth or (rest and rest[0].type in ("EQUAL", "ACCESS")):
            continue
        if _starts_block(word, rest, habits):
            return _report(instr, before, token)
        if equals and word in PLAIN and _word(before) not in _QUOTING and before.type != "SYMBOL":
            return _report(instr, before, token)  # what gives no result cannot stand in an assignment
        if habits is not None and _starts_directive(
            word, held[0], rest, base, _indent(instr.source, token), habits, before, token.type == "NAME"
        ):
            return _report(instr, before, token)
    return None


def _indent(source: SourceText, token: Token) -> int:
    line = source.line(source.locate(token.start_pos)[0])
    return len(line) - len(line.lstrip())


def _assigns(held: list[Token], i: int) -> bool:
    """Say whether `NAME [indices] [*TYPE] =` stands at token `i`."""
    token = held[i]
    at = i + 1
    if token.type == "ACCESS":
        if token.value != "%":
            return False
        at = i + 2
    elif token.type != "NAME":
        return False
    depth = 0
    expects = False
    while at < len(held):
        kind = held[at].type
        if depth == 0 and kind == "EQUAL":
            return True
        if kind == "LPAR":
            if depth == 0 and not expects:
                return False
            depth += 1
        elif kind == "RPAR":
            depth -= 1
            if depth < 0:
                return False
            expects = False
        elif depth == 0:
            if kind == "ACCESS" or (kind == "SYMBOL" and held[at].value == "*"):
                expects = True
            elif expects:
                expects = False
            else:
                return False
        at += 1
    return False


def _could_be_targets(held: Sequence[Token], habits: Habits | None) -> bool:
    """Say whether tokens may be names that an assignment on the next line continues (`A B <line> C = ...`)."""
    first = _word(held[0])
    if first in CONTROL or (first in DIRECTIVES and len(held) > 1):
        return False
    if habits is not None and len(held) > 1 and first in habits.directives and not habits.assigns(first):
        return False
    for i, token in enumerate(held):
        joined = i > 0 and (held[i - 1].type == "ACCESS" or held[i - 1].value == "*")
        if not joined and token.type not in ("NAME", "ACCESS", "RPAR") and token.value != "*":
            return False
    return True


def _starts_block(word: str, rest: Sequence[Token], habits: Habits | None) -> bool:
    if word in OPENING or (word in INNER and rest):
        return True
    if word not in LEAVING or (habits is not None and habits.assigns(word) and word not in ("FIN",)):
        return False
    if not rest:
        return word == "FIN"
    free = habits is None or word[:4] == "QUIT" or _word(rest[0]) in habits.loops
    return len(rest) == 1 and rest[0].type == "NAME" and free


def _starts_directive(
    word: str,
    first: Token,
    rest: Sequence[Token],
    base: int,
    indent: int,
    habits: Habits,
    before: Token,
    unquoted: bool,
) -> bool:
    opening = _word(first)
    if habits.assigns(word) or before.type == "SYMBOL" or _word(before) in _QUOTING:
        return False
    if word in DIRECTIVES:
        if word[:4] in _KEYWORDS_OF.get(opening[:4], ()):
            return word[:4] == "TRAC" and bool(rest) and _word(rest[0])[:4] not in _TRAC_DEVICES
        if word[:4] == "OPTI":
            return bool(rest) and _word(rest[0])[:4] in _OPTION_WORDS
        if word[:4] in ("TITR", "DENS", "LIST", "INFO"):
            return indent <= base and opening not in ("TRAC", "DESS")
        return indent <= base or opening in CONTROL or word in PLAIN or unquoted
    if word[:1] == "@" and rest and indent <= base:
        return True
    return indent <= base and habits.directives[word] > 0 and word not in ("ET", "OU") and opening != word


def _same_line(instr: Instr, held: list[Token], habits: Habits) -> Diagnostic | None:
    """Words that start instructions, in the middle of a line."""
    equals = next((i for i, t in enumerate(held) if t.type == "EQUAL"), None)
    first = _word(held[0])
    if equals is not None and equals > 1 and (first in CONTROL or first in DIRECTIVES) and not habits.assigns(first):
        at = equals - 1
        while at > 1 and not _assigns(held[: equals + 1], at):
            at -= 1
        nearest = max((i for i in range(1, equals) if _assigns(held[: equals + 1], i)), default=at)
        while nearest > 1 and held[nearest - 1].type == "ACCESS" and _assigns(held[: equals + 1], nearest - 2):
            nearest -= 2
        return _report(instr, held[nearest - 1], held[nearest], 315)
    if first in DIRECTIVES and equals is None and first[:4] in ("MESS", "COMM", "TITR"):
        return None
    depth = 0
    for i in range(1, len(held)):
        token, before = held[i], held[i - 1]
        depth += (before.type == "LPAR") - (token.type == "RPAR")
        word = _word(token)
        if not word or depth or before.type in ("ACCESS", "EQUAL", "SYMBOL") or _word(before) in _QUOTING:
            continue
        rest = held[i + 1 : i + 3]
        if habits.assigns(word) or (rest and rest[0].type in ("ACCESS", "EQUAL")):
            continue
        if word in ("FIN", "QUIT", "ITER"):
            hit = len(rest) == 1 and _word(rest[0]) in habits.loops
        elif word == "SI":
            hit = bool(rest) and rest[0].type == "LPAR"
        elif word in ALONE:
            hit = not rest
        elif word in ("LIST", "ERRE", "ERREUR", "TRAC"):
            if token.type == "STRING":
                continue  # more likely a keyword: TAILLE 'ERREUR' ...
            acts = equals is not None or (first in DIRECTIVES and word[:4] not in _KEYWORDS_OF.get(first[:4], ()))
            hit = acts and bool(rest) and first[:4] != "VALE"
        else:
            hit = word in PLAIN
        if hit:
            return _report(instr, before, token)
    return None
