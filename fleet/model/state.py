"""Summary states of a robot and of an edge, published on the bus: the rows of ``fleet ps``."""

from __future__ import annotations

import msgspec

from fleet.model.geometry import Vector3
from fleet.model.place import Place
from fleet.model.site import Placement


class RobotState(msgspec.Struct, frozen=True, omit_defaults=True):
    """Current state of one robot. ``position`` is metres in its world frame; ``health`` a word of ``Level``.

    ``heading`` is radians counter-clockwise from +x of its world.

    ``senders``: recent senders of time-stamped requests, each with the sum of its clock offset and network
    delay in seconds; a positive value means a slow clock or a late message.

    ``site`` is its position in the site frame, ``placement`` the pose of its world there; None while unknown.
    ``separation`` names the robots to which its distance is unknown, and why.

    ``drop_in``: the source file of its adapter, when that is a drop-in and not an installed package.

    ``in_use``: it was moved through its edge, and control has not been released since.

    ``stop_cause``: who set the emergency stop, and why; empty while none is set.

    ``speed`` is m/s over all axes, averaged over the last second; None when the robot reports no pose.
    ``age``: seconds from its last message to ``stamp``; None before the first message.

    ``control`` is the session that controls it, known from its last motion request; empty for none.

    ``run`` is the mission run that has it; ``left_run`` is why the last run has lost it, with the first word
    ``taken``, ``stopped`` or ``lost``.

    ``reachable``: it accepts requests. A robot with a fault may still be reachable: the fault may be one that
    it reports itself.
    """

    name: str
    twin: str
    adapter: str
    edge: str
    stamp: float
    health: str = "offline"
    cause: str = ""
    reachable: bool = False
    simulated: bool = False
    worker: str = ""
    mode: str = ""
    armed: bool | None = None
    battery: float | None = None
    position: Vector3 | None = None
    activity: str = ""
    emergency_stop: bool = False
    stop_cause: str = ""
    last_command: str = ""
    last_outcome: str = ""
    senders: dict[str, float] = {}
    site: Vector3 | None = None
    placement: Placement | None = None
    separation: str = ""
    in_use: bool = False
    drop_in: str = ""
    speed: float | None = None
    age: float | None = None
    run: str = ""
    left_run: str = ""
    heading: float | None = None
    control: str = ""


class EdgeState(msgspec.Struct, frozen=True, omit_defaults=True):
    """Current state of one edge, with its bus and cloud connections. ``robots``: number of robots by health.

    Towards the cloud, ``waiting`` samples wait for a later tick, and ``queued`` messages wait to be sent:
    ``spooled`` durable ones, ``unheard`` of these because their topics have no subscriber, and QoS 0
    (``queued_bytes``). ``refused`` messages were refused in either direction, ``dropped`` ones lost.
    ``round_trip`` is seconds to the cloud and back. ``problems`` are those of the edge's own services (bus,
    disk, ...) without the cloud, as text. ``groups`` and ``places`` are those of its fleet.yaml. ``pair`` is
    its role in its pair (holder, standby or fenced), ``epoch`` that of its lease, ``pair_file`` the digest of
    the settings that must be the same in both files.
    """

    edge: str
    version: str
    stamp: float
    uptime: float
    health: str = "ok"
    cause: str = ""
    robots: dict[str, int] = {}
    bus: str = "ok"
    cloud: str = "none"
    cloud_cause: str = ""
    queued: int = 0
    queued_bytes: int = 0
    spooled: int = 0
    unheard: int = 0
    waiting: int = 0
    refused: int = 0
    round_trip: float | None = None
    dropped: int = 0
    load: float | None = None
    memory_percent: float | None = None
    threads: int | None = None
    groups: dict[str, list[str]] = {}
    places: dict[str, Place] = {}
    pair: str = ""
    epoch: int = 0
    pair_file: str = ""
    problems: list[str] = []
