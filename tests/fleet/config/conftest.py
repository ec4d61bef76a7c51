import pathlib
import textwrap

import pytest

from fleet.config.load import load
from fleet.config.problems import InvalidConfig
from fleet.plugins.registry import Registry

TOY = """
from typing import Literal

from pydantic import Field, SecretStr

from fleet import AdapterConfig, FrameAdapter


class ToyConfig(AdapterConfig):
    adapter: Literal["toy"]
    link: str = Field(description="Where the toy is.")
    system_id: int = Field(1, ge=1, le=255, description="The toy's number.")
    armed: bool = Field(False, description="Whether it is armed.")
    pace: Literal["slow", "fast"] = Field("slow", description="How fast it goes.")
    pin: SecretStr | None = Field(None, description="Its secret.")

    def identity(self):
        return f"{self.link}#{self.system_id}"


class Toy(FrameAdapter[ToyConfig]):
    Config = ToyConfig

    def decode(self, frame, stamp):
        return ()

    def halt(self):
        return (b"halt",)
"""


class Yard:
    """A folder with a fleet file and a toy adapter in it."""

    def __init__(self, folder: pathlib.Path):
        self.folder = folder
        self.file = folder / "fleet.yaml"
        (folder / "plugins").mkdir()
        (folder / "plugins" / "toy.py").write_text(TOY)

    def write(self, text, name="fleet.yaml", mode=0o644):
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(textwrap.dedent(text))
        path.chmod(mode)

    def load(self, text=None, environ=None, **options):
        if text is not None:
            self.write(text)
        return load(self.file, environ or {}, registry=Registry([]), **options)

    def problems(self, text=None, environ=None, **options):
        """Return each problem as ``line:column: path: message (hint)``."""
        with pytest.raises(InvalidConfig) as caught:
            self.load(text, environ, **options)
        return [str(problem).replace(f"{self.folder}/", "") for problem in caught.value.problems]


@pytest.fixture
def yard(tmp_path):
    return Yard(tmp_path)


@pytest.fixture
def fleet_text():
    return textwrap.dedent("""\
        edge:
          id: yard-1
        cloud:
          host: mqtt.example.com
          port: 8883
          tls: true
          token: cw_canary
        bus:
          mode: peer
          scouting: false
        plugins: [plugins]
        defaults:
          limits:
            speed: 5.0
        robots:
          - name: kestrel
            twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
            adapter: toy
            link: udpin:0.0.0.0:14550
            system_id: 1
            accepts:
              command: [tele]
          - name: rex
            twin: 0b7e7a52-3c1d-4f08-8f6e-5d2a9c4b1e73
            adapter: toy
            link: sim:toy
            armed: true
            pace: fast
            limits:
              altitude: 60
        groups:
          yard: [kestrel, rex]
        """)
