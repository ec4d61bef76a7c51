"""Builds the bridge to the cloud, if fleet.yaml has a cloud."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fleet.bridge.bridge import Bridge
from fleet.bridge.command_replies import RobotPort
from fleet.bridge.downlink import MessageHandler
from fleet.bridge.relay import Put
from fleet.clock import Clock
from fleet.config.schema import FleetConfig
from fleet.host.process.component_settings import bridge_rules, cloud_settings, spool_settings, topics
from fleet.spool.spool import Spool


def bridge_of(
    config: FleetConfig,
    ports: dict[str, RobotPort],
    *,
    put: Put,
    alive: Callable[[str], bool],
    claimed: Callable[[str, str], None],
    clock: Clock,
    handlers: Mapping[str, MessageHandler],
) -> Bridge | None:
    """Return the bridge of an edge and its robots, by twin; None without a cloud. Raises CloudError."""
    cloud = config.cloud
    if cloud is None:
        return None
    return Bridge(
        cloud_settings(cloud, simulated=all(port.source_type == "sim" for port in ports.values())),
        topics(cloud),
        ports,
        edge=config.edge.id,
        rules=bridge_rules(cloud, config.robots, config.pair or ()),
        put=put,
        alive=alive,
        claimed=claimed,
        clock=clock,
        spool=Spool(spool_settings(config), clock),
        handlers=handlers,
    )
