"""Bundles: round trip, and refusal of changed bytes before anything is written."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.rollout.bundle import HEAD, LARGEST, Bundle, BundleError, sign_bundle, verify_bundle
from fleet.rollout.signature import by_name, new_key

KEY = new_key()
TRUSTED = by_name([KEY.public])


def bundle_of(**changes):
    bundle = Bundle(
        format=1,
        version=7,
        edges=("yard-1",),
        files={"fleet.yaml": b"edge: {id: yard-1}\n", "plugins/rover.py": b"x = 1\n"},
        secrets=("cyberwave_token",),
        fleet="0.2.0",
        made=1795000000.0,
    )
    return msgspec.structs.replace(bundle, **changes)


def forged(bundle):
    """Return the bytes of a bundle that ``sealed`` would refuse, signed by the trusted key."""
    content = msgspec.json.encode(bundle)
    header = msgspec.json.encode({"key": KEY.public.name, "signature": KEY.sign(HEAD + content)})
    return HEAD + header + b"\n" + content


def test_an_opened_bundle_equals_the_sealed_one_and_has_the_address_of_its_content():
    address, data = sign_bundle(bundle_of(), KEY)
    assert verify_bundle(data, TRUSTED, address) == (address, bundle_of())
    assert len(address) == 64
    assert sign_bundle(bundle_of(), new_key())[0] == address, "the address is the content's, whoever signs it"
    assert sign_bundle(bundle_of(version=8), KEY)[0] != address


def test_a_bundle_signed_by_another_key_is_refused():
    _, data = sign_bundle(bundle_of(), new_key())
    with pytest.raises(BundleError, match="no trusted key signed the bundle"):
        verify_bundle(data, TRUSTED)


def test_a_signature_of_another_key_under_the_name_of_a_trusted_one_is_refused():
    _, data = sign_bundle(bundle_of(), other := new_key())
    data = data.replace(other.public.name.encode(), KEY.public.name.encode())
    with pytest.raises(BundleError, match="no trusted key signed the bundle"):
        verify_bundle(data, TRUSTED)


def test_a_bundle_with_the_content_of_another_address_is_refused():
    address, _ = sign_bundle(bundle_of(version=8), KEY)
    _, replayed = sign_bundle(bundle_of(), KEY)
    with pytest.raises(BundleError, match="changed on its way"):
        verify_bundle(replayed, TRUSTED, address)


@pytest.mark.parametrize(
    "name",
    [
        "../fleet.yaml",
        "a/../../b",
        "/etc/passwd",
        "./a",
        "a//b",
        "a/",
        "a\\b",
        "a\0b",
        "a\nb",
        "",
        "secrets.yaml",
        ".new",
        "x" * 200,
        "fleet.yaml/below",
    ],
)
def test_a_signed_bundle_with_a_file_outside_its_folder_is_refused(name):
    data = forged(bundle_of(files={"fleet.yaml": b"", name: b""}))
    with pytest.raises(BundleError, match=r"no name of a file|the edge's own|stands below"):
        verify_bundle(data, TRUSTED)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": 2}, "format 2"),
        ({"version": 0}, "at least 1"),
        ({"edges": ()}, "for no edge"),
        ({"files": {"other.yaml": b""}}, "has no fleet.yaml"),
        ({"files": {f"f{number}": b"" for number in range(1001)} | {"fleet.yaml": b""}}, "more than 1000"),
    ],
)
def test_a_signed_bundle_that_cannot_be_used_is_refused_with_the_reason(changes, words):
    with pytest.raises(BundleError, match=words):
        verify_bundle(forged(bundle_of(**changes)), TRUSTED)


def test_a_bundle_that_is_too_large_is_neither_made_nor_read():
    with pytest.raises(BundleError, match="MiB"):
        sign_bundle(bundle_of(files={"fleet.yaml": b"x" * LARGEST}), KEY)
    with pytest.raises(BundleError, match="MiB"):
        verify_bundle(HEAD + b"x" * LARGEST, TRUSTED)


_, WHOLE = sign_bundle(bundle_of(), KEY)


@given(at=st.integers(0, len(WHOLE) - 1), byte=st.integers(0, 255))
def test_no_bundle_with_a_changed_byte_is_accepted_as_another(at, byte):
    changed = WHOLE[:at] + bytes([byte]) + WHOLE[at + 1 :]
    try:
        _, found = verify_bundle(changed, TRUSTED)
    except BundleError:
        return
    assert found == bundle_of()


@given(st.binary(max_size=300))
def test_any_bytes_are_refused_in_one_line(data):
    for given_bytes in (data, HEAD + data):
        with pytest.raises(BundleError) as error:
            verify_bundle(given_bytes, TRUSTED)
        assert "\n" not in str(error.value)
