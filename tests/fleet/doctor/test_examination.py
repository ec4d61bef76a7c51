"""The whole examination: what is put together, what is not touched, and that one check hides no other."""

import sys
import time
from datetime import UTC, datetime, timedelta

import pytest

from fleet.config.certificates import Identity, issue_pair, make_authority
from fleet.doctor import examination
from fleet.doctor.examination import examine
from fleet.doctor.finding import Rating
from fleet.model.state import EdgeState

FILE = """\
edge: {id: yard-1}
plugins: [plugins]
metrics: {port: 9464}
robots:
  - name: kestrel
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
    adapter: toy
    link: serial:/dev/no-such?baud=57600
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    (tmp_path / "run").mkdir()
    monkeypatch.setenv("FLEET_RUNTIME_DIR", str(tmp_path / "run"))
    (tmp_path / "plugins").mkdir(mode=0o700)
    (tmp_path / "plugins" / "toy.py").write_text("import pathlib; pathlib.Path('imported').touch()\n")
    (tmp_path / "plugins" / "toy.py").chmod(0o600)
    (tmp_path / "fleet.yaml").write_text(FILE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path


def found_in(findings, check):
    return [each for each in findings if each.check == check]


def test_every_part_is_looked_at_and_no_plugin_is_imported(place):
    before = set(sys.modules)
    findings = examine(place / "fleet.yaml")
    assert {"clock", "disk", "permissions", "devices", "ports", "fleet file", "edges"} <= {
        each.check for each in findings
    }
    assert not (place / "imported").exists()
    assert not {name for name in set(sys.modules) - before if name.startswith("fleet_")}
    (device,) = found_in(findings, "devices")
    assert (device.verdict, "/dev/no-such" in device.found) == (Rating.ERROR, True)


def test_a_wrong_fleet_file_is_reported_and_the_rest_is_looked_at(place):
    (place / "fleet.yaml").write_text("edge: {id: YARD}\nrobots: [{}]\n")
    findings = examine(place / "fleet.yaml")
    assert found_in(findings, "fleet file")[0].verdict is Rating.ERROR
    assert found_in(findings, "clock")


def test_the_certificate_of_the_console_is_reported_with_its_last_day(place):
    now = datetime.now(UTC)
    end = now + timedelta(days=300)
    authority = make_authority("site", now)
    pair = issue_pair(authority, Identity("web", "console", ("console.test",), end), now)
    (place / "web.pem").write_bytes(pair.certificate)
    (place / "web.key").write_bytes(pair.key)
    console = "console: {listen: '0.0.0.0:8443', tls: {cert: web.pem, key: web.key}}\n"
    (place / "fleet.yaml").write_text(FILE + console)
    (finding,) = found_in(examine(place / "fleet.yaml"), "tls")
    assert finding.verdict is Rating.OK
    assert finding.found == f"certificates are valid; web.pem is the first to end, on {end:%Y-%m-%d}"


def test_a_check_that_fails_itself_hides_no_other(place, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr(examination.disk, "check_disk", broken)
    findings = examine(place / "fleet.yaml")
    assert found_in(findings, "disk")[0].verdict is Rating.UNKNOWN
    assert found_in(findings, "ports")


class Asked:
    """Edges that answer, and one that does not."""

    unreached = ("edge yard-2: it lets nobody in",)

    @classmethod
    def reach(cls, _file):
        return cls()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def edges(self):
        return [EdgeState("yard-1", "0.0.1", time.time(), 1.0)]

    def silent(self, _found):
        return []


def test_the_edges_that_run_are_asked_over_the_bus(place, monkeypatch):
    monkeypatch.setattr(examination, "Edges", Asked)
    findings = examine(place / "fleet.yaml")
    silent, older = found_in(findings, "edges")
    assert (silent.verdict, silent.found) == (Rating.ERROR, Asked.unreached[0])
    assert (older.verdict, "yard-1 runs fleet 0.0.1" in older.found) == (Rating.WARNING, True)
