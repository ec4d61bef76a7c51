"""Certificates that expire are reported a month before, by their file and with what to do."""

import types
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from fleet.config.certificates import Identity, issue_pair, make_authority
from fleet.host.edge.certificate_expiry import CertificateExpiry, ending, files_of
from fleet.testing.clock import ManualClock

NOW = datetime(2026, 11, 28, 12, 0, tzinfo=UTC)
DAY = timedelta(days=1)


@pytest.mark.parametrize(
    ("left", "words"),
    [
        (31 * DAY, ""),
        (30 * DAY + timedelta(seconds=1), ""),
        (30 * DAY, "expires in 30 days, on 2026-12-28"),
        (DAY, "expires in 1 days, on 2026-11-29"),
        (timedelta(seconds=1), "expires in 0 days, on 2026-11-28"),
        (timedelta(), "has expired on 2026-11-28"),
        (-3 * DAY, "has expired on 2026-11-25"),
    ],
)
def test_a_certificate_is_reported_from_thirty_days_before_its_end_on(left, words):
    assert ending(NOW + left, NOW) == words


def section(*names):
    return types.SimpleNamespace(**{name: Path(f"{name}.pem") for name in names})


@pytest.mark.parametrize(
    ("bus", "console", "files"),
    [
        (None, None, {}),
        (section("root_ca", "cert"), None, {"root_ca": "bus.tls", "cert": "bus.tls"}),
        (None, section("cert"), {"cert": "console.tls"}),
        (section("root_ca"), section("cert"), {"root_ca": "bus.tls", "cert": "console.tls"}),
    ],
)
def test_the_certificates_of_bus_and_console_are_watched(bus, console, files):
    if bus is not None and not hasattr(bus, "cert"):
        bus.cert = bus.root_ca
    made = types.SimpleNamespace(
        bus=types.SimpleNamespace(tls=bus), console=console and types.SimpleNamespace(tls=console)
    )
    assert files_of(made) == {Path(f"{name}.pem"): where for name, where in files.items()}


@pytest.fixture(scope="module")
def authority():
    return make_authority("yard", NOW)


@pytest.fixture
def made(tmp_path, authority):
    """Make certificates that end in so many days; give what watches them, and its clock."""

    def made(**days):
        files = []
        for name, left in days.items():
            files.append(tmp_path / f"{name}.pem")
            identity = Identity(name, "edge", (), NOW + left * DAY)
            files[-1].write_bytes(issue_pair(authority, identity, NOW).certificate)
        clock = ManualClock(time=NOW.timestamp())
        return CertificateExpiry(files, clock), clock

    return made


def test_nothing_is_said_of_certificates_that_last(made):
    expiry, _ = made(edge=300)
    assert (expiry.problems, expiry.problem) == ([], "")
    assert expiry.first_end == "edge.pem is the first to end, on 2027-09-24"


def test_each_that_ends_is_named_with_what_to_do_as_time_goes_by(made):
    expiry, clock = made(edge=20, console=40)
    assert expiry.problems == [
        "certificate edge.pem expires in 20 days, on 2026-12-18; make a new one: fleet certs renew"
    ]
    clock.step(25 * 86_400)
    assert expiry.problem == (
        "certificate edge.pem has expired on 2026-12-18; make a new one: fleet certs renew; "
        "certificate console.pem expires in 15 days, on 2027-01-07; make a new one: fleet certs renew"
    )
    assert expiry.first_end == "edge.pem is the first to end, on 2026-12-18"


def test_one_that_cannot_be_read_is_named_and_the_others_are_watched(made, tmp_path):
    (tmp_path / "odd.pem").write_text("no certificate")
    expiry = CertificateExpiry([tmp_path / "odd.pem", tmp_path / "gone.pem"], ManualClock())
    assert expiry.problems == [
        "odd.pem is no certificate that can be read",
        "gone.pem is no certificate that can be read",
    ]
    assert expiry.first_end == ""


def test_a_file_that_is_changed_later_is_as_it_was_at_the_start(made, tmp_path):
    expiry, _ = made(edge=20)
    (tmp_path / "edge.pem").write_text("no certificate")
    assert "edge.pem expires in 20 days" in expiry.problem
