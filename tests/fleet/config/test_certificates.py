"""Certificates of a site: what they allow, for whom, and until when."""

from datetime import UTC, datetime, timedelta
from ipaddress import ip_address

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID

from fleet.config.certificates import (
    AUTHORITY_LIFE,
    SKEW,
    Identity,
    first_end,
    issue_pair,
    make_authority,
    read_identity,
)

NOW = datetime(2026, 11, 28, 12, tzinfo=UTC)
DESK = Identity("desk", "console", ("desk.local", "10.0.0.7", "2001:db8::1"), NOW + timedelta(days=90))


@pytest.fixture(scope="module")
def authority():
    return make_authority("yard", NOW)


@pytest.fixture(scope="module")
def desk(authority):
    return issue_pair(authority, DESK, NOW)


def certificate(pair):
    return x509.load_pem_x509_certificate(pair.certificate)


def extension(pair, kind):
    return certificate(pair).extensions.get_extension_for_class(kind)


def test_an_authority_signs_certificates_and_nothing_else(authority):
    limits = extension(authority, x509.BasicConstraints)
    assert (limits.critical, limits.value.ca, limits.value.path_length) == (True, True, 0)
    usage = extension(authority, x509.KeyUsage)
    assert (usage.critical, usage.value.key_cert_sign, usage.value.crl_sign) == (True, True, True)
    assert (usage.value.digital_signature, usage.value.key_agreement) == (False, False)
    assert read_identity(authority.certificate) == Identity("yard", "authority", (), NOW + AUTHORITY_LIFE)


def test_an_identity_is_read_as_it_was_issued(desk):
    assert read_identity(desk.certificate) == DESK


def test_an_identity_cannot_sign_and_serves_both_ends_of_a_connection(desk):
    limits = extension(desk, x509.BasicConstraints)
    assert (limits.critical, limits.value.ca) == (True, False)
    usage = extension(desk, x509.KeyUsage)
    assert (usage.critical, usage.value.digital_signature, usage.value.key_cert_sign) == (True, True, False)
    uses = set(extension(desk, x509.ExtendedKeyUsage).value)
    assert uses == {ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH}


def test_addresses_and_names_of_hosts_are_told_apart(desk):
    names = extension(desk, x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["desk.local"]
    assert names.get_values_for_type(x509.IPAddress) == [ip_address("10.0.0.7"), ip_address("2001:db8::1")]


def test_an_identity_without_hosts_has_none(authority):
    bare = Identity("anna", "operate", (), NOW + timedelta(days=1))
    assert read_identity(issue_pair(authority, bare, NOW).certificate) == bare


def test_a_certificate_is_signed_by_its_authority_and_by_no_other(authority, desk):
    issued, issuer = certificate(desk), certificate(authority)
    issued.verify_directly_issued_by(issuer)
    key = extension(desk, x509.AuthorityKeyIdentifier).value.key_identifier
    assert key == extension(authority, x509.SubjectKeyIdentifier).value.digest
    with pytest.raises(Exception):  # noqa: B017 - the library's own
        issued.verify_directly_issued_by(certificate(make_authority("yard", NOW)))


def test_a_certificate_is_valid_also_for_a_computer_whose_clock_is_slow(authority, desk):
    for pair in (authority, desk):
        assert certificate(pair).not_valid_before_utc == NOW - SKEW
    assert certificate(desk).not_valid_after_utc == DESK.until


def test_every_certificate_has_a_key_and_a_number_of_its_own(authority, desk):
    other = issue_pair(authority, DESK, NOW)
    assert other.key != desk.key
    assert certificate(other).serial_number != certificate(desk).serial_number
    key = load_pem_private_key(desk.key, None)
    assert key.public_key() == certificate(desk).public_key()
    assert key.curve.name == "secp256r1"


def test_the_first_end_of_several_certificates_counts(authority, desk):
    assert first_end(desk.certificate) == DESK.until
    assert first_end(authority.certificate + desk.certificate) == DESK.until
    assert first_end(desk.certificate + authority.certificate) == DESK.until


def test_a_subject_without_a_role_or_a_name_is_read_as_empty(authority):
    signer = load_pem_private_key(authority.key, None)
    bare = (
        x509.CertificateBuilder()
        .subject_name(x509.Name([]))
        .issuer_name(certificate(authority).subject)
        .public_key(signer.public_key())
        .serial_number(1)
        .not_valid_before(NOW)
        .not_valid_after(NOW + SKEW)
        .sign(signer, certificate(authority).signature_hash_algorithm)
    )
    assert read_identity(bare.public_bytes(Encoding.PEM)) == Identity("", "", (), NOW + SKEW)


@pytest.mark.parametrize(
    "data", [b"", b"rubbish", b"-----BEGIN CERTIFICATE-----\nx\n-----END CERTIFICATE-----\n"]
)
def test_what_is_no_certificate_is_a_value_error(authority, data):
    for read in (read_identity, first_end):
        with pytest.raises(ValueError):
            read(data)
    with pytest.raises(ValueError):
        issue_pair(authority._replace(key=data), DESK, NOW)
    with pytest.raises(ValueError):
        issue_pair(authority._replace(certificate=data), DESK, NOW)


def test_an_authority_of_another_kind_of_key_is_refused(authority):
    key = rsa.generate_private_key(65537, 1024)
    pem = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    with pytest.raises(ValueError, match="the authority's key is not on an elliptic curve"):
        issue_pair(authority._replace(key=pem), DESK, NOW)
