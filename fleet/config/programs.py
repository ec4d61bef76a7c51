"""Sections of the programs beside an edge: the console and the recorder."""

from __future__ import annotations

import ipaddress
import re
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from fleet.config.basemap import raster_archive
from fleet.yaml_model import ExistingPath, Model, NewPath, wrong

_ENDPOINT = re.compile(r"(\[[0-9a-fA-F:.]+\]|[0-9.]+):(\d{1,5})")


def _tcp_endpoint(given: str) -> str:
    """Refuse a text that is not ADDRESS:PORT."""
    match = _ENDPOINT.fullmatch(given)
    try:
        ipaddress.ip_address(match[1].strip("[]") if match else "")
    except ValueError:
        raise ValueError(f"{given!r} is no address with a port, as 0.0.0.0:8443 or '[::]:8443'") from None
    if match is None or int(match[2]) > 65535:
        raise ValueError("a port is at most 65535")
    return given


class ConsoleTlsConfig(Model):
    """The certificate that the console presents to browsers (PEM files)."""

    cert: ExistingPath = Field(
        description="Certificate for the name in the browser's address, and its chain."
    )
    key: ExistingPath = Field(description="Its private key, without a passphrase.")


class ConsoleConfig(Model):
    """The console, a web page with the fleet: beside the edge, or by itself (``fleet console -f FILE``)."""

    port: int = Field(8480, ge=0, le=65535, description="On loopback, for links; 0 takes any that is free.")
    listen: Annotated[str, AfterValidator(_tcp_endpoint)] | None = Field(
        None,
        description="Address and port on which people log in from other computers, as 0.0.0.0:8443; needs "
        "tls, and people (fleet console people add). Left out: loopback alone.",
    )
    tls: ConsoleTlsConfig | None = Field(None, description="Needed for listen.")
    hosts: tuple[Annotated[str, Field(pattern=r"^[A-Za-z0-9.:_-]{1,253}$")], ...] = Field(
        (), description="Names and addresses by which browsers reach listen. Left out: the certificate's."
    )
    map: Annotated[ExistingPath, AfterValidator(raster_archive)] | None = Field(
        None,
        description="PMTiles archive with pictures (aerial photographs, a drawn map) that is shown under the "
        "robots; needs site.origin.",
    )
    people: NewPath | None = Field(
        None,
        description="File of the people who may log in. Left out: console-people.json, with the edge's "
        "state.",
    )

    @model_validator(mode="after")
    def _listens_with_tls(self) -> Self:
        """Refuse a port on which a password could be read on the network."""
        if self.listen is not None and self.tls is None:
            raise wrong(
                "listen", "passwords and commands could be read and changed on the way; set tls: {cert, key}"
            )
        if self.listen is None and (self.tls is not None or self.hosts):
            raise wrong("tls" if self.tls is not None else "hosts", "it is for listen, which is not there")
        return self

    @property
    def endpoint(self) -> tuple[str, int] | None:
        """Address and port of ``listen``."""
        if self.listen is None:
            return None
        host, _, port = self.listen.rpartition(":")
        return host.strip("[]"), int(port)


class RecordConfig(Model):
    """A recorder as a process beside the edge: reports and requests of the robots, in MCAP files."""

    folder: NewPath | None = Field(
        None,
        description="For this recorder only; not readable by other users. Left out: recordings, beside "
        "the spool of the edge.",
    )
    size: int = Field(
        2048, ge=16, le=1_048_576, description="Limit in MiB; beyond it the oldest files are deleted."
    )
    hours: float = Field(24.0, gt=0, le=87_600, allow_inf_nan=False, description="How long files are kept.")
    free: int = Field(
        512,
        ge=0,
        le=1_048_576,
        description="MiB of the disk that stay free for others; with less, nothing is recorded.",
    )
