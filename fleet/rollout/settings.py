"""Model of ``rollout.yaml``: address of the store of roll-outs, trusted keys.

The file is beside the bundles of an edge and part of none, so that no roll-out can cut an edge off from the
next one or add a trusted key.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Self

from pydantic import AfterValidator, Field, SecretStr, model_validator

from fleet.config.endpoints import is_local
from fleet.config.explain import validated
from fleet.config.other_edges import check_server, host_of
from fleet.config.problems import InvalidConfig, Mark, Problem
from fleet.config.yaml import read
from fleet.robot_config import Name
from fleet.rollout.signature import PublicKey, SigningKeyError, by_name, public_key
from fleet.yaml_model import Duration, ExistingPath, Model, wrong

FILE = "rollout.yaml"


class RolloutSettings(Model):
    """Content of rollout.yaml, on an edge and on the computer of an operator."""

    servers: tuple[Annotated[str, AfterValidator(check_server)], ...] = Field(
        min_length=1, description="tls://HOST:4222 of the NATS servers, which are one cluster."
    )
    edge: Name | None = Field(None, description="The edge of this computer; left out where none is.")
    trust: tuple[ExistingPath, ...] = Field(
        (), description="Public keys; a bundle must be signed by one of them."
    )
    ca_file: ExistingPath | None = Field(None, description="Certificates to trust instead of the system's.")
    certificate: ExistingPath | None = Field(None, description="Certificate of this computer.")
    private_key: ExistingPath | None = Field(None, description="Its private key.")
    user: str | None = Field(None, min_length=1, description="Account of this computer.")
    password: SecretStr | None = Field(None, description="Its password.")
    insecure: bool = Field(
        False, description="Allow nats:// to another computer: every computer on the network can roll out."
    )
    look_every: Duration = Field(5.0, description="Seconds between two looks of an edge into the store.")

    @model_validator(mode="after")
    def _whole(self) -> Self:
        for one, other in (("user", "password"), ("certificate", "private_key")):
            if (getattr(self, one) is None) != (getattr(self, other) is None):
                raise wrong(
                    one if getattr(self, one) is not None else other, f"{one} and {other} come together"
                )
        plain = [each for each in self.servers if each.startswith("nats:") and not is_local(host_of(each))]
        if plain and not self.insecure:
            raise wrong("servers", f"{plain[0]} is not encrypted: write tls://, or set insecure: true")
        if self.edge is not None and not self.trust:
            raise wrong("edge", "an edge needs trust: the public keys whose bundles it takes")
        return self

    def trusted(self) -> dict[str, PublicKey]:
        """Return the trusted keys by name; raises SigningKeyError."""
        return by_name(_key(path) for path in self.trust)


def _key(path: Path) -> PublicKey:
    """Read a public key; raises SigningKeyError."""
    try:
        return public_key(path.read_bytes())
    except OSError as error:
        raise SigningKeyError(f"cannot read {path}: {error.strerror}") from None
    except SigningKeyError as error:
        raise SigningKeyError(f"{path}: {error}") from None


def read_settings(file: Path, environ: Mapping[str, str] = os.environ) -> RolloutSettings:
    """Read a rollout.yaml; raises InvalidConfig."""
    document = read(file, environ)
    settings = None
    if isinstance(document.data, dict):
        settings = validated(RolloutSettings, document.data, (), document, {"folder": file.parent})
    elif not document.problems:
        document.report(Mark(str(file), 1, 1), "it must hold  key: value", "servers: [tls://HOST:4222]")
    if settings is None or document.problems:
        raise InvalidConfig(document.problems or [Problem(str(file), 1, 1, "", "it cannot be used")])
    return settings
