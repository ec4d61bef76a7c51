"""fleet run starts the edge, or one worker, below a supervisor, with the options that it was given."""

import os
import resource
import sys

import pytest

from fleet.cli import run as module
from fleet.config.edge_id import EDGE_ID

PYTHON = [sys.executable, "-P", "-m"]


@pytest.fixture
def supervised(fleet, monkeypatch):
    """Return a function that runs a command line; it returns the result, and what is supervised."""
    started = []

    class Supervisor:
        def __init__(self, command, **given):
            started.append((command, given))

        def run(self):
            return 7

    monkeypatch.setattr(module, "Supervisor", Supervisor)
    monkeypatch.setenv(EDGE_ID, "")

    def run(*arguments):
        result = fleet("run", *arguments)
        ((command, given),) = started
        return result, command, given

    return run


LINES = [
    ((), ["--no-color", "--log-format", "text", "--", "fleet.yaml"]),
    (("my.yaml",), ["--no-color", "--log-format", "text", "--", "my.yaml"]),
    (("--json",), ["--json", "--no-color", "--log-format", "text", "--", "fleet.yaml"]),
    (("-vv", "--watch"), ["--no-color", "-v", "-v", "--watch", "--log-format", "text", "--", "fleet.yaml"]),
    (
        ("--log-format", "json", "--log-file", "a.log"),
        ["--no-color", "--log-format", "json", "--log-file", "a.log", "--", "fleet.yaml"],
    ),
    (("--", "-x.yaml"), ["--no-color", "--log-format", "text", "--", "-x.yaml"]),
]


@pytest.mark.parametrize(("arguments", "passed"), LINES)
def test_the_edge_gets_the_options_of_the_command(supervised, arguments, passed):
    result, command, given = supervised(*arguments)
    assert command == [*PYTHON, "fleet", "run-edge", *passed]
    assert given["notice_command"] == [*PYTHON, "fleet.bridge.disconnect_program"]
    assert result.code == 7, "that of the edge"


def test_an_edge_on_a_terminal_may_use_colours(supervised, monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    _, command, _ = supervised()
    assert "--no-color" not in command


def test_a_worker_of_another_computer_runs_without_an_edge_and_its_notice(supervised):
    _, command, given = supervised("my.yaml", "--worker", "limbs", "--watch")
    worker = ["fleet.host.workers.worker_process", "--name", "limbs", "--config", "my.yaml"]
    assert (command, given["notice_command"]) == ([*PYTHON, *worker], ())


@pytest.mark.parametrize(("arguments", "said"), [((), ""), (("--edge-id", "yard-b"), "yard-b")])
def test_which_edge_of_a_pair_this_is_is_passed_on_by_the_environment(supervised, arguments, said):
    supervised(*arguments)
    assert os.environ[EDGE_ID] == said


def test_nothing_of_the_folder_in_which_it_runs_is_imported_in_place_of_fleet(supervised):
    _, command, given = supervised()
    assert "-P" in command
    assert "-P" in given["notice_command"]


@pytest.mark.parametrize(
    ("limits", "raised"),
    [
        ((1024, 4096), (4096, 4096)),
        ((4096, 4096), (4096, 4096)),
        ((1024, resource.RLIM_INFINITY), (1024, resource.RLIM_INFINITY)),
    ],
)
def test_an_edge_may_open_as_many_descriptors_as_the_system_lets_it(supervised, monkeypatch, limits, raised):
    """Each robot's link needs one."""
    found = []
    monkeypatch.setattr(
        resource, "getrlimit", lambda kind: limits if kind == resource.RLIMIT_NOFILE else None
    )
    monkeypatch.setattr(resource, "setrlimit", lambda kind, value: found.append((kind, value)))
    supervised()
    assert found == [(resource.RLIMIT_NOFILE, raised)]
