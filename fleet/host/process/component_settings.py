"""Settings of bus, cloud, spool and processes from the models of fleet.yaml."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from fleet.bridge.bridge import BridgeRules
from fleet.bus.access import Access
from fleet.bus.settings import BusSettings, BusTls, running_edges
from fleet.cloud.credentials import PLACEHOLDER, client_id, credentials
from fleet.cloud.values import CloudSettings
from fleet.config.schema import CloudConfig, FleetConfig, Sections
from fleet.host.process.twin_claims import SETTLE
from fleet.model.permission import Permission
from fleet.plugins.registry import Plugin
from fleet.robot_config import MAIN, AdapterConfig
from fleet.spool.spool import SpoolSettings
from fleet.spool.state_folder import state_folder
from fleet.wire.rulebook import of_a_workflow, of_an_environment, rulebook, run_rules, twin_rules
from fleet.wire.rules import TrafficClass
from fleet.wire.topics import Topics, prefix_from


def worker_of(config: AdapterConfig, plugin: Plugin) -> str:
    """Return the worker that a robot runs in, empty for the edge's own process.

    A drop-in file is not trusted with the edge's process unless its robot says ``worker: main``.
    """
    if config.worker == MAIN:
        return ""
    if config.worker is None and Path(plugin.origin).suffix == ".py":
        return config.name
    return config.worker or ""


def bus_settings(config: Sections, access: Access | None = None) -> BusSettings:
    """Return the bus settings; ``access`` has the edge's rules for other parties."""
    bus = config.bus
    tls = BusTls()
    if bus.tls is not None:
        tls = BusTls(
            root_ca=str(bus.tls.root_ca),
            certificate=str(bus.tls.cert),
            key=str(bus.tls.key),
            mutual=bus.tls.mutual,
            verify_name=bus.tls.verify_name,
        )
    return BusSettings(
        edge=config.edge.id,
        mode=bus.mode,
        listen=bus.listen,
        connect=bus.connect,
        tls=tls,
        user=bus.user,
        password=bus.password.get_secret_value() if bus.password else None,
        scouting=bus.scouting,
        access=access,
    )


def bus_access(config: FleetConfig) -> Access | None:
    """Return the access rules of the edge's bus; None without any in fleet.yaml."""
    if config.bus.access is None:
        return None
    twins = tuple(str(robot.twin) for robot in config.robots)
    coordinators = frozenset(name for name, partner in config.partners.items() if partner.coordinates)
    channels = tuple(config.cloud.channels) if config.cloud else ()
    consoles = {name: Permission[word.upper()] for name, word in config.bus.consoles.items()}
    return Access(config.bus.access, twins, channels, coordinators, consoles)


def settle_time(config: Sections) -> float:
    """Return how many seconds a twin is requested before it is claimed: 0 if no other edge can be reached.

    A port that the system chooses (0) is not known to any other edge.
    """
    bus = config.bus
    known = [end for end in bus.listen if not end.endswith(":0")]
    return SETTLE if known or bus.connect or bus.scouting else 0.0


def settle_time_beside(edge: str, directory: Path) -> float:
    """Return the same for other edges on this computer, which may reach our sockets."""
    return SETTLE if any(other != edge for other in running_edges(directory)) else 0.0


def bridge_rules(
    cloud: CloudConfig, robots: Iterable[AdapterConfig], pair: Iterable[str] = ()
) -> BridgeRules:
    """Return the rules of the bridge: the table with the changes of profile, cloud and robot.

    Heartbeats of edges in the same ``pair`` claim no twin: their lease decides.
    """
    channels = {name: rule.channel() for name, rule in cloud.channels.items()}
    general = cloud.changes()
    everyone = rulebook(cloud.profile, (general,), channels)
    usual = twin_rules(everyone)  # shared by all robots without their own rules: each is 16 kB
    twins = {
        str(robot.twin): twin_rules(rulebook(cloud.profile, (general, robot.changes()), channels))
        if robot.rules or robot.inbound
        else usual
        for robot in robots
    }
    any_run = run_rules(everyone)
    return BridgeRules(
        twins,
        {str(uuid): of_an_environment(everyone) for uuid in cloud.environments},
        any_run if any_run.inward else None,
        cloud.ignore_edges | frozenset(pair),
        {str(uuid): of_a_workflow(everyone) for uuid in cloud.workflows},
    )


def cloud_settings(cloud: CloudConfig, *, simulated: bool) -> CloudSettings:
    """Return the settings of the cloud connection, with the credentials as the SDK derives them."""
    login = credentials(
        cloud.token.get_secret_value() if cloud.token else None,
        cloud.username or PLACEHOLDER,
        cloud.password.get_secret_value() if cloud.password else None,
    )
    return CloudSettings(
        host=cloud.host,
        port=cloud.port,
        tls=cloud.tls,
        insecure=cloud.insecure,
        ca_file=str(cloud.ca_file) if cloud.ca_file else None,
        username=login.username if login else None,
        password=login.password if login else None,
        client_id=client_id("fleet", simulated=simulated),
        protocol=cloud.protocol,
        keepalive=cloud.keepalive,
    )


def spool_settings(config: FleetConfig) -> SpoolSettings:
    """Return folder, size and ages of the spool."""
    spool = config.edge.spool
    ages = {
        TrafficClass.REPLY: spool.ages.reply,
        TrafficClass.STATUS: spool.ages.status,
        TrafficClass.EVENT: spool.ages.event,
    }
    return SpoolSettings(
        folder=state_folder(config.edge.id, spool.path), size=spool.size * 1024 * 1024, ages=ages
    )


def topics(cloud: CloudConfig, environ: Mapping[str, str] = os.environ) -> Topics:
    """Return the topics with the prefix of fleet.yaml, even if empty, or of the environment."""
    given = cloud.prefix if "prefix" in cloud.model_fields_set else None
    return Topics(prefix_from(given, environ))
