"""The command line of the simulated bases."""

from pathlib import Path

import pytest

from fleet_ugv.sim import __main__ as module
from fleet_ugv.sim.__main__ import main
from fleet_ugv.sim.spec import BaseSpec


class Server:
    """The server of the bases, of which a test sees what it is asked for."""

    made = None

    def __init__(self, folder):
        self.folder, self.added, self.obeys = folder, [], None
        assert folder.is_dir()
        Server.made = self

    async def add(self, spec):
        self.added.append(spec)

    async def serve(self, *, obeys):
        self.obeys = obeys


@pytest.fixture(autouse=True)
def server(monkeypatch):
    monkeypatch.setattr(module, "Bases", Server)
    monkeypatch.setattr(Server, "made", None)


def test_a_base_of_the_command_line_is_served():
    assert main(["--profile", "hoverboard", "--fault", "loss:0.05,mute", "--seed", "7"]) == 0
    assert Server.made.added == [BaseSpec("hoverboard", 7, {"loss": 0.05, "mute": 1.0})]
    assert Server.made.obeys is False


def test_without_one_the_lines_of_stdin_say_what_is_served():
    assert main(["--stdin"]) == 0
    assert (Server.made.added, Server.made.obeys) == ([], True)


def test_the_folder_of_the_device_files_is_gone_in_the_end():
    main(["--stdin"])
    assert not Path(Server.made.folder).exists()


@pytest.mark.parametrize("fault", ["los:0.1", "loss:2", "loss:x"])
def test_a_fault_that_there_is_not_is_said(fault, capsys):
    assert main(["--profile", "hoverboard", "--fault", fault]) == 2
    assert "fleet_ugv.sim: " in (said := capsys.readouterr().err)
    assert "los" in said


def test_a_device_that_cannot_be_made_is_said(monkeypatch, capsys):
    async def serve(self, *, obeys):
        raise OSError("out of pty devices")

    monkeypatch.setattr(Server, "serve", serve)
    assert main(["--stdin"]) == 2
    assert capsys.readouterr().err == "fleet_ugv.sim: out of pty devices\n"


@pytest.mark.parametrize("arguments", [["--profile", "tank"], ["--seed", "x"], ["--nothing"]])
def test_wrong_arguments_are_refused_with_the_usage(arguments, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert "python -m fleet_ugv.sim" in capsys.readouterr().err
