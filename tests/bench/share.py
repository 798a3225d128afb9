"""Run a script and tell where its time goes: `python share.py SCRIPT`; a line of JSON follows its output.

A second thread looks at the stack of the first every 5 ms; the time since it last looked goes to what it sees then, so
that a long call into a compiled library, during which it cannot look, counts in full.
"""

import json
import sys
import threading
import time
from pathlib import Path

BEGIN = time.perf_counter()
KINDS = ("imports", "numerical", "language")


def place(frame):
    """Say what a stack does: imports, numerical work, or the language with its operators."""
    inner = frame.f_code.co_filename
    numerical = "/numpy/" in inner or "/scipy/" in inner
    while frame is not None:
        name = frame.f_code.co_filename
        if name.startswith("<frozen importlib"):
            return "imports"
        numerical |= "/gibiane_ops/kernels/" in name.replace("\\", "/")
        frame = frame.f_back
    return "numerical" if numerical else "language"


def watch(thread, times, done):
    last = BEGIN
    while not done.wait(0.005):
        frame = sys._current_frames().get(thread)
        now = time.perf_counter()
        if frame is not None:
            kind = place(frame)
            times[kind] += now - last
        last = now


def highest_memory():
    """Return the largest memory of this process, Gbyte."""
    status = Path("/proc/self/status")
    if status.exists():  # the figure of getrusage would include that of the process which started this one
        return next(int(line.split()[1]) / 1e6 for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e9 if sys.platform == "darwin" else 1e6)


def main(script):
    times, done = dict.fromkeys(KINDS, 0.0), threading.Event()
    watcher = threading.Thread(target=watch, args=(threading.get_ident(), times, done), daemon=True)
    watcher.start()
    from gibiane.cli import main as run

    try:
        code = run([script])
    finally:
        done.set()
        watcher.join()
    peak = highest_memory()
    print(json.dumps({"times": times, "seconds": time.perf_counter() - BEGIN, "peak": peak}))
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
