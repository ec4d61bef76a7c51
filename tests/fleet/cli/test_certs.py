import stat
import subprocess
from datetime import UTC, datetime, timedelta

import pytest

from fleet.bus.bus import join, open_edge
from fleet.bus.settings import BusSettings, BusTls
from fleet.clock import SystemClock
from fleet.config.certificates import issue_pair, make_authority, read_identity
from fleet.errors import BusError
from fleet.host.edge.certificate_expiry import CertificateExpiry

TLS = "bus: {listen: ['tls/127.0.0.1:0'], access: {}, tls: {root_ca: certs/ca.pem, "
TLS += "cert: certs/yard-1.pem, key: certs/yard-1.key}}\n"


@pytest.fixture
def site(fleet, place):
    """Make a site's authority; gives the folder."""
    assert fleet("certs", "init", "site").code == 0
    return place / "certs"


def aged(site, **left):
    """Put a certificate of yard-1 in place that ends in so long."""
    now = datetime.now(UTC) - timedelta(days=100)
    authority = make_authority("site", now)
    identity = read_identity((site / "yard-1.pem").read_bytes())._replace(
        until=datetime.now(UTC) + timedelta(**left)
    )
    (site / "yard-1.pem").write_bytes(issue_pair(authority, identity, now).certificate)


def test_a_site_has_keys_that_nobody_else_reads(fleet, site):
    result = fleet("certs", "issue", "yard-1", "--as", "edge", "--host", "10.0.0.7")
    assert result.code == 0
    assert result.out.startswith("wrote certs/yard-1.pem and .key, good until ")
    assert "bus.access: {yard-1: edge}" in result.err
    for name in ("ca.key", "yard-1.key"):
        assert stat.S_IMODE((site / name).stat().st_mode) == 0o600
    assert stat.S_IMODE(site.stat().st_mode) == 0o700
    identity = read_identity((site / "yard-1.pem").read_bytes())
    assert (identity.name, identity.role) == ("yard-1", "edge")
    assert identity.hosts == ("10.0.0.7", "yard-1", "localhost", "127.0.0.1")


def test_other_programs_find_the_certificates_good(fleet, site, program):
    fleet("certs", "issue", "yard-1", "--as", "edge")
    checked = subprocess.run(
        [program("openssl"), "verify", "-x509_strict", "-CAfile", "ca.pem", "yard-1.pem"],
        cwd=site,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (checked.returncode, checked.stdout) == (0, "yard-1.pem: OK\n"), checked


def test_edges_let_each_other_in_by_them(fleet, site, runtime, free_port):
    for name in ("yard-1", "desk"):
        fleet("certs", "issue", name, "--as", "edge")
    there = (f"tls/127.0.0.1:{free_port}",)

    def tls(name):
        return BusTls(*(str(site / file) for file in ("ca.pem", f"{name}.pem", f"{name}.key")), mutual=True)

    edge = open_edge(BusSettings("yard-1", listen=there, tls=tls("yard-1")), runtime)
    try:
        join(BusSettings("away", connect=there, tls=tls("desk")), runtime).close()
        aged(site, days=-1)
        (site / "desk.pem").write_bytes((site / "yard-1.pem").read_bytes())
        with pytest.raises(BusError, match="cannot join the bus"):
            join(BusSettings("away", connect=there, tls=tls("desk")), runtime)
    finally:
        edge.close()


def test_nothing_is_ever_overwritten_but_by_renewal(fleet, site):
    assert fleet("certs", "init", "site").code == 1
    fleet("certs", "issue", "yard-1", "--as", "edge", "--host", "yard.local")
    before = {path.name: path.read_bytes() for path in site.iterdir()}
    assert "is there already" in fleet("certs", "issue", "yard-1", "--as", "console").err
    assert {path.name: path.read_bytes() for path in site.iterdir()} == before
    assert fleet("certs", "renew", "yard-1", "--days", "10").code == 0
    assert (site / "yard-1.key").read_bytes() != before["yard-1.key"]
    identity = read_identity((site / "yard-1.pem").read_bytes())
    assert (identity.role, identity.hosts[0]) == ("edge", "yard.local")
    assert identity.until < datetime.now(UTC) + timedelta(days=11)


def test_a_revoked_name_is_never_issued_again_and_what_makes_it_so_is_said(fleet, site):
    fleet("certs", "issue", "desk", "--as", "console")
    result = fleet("certs", "revoke", "desk")
    assert result.code == 0
    assert "IT IS STILL ACCEPTED until desk is removed from bus.access of every edge" in result.err
    assert fleet("certs", "renew", "desk").code == 1
    (site / "desk.pem").unlink()
    assert "desk is revoked" in fleet("certs", "issue", "desk", "--as", "console").err


def test_all_certificates_are_shown_with_their_state(fleet, site):
    for name in ("yard-1", "desk"):
        fleet("certs", "issue", name, "--as", "edge")
    fleet("certs", "revoke", "desk")
    aged(site, days=20, hours=1)
    states = {row["name"]: row["state"] for row in fleet("certs", "ls", "--json").json["certificates"]}
    assert (states["site"], states["desk"]) == ("good", "revoked")
    assert states["yard-1"].startswith("expires in 20 days, on ")


@pytest.mark.parametrize(
    ("arguments", "code", "expected"),
    [
        (("issue", "../x", "--as", "edge"), 2, "is no name"),
        (("issue", "ca", "--as", "edge"), 2, "is no name"),
        (("issue", "a b", "--as", "edge"), 2, "is no name"),
        (("issue", "x", "--as", "king"), 2, "'king' is not one of"),
        (("renew", "nobody"), 1, "cannot read certs/nobody.pem"),
        (("revoke", "nobody"), 1, "cannot read certs/nobody.pem"),
        (("ls", "-d", "."), 1, "begin with: fleet certs init SITE"),
    ],
)
def test_what_cannot_be_is_refused(fleet, site, arguments, code, expected):
    result = fleet("certs", *arguments)
    assert result.code == code
    assert expected in result.err


@pytest.mark.parametrize(
    ("left", "expected"),
    [({"days": 31}, ""), ({"days": 29, "hours": 1}, "expires in 29 days"), ({"days": -1}, "has expired on")],
)
def test_the_end_of_a_certificate_is_reported_thirty_days_ahead(fleet, site, place, left, expected):
    fleet("certs", "issue", "yard-1", "--as", "edge")
    aged(site, **left)
    (place / "fleet.yaml").write_text((place / "fleet.yaml").read_text() + TLS)
    result = fleet("check")
    assert result.code == 0
    assert (expected in result.err) if expected else (result.err == "")
    assert [warning["path"] for warning in fleet("check", "--json").json["warnings"]] == ["bus.tls"] * bool(
        expected
    )


def test_a_certificate_that_cannot_be_read_is_reported(tmp_path):
    (tmp_path / "ca.pem").write_text("nothing")
    expiry = CertificateExpiry([tmp_path / "ca.pem", tmp_path / "none.pem"], SystemClock())
    assert expiry.problem == (
        "ca.pem is no certificate that can be read; none.pem is no certificate that can be read"
    )
