"""The models of fleet.yaml. The ``Config`` of each robot's adapter validates the robot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self
from uuid import UUID

from pydantic import AfterValidator, Field, SecretStr, model_validator

from fleet.config.edge_section import EdgeConfig
from fleet.config.endpoints import COMMON_NAME, Insecure, Role, check_locator, is_encrypted, is_local
from fleet.config.groups import Group, members_of
from fleet.config.notify import NotifyConfig, with_members
from fleet.config.other_edges import LeaseConfig, PartnerConfig
from fleet.config.places import PlaceConfig
from fleet.config.programs import ConsoleConfig, RecordConfig
from fleet.robot_config import AdapterConfig, Name
from fleet.schedules.model import ScheduleConfig
from fleet.wire.topic_rules import ChannelConfig, ChannelName, TopicsConfig
from fleet.yaml_model import ExistingPath, Model, wrong

Mode = Literal["peer", "client", "router"]
TOKEN = "cw_"  # noqa: S105 - prefix of a Cyberwave token, which implies its user name


def _folder(path: Path) -> Path:
    """Refuse a path that is no folder."""
    if not path.is_dir():
        raise ValueError(f"{path} is no folder")
    return path


def _host(text: str) -> str:
    """Refuse a URL, or a host with a port."""
    if "/" in text or text.count(":") == 1:
        raise ValueError("must be a name or an address alone; the port has a key of its own")
    return text


CommonName = Annotated[str, Field(pattern=f"^{COMMON_NAME.pattern}$")]
ExistingFolder = Annotated[ExistingPath, AfterValidator(_folder)]
Host = Annotated[str, AfterValidator(_host)]
Locator = Annotated[str, AfterValidator(check_locator)]


class WorkflowConfig(Model):
    """The mission that a workflow of the cloud starts."""

    mission: Name = Field(description="The mission that is started.")
    inputs: dict[str, Any] = Field(
        {}, description="Its inputs; those of the workflow's run cannot change them."
    )
    source_type: str = Field(
        "tele",
        min_length=1,
        max_length=32,
        description="Source type with which its robots are commanded: each must accept it for missions "
        "and for every step. The cloud's message itself names none.",
    )


class CloudConfig(TopicsConfig):
    """The connection to the Cyberwave cloud (MQTT). Missing values are taken from the environment."""

    host: Host = Field(
        min_length=1, description="Name or address of the MQTT broker. Left out: CYBERWAVE_MQTT_HOST."
    )
    port: int = Field(8883, ge=1, le=65535, description="Left out: CYBERWAVE_MQTT_PORT, else 8883.")
    tls: bool = Field(True, description="Encrypt and check the broker's certificate.")
    insecure: bool = Field(
        False,
        description="Allow tls: false to another computer: anyone on the way could read the traffic and "
        "command the robots.",
    )
    ca_file: ExistingPath | None = Field(
        None,
        description="Certificates to trust instead of the system's. Left out: CYBERWAVE_MQTT_TLS_CA_CERT.",
    )
    username: str | None = Field(None, description="Left out: CYBERWAVE_MQTT_USERNAME.")
    password: SecretStr | None = Field(
        None, description="Of a plain broker account. Left out: CYBERWAVE_MQTT_PASSWORD."
    )
    token: SecretStr | None = Field(None, description="A Cyberwave token. Left out: CYBERWAVE_API_KEY.")
    protocol: Literal[5, 311] = Field(5, description="MQTT 5 or 3.1.1. Left out: CYBERWAVE_MQTT_PROTOCOL.")
    prefix: str = Field(
        "",
        pattern=r"^[^+#\s]*$",
        description="Put before every topic as it is, without a separator. Left out: "
        "CYBERWAVE_MQTT_TOPIC_PREFIX, CYBERWAVE_TOPIC_PREFIX, or CYBERWAVE_ENVIRONMENT unless "
        "it is production.",
    )
    keepalive: int = Field(
        5, ge=1, le=600, description="Seconds; a dead connection is detected after about 1.5 times this."
    )

    profile: Literal["lan", "lte", "satellite"] = Field(
        "lan",
        description="Bandwidth to the cloud; rates of each profile: docs/reference/topics.md.",
    )
    channels: dict[ChannelName, ChannelConfig] = Field(
        {},
        description="More bus channels for the cloud than those in docs/reference/topics.md, by name.",
    )
    environments: frozenset[UUID] = Field(
        frozenset(), description="Environments whose updates are forwarded between the cloud and the bus."
    )
    workflows: dict[UUID, WorkflowConfig] = Field(
        {}, description="Workflows of the cloud that start a mission, by uuid; any other starts none."
    )
    ignore_edges: frozenset[str] = Field(
        frozenset(),
        description="Edges whose edge_health claims no twin, by edge_id: a Cyberwave Edge Core that serves "
        "the same twins.",
    )

    @model_validator(mode="after")
    def _encrypted(self) -> Self:
        if not (self.tls or self.insecure or is_local(self.host)):
            raise wrong(
                "tls",
                "plain text to another computer shows the token to anyone; set tls: true, or insecure: true",
            )
        return self

    @model_validator(mode="after")
    def _named(self) -> Self:
        secrets = {
            name: given.get_secret_value()
            for name, given in (("password", self.password), ("token", self.token))
            if given is not None
        }
        named = secrets if self.username is None else {"username": self.username, **secrets}
        for key, text in named.items():
            if not text.strip():
                raise wrong(key, "is empty and grants no access; leave the key out, or give it a value")
        password = secrets.get("password", TOKEN)
        if self.username is None and not password.startswith(TOKEN):
            raise wrong(
                "password",
                "a password needs the username: of its account; a Cyberwave token is said as token:",
            )
        return self


class BusTlsConfig(Model):
    """Certificates for the bus (PEM files)."""

    root_ca: ExistingPath = Field(description="Certificate of the authority that signed all others.")
    cert: ExistingPath = Field(description="This edge's certificate.")
    key: ExistingPath = Field(description="This edge's private key.")
    verify_name: bool = Field(True, description="Refuse a peer whose certificate is for another name.")
    mutual: bool = Field(True, description="Refuse a peer that shows no certificate.")


class BusConfig(Model):
    """The Zenoh bus, where robots, edges and local programs meet."""

    mode: Mode = Field("peer", description="How this edge takes part.")
    listen: tuple[Locator, ...] = Field(
        (),
        description="Endpoints to open besides the Unix sockets, by which programs of this user on this "
        "computer join (docs/how-to/bus.md).",
    )
    connect: tuple[Locator, ...] = Field((), description="Endpoints to connect to.")
    tls: BusTlsConfig | None = Field(None, description="Certificates; needed for tls/ and quic/ endpoints.")
    user: str | None = Field(None, min_length=1, description="User name that peers must know.")
    password: SecretStr | None = Field(None, description="The user's password.")
    scouting: bool = Field(False, description="Find peers on the local network by multicast.")
    insecure: Insecure = Field(
        False,
        description="Allow endpoints without certificate and password: local, those that every user of "
        "this computer can reach (tcp/127.0.0.1:7447); true, also those that other computers "
        "can reach.",
    )

    access: dict[CommonName, Role] | None = Field(
        None,
        description="Roles by the common name of the certificate: edge, worker (of this edge, by its "
        "name), console, program or router, for a person view, operate or admin; other names may do nothing "
        "(docs/how-to/bus.md). Left out: every certificate of the authority may do everything.",
    )
    consoles: dict[CommonName, Literal["view", "operate", "admin"]] = Field(
        {},
        description="Highest permission of persons at a console in access: view, operate or admin (default).",
    )

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.access is not None and (self.tls is None or not self.tls.mutual):
            raise wrong("access", "identities are certificates: it needs tls: with mutual: true")
        if self.mode == "client" and not self.connect:
            raise wrong("mode", "client needs connect:, the endpoints of a router")
        if (self.user is None) != (self.password is None):
            raise wrong("password" if self.user is None else "user", "user and password come together")
        encrypted = [end for end in (*self.listen, *self.connect) if is_encrypted(end)]
        if encrypted and self.tls is None:
            key = "listen" if encrypted[0] in self.listen else "connect"
            raise wrong(key, f"{encrypted[0]} needs certificates: tls: with root_ca, cert and key")
        return self


class MetricsConfig(Model):
    """Prometheus metrics at ``/metrics``."""

    port: int = Field(9464, ge=0, le=65535, description="0 takes any that is free, and logs it.")
    host: Host = Field("127.0.0.1", description="Where it listens.")
    insecure: bool = Field(False, description="Allow other computers to read it; it has no password.")

    @model_validator(mode="after")
    def _here(self) -> Self:
        if not (self.insecure or is_local(self.host)):
            raise wrong("host", "other computers could read it without a password; set insecure: true")
        return self


class SiteConfig(Model):
    """The common frame of the robots of this edge: east-north-up, metres."""

    origin: tuple[float, float, float] | None = Field(
        None,
        description="[latitude, longitude, altitude]: degrees, and metres above mean sea level of the "
        "ground there. Robots with a position on Earth are placed by it, those without GPS by "
        "their start.",
    )

    @model_validator(mode="after")
    def _on_earth(self) -> Self:
        if self.origin is not None and (abs(self.origin[0]) >= 89 or abs(self.origin[1]) > 180):
            raise wrong("origin", "must be [latitude, longitude, altitude] in degrees and metres")
        return self


class StopInputConfig(Model):
    """A device whose heartbeat permits motion: without it the robots are stopped. Not safety-rated."""

    name: Name = Field(description="Its name in logs and health.")
    kind: Literal["serial", "gpio", "hid"] = Field(
        description="Source of the heartbeat: bytes of a serial line, rising edges of a GPIO line, "
        "reports of HID."
    )
    device: str = Field(
        pattern=r"^/",
        description="/dev/serial/by-id/..., /dev/gpiochipN or /dev/hidrawN; checked only when the edge "
        "runs: a device that cannot be opened stops the robots.",
    )
    baud: Literal[1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400] = Field(
        9600, description="Of a serial line."
    )
    heartbeat: str = Field(
        "", max_length=64, description="Text that a serial line must send; left out: any byte."
    )
    line: int | None = Field(None, ge=0, le=65535, description="Of a GPIO chip: the line's offset.")
    timeout: float = Field(
        0.5, ge=0.1, le=5.0, description="Seconds without a heartbeat after which the robots are stopped."
    )
    robots: tuple[Name, ...] = Field((), description="Robots and groups that it stops. None: all.")

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.kind == "gpio") != (self.line is not None):
            raise wrong("line" if self.line is not None else "kind", "a GPIO line, and no other, has line:")
        if self.heartbeat and self.kind != "serial":
            raise wrong("heartbeat", "only a serial line says text")
        return self


class Sections(Model):
    """Everything in fleet.yaml except the robots."""

    edge: EdgeConfig = Field(description="The computer that this file is for.")
    pair: tuple[Name, Name] | None = Field(
        None,
        description="Two edges, of which one takes over from the other; `fleet run --edge-id` says which "
        "this computer is, in the place of edge.id (docs/how-to/when-a-computer-dies.md).",
    )
    lease: LeaseConfig | None = Field(None, description="The lease service of the pair.")
    cloud: CloudConfig | None = Field(None, description="Left out: no cloud.")
    bus: BusConfig = Field(BusConfig(), description="The Zenoh bus.")
    site: SiteConfig = Field(SiteConfig(), description="The frame that the robots share.")
    metrics: MetricsConfig | None = Field(
        None, description="Prometheus metrics. Left out: none, and no port is opened."
    )
    console: ConsoleConfig | None = Field(
        None, description="A web page with the fleet (docs/how-to/console.md). Left out: none."
    )
    record: RecordConfig | None = Field(
        None, description="A recorder (docs/how-to/record.md). Left out: none."
    )
    plugins: tuple[ExistingFolder, ...] = Field(
        (),
        description="Folders of drop-in adapters, writable only by you and root; their code runs in "
        "workers, with the rights of your user.",
    )
    remote_workers: frozenset[Name] = Field(
        frozenset(),
        description="Workers that are started by hand on another computer, with fleet run --worker NAME "
        "and a copy of this file whose bus.connect is this edge; the edge itself starts only "
        "the others.",
    )
    defaults: dict[str, Any] = Field(
        {}, description="Default values for every robot; a robot's own values take precedence."
    )
    groups: dict[Name, Group] = Field(
        {},
        description="Names for several robots at once: [names], or {robots: [names], accepts: ..., "
        "limits: ...} with settings for each of them, over which its own take precedence.",
    )
    missions: dict[Name, Any] = Field(
        {}, description="Tasks for groups of robots; docs/how-to/missions.md has the grammar."
    )
    events: tuple[Name, ...] = Field(
        (),
        description="Events that programs on the bus report of robots, such as person_seen: missions may "
        "wait for them, as they may for those of `fleet history`.",
    )
    schedules: dict[Name, ScheduleConfig] = Field(
        {}, description="Automatic starts of missions (docs/how-to/groups.md)."
    )
    partners: dict[Name, PartnerConfig] = Field(
        {}, description="Other edges with which this one shares missions and the site, by their id."
    )
    places: dict[Name, PlaceConfig] = Field(
        {}, description="Named points and areas: robots are sent there by name, missions occupy them."
    )
    stop_inputs: tuple[StopInputConfig, ...] = Field(
        (),
        description="Devices whose heartbeat lets robots move; their limits: docs/explanation/stops.md.",
    )
    notify: tuple[NotifyConfig, ...] = Field(
        (), description="Webhooks and programs that are informed of faults and stops, also without a cloud."
    )

    @property
    def notified(self) -> tuple[NotifyConfig, ...]:
        """Return the targets of notices, with groups replaced by their robots."""
        return with_members(self.notify, self.members)

    @property
    def members(self) -> dict[str, tuple[str, ...]]:
        """Return the robots of each group."""
        return {name: members_of(group) for name, group in self.groups.items()}


class FleetConfig(Sections):
    """The whole fleet.yaml."""

    robots: tuple[AdapterConfig, ...] = Field(description="The robots, each with its adapter's own fields.")
