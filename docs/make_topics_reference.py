"""Writes docs/topics.md from the tables of the wire; run it after changing one.

python docs/make_topics_reference.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import inspect
import pathlib
import re
from collections.abc import Iterable, Iterator

from fleet.bus import keys
from fleet.wire.commands import STOP_WORDS, VERBS
from fleet.wire.navigation import CONTROLS, MOST_LOOPS, MOST_WAYPOINTS, TASKS, WORLD_FRAMES
from fleet.wire.rules import CHANNEL_LEAVES, RULES
from fleet.wire.topics import INBOUND, JOINT_UPDATE

TARGET = pathlib.Path(__file__).with_name("topics.md")

INTRODUCTION = """\
# Topics and keys

Made from the tables in `fleet/wire` by `docs/make_topics_reference.py`; do not edit.

`T` is `{prefix}cyberwave/twin/{twin}/`, `J` is `{prefix}cyberwave/joint/{twin}/`, with the uuid of the twin.
The prefix is put in front as it is, without a separator. It is the one configured, else the first that is
set of `CYBERWAVE_MQTT_TOPIC_PREFIX`, `CYBERWAVE_TOPIC_PREFIX` and `CYBERWAVE_ENVIRONMENT` (unless that is
`production`). An edge subscribes under one prefix only.
"""

CLASSES = """\
| class | what becomes of it while the cloud is slow or away |
|---|---|
| reply, status, event | kept in order on disk, sent at least once |
| latest | only the newest is kept |
| stream | dropped first |
"""

PAYLOADS = """\
Every message has `timestamp` (Unix seconds, when it was measured), `session_id` (the edge's client id) and
`source_type` (`edge`, or `sim` for a simulated robot); `connected` and `disconnected` have no source type.
What is unknown is left out, and a number that is not finite is never sent. An exact zero position and an
exact identity rotation are moved by 1e-9, because the SDK's readers take them for "not given".
"""

ENVELOPE = """\
`{source_type, command, data, timestamp, session_id}`; `type` does for `command`, `ts` for `timestamp`, and
milliseconds for seconds. `data` may be missing. A message with a `status` is a reply and is ignored. Refused
are NaN, infinity, numbers in quotes, a key that stands twice, more than 1 MiB, more than 32 levels.
"""

VERBS_RULE = """\
The verb fixes axis and sign; the magnitude is the absolute value of its own field, else of `linear_x`, else a
default. A `distance` (m) without the own field makes it a displacement: the robot's own command where it
declares the verb (`ascend`, `descend`), else a way that it goes like a goal, 0.1 m to what it does in 30 s.
A magnitude that is not a finite number is refused.
"""

SIGNED = """\
Signed, body frame (x forward, y left, z up, left turn positive), m/s and rad/s: `move`, `set_linear_velocity
{linear}`, `set_angular_velocity {angular}`, the twist on `T motion/command`, and the contracts
`locomotion.velocity_command.v1` and `aerial.velocity_command.v1` in the top-level `velocity_command`, whose
`duration_ms` is the lease (0.15 to 5 s; 0 is a stop). `estop {activate: false}` releases an emergency stop.
"""

GOALS = """\
A place is `position` (`[x, y, z]` or `{x, y, z}`, m) or `geodetic_position`, never both. The heading is `yaw`
(rad), else `rotation` by name, else as a list: x y z w in `navigate_to_pose`, w x y z in the others, or as
`rotation_order` says. A geodetic goal is turned by `orientation.heading` (degrees clockwise from north);
its `altitude` counts from the take-off point unless `coordinate_frame.altitude_reference` is `amsl`.
`constraints` may hold `max_speed_ms` and `goal_tolerance_m`, `metadata` `wait_s` and `max_loops`.
"""

SAMPLES = """\
A sample is a u32 header length, f64 Unix seconds, i64 sequence, header JSON (little-endian), then JSON. Plain
JSON without a header is read too. The payloads differ from those on MQTT; the bridge translates.
"""

SHAPES = {
    "position": "`ts, x, y, z, qx, qy, qz, qw`",
    "joint_states": "`ts, names[], positions[], velocities[]?, efforts[]?`",
    "battery": "`ts, voltage_v?, current_a?, charge_pct?`",
    "imu": "`ts, accel{x,y,z}, gyro{x,y,z}`",
    "gps": "`ts, latitude, longitude, altitude, fix_type, satellite_count?, ...`",
}


def topic(leaf: str) -> str:
    """Return how a leaf is written in the tables."""
    return "`J update`" if leaf == JOINT_UPDATE else f"`T {leaf}`".replace("+", "{client_id}")


def rate(hertz: float) -> str:
    """Return a rate, a dash for none."""
    return f"{hertz:g}" if hertz else "-"


def words(names: Iterable[str]) -> str:
    """Return names as code, separated by commas."""
    return ", ".join(f"`{name}`" for name in names)


def outbound() -> Iterator[str]:
    """Yield the table of what the edge sends."""
    yield "| topic | what | class | QoS | at most, Hz | repeated at, Hz |"
    yield "|---|---|---|---|---|---|"
    for rule in RULES.values():
        rates = f"{rate(rule.max_rate)} | {rate(rule.repeat)}"
        yield f"| {topic(rule.leaf)} | {rule.about} | {rule.traffic.name.lower()} | {rule.qos} | {rates} |"


def inbound() -> Iterator[str]:
    """Yield the table of what the edge subscribes to."""
    yield from ("| topic | QoS |", "|---|---|")
    yield from (f"| {topic(leaf)} | {qos} |" for leaf, qos in INBOUND.items())


def verbs() -> Iterator[str]:
    """Yield the table of motion verbs."""
    yield from ("| command | moves along | own field |", "|---|---|---|")
    for name, verb in VERBS.items():
        yield f"| `{name}` | {'+' if verb.sign > 0 else '-'}{verb.axis} | `{verb.own_field}` |"


def channels() -> Iterator[str]:
    """Yield the table of the reports' channels on the bus."""
    yield from ("| key | payload | goes to |", "|---|---|---|")
    for channel, leaves in CHANNEL_LEAVES.items():
        shape = SHAPES.get(channel, "the report's fields, with `ts`")
        yield f"| `cw/{{twin}}/data/{channel}` | {shape} | {', '.join(map(topic, leaves))} |"
    yield "| `cw/{twin}/data/commands/velocity` | `linear_x` to `angular_z`, signed | the robot: a setpoint |"


def fleet_keys() -> Iterator[str]:
    """Yield the table of the fleet's own keys, which is that of the module."""
    yield from ("| key | what |", "|---|---|")
    for key, what in re.findall(r"^(``\S+``)\s+(.+)$", inspect.getdoc(keys) or "", re.MULTILINE):
        yield f"| {key.replace('``', '`')} | {what.replace('``', '`')} |"


def render() -> str:
    """Return the whole reference."""
    goals = f"Tasks: {words(TASKS)}. Controls: {words(CONTROLS)} (`cancel` and `hover` are `stop`)."
    bounds = (
        f"At most {MOST_WAYPOINTS} waypoints and {MOST_LOOPS} loops. Frames: {words(sorted(WORLD_FRAMES))}; "
        "any other is refused, and so are actions at a goal."
    )
    stops = f"{words(sorted(STOP_WORDS))} are obeyed even when their stamp, sender or data is malformed."
    sections = [
        INTRODUCTION,
        "## From the edge to the cloud\n",
        *outbound(),
        "",
        CLASSES,
        PAYLOADS,
        "## From the cloud to the edge\n",
        *inbound(),
        "",
        "### Commands\n",
        ENVELOPE,
        f"{stops}\n",
        VERBS_RULE,
        *verbs(),
        "",
        SIGNED,
        "### Goals\n",
        f"{goals}\n",
        GOALS,
        f"{bounds}\n",
        "## On the bus\n",
        SAMPLES,
        *channels(),
        "",
        *fleet_keys(),
    ]
    return "\n".join(sections) + "\n"


if __name__ == "__main__":
    TARGET.write_text(render(), encoding="utf-8")
