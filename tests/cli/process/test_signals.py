"""Ctrl-C and SIGTERM: one line and an exit code, at any moment, and no wait for what is left."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from commands import COMMAND, HEADING, log_text, names, write_model
from piezotrack._support.two_threads import two_threads

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C in another way")


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def stopped(command: list[str], after: float, number: signal.Signals) -> tuple[int, str, str]:
    """Send a signal some time after a command has printed its first line."""
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "begun\n"
            threading.Event().wait(after)
            process.send_signal(number)
            output, errors = process.communicate(timeout=60.0)
        finally:
            process.kill()
    return process.returncode, output, errors


BEGUN = [
    *(sys.executable, "-c"),
    f"{HEADING}; from piezotrack.cli.process import interruption; "
    "interruption.answer_signals(); print('begun', flush=True); main()",
]


@pytest.mark.slow
@pytest.mark.parametrize("after", [0.0, 0.002, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8])
@pytest.mark.parametrize(
    ("number", "code", "word"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
)
def test_a_signal_while_modules_are_imported_is_one_line(
    number: signal.Signals, code: int, word: str, after: float
) -> None:
    Path("log.csv").write_text(log_text(), encoding="utf-8")
    search = ["identify", "log.csv", "--model", "dahl", "--runs", "500"]
    found = stopped([*BEGUN, *search], after, number)
    assert found[:2] == (code, "")
    assert re.fullmatch(rf"piezotrack: (interrupted|{word})[^\n]*\n", found[2]), found[2]


# Every file takes a while to be renamed.
SLOWLY = """
import pathlib, time
from piezotrack.cli import main
from piezotrack._support.files import sets
rename, replace = sets._rename, pathlib.Path.replace
def slowly(path, target):
    time.sleep(0.05)
    return replace(path, target)
def begun(*all):
    print("begun", flush=True)
    rename(*all)
pathlib.Path.replace, sets._rename = slowly, begun
main()
"""


@pytest.mark.slow
@pytest.mark.parametrize("after", [0.0, 0.03, 0.08, 0.13, 0.18])
def test_sigterm_while_results_are_put_in_place_leaves_them_whole(after: float) -> None:
    write_model()
    work = ["feedforward", "dahl.json", "sine:0.5Hz,0..50um,2s", "--dt", "0.02"]
    code, _, errors = stopped([sys.executable, "-c", SLOWLY, *work], after, signal.SIGTERM)
    # It may come when all is done, and the interpreter no longer answers.
    said = {143: "piezotrack: terminated\n", 0: "", -signal.SIGTERM: ""}
    assert errors == said[code]
    written = [f"feedforward.{ending}" for ending in ("csv", "png", "svg")]
    assert names("results") in ([], written)


# A command that does what is appended.
WAIT = """
import os, signal, sys, threading, time, weakref
from piezotrack.cli import main
from piezotrack.cli.commands import app
from piezotrack.cli.error_messages import report_errors
def press():
    signal.raise_signal(signal.SIGINT)
@app.command("wait")
@report_errors
def wait() -> None:
    {}
sys.argv[1:] = ["wait"]
main()
"""
LOST = {
    "in a callback of the interpreter": """class One: pass
    one = One()
    kept = weakref.ref(one, lambda _: press())
    del one
    time.sleep(50)""",
    "caught by somebody": """try: press()
    except KeyboardInterrupt: pass
    time.sleep(50)""",
    "turned into another error": """try: press()
    except KeyboardInterrupt: raise ImportError("core")""",
    "while seeds are under way": """from piezotrack.xu_li_2010 import reproduction
    begun = threading.Semaphore(0)
    reproduction.run_experiments = lambda *_: (begun.release(), time.sleep(50))
    def later():
        begun.acquire(), begun.acquire(), os.kill(os.getpid(), signal.SIGINT)
    threading.Thread(target=later).start()
    reproduction._scored(None, range(4), reproduction.ProgressBar(False, "test"))""",
    "put into words by a codec": """import codecs
    def decode(raw, errors="strict"): press()
    codecs.register(lambda name: name == "odd" and codecs.CodecInfo(None, decode) or None)
    b"x".decode("odd")""",
    "while threads compute": """threading.Thread(target=time.sleep, args=(50,)).start()
    press()""",
}


@pytest.mark.parametrize("how", LOST)
def test_an_interruption_is_not_lost(how: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WAIT.format(LOST[how])],
        capture_output=True,
        text=True,
        timeout=30.0,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "piezotrack: interrupted\n")


def test_a_signal_that_was_ignored_from_the_start_is_ignored() -> None:
    ignored = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    body = WAIT.format("press()\n    print('still here')")
    done = subprocess.run(
        [sys.executable, "-c", ignored + body],
        capture_output=True,
        text=True,
        timeout=30.0,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "still here\n", "")


def test_after_an_interruption_threads_are_not_waited_for() -> None:
    """What has begun goes on by itself, and nothing else begins."""
    free, begun = threading.Event(), threading.Semaphore(0)

    def work(_: int) -> None:
        begun.release()
        free.wait(60.0)

    def press() -> None:
        with two_threads() as pool:
            waiting.extend(pool.submit(work, number) for number in range(5))
            for _ in range(2):
                begun.acquire()
            raise KeyboardInterrupt

    waiting: list[object] = []
    try:
        with pytest.raises(KeyboardInterrupt):
            press()
        states = [(one.running(), one.cancelled()) for one in waiting]  # type: ignore[attr-defined]
        assert states == [(True, False)] * 2 + [(False, True)] * 3
    finally:
        free.set()


def test_python_m_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "piezotrack", "--version"], capture_output=True, check=True
    )
    from_main = subprocess.run([*COMMAND, "--version"], capture_output=True, check=True)
    assert done.stdout == from_main.stdout
