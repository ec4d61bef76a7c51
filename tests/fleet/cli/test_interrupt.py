"""Ctrl-C is no traceback, whenever it comes."""

import signal
import subprocess
import sys

import pytest

from fleet.model.command import Reply, ReplyStatus

PROGRAM = """
import atexit, os, signal, sys, threading
from fleet.__main__ import main
moment = sys.argv[1]

def interrupt(*_):
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1000):  # Python looks for signals between its own steps
        pass

def audit(event, arguments):
    if event == "import" and arguments[0] == moment:
        interrupt()

if moment == "atexit":
    atexit.register(interrupt)
elif moment == "threads":
    threading._register_atexit(interrupt)
else:
    sys.addaudithook(audit)
sys.argv[1:] = sys.argv[2:]
sys.exit(main())
"""


def quiet(code, err):
    """Return whether a program that was interrupted said nothing, and ended as such."""
    return err.strip() == "" and code in (130, -signal.SIGINT)


@pytest.mark.parametrize(
    "moment",
    [
        "click",
        "fleet.cli.main",
        "fleet.config.load",
        "pydantic",
        "yaml",
        "zenoh",
        "msgspec",
        "atexit",
        "threads",
    ],
)
def test_in_the_middle_of_an_import_or_of_the_end_nothing_is_said(place, runtime, moment):
    command = ["ps"] if moment == "zenoh" else ["check"]
    program = [sys.executable, "-c", PROGRAM, moment, *command]
    done = subprocess.run(program, check=False, capture_output=True, text=True, timeout=60)
    assert quiet(done.returncode, done.stderr), done.stderr


@pytest.mark.parametrize("command", [["--help"], ["--version"]])
def test_a_program_that_was_set_to_ignore_ctrl_c_goes_on(command):
    ignoring = f"trap '' INT; {sys.executable} -c \"$0\" click {' '.join(command)}"
    done = subprocess.run(["sh", "-c", ignoring, PROGRAM], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_at_a_question_nothing_but_the_end_of_the_line_is_said(terminal):
    requesting = terminal("spool", "purge")
    requesting.reads("[y/N]")
    requesting.interrupt()
    assert requesting.ended() == -signal.SIGINT  # by the signal itself, which no moment can lose
    assert requesting.text.partition("[y/N]:")[2].strip() == ""


def test_while_an_answer_is_waited_for_nothing_is_said(terminal, play_edge):
    edge = play_edge("yard-1", robots={"rex": {"health": "ok"}})
    edge.answers_late(
        "rex", Reply("beep", ReplyStatus.ACCEPTED), Reply("beep", ReplyStatus.ACCEPTED, done=True)
    )
    requesting = terminal("send", "rex", "beep", "--wait")
    requesting.reads("accepted")
    requesting.interrupt()
    assert requesting.ended() == 130
    assert "Traceback" not in requesting.text
    assert requesting.text.partition("accepted")[2].strip() == ""
