"""Sections about other edges: partners in missions, and the pair with a standby edge."""

from __future__ import annotations

import re
from typing import Annotated, Self

from pydantic import AfterValidator, Field, SecretStr, model_validator

from fleet.config.endpoints import is_local
from fleet.robot_config import Name
from fleet.yaml_model import ExistingPath, Model, wrong

_SERVER = re.compile(r"(?P<scheme>nats|tls)://(?P<host>[A-Za-z0-9._-]+|\[[0-9a-fA-F:.]+\]):(?P<port>\d{1,5})")

LAST_PORT = 65_535


class PartnerConfig(Model):
    """Another edge of the site, for missions of several edges."""

    robots: tuple[Name, ...] = Field(
        (),
        description="Robots of that edge, by name: missions of this one may use them, and its robots are "
        "kept apart from them.",
    )
    coordinates: bool = Field(
        False,
        description="That edge may have robots of this one in its runs; if it falls silent meanwhile, "
        "this edge executes the mission's action for failed robots (robot_failed.do).",
    )


def check_server(text: str) -> str:
    """Refuse an invalid address of a NATS server."""
    if not 0 < port_of(text) <= LAST_PORT:
        raise ValueError(f"{text!r} is no server; write nats://HOST:4222, or tls://HOST:4222")
    return text


def host_of(server: str) -> str:
    """Return the host of a server's address."""
    match = _SERVER.fullmatch(server)
    return match["host"] if match else ""


def port_of(server: str) -> int:
    """Return the port of a server's address."""
    match = _SERVER.fullmatch(server)
    return int(match["port"]) if match else 0


class LeaseConfig(Model):
    """The lease service (NATS with JetStream), which decides which edge of a pair runs the robots."""

    servers: tuple[Annotated[str, AfterValidator(check_server)], ...] = Field(
        min_length=1,
        description="nats://HOST:4222 or tls://HOST:4222, on neither computer of the pair; several must "
        "belong to one cluster.",
    )
    user: str | None = Field(None, min_length=1, description="Its account.")
    password: SecretStr | None = Field(None, description="The account's password.")
    ca_file: ExistingPath | None = Field(None, description="Certificates to trust instead of the system's.")
    insecure: bool = Field(
        False,
        description="Allow nats:// to another computer: anyone on the network could take over the robots.",
    )

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.user is None) != (self.password is None):
            raise wrong("password" if self.user is None else "user", "user and password come together")
        plain = [each for each in self.servers if each.startswith("nats:") and not is_local(host_of(each))]
        if plain and not self.insecure:
            raise wrong("servers", f"{plain[0]} is not encrypted: write tls://, or set insecure: true")
        return self
