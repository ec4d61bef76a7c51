"""What a backup has of an edge, and what it must not have."""

import sqlite3

import pytest

from fleet.backup.making import pack
from fleet.config.load import sections_of
from fleet.console.people import Person, add_person

FILE = """\
edge: {id: yard-1}
plugins: [plugins]
cloud: {host: mqtt.example.com, token: !secret cyberwave_token}
bus:
  listen: [tls/0.0.0.0:7447]
  tls: {root_ca: certs/ca.pem, cert: certs/yard-1.pem, key: certs/yard-1.key}
notify:
  - {url: "https://hooks.example.com/T0KEN-OF-THE-HOOK"}
robots: !include robots.yaml
"""
ROBOTS = """\
- name: rex
  twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
  adapter: toy
  body: bodies/rex.yaml
"""


@pytest.fixture
def site(tmp_path):
    """Make the folder of a fleet file with everything that it names."""
    folder = tmp_path / "site"
    for name, text in {
        "fleet.yaml": FILE,
        "robots.yaml": ROBOTS,
        "secrets.yaml": "cyberwave_token: THE-VALUE-OF-THE-TOKEN\n",
        "plugins/toy.py": "import fleet\n",
        "bodies/rex.yaml": "legs: 4\n",
        "certs/ca.pem": "-----BEGIN CERTIFICATE-----\n",
        "certs/yard-1.pem": "-----BEGIN CERTIFICATE-----\n",
        "certs/yard-1.key": "-----BEGIN PRIVATE KEY-----\nTHE-KEY\n",
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    (folder / "secrets.yaml").chmod(0o600)
    return folder


def packed(site, state):
    file = site / "fleet.yaml"
    return pack(file, sections_of(file, {}), state, {}, 1e9)


def test_everything_that_the_fleet_file_names_is_in_it(site, tmp_path):
    assert set(packed(site, tmp_path / "none").contents) == {
        "config/fleet.yaml",
        "config/robots.yaml",
        "config/plugins/toy.py",
        "config/bodies/rex.yaml",
        "config/certs/ca.pem",
        "config/certs/yard-1.pem",
    }


def test_no_value_of_a_secret_is_in_it_but_every_name(site, tmp_path):
    found = packed(site, tmp_path / "none")
    everything = b"".join(found.contents.values())
    assert not [word for word in (b"THE-VALUE", b"THE-KEY", b"T0KEN") if word in everything]
    assert (found.manifest.secrets, found.manifest.keys) == (("cyberwave_token",), ("certs/yard-1.key",))
    assert found.manifest.masked == ("fleet.yaml",)


def test_a_file_that_is_not_beside_the_fleet_file_is_reported(site, tmp_path):
    (tmp_path / "elsewhere.yaml").write_text("x: 1\n")
    (site / "robots.yaml").write_text(ROBOTS.replace("bodies/rex.yaml", str(tmp_path / "elsewhere.yaml")))
    found = packed(site, tmp_path / "none")
    assert found.left_out == (f"{tmp_path / 'elsewhere.yaml'}: it is not beside the fleet file",)


def test_the_state_of_an_edge_that_writes_is_copied_whole(site, tmp_path):
    state = tmp_path / "state"
    state.mkdir()
    writer = sqlite3.connect(state / "history.db", isolation_level=None)
    writer.executescript("PRAGMA journal_mode = WAL; PRAGMA user_version = 1; CREATE TABLE event (n);")
    writer.execute("INSERT INTO event VALUES (1)")  # in the -wal file alone
    writer.execute("BEGIN IMMEDIATE")
    writer.execute("INSERT INTO event VALUES (2)")
    try:
        copy = packed(site, state).contents["state/history.db"]
    finally:
        writer.close()
    (tmp_path / "copy.db").write_bytes(copy)
    reader = sqlite3.connect(tmp_path / "copy.db")
    assert reader.execute("SELECT n FROM event").fetchall() == [(1,)]
    reader.close()


def test_the_people_who_may_log_in_at_the_console_are_in_it(site, tmp_path):
    add_person(tmp_path / "state" / "console-people.json", Person("anna", "view", "$argon2id$x"))
    assert b'"anna"' in packed(site, tmp_path / "state").contents["state/console-people.json"]
