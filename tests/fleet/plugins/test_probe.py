"""Drop-in files that do the worst they can while they are imported: one report each, no cost to others."""

import json
import os
import stat
import textwrap

import psutil
import pytest

from fleet.plugins.probe import ConfigCase, Probe, ProbeError, ProblemPlace, bare_environment
from fleet.plugins.registry import PluginState, Registry
from tests.tools.waiting import wait_until

TOY = """
from typing import Literal
from fleet import AdapterConfig, FrameAdapter

class Config(AdapterConfig):
    adapter: Literal["toy"]

class Toy(FrameAdapter[Config]):
    Config = Config
    def decode(self, frame, stamp): return ()
    def halt(self): return (b"",)
"""

FAULTS = {
    "hangs": ("import time\ntime.sleep(600)", "it hung while it was imported, and was given up"),
    "burns": ("while True: pass", "it hung while it was imported"),
    "hangs deaf": (
        "import signal, time\nfor n in (1, 2, 3, 13, 15): signal.signal(n, signal.SIG_IGN)\ntime.sleep(600)",
        "it hung while it was imported",
    ),
    "leaves": ("import os\nos._exit(7)", "its process ended while it was imported (exit code 7)"),
    "exits": ("import sys\nsys.exit(3)", "SystemExit: 3"),
    "crashes": ("import ctypes\nctypes.string_at(0)", "its process ended while it was imported (SIGSEGV)"),
    "kills itself": ("import os, signal\nos.kill(os.getpid(), signal.SIGKILL)", "(SIGKILL)"),
    "kills its group": ("import os, signal\nos.killpg(0, signal.SIGKILL)", "(SIGKILL)"),
    "becomes a daemon": (
        "import os, time\nif os.fork(): os._exit(0)\ntime.sleep(600)",
        "its process ended while it was imported (exit code 0)",
    ),
    "becomes another program": ("import os\nos.execv('/bin/true', ['true'])", "its process ended"),
    "interrupts": ("raise KeyboardInterrupt", "its process ended while it was imported"),
    "closes all": ("import os\nos.closerange(0, 99)", "its process ended while it was imported"),
    "eats memory": ("x = bytearray(4 << 30)", "MemoryError"),
    "talks nonsense": (
        "import os\nfor fd in range(3, 20):\n    try: os.write(fd, b'\\xff' * 64)\n    except OSError: pass",
        "its answer while it was imported cannot be read",
    ),
}


@pytest.fixture(autouse=True)
def _soon(monkeypatch):
    monkeypatch.setattr("fleet.plugins.probe.IMPORT_WITHIN", 5.0)


def write(folder, **files):
    for stem, text in files.items():
        (folder / f"{stem}.py").write_text(textwrap.dedent(text))


HANG = tuple(name for name, (_, report) in FAULTS.items() if "hung" in report)


@pytest.mark.parametrize("hang", [True, False])
def test_a_file_that_fails_at_import_is_one_report_and_leaves_nothing_behind(tmp_path, monkeypatch, hang):
    if hang:  # they are given up, one after another; the good file beside them has as much time again
        monkeypatch.setattr("fleet.plugins.probe.IMPORT_WITHIN", 1.5)
    faults = {name.replace(" ", "_"): FAULTS[name] for name in FAULTS if (name in HANG) is hang}
    write(tmp_path, toy=TOY, **{name: text for name, (text, _) in faults.items()})
    registry = Registry([])
    registry.add_folder(tmp_path)
    broken = {bad.name: bad for bad in registry.broken_files()}
    assert broken.keys() == faults.keys()
    for name, (_, report) in faults.items():
        assert (broken[name].origin, broken[name].state) == (str(tmp_path / f"{name}.py"), PluginState.FAILED)
        assert report in broken[name].report
    assert registry.get("toy").state is PluginState.LOADED
    registry.close()
    wait_until("nothing is left of them", lambda: not left_of(tmp_path))


