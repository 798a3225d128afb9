"""Studies on several processes: a worker that is killed, a run that is interrupted, a cluster."""

import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gibiane.session import Session
from gibiane_ops.assistants import operator, study

STUDY = """\
DEBP CAS X*FLOTTANT ;
  S = 0. ;
  REPE B 500000 ;
    S = S + (X / &B) ;
  FIN B ;
FINP S ;
T = TABL ESCLAVE ;
REPE B 4 ; T. &B = FLOT &B ; FIN B ;
R = ASSI 'TOUS' {keep} CAS T ;
MESS 'ratios ' ((R.2) / (R.1)) ' ' ((R.3) / (R.1)) ' ' ((R.4) / (R.1)) ;
"""
ROOT = Path(__file__).parents[3]
ENVIRONMENT = os.environ | {"PYTHONPATH": f"{ROOT / 'interpreter'}{os.pathsep}{ROOT / 'ops'}"}
PATIENCE = 600
"""Seconds that a process may take on a busy machine before it is said to hang."""
ANSWER = "ratios  2.00000E+00  3.00000E+00  4.00000E+00"

needs_proc = pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="children are found in /proc")


def _run(folder: Path, *options: str, keep: str = "") -> subprocess.Popen[str]:
    script = folder / "study.dgibi"
    script.write_text(STUDY.format(keep=keep))
    command = [sys.executable, "-m", "gibiane", *options, script.name]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=folder, env=ENVIRONMENT, stdout=pipe, stderr=pipe, text=True)


def _workers(parent: int) -> list[int]:
    """Return the worker processes of a process."""
    found: list[int] = []
    for children in Path(f"/proc/{parent}/task").glob("*/children"):
        for child in children.read_text().split():
            try:
                command = Path(f"/proc/{child}/cmdline").read_text()
            except OSError:
                continue
            if "spawn_main" in command:
                found.append(int(child))
    return found


def _first_worker(process: subprocess.Popen[str]) -> int:
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and process.poll() is None:
        if found := _workers(process.pid):
            return found[0]
        time.sleep(0.02)
    pytest.fail("no worker process was started")


@needs_proc
def test_a_killed_worker_loses_no_case(tmp_path: Path) -> None:
    process = _run(tmp_path, "--workers", "2")
    victim = _first_worker(process)
    time.sleep(0.7)
    assert process.poll() is None, "the study was over before its worker was killed"
    os.kill(victim, signal.SIGKILL)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    assert ANSWER in out


@needs_proc
def test_an_interrupted_study_only_does_what_is_missing(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    process = _run(tmp_path, "--workers", "1", keep="'REPR' 'kept'")
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and not list(kept.glob("*.zip")):
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE)
    first = {path: path.stat().st_mtime_ns for path in kept.glob("*.zip")}
    assert 0 < len(first) < 4
    out, err = _run(tmp_path, "--workers", "1", "--echo", "1", keep="'REPR' 'kept'").communicate(timeout=PATIENCE)
    assert ANSWER in out, err
    assert f"{len(first)} of 4 cases were done before" in out
    assert len(list(kept.glob("*.zip"))) == 4
    assert {path: path.stat().st_mtime_ns for path in first} == first


def test_a_changed_procedure_is_run_again(tmp_path: Path) -> None:
    text = "DEBP CAS X*ENTIER ;\nFINP (X * {k}) ;\nT = TABL ESCLAVE ;\nT.1 = 4 ;\n"
    text += "R = ASSI 'TOUS' 'REPR' 'kept' CAS T ;\nMESS (R.1) ;\n"
    for k, shown in ((2, "8"), (3, "12"), (3, "12")):
        (tmp_path / "s.dgibi").write_text(text.format(k=k))
        command = [sys.executable, "-m", "gibiane", "s.dgibi"]
        run = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=PATIENCE)
        assert run.stdout.split() == [shown], run.stderr
    assert len(list((tmp_path / "kept").glob("*.zip"))) == 2


@needs_proc
@pytest.mark.parametrize("holds_the_study", [True, False])
def test_a_killed_worker_of_a_cluster_loses_no_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, holds_the_study: bool
) -> None:
    distributed = pytest.importorskip(
        "distributed", reason="SKIPPED LOUDLY: no dask.distributed, the cluster is not tested"
    )
    monkeypatch.setenv("PYTHONPATH", ENVIRONMENT["PYTHONPATH"])
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    ) as cluster:
        pids = {nanny.worker_address: nanny.pid for nanny in cluster.workers.values()}
        process = _run(tmp_path, "--dask", cluster.scheduler_address)
        with distributed.Client(cluster.scheduler_address) as client:
            holders: tuple[str, ...] = ()
            deadline = time.monotonic() + PATIENCE
            while not holders and time.monotonic() < deadline:
                time.sleep(0.02)
                holders = next((who for key, who in client.who_has().items() if str(key).startswith("bytes-")), ())
        first = holders[0]
        victim = pids[first] if holds_the_study else next(pid for address, pid in pids.items() if address != first)
        assert process.poll() is None, "the study was over before its worker was killed"
        os.kill(victim, signal.SIGKILL)
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    assert ANSWER in out


def test_no_cluster_at_the_address(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    process = _run(tmp_path, "--dask", "tcp://127.0.0.1:1")
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 8
    assert "error[G602]" in err
    assert "Traceback" not in err


def test_without_the_package_the_message_says_how_to_get_it(tmp_path: Path) -> None:
    (tmp_path / "distributed.py").write_text("raise ImportError('not here')\n")
    process = _run(tmp_path, "--dask", "tcp://127.0.0.1:1")
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 8
    assert "gibiane[dask]" in err


def test_a_case_without_memory_beside_others_is_run_again_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def local(package, numbers, count, make_session):
        for number in numbers:
            if number == 1:
                yield number, study.Answer(None, "error[G414]\n", 2, operator.NO_ROOM, "too little memory", 0.1)
            else:
                yield number, study.run_case(package, number, make_session)

    monkeypatch.setattr(operator.workers, "local", local)
    session = Session(out=io.StringIO(), err=io.StringIO())
    text = "OPTI ASSI 2 ; " + STUDY.format(keep="").replace("500000", "5")
    assert session.run_text(text) == 0, session.err.getvalue()
    assert ANSWER in session.out.getvalue()
    assert "G414" not in session.out.getvalue()
