"""Keys for signatures of bundles."""

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from fleet.rollout.signature import SigningKeyError, by_name, is_signed, new_key, private_key, public_key


def test_a_key_is_the_same_after_it_was_written_and_read():
    key = new_key()
    assert private_key(key.pem()).public.name == key.public.name == public_key(key.public.pem()).name
    assert public_key(key.public.pem()).accepts(b"text", key.sign(b"text"))


def test_only_signatures_of_trusted_keys_are_accepted():
    key, other = new_key(), new_key()
    trusted = by_name([key.public])
    assert is_signed(b"text", key.sign(b"text"), key.public.name, trusted)
    assert not is_signed(b"text", other.sign(b"text"), other.public.name, trusted)
    assert not is_signed(b"other", key.sign(b"text"), key.public.name, trusted)
    assert not is_signed(b"text", b"", key.public.name, trusted)


def test_a_key_of_another_kind_is_refused_with_advice():
    curve = ec.generate_private_key(ec.SECP256R1())
    private = curve.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    public = curve.public_key().public_bytes(
        serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
    )
    for read, pem in ((private_key, private), (public_key, public)):
        with pytest.raises(SigningKeyError, match="fleet bundle key"):
            read(pem)
        with pytest.raises(SigningKeyError, match="it is no"):
            read(b"nothing")