def test_a_file_that_forks_at_import_is_asked_once_and_its_child_ends(tmp_path):
    write(tmp_path, toy="import os\nos.fork()\nos.fork()\n" + TOY)
    registry = Registry([])
    registry.add_folder(tmp_path)
    assert registry.get("toy").state is PluginState.LOADED
    registry.close()
    wait_until("nothing is left of it", lambda: not left_of(tmp_path))


def test_a_file_is_never_imported_in_this_process_and_gets_none_of_its_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("CYBERWAVE_API_KEY", "cw_canary")
    note = (
        f"import os\nopen({str(tmp_path / 'note')!r}, 'a').write(f'{{os.getpid()}} {{dict(os.environ)}}')\n"
    )
    write(tmp_path, toy=note + TOY)
    registry = Registry([])
    registry.add_folder(tmp_path)
    assert registry.get("toy").adapter is None
    said = (tmp_path / "note").read_text()
    assert int(said.split()[0]) != os.getpid()
    assert "PATH" in said
    assert "canary" not in said


def test_what_is_passed_on_holds_no_secret():
    given = {"PATH": "/bin", "LC_ALL": "C", "CYBERWAVE_API_KEY": "x", "AWS_SECRET_ACCESS_KEY": "x"}
    assert bare_environment(given) == {"PATH": "/bin", "LC_ALL": "C"}


def test_a_file_that_was_closed_is_asked_again_when_it_is_needed(tmp_path):
    write(tmp_path, toy=TOY)
    probe = Probe(tmp_path / "toy.py")
    assert [kind.name for kind in probe.found().kinds] == ["toy"]
    probe.close()
    data = json.dumps({"name": "rex", "twin": "6f0c9a1e-0000-4000-8000-000000000001", "adapter": "toy"})
    checked = probe.check(ConfigCase("toy", data, (), str(tmp_path), marks=(((), ProblemPlace("f", 1, 1)),)))
    assert json.loads(checked.fields)["name"] == "rex"
    assert json.loads(checked.given) == json.loads(data)


@pytest.mark.parametrize("text", ["import time\ntime.sleep(600)", "import os\nos._exit(7)"])
def test_a_config_that_hangs_or_exits_is_an_error(tmp_path, text, monkeypatch):
    monkeypatch.setattr("fleet.plugins.probe.CHECK_WITHIN", 1.0)
    bad = textwrap.indent(text, "        ")
    check = f"    def identity(self):\n{bad}\n\nclass Toy("
    write(tmp_path, toy=TOY.replace("\nclass Toy(", check))
    data = json.dumps({"name": "rex", "twin": "6f0c9a1e-0000-4000-8000-000000000001", "adapter": "toy"})
    probe = Probe(tmp_path / "toy.py")
    assert probe.found().kinds
    with pytest.raises(ProbeError, match="while it checked its robot's config"):
        probe.check(ConfigCase("toy", data, (), str(tmp_path), marks=(((), ProblemPlace("f", 1, 1)),)))
    assert left_of(tmp_path) == []


@pytest.mark.parametrize(("mode", "trusted"), [(0o755, True), (0o700, True), (0o775, False), (0o757, False)])
@pytest.mark.usefixtures("shared_probes")
def test_code_that_others_may_write_is_refused(tmp_path, mode, trusted):
    write(tmp_path, toy=TOY)
    for path in (tmp_path / "toy.py", tmp_path):
        before = stat.S_IMODE(path.stat().st_mode)
        path.chmod(mode)
        registry = Registry([])
        registry.add_folder(tmp_path)
        assert registry.names() == (("toy",) if trusted else ())
        reports = [plugin.report for plugin in registry.broken_files()]
        assert all("others may write it" in text and f"chmod go-w {path}" in text for text in reports)
        assert len(reports) == (0 if trusted else 1)
        registry.close()
        path.chmod(before)


def left_of(folder):
    """Return the processes that still run for a file of this folder."""
    named = [each.info["cmdline"] or [] for each in psutil.process_iter(["cmdline"])]
    return [words for words in named if any(str(folder) in word for word in words)]
