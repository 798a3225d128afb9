"""The prompt: read a complete block, run it, keep the session whatever happens."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gibiane.completion import candidates, incomplete

PROMPT, CONTINUATION = "$ ", ". "
ADVICE = "colour, completion and editing of several lines need prompt_toolkit: pip install 'gibiane[repl]'"

Reader = Callable[[], str]


def run(session: Any) -> int:
    """Read and run instructions until FIN or the end of the input; return the exit code."""
    from gibiane import __version__

    sys.stdout.write(f"Gibiane {__version__}. INFO name ; describes an operator, FIN ; ends.\n")
    session.pager = page
    read = _reader(session)
    count = 0
    while True:
        try:
            text = read()
        except EOFError:
            sys.stdout.write("\n")
            return 0
        except KeyboardInterrupt:
            sys.stdout.write("\n")
            continue
        if not text.strip():
            continue
        count += 1
        session.worst = 0
        session.internal = False
        session.run_text(text, f"<{count}>")
        if session.finished:
            return 0


def page(text: str) -> None:
    """Show a text a screen at a time: Enter for more, q to leave."""
    lines = text.splitlines()
    height = max(shutil.get_terminal_size().lines - 1, 5)
    if not sys.stdin.isatty() or len(lines) <= height:
        sys.stdout.write("\n".join(lines) + "\n")
        return
    for start in range(0, len(lines), height):
        sys.stdout.write("\n".join(lines[start : start + height]) + "\n")
        if start + height < len(lines):
            with suppress(EOFError, KeyboardInterrupt):
                if input("-- Enter for more, q to leave -- ").strip().lower() != "q":
                    continue
            return


def history_file() -> Path | None:
    """Return the file that keeps what was typed, in the user's folder for state; None when it cannot be had."""
    state = os.environ.get("XDG_STATE_HOME")
    folder = (Path(state) if state else Path.home() / ".local" / "state") / "gibiane"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "history"
        file.touch(mode=0o600)
    except OSError:
        return None
    return file


def _reader(session: Any) -> Reader:
    if find_spec("prompt_toolkit") is not None and find_spec("pygments") is not None:
        return _rich_reader(session)
    sys.stdout.write(ADVICE + "\n")
    return _plain_reader(session)


# -- the plain prompt ----------------------------------------------------------------------------------------------


def _plain_reader(session: Any) -> Reader:
    """Return a reader of lines; with Python's readline it has a history and completes with the Tab key."""
    if find_spec("readline") is not None:
        _use_readline(session)

    def read() -> str:
        text = input(PROMPT)
        while (still := incomplete(text)) is not None:
            text += "\n" + input(f"{still}> " if still else CONTINUATION)
        return text

    return read


def _use_readline(session: Any) -> None:
    import atexit
    import readline

    file = history_file()
    if file is not None:
        with suppress(OSError):
            readline.read_history_file(file)

        def save() -> None:
            with suppress(OSError):
                readline.write_history_file(file)

        atexit.register(save)

    def complete(_text: str, state: int) -> str | None:
        partial, found = candidates(session, readline.get_line_buffer()[: readline.get_endidx()])
        words = [word for word, _ in found if word.startswith(partial)]
        return words[state] if state < len(words) else None

    readline.set_completer(complete)
    readline.set_completer_delims(" \t\n'();=+-*/<>.,%")
    readline.parse_and_bind("tab: complete")


# -- the prompt with prompt_toolkit ----------------------------------------------------------------------------------


def _rich_reader(session: Any) -> Reader:
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import Completer, Completion
    from prompt_toolkit.document import Document
    from prompt_toolkit.history import FileHistory, History, InMemoryHistory
    from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
    from prompt_toolkit.lexers import PygmentsLexer

    from gibiane.highlight import GibianeLexer

    class _Completer(Completer):
        def get_completions(self, document: Document, _event: Any) -> Iterator[Completion]:
            partial, found = candidates(session, document.text_before_cursor)
            for word, meta in found:
                yield Completion(word, start_position=-len(partial), display_meta=meta)

    keys = KeyBindings()

    @keys.add("enter")
    def _(event: KeyPressEvent) -> None:
        buffer = event.current_buffer
        if buffer.complete_state and buffer.complete_state.current_completion:
            buffer.complete_state = None
        elif incomplete(buffer.text) is None:
            buffer.validate_and_handle()
        else:
            buffer.insert_text("\n")

    file = history_file()
    history: History = FileHistory(str(file)) if file is not None else InMemoryHistory()
    prompt: PromptSession[str] = PromptSession(
        history=history,
        lexer=PygmentsLexer(GibianeLexer),
        completer=_Completer(),
        complete_while_typing=False,
        multiline=True,
        key_bindings=keys,
    )

    def continuation(width: int, line_number: int, _wraps: int) -> str:
        lines = prompt.default_buffer.text.split("\n")[:line_number]
        still = incomplete("\n".join(lines))
        return f"{still}> " if still else CONTINUATION

    return lambda: prompt.prompt(PROMPT, prompt_continuation=continuation)
