"""The program: its version without any other module, its exit code, and a Ctrl-C at any moment."""

import os
import subprocess
import sys

import pytest

import fleet.__main__ as module
from fleet.cli.interrupt import INTERRUPTED
from fleet.version import __version__

LOADED = """
import sys
from fleet.__main__ import main
sys.argv[1:] = ["--version"]
code = main()
print(code, sorted(name for name in sys.modules if name.startswith(("fleet", "click", "pydantic", "zenoh"))))
"""


@pytest.fixture
def called(monkeypatch):
    """Record what the program does around its command line."""
    calls = []
    monkeypatch.setattr(module, "restore_interrupt", lambda: calls.append("Ctrl-C raises"))
    monkeypatch.setattr(module, "end_on_interrupt", lambda: calls.append("Ctrl-C ends"))
    monkeypatch.setattr("fleet.host.runtime.shutdown.shutdown", lambda code: calls.append("shutdown") or code)
    return calls


def commanding(monkeypatch, *arguments, does):
    """Run the program with a command line that does this."""
    monkeypatch.setattr(sys, "argv", ["fleet", *arguments])
    monkeypatch.setattr("fleet.cli.main.main", does)
    return module.main()


def test_the_version_is_told_without_loading_the_rest():
    said = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, check=True)
    version, rest = said.stdout.splitlines()
    known = ["fleet", "fleet.__main__", "fleet.cli", "fleet.cli.interrupt", "fleet.version"]
    assert (version, rest) == (f"fleet {__version__}", f"0 {known}")


def test_the_version_is_told_only_where_nothing_else_is_asked(monkeypatch, called):
    given = []
    commanding(monkeypatch, "--version", "ps", does=lambda arguments: given.append(arguments) or 0)
    assert given == [["--version", "ps"]]


def test_a_command_ends_with_its_own_code_after_the_shutdown(monkeypatch, called):
    assert commanding(monkeypatch, "ps", does=lambda arguments: 5 if arguments == ["ps"] else 1) == 5
    assert called == ["Ctrl-C raises", "Ctrl-C ends", "shutdown"]


def test_a_ctrl_c_is_an_exit_code_and_no_traceback(monkeypatch, called, capsys):
    def interrupted(_arguments):
        raise KeyboardInterrupt

    assert commanding(monkeypatch, "ps", does=interrupted) == INTERRUPTED
    assert called == ["Ctrl-C raises", "Ctrl-C ends", "Ctrl-C ends"], "also where it came before the first"
    assert capsys.readouterr().err == ""


def test_the_end_of_a_command_that_failed_is_not_interrupted_either(monkeypatch, called):
    def fails(_arguments):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        commanding(monkeypatch, "ps", does=fails)
    assert called == ["Ctrl-C raises", "Ctrl-C ends"]


def test_no_link_takes_the_place_of_an_output_that_was_closed():
    program = (
        "import os, sys\nfor each in (0, 1): os.close(each)\nfrom fleet.__main__ import main\n"
        "sys.argv[1:] = ['--version']\nsys.stdout = sys.stderr\nmain()\n"
        "sys.stderr.write(' '.join(os.readlink(f'/proc/self/fd/{each}') for each in (0, 1)))"
        "\nsys.stderr.write(f' {os.open(os.devnull, os.O_RDONLY) > 2}')"
        "\nsys.stderr.write(f' {os.get_inheritable(0)}')"
    )
    said = subprocess.run([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True, check=True)
    assert said.stderr.splitlines()[-1] == f"{os.devnull} {os.devnull} True True"
