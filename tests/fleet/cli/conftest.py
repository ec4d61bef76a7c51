import json
from typing import NamedTuple

import pytest

from fleet.cli.main import main

TOY = """
from typing import Literal

from fleet import AdapterConfig, FrameAdapter


class ToyConfig(AdapterConfig):
    adapter: Literal["toy"]
    link: str


class Toy(FrameAdapter[ToyConfig]):
    Config = ToyConfig
    verbs = ("beep",)

    def encode(self, ask):
        return ()

    def decode(self, frame, stamp):
        return ()

    def halt(self):
        return (b"halt",)
"""
FLEET = """\
edge: {id: yard-1}
plugins: [plugins]
robots:
  - name: rex
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
    adapter: toy
    link: sim:toy
"""


class Result(NamedTuple):
    code: int
    out: str
    err: str

    @property
    def json(self):
        return json.loads(self.out)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Make a folder with a good fleet.yaml and a toy adapter; the current one for the time of the test."""
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "toy.py").write_text(TOY)
    (tmp_path / "fleet.yaml").write_text(FLEET)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    return tmp_path


@pytest.fixture
def fleet(place, capsys):
    """Run one command line in the folder."""

    def fleet(*arguments):
        code = main(arguments)
        return Result(code, *capsys.readouterr())

    return fleet
