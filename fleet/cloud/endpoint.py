"""Opens the network connection to the broker, with plain error messages."""

from __future__ import annotations

import ipaddress
import socket
import ssl

from fleet.cloud.dial import dial, wrap_tls
from fleet.cloud.mqtt_session import SessionRefused
from fleet.cloud.values import CloudSettings
from fleet.errors import CloudError

_NAME_MISMATCHES = frozenset({62, 63, 64})
"""OpenSSL's X509_V_ERR_*_MISMATCH: the certificate is for another host name, e-mail or address."""
_PORT_HINT = "is it the port for TLS? (a plain one wants tls: false)"


def tls_context(settings: CloudSettings) -> ssl.SSLContext | None:
    """Return the TLS context that verifies the broker, None for a plain connection.

    Raises CloudError when the certificate file cannot be used, and for a plain connection to another computer
    without ``insecure``: it would expose the token to the network.
    """
    if not settings.tls:
        if not (settings.insecure or _is_local(settings.host)):
            raise CloudError(
                f"the connection to {settings.host} would be in clear text, with the token in it; "
                "set tls: true, or insecure: true if you accept that"
            )
        return None
    try:
        return ssl.create_default_context(cafile=settings.ca_file)
    except (OSError, ssl.SSLError) as error:
        raise CloudError(f"the certificate file {settings.ca_file} cannot be used: {error}") from None


async def open_socket(settings: CloudSettings, tls: ssl.SSLContext | None) -> socket.socket:
    """Connect to the broker; raise CloudError, or SessionRefused for an untrusted certificate."""
    place = f"{settings.host}:{settings.port}"
    try:
        opened = await dial(settings.host, settings.port)
    except socket.gaierror as error:
        raise CloudError(f"the name {settings.host} cannot be looked up: {error.strerror}") from None
    except OSError as error:
        raise CloudError(f"{place} cannot be reached: {error.strerror or error}") from None
    return await _secured(opened, tls, settings.host, place) if tls else opened


async def _secured(opened: socket.socket, tls: ssl.SSLContext, host: str, place: str) -> socket.socket:
    """Return the connection with TLS; raise CloudError, or SessionRefused for an untrusted certificate."""
    try:
        return await wrap_tls(opened, tls, host)
    except ssl.SSLCertVerificationError as error:
        named = error.verify_code in _NAME_MISMATCHES
        cure = "name it in cloud.host as the certificate does" if named else "set ca_file if it is your own"
        why = error.verify_message.rstrip(".")
        raise SessionRefused(f"the certificate of {place} is not trusted: {why}; {cure}") from None
    except ssl.SSLError as error:
        raise CloudError(f"{place} does not speak TLS as expected: {error.reason}; {_PORT_HINT}") from None
    except OSError as error:
        why = error.strerror or str(error) or "the connection was ended"
        raise CloudError(f"{place} does not finish the TLS handshake: {why}; {_PORT_HINT}") from None


def _is_local(host: str) -> bool:
    """Return whether a host is this computer, so that no other computer can eavesdrop."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
