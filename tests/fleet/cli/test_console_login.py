"""What ``fleet check`` asks of a console that people reach from other computers."""

from datetime import UTC, datetime, timedelta

import pytest

from fleet.config.certificates import Identity, issue_pair, make_authority
from fleet.console.people import Person, add_person

ROBOTS = """
robots:
  - {name: scout, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: ugv,
     profile: waveshare-rover, link: "sim:waveshare-rover"}
"""
TLS = "tls: {cert: web.pem, key: web.key}, people: people.json"


@pytest.fixture
def checked(fleet, place):
    """Check a fleet file whose console is this one."""

    def checked(console, days=365):
        now = datetime.now(UTC)
        authority = make_authority("site", now)
        identity = Identity("web", "console", ("console.test",), now + timedelta(days=days))
        pair = issue_pair(authority, identity, now)
        (place / "web.pem").write_bytes(pair.certificate)
        (place / "web.key").write_bytes(pair.key)
        (place / "other.key").write_bytes(issue_pair(authority, identity, now).key)
        (place / "fleet.yaml").write_text(f"edge: {{id: yard-1}}\nconsole: {{{console}}}\n{ROBOTS}")
        return fleet("check")

    return checked


@pytest.fixture
def people(place):
    add_person(place / "people.json", Person("anna", "view", "x"))
    return place / "people.json"


def test_a_console_with_certificate_and_people_is_valid(checked, people):
    result = checked(f"listen: '0.0.0.0:8443', {TLS}")
    assert (result.code, "is valid" in result.out) == (0, True)


@pytest.mark.parametrize("listen", ["0.0.0.0:8443", "10.0.0.5:8443", "[::]:8443", "127.0.0.1:8443"])
def test_a_console_that_listens_without_tls_is_refused(checked, people, listen):
    result = checked(f"listen: '{listen}'")
    assert result.code == 3
    assert "passwords and commands could be read and changed on the way; set tls: {cert, key}" in result.err


@pytest.mark.parametrize(
    "listen", ["8443", "example.org:8443", "0.0.0.0", "0.0.0.0:99999", "::8443", "1.2.3:1"]
)
def test_what_is_no_address_with_a_port_is_refused(checked, people, listen):
    result = checked(f"listen: '{listen}', {TLS}")
    assert (result.code, "console.listen" in result.err) == (3, True)


def test_a_console_at_which_nobody_could_log_in_is_refused(checked, place):
    result = checked(f"listen: '0.0.0.0:8443', {TLS}")
    assert result.code == 3
    assert f"no login is possible: there are no people in {place / 'people.json'}" in result.err
    assert "fleet console people add NAME" in result.err


def test_people_in_a_file_that_others_may_read_are_refused(checked, people):
    people.chmod(0o644)
    result = checked(f"listen: '0.0.0.0:8443', {TLS}")
    assert (result.code, f"chmod 600 {people}" in result.err) == (3, True)


def test_a_key_of_another_certificate_is_refused(checked, people):
    result = checked(f"listen: '0.0.0.0:8443', {TLS.replace('web.key', 'other.key')}")
    assert (result.code, "console.tls cannot be used" in result.err) == (3, True)


def test_tls_without_a_place_to_listen_is_refused(checked, people):
    result = checked(TLS)
    assert (result.code, "it is for listen, which is not there" in result.err) == (3, True)


def test_a_certificate_that_ends_soon_is_a_warning(checked, people):
    result = checked(f"listen: '0.0.0.0:8443', {TLS}", days=10)
    assert (result.code, "console.tls: certificate web.pem expires in" in result.err) == (0, True)
