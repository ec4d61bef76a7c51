"""Certificates of a site: its authority, and one for each identity on the bus (X.509, ECDSA on P-256).

The common name is the identity, the organisational unit its role. Pure functions on PEM data; the time is an
argument. Raises ValueError for data that is not PEM.
"""

from __future__ import annotations

import ipaddress
from datetime import datetime, timedelta
from typing import NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

AUTHORITY_LIFE = timedelta(days=3650)
SKEW = timedelta(hours=1)  # tolerates a computer whose clock is slow


class CertificateAndKey(NamedTuple):
    """A certificate and its private key, PEM."""

    certificate: bytes
    key: bytes


class Identity(NamedTuple):
    """Contents of a certificate: identity, role, host names and addresses, and expiry."""

    name: str
    role: str
    hosts: tuple[str, ...]
    until: datetime


def make_authority(site: str, now: datetime) -> CertificateAndKey:
    """Return the certificate of a site's authority, which can only sign other certificates."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = _named(site, "authority")
    built = (
        _builder(name, name, key.public_key(), now)
        .not_valid_after(now + AUTHORITY_LIFE)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs_others=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )
    return _pair(built, key, key)


def issue_pair(authority: CertificateAndKey, identity: Identity, now: datetime) -> CertificateAndKey:
    """Return a new key and a certificate for an identity, for both ends of a connection."""
    signer = load_pem_private_key(authority.key, None)
    if not isinstance(signer, ec.EllipticCurvePrivateKey):
        raise ValueError("the authority's key is not on an elliptic curve")  # noqa: TRY004 - bad content
    issuer = x509.load_pem_x509_certificate(authority.certificate)
    key = ec.generate_private_key(ec.SECP256R1())
    uses = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    built = (
        _builder(_named(identity.name, identity.role), issuer.subject, key.public_key(), now)
        .not_valid_after(identity.until)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(signs_others=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(uses), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.public_key()), critical=False
        )
        .add_extension(x509.SubjectAlternativeName([_host(host) for host in identity.hosts]), critical=False)
    )
    return _pair(built, key, signer)


def read_identity(pem: bytes) -> Identity:
    """Return the contents of a certificate."""
    certificate = x509.load_pem_x509_certificate(pem)
    return Identity(
        _first(certificate.subject, NameOID.COMMON_NAME),
        _first(certificate.subject, NameOID.ORGANIZATIONAL_UNIT_NAME),
        _hosts(certificate),
        certificate.not_valid_after_utc,
    )


def first_end(pem: bytes) -> datetime:
    """Return the earliest expiry of the certificates in a file."""
    return min(each.not_valid_after_utc for each in x509.load_pem_x509_certificates(pem))


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, now: datetime
) -> x509.CertificateBuilder:
    """Return a builder with the common fields of all certificates."""
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - SKEW)
    )


def _named(name: str, role: str) -> x509.Name:
    """Return a subject name."""
    return x509.Name(
        [
            x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, role),
            x509.NameAttribute(NameOID.COMMON_NAME, name),
        ]
    )


def _usage(*, signs_others: bool) -> x509.KeyUsage:
    """Return the permitted usage of a key."""
    return x509.KeyUsage(
        digital_signature=not signs_others,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs_others,
        crl_sign=signs_others,
        encipher_only=False,
        decipher_only=False,
    )


def _host(text: str) -> x509.GeneralName:
    """Return a host name or address as a subject alternative name."""
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        return x509.DNSName(text)


def _hosts(certificate: x509.Certificate) -> tuple[str, ...]:
    """Return the host names and addresses of a certificate."""
    try:
        found = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return ()
    return tuple(str(each.value) for each in found)


def _first(name: x509.Name, kind: x509.ObjectIdentifier) -> str:
    """Return the first value of a kind in a name, empty if there is none."""
    found = name.get_attributes_for_oid(kind)
    return str(found[0].value) if found else ""


def _pair(
    builder: x509.CertificateBuilder, key: ec.EllipticCurvePrivateKey, signer: ec.EllipticCurvePrivateKey
) -> CertificateAndKey:
    """Sign a certificate; return it and its key as PEM."""
    signed = builder.sign(signer, SHA256())
    private = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    return CertificateAndKey(signed.public_bytes(Encoding.PEM), private)
