"""Bundles: encoding and decoding of a fleet file and its files, for one or several edges. Pure.

The address of a bundle is the SHA-256 of its content. A bundle is untrusted input: ``opened`` checks size,
address and signature before it decodes the content, and every file name before a caller writes a file.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import PurePosixPath

import msgspec

from fleet.errors import FleetError
from fleet.rollout.signature import PrivateKey, PublicKey, is_signed
from fleet.runtime.decoding import decode_json
from fleet.runtime.state_format import format_of

FORMAT = 1
HEAD = b"fleet bundle 1\n"
"""First line of a bundle; it is part of the signed text, so that no other signed text passes as a bundle."""
LARGEST = 16 << 20  # bytes of a bundle
MOST_FILES = 1000
LONGEST_PART = 128  # characters of one component of a path
FLEET_FILE = "fleet.yaml"
LOCAL = frozenset({"secrets.yaml"})
"""Files that belong to the edge; a bundle must not contain them."""
_HEADER = 1024  # maximum bytes of the header


class BundleError(FleetError):
    """A bundle cannot be built, or is refused."""


class Bundle(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Content of a bundle.

    ``edges``: the edges that may install it. ``version``: grows with each bundle. ``files``: ``fleet.yaml``
    and the files that it names. ``secrets``: names that each edge must have in its own secrets.yaml.
    ``fleet``: version of the program that built it. ``made``: build time (Unix s).
    """

    format: int
    version: int
    edges: tuple[str, ...]
    files: dict[str, bytes]
    secrets: tuple[str, ...]
    fleet: str
    made: float


class _Header(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    key: str
    signature: bytes


def address_of(content: bytes) -> str:
    """Return the address of the content of a bundle."""
    return hashlib.sha256(content).hexdigest()


def sign_bundle(bundle: Bundle, key: PrivateKey) -> tuple[str, bytes]:
    """Return the address and the signed bytes of a bundle; raises BundleError."""
    _check(bundle)
    content = msgspec.json.encode(bundle, order="deterministic")
    header = msgspec.json.encode(_Header(key.public.name, key.sign(HEAD + content)))
    data = HEAD + header + b"\n" + content
    if len(data) > LARGEST:
        raise BundleError(f"the bundle has {len(data) >> 20} MiB; more than {LARGEST >> 20} MiB is refused")
    return address_of(content), data


def verify_bundle(data: bytes, trusted: Mapping[str, PublicKey], address: str = "") -> tuple[str, Bundle]:
    """Verify and decode a bundle; return its address and content.

    The bytes must be signed by one of the trusted keys. If ``address`` is not empty, the content must have
    that address. Raises BundleError.
    """
    header, content = _parts(data)
    found = address_of(content)
    if address and found != address:
        raise BundleError(f"the bundle's content is not that of {address[:12]}: it was changed on its way")
    if not is_signed(HEAD + content, header.signature, header.key, trusted):
        known = ", ".join(sorted(trusted)) or "none"
        raise BundleError(
            f"no trusted key signed the bundle: it names key {header.key[:16]!r}; trusted: {known}"
        )
    bundle = _decoded(content)
    _check(bundle)
    return found, bundle


def _parts(data: bytes) -> tuple[_Header, bytes]:
    """Split the bytes of a bundle into header and content; raises BundleError."""
    if len(data) > LARGEST:
        raise BundleError(f"the bundle has more than {LARGEST >> 20} MiB")
    if not data.startswith(HEAD):
        raise BundleError(f"it is no bundle: it does not begin with {HEAD.decode().strip()!r}")
    header, newline, content = data[len(HEAD) :].partition(b"\n")
    if not newline or len(header) > _HEADER:
        raise BundleError("it is no bundle: its header is not on one line")
    try:
        return decode_json(header, _Header), content
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise BundleError(f"the bundle's header cannot be read: {error}") from None


def _decoded(content: bytes) -> Bundle:
    """Return the decoded content of a bundle whose signature was verified; raises BundleError."""
    try:
        number = format_of(content)
        if number > FORMAT:
            raise BundleError(f"the bundle has format {number}; this fleet reads {FORMAT}: update it first")
        return decode_json(content, Bundle)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise BundleError(f"the bundle cannot be read: {error}") from None


def _check(bundle: Bundle) -> None:
    """Check version, edges, files and file names of a bundle; raises BundleError."""
    if bundle.version < 1:
        raise BundleError("the bundle's version must be at least 1")
    if not bundle.edges:
        raise BundleError("the bundle is for no edge")
    if FLEET_FILE not in bundle.files:
        raise BundleError(f"the bundle has no {FLEET_FILE}")
    if len(bundle.files) > MOST_FILES:
        raise BundleError(f"the bundle has more than {MOST_FILES} files")
    for name in bundle.files:
        _check_name(name, bundle.files)


def _check_name(name: str, files: Mapping[str, bytes]) -> None:
    """Refuse a file name that leaves the folder of the bundle or collides; raises BundleError."""
    path = PurePosixPath(name)
    plain = name.isprintable() and "\\" not in name and str(path) == name and not path.is_absolute()
    if (
        not plain
        or {"..", "."} & set(path.parts)
        or not all(len(part) <= LONGEST_PART for part in path.parts)
    ):
        raise BundleError(f"{name!r} is no name of a file in a bundle")
    if name in LOCAL or name.startswith("."):
        raise BundleError(f"{name} is the edge's own; no bundle brings it")
    if any(str(parent) in files for parent in path.parents):
        raise BundleError(f"{name!r} stands below a file of the bundle")
