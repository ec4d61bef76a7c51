import importlib.util
import pathlib
import sys
import textwrap
from importlib.metadata import EntryPoint

import pytest

from fleet.config.load import load
from fleet.config.problems import InvalidConfig
from fleet.config.yaml import read
from fleet.plugins.registry import GROUP, Registry

TOY = pathlib.Path(__file__).with_name("toy.py")
_spec = importlib.util.spec_from_file_location("toy_for_config", TOY)
sys.modules["toy_for_config"] = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(sys.modules["toy_for_config"])
INSTALLED = EntryPoint(name="toy", value="toy_for_config:Toy", group=GROUP)


class Yard:
    """A folder with a fleet file, and a toy adapter: installed, or (``drop_in``) a file in its plugin folder.

    A drop-in file is asked in a process of its own, which tests with the same file share.
    """

    def __init__(self, folder: pathlib.Path):
        self.folder = folder
        self.file = folder / "fleet.yaml"
        (folder / "plugins").mkdir()
        self.installed = [INSTALLED]

    def drop_in(self):
        """Have the toy as a drop-in file from now on."""
        (self.folder / "plugins" / "toy.py").write_bytes(TOY.read_bytes())
        self.installed = []

    def write(self, text, name="fleet.yaml", mode=0o644):
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(textwrap.dedent(text))
        path.chmod(mode)

    def load(self, text=None, environ=None, **options):
        if text is not None:
            self.write(text)
        return load(self.file, environ or {}, registry=Registry(self.installed), **options)

    def problems(self, text=None, environ=None, **options):
        """Return each problem as ``line:column: path: message (hint)``."""
        with pytest.raises(InvalidConfig) as caught:
            self.load(text, environ, **options)
        return [str(problem).replace(f"{self.folder}/", "") for problem in caught.value.problems]


@pytest.fixture
def yard(tmp_path, shared_probes):
    return Yard(tmp_path)


@pytest.fixture
def reading(tmp_path):
    def reading(text, environ=None):
        path = tmp_path / "fleet.yaml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read(path, environ or {})

    return reading


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
