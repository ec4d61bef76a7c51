"""``fleet support``: all that is needed, and none of the secrets that are planted everywhere."""

import json
import logging
import tarfile

import pytest

from fleet.clock import SystemClock
from fleet.config.masking import Masking
from fleet.history.store import History
from fleet.host.logs.line_format import JsonFormatter
from fleet.host.logs.rotating_file import RotatingLogFile
from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester

TOKEN, PASSWORD, INLINE = "tok-5f1e9a", 'pa"ss\\wörd-77', "in-line-3141"
HOOK = "https://hooks.example/T0/B1/xyzzy"
FROM_ENV, UNUSED, MANY = "env-27182818", "not-used-yet-161803", "first-line-1414\nsecond-line-1732"
ALL = (TOKEN, PASSWORD, HOOK, INLINE, FROM_ENV, UNUSED, *MANY.splitlines())
CONFIG = f"""\
edge: {{id: yard-1}}
cloud: {{host: 127.0.0.1, tls: false, username: anna, password: !secret broker}}
bus: {{user: fleet, password: "{INLINE}"}}
notify:
  - url: {HOOK}
plugins: [plugins]
x-note:
  api_token: |
    {MANY.splitlines()[0]}
    {MANY.splitlines()[1]}
robots:
  - name: rex
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
    adapter: toy
    link: sim:toy
"""


@pytest.fixture
def site(place, tmp_path, monkeypatch, runtime):
    """Make a fleet with secrets in its files, its environment, its log and its history."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("CYBERWAVE_API_KEY", FROM_ENV)
    (place / "fleet.yaml").write_text(CONFIG)
    secrets = place / "secrets.yaml"
    secrets.write_text(f"broker: {json.dumps(PASSWORD)}\ntoken: {TOKEN}\nunused: '{UNUSED}'\n")
    secrets.chmod(0o600)
    state = tmp_path / "state" / "fleet" / "yard-1"
    log = RotatingLogFile(state / "log" / "main.jsonl", JsonFormatter())
    store = History(state, SystemClock())
    for secret in ALL:
        line = logging.LogRecord("fleet", logging.INFO, "x.py", 1, "%s, %r", (secret, secret), None)
        log.handle(line)
        asker, text = Requester(Transport.CLOUD, "anna"), f"login {secret}"
        store.add("rex", EventReport(1.0, EventKind.COMMAND, text, asker=asker, data={"x": secret}))
    log.close()
    store.close()
    return place


def packed(path):
    with tarfile.open(path) as archive:
        members = [member for member in archive.getmembers() if member.isfile()]
        return {member.name: archive.extractfile(member).read() for member in members}


def written(secret):
    """Return the ways in which a secret may be written."""
    plain = json.dumps(secret)[1:-1]
    return {secret.encode(), plain.encode(), json.dumps(plain)[1:-1].encode(), repr(secret)[1:-1].encode()}


def test_what_helps_is_in_it_and_no_secret_is(fleet, site):
    result = fleet("support", "-o", "out.tar.gz", "--json")
    assert result.code == 0
    assert (site / "out.tar.gz").stat().st_mode & 0o777 == 0o600
    files = packed(site / "out.tar.gz")
    assert {
        f"fleet-support/{name}"
        for name in ("config/fleet.yaml", "versions.json", "history.jsonl", "log/main.jsonl", "problems.txt")
    } <= files.keys()
    for secret in ALL:
        leaks = [name for name, data in files.items() if any(form in data for form in written(secret))]
        assert leaks == [], secret
    assert b"name: rex" in files["fleet-support/config/fleet.yaml"]
    assert b"login" in files["fleet-support/history.jsonl"]
    assert list(result.json["left_out"]) == ["state.json"], "no edge runs"
    assert all(secret not in result.out + result.err for secret in ALL)


def test_a_file_that_cannot_be_used_is_packed_with_its_problems(fleet, site):
    (site / "fleet.yaml").write_text(CONFIG + "  - name: [\n")
    assert fleet("support", "-o", "out.tar.gz").code == 0
    files = packed(site / "out.tar.gz")
    assert b"fleet.yaml:" in files["fleet-support/problems.txt"]
    for secret in (TOKEN, PASSWORD, INLINE, FROM_ENV, UNUSED):
        assert [name for name, data in files.items() if secret.encode() in data] == []


def test_secrets_that_others_can_read_are_taken_out_all_the_same(fleet, site):
    (site / "secrets.yaml").chmod(0o644)
    assert fleet("support", "-o", "out.tar.gz").code == 0
    files = packed(site / "out.tar.gz")
    for secret in (TOKEN, PASSWORD, UNUSED):
        assert [name for name, data in files.items() if secret.encode() in data] == []


def test_an_archive_is_not_overwritten(fleet, site):
    (site / "out.tar.gz").write_text("mine")
    assert fleet("support", "-o", "out.tar.gz").code == 1
    assert (site / "out.tar.gz").read_text() == "mine"


def test_what_looks_like_a_secret_is_taken_out_though_nobody_knows_it():
    mask = Masking(())
    assert mask.text("tcp://anna:hunter2@host:1883/x") == "tcp://****@host:1883/x"
    assert "abcdefgh1234" not in mask.text("Authorization: Bearer abcdefgh1234")
    assert mask.text("rex: stopped") == "rex: stopped"
