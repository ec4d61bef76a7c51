"""Ed25519 signatures of bundles, and the trusted keys of an edge. Pure."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from fleet.errors import FleetError


class SigningKeyError(FleetError):
    """A key cannot be used for signatures of bundles."""


class PublicKey:
    """Public key that verifies signatures; ``name`` is the beginning of its SHA-256."""

    def __init__(self, key: Ed25519PublicKey) -> None:
        self._key = key
        self.name = hashlib.sha256(key.public_bytes_raw()).hexdigest()[:16]

    def pem(self) -> bytes:
        """Return the key in PEM format."""
        form = serialization.PublicFormat.SubjectPublicKeyInfo
        return self._key.public_bytes(serialization.Encoding.PEM, form)

    def accepts(self, text: bytes, signature: bytes) -> bool:
        """Return whether the signature of a text was made with the private key of this key."""
        try:
            self._key.verify(signature, text)
        except InvalidSignature:
            return False
        return True


class PrivateKey:
    """Private key that makes signatures; ``public`` is its public key."""

    def __init__(self, key: Ed25519PrivateKey) -> None:
        self._key = key
        self.public = PublicKey(key.public_key())

    def pem(self) -> bytes:
        """Return the key in PEM format, unencrypted."""
        form = serialization.PrivateFormat.PKCS8
        return self._key.private_bytes(serialization.Encoding.PEM, form, serialization.NoEncryption())

    def sign(self, text: bytes) -> bytes:
        """Return the signature of a text."""
        return self._key.sign(text)


def new_key() -> PrivateKey:
    """Generate a key."""
    return PrivateKey(Ed25519PrivateKey.generate())


def private_key(pem: bytes) -> PrivateKey:
    """Return the private key in a PEM file; raises SigningKeyError."""
    try:
        key = serialization.load_pem_private_key(pem, None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise SigningKeyError(f"it is no private key without password: {error}") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise SigningKeyError("it is no Ed25519 key; make one with: fleet bundle key")
    return PrivateKey(key)


def public_key(pem: bytes) -> PublicKey:
    """Return the public key in a PEM file; raises SigningKeyError."""
    try:
        key = serialization.load_pem_public_key(pem)
    except (ValueError, UnsupportedAlgorithm) as error:
        raise SigningKeyError(f"it is no public key: {error}") from None
    if not isinstance(key, Ed25519PublicKey):
        raise SigningKeyError("it is no Ed25519 key; give the .pub file of: fleet bundle key")
    return PublicKey(key)


def by_name(keys: Iterable[PublicKey]) -> dict[str, PublicKey]:
    """Return the keys by name."""
    return {key.name: key for key in keys}


def is_signed(text: bytes, signature: bytes, name: str, trusted: Mapping[str, PublicKey]) -> bool:
    """Return whether a text has a valid signature of the trusted key with this name."""
    key = trusted.get(name)
    return key is not None and key.accepts(text, signature)
