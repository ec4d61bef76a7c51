"""How a network connection to the broker is opened, and why it could not be, in plain words."""

from __future__ import annotations

import ipaddress
import socket
import ssl

from fleet.cloud.dial import dial, secure
from fleet.cloud.session import SessionRefused
from fleet.cloud.values import CloudSettings
from fleet.errors import CloudError


def tls_context(settings: CloudSettings) -> ssl.SSLContext | None:
    """Return what verifies the broker, None for a plain connection.

    Raises CloudError when the certificate file cannot be used, and for a plain connection that leaves this
    computer without ``insecure``: it would show the token to the network.
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
    """Open the way to the broker; raise CloudError, or SessionRefused for an untrusted certificate."""
    place = f"{settings.host}:{settings.port}"
    try:
        opened = await dial(settings.host, settings.port)
        return await secure(opened, tls, settings.host) if tls else opened
    except ssl.SSLCertVerificationError as error:
        raise SessionRefused(
            f"the certificate of {place} is not trusted: {error.verify_message}; "
            "set ca_file if it is your own"
        ) from None
    except ssl.SSLError as error:
        raise CloudError(f"{place} does not speak TLS as expected: {error.reason}") from None
    except socket.gaierror as error:
        raise CloudError(f"the name {settings.host} cannot be looked up: {error.strerror}") from None
    except OSError as error:
        why = error.strerror or str(error) or "it ended the TLS handshake"
        raise CloudError(f"{place} cannot be reached: {why}") from None


def _is_local(host: str) -> bool:
    """Tell whether a host is this computer, so that nothing can listen in between."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
