"""Writes docs/reference/topics.md from the tables of the wire; run it after changing one.

python docs/reference/make_topics_reference.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import inspect
import pathlib
import re
from collections.abc import Iterable, Iterator

from fleet.bridge.event_limits import A_MINUTE, DEFAULT_A_MINUTE, LOOP
from fleet.bus import keys
from fleet.model.event import EventKind
from fleet.wire.navigation import CONTROLS, MOST_LOOPS, MOST_WAYPOINTS, TASKS, WORLD_FRAMES
from fleet.wire.rulebook import PROFILES, RuleChange
from fleet.wire.rules import CHANNEL_SUFFIXES, INWARD, KIB, MIB, RULES, Recipient, TopicForm, TopicRule
from fleet.wire.stops import STOP_WORDS
from fleet.wire.sub_states import TELEMETRY
from fleet.wire.topic_rules import topic_name
from fleet.wire.topics import NAMESPACES
from fleet.wire.verbs import VERBS

TARGET = pathlib.Path(__file__).with_name("topics.md")

INTRODUCTION = """\
# Topics and keys

Made from the tables in `fleet/wire` by `docs/reference/make_topics_reference.py`; do not edit.

`T` is `{prefix}cyberwave/twin/{twin}/`, `J` is `{prefix}cyberwave/joint/{twin}/`, with the uuid of the twin;
other topics are written without `{prefix}cyberwave/`.
The prefix is put in front as it is, without a separator. It is the one configured, else the first that is
set of `CYBERWAVE_MQTT_TOPIC_PREFIX`, `CYBERWAVE_TOPIC_PREFIX` and `CYBERWAVE_ENVIRONMENT` (unless that is
`production`). An edge subscribes under one prefix only.
"""

CLASSES = """\
| class | how it is queued while the cloud is slow or away |
|---|---|
| reply, status, event | kept in order on disk, sent at least once |
| latest | only the newest is kept |
| stream | dropped first: as soon as more bytes wait than the profile allows |

"Off" topics are sent only when fleet.yaml says `on: true`. A message larger than its size is not sent, and
counted. After its age a message is not worth sending any more, wherever it waits.
"""

TELEMETRY_TEXT = """\
### Telemetry and metrics

When a robot answers, `T telemetry` says `connected` and `telemetry_start`; when it is lost or the edge ends,
`disconnected` and `telemetry_end`. An end of the whole twin (one without `sensor`, `stream_source` or
`stream_instance_id`) closes all its streams and recordings: it is not sent, and counted, while a program on
the bus has signalled a stream of that twin. A `type` that is told again and again is state: the newest
crosses, and none from before an outage arrives after it. Every other type is an event, as the row says:
"""

LAYOUTS_TEXT = """\
`J update` is aggregated (`positions`, `velocities`, `efforts`) unless its rule has `layout: single` (a
message for each joint) or `flat` (positions at the top); which arm moves the joints, if a report says so
(`source_subtype`, `workload_uuid`, `camera_frame_counters`) goes along. The `data` of `T depth` is an object,
or with `layout: string` the image in base64 and with `list` a list of `uint16`; width, height and dtype then
stand beside it. A pose has the `frame_id` that its report names.
"""

METRICS_TEXT = """\
`T metrics` has its categories in `metrics`, whatever they are; those that a robot's adapter reports and those
of a program on the bus do not replace each other. A `camera_sync_frame` keeps the `session_id` of its stream.
"""

RULES_TEXT = """\
### Rules

fleet.yaml changes a row under `cloud.rules` for all robots, or under a robot's own `rules`, which win. A
topic's name is what stands behind the uuid; in another namespace, with the namespace in front:

```yaml fragment
cloud:
  profile: lte
  rules:
    position: {rate: 2}
    joint/update: {on: false}
    event: {max_age: 3600}
  inbound:
    commands/sync_workflows: {on: false}
  channels:
    thermal: {topic: sensors/thermal, traffic: latest, rate: 1}
robots:
  - name: rex
    rules:
      pointcloud: {rate: 1, size: 1000000}
```

`rotation` and `joint_states` are made with another topic and have its rule; they take only `on`. What a
robot is asked is never thinned, so that no stop is lost. A bus channel that is not in the table crosses
only when it stands under `channels`: its JSON objects, with source type, session and stamp.

What each profile changes (Hz, bytes):
"""

PAYLOADS = """\
Every message has `timestamp` (Unix seconds, when it was measured), `session_id` (the edge's client id) and
`source_type` (`edge`, `sim` for a simulated robot, `edge_leader` or `edge_follower` by its `role`);
`connected` and `disconnected` have no source type.
What is unknown is left out, and a number that is not finite is never sent. An exact zero position and an
exact identity rotation are moved by 1e-9, because the SDK's readers take them for "not given".
"""

HEALTH = """\
`T edge_health` also has the robot's own `health` (ok, degraded, offline, fault) and `cause`. Of the edge
itself `{prefix}edges/{edge}/health`, beside the topic of its commands in Cyberwave's contract, has the
roll-up each 5 s (QoS 0): `{type: "edge_state", edge_id, health, cause, robots, unwell, timestamp, ...}`, with
how many `robots` are how, and `unwell` with name, twin, health and cause of up to 50 that are not well.
"""

EVENTS = """\
Events of the fleet on `T event` have the SDK's form, `{event_type, source: "fleet", data, timestamp}`; `data`
has `text`, `severity` (info, warning, error, critical) and the details, and where a command led to it also
`command`, `request` (its id) and `asker` (`way`, `name`, `source_type`).

| event_type | what | at most a minute |
|---|---|---|
"""

EVENT_BOUNDS = f"""
The bounds are of one robot. A loop (an event starts a workflow, whose command leads to the event again) is
cut: once more than {LOOP} requests from the cloud have led to events of one kind of a robot within a minute,
no more of that kind that such a request led to are told until a minute has passed in which that was not so.
What was cut is told as `gap` on `T telemetry`, with the reason `rate` or `loop` and the number, a minute
after the first of it.

A program on the bus says no event with `source: "fleet"` of a robot that runs in the bridge's own process: it
is refused and counted as `forged`. Of a worker's robot it is told, with limits of its own, and its `asker` is
never `proven`.
"""

WHAT_HAPPENED = {
    EventKind.EMERGENCY_STOP: "the emergency stop was set",
    EventKind.AUTHORITY_LOST: "another operator (a pilot, a remote control) took control of the robot",
    EventKind.HEALTH: "its health changed: `level`, `cause`",
    EventKind.FOUND: "it answers: `level`, `cause`",
    EventKind.LOST: "it does not answer any more: `level`, `cause`",
    EventKind.FAILSAFE: "its autopilot's fail-safe began: `mode`, `status_texts`",
    EventKind.FENCE: "it is where its fence forbids: `reason`",
    EventKind.BATTERY: "its battery is low, and what `battery_policy` did about it: `percent`, `action`",
    EventKind.SEPARATION: "it is slowed or held for another robot: `robot`, `distance_m`, `reason`",
}

REFUSED = """\
A retained message is refused, and so is what is too large, cannot be read, or carries the edge's own
`session_id` at its top. None of that holds for a stop
([adr 0010](../adr/0010-nothing-between-a-stop-and-the-robot.md)): a retained one counts once, and not again
when the connection is made anew; what is too large to be read is an emergency stop on `T command`, a stop on
`T navigate/command` and `T mission/command`.

What is asked of a robot is answered: to the Response Topic of a request, else with a status on `T command`
(the success of a velocity or of joint targets is not told, their refusal once a second), on
`T navigate/status`, or on `T mission/status`. A command that was accepted is told once more when it has
ended, by a status on `T command` with `done`, the reason in the robot's own words when that is false, and the
request's Correlation Data, where that is text, as `correlation_id`; what was done at once has `done` in its
one answer. A command that the death of the edge cut off ends with a status too, `done: false`, once the edge
is back, without `correlation_id`. With `legacy_status: false` a robot sends no status.
Missions are flown by robots with a memory for them.

Joint targets on `J update` are a stream of motion, as velocities are: at most `max_age` (0.5 s) old, none
older than its sender's last, within the control lease, from a source type that `accepts.command` names;
each lives for `setpoint_lease` (0.5 s), then the joint holds where it is, as after any stop. All published
forms are read (`target_positions`, aggregated, single, flat; `update_mode` absolute or relative);
velocities and efforts beside a position are not used. A joint that takes no targets, a position outside its
range, or one that is no number, refuses the whole message. No joint goes faster than its adapter declares.
What an `edge_leader` measured leads a robot that accepts `edge_leader`; what `edge`, `edge_follower` and
`sim` measured asks nothing.

A robot with `follows: TWIN` in fleet.yaml follows the joints that this twin tells on the bus, those of the
same names, from the command `follow_leader` on, until any stop, or until the leader is silent for a lease.
A leader (`role: leader`) cannot be led by one.

Of `T position`, `T rotation` and `T scale` only messages of the editor (`source_type: edit`) go to the bus,
for local programs; they move nothing. Measured and simulated poses from other sources are ignored. With MQTT
3.1.1 a broker sends an edge's own state back to it; `inbound: {position: {on: false}}` avoids that traffic.

A twin has one edge. An edge learns that another edge has the twin from the token
`fleet/{edge}/claims/{twin}/{since}-held` on the bus, or, while its own robot is not in use, from two
`edge_health` messages in the cloud. It then does not run the robot and forwards nothing for it, answers
requests with the name of the other edge (after a second), and takes the twin when the other edge is gone. A
stop is executed all the same. A robot in use is never lost to a claim.

When an edge dies, the broker publishes its will: `disconnected` on `T telemetry`, at once, but only for the
first twin of fleet.yaml, because an MQTT connection has one will. The edge's supervisor publishes it for all
twins within a second, unless another edge has taken over by then. When the whole computer dies, the missing
`T edge_health`, published every 5 s, is the sign: none for 16 s means that no edge serves the twin. When the
edge is connected again it publishes `connected` for each twin that answers, and once after its start
`disconnected` for those that do not.
"""

ENVELOPE = """\
`{source_type, command, data, timestamp, session_id, twin_uuid}`; `type` does for `command`, `ts` for
`timestamp`, and milliseconds for seconds. `data` may be missing. A message with a `status` is a reply and is
ignored. Refused are the `twin_uuid` of another twin (but for a stop), NaN, infinity, numbers in quotes, a key
that stands twice, more than 1 MiB, more than 32 levels.
"""

VERBS_RULE = """\
The verb fixes axis and sign; the magnitude is the absolute value of its own field, else of `linear_x`, else a
default. A `distance` (m) without the own field makes it a displacement: the robot's own command where it
declares the verb (`ascend`, `descend`), else a way that it goes like a goal, 0.1 m to what it does in 30 s.
A magnitude that is not a finite number is refused, and so is a field that the verb does not read: a misspelt
one with the near miss, a speed other than 0 along another axis by name. A misspelt field of a goal, a mission
or joint targets is refused as well; fields of other programs are let through at the top of a message. A robot
that cannot move sideways, or stays on the ground, refuses a velocity that has such a part.
"""

SIGNED = """\
`set_linear_velocity {linear}` (m/s) and `set_angular_velocity {angular}` (rad/s) move nothing. They store the
magnitude, within the robot's limits, that later verbs of the same session have when they bring none, also
those with a `distance`, and answer with the applied value in `data`. A stop, anybody else who moves the robot
(an operator, a pilot) and a restart of the edge or the adapter end the setting.

Signed, body frame (x forward, y left, z up, left turn positive), m/s and rad/s: `move`, the twist on `T
motion/command`, and the contracts `locomotion.velocity_command.v1` and `aerial.velocity_command.v1` in the
top-level `velocity_command`, whose `duration_ms` is the lease (0.15 to 5 s; 0 is a stop). `estop {activate:
false}` releases an emergency stop.
"""

GOALS = """\
A place is `position` (`[x, y, z]` or `{x, y, z}`, m) or `geodetic_position`, never both. The heading is `yaw`
(rad), else `rotation` by name, else as a list: x y z w in `navigate_to_pose`, w x y z in the others, or as
`rotation_order` says. A geodetic goal is turned by `orientation.heading` (degrees clockwise from north);
its `altitude` counts from the take-off point unless `coordinate_frame.altitude_reference` is `amsl`.
`constraints` may hold `max_speed_ms` and `goal_tolerance_m`, `metadata` `wait_s` and `max_loops`.
"""

SAMPLES = """\
A sample is a u32 header length, f64 Unix seconds, i64 sequence, header JSON (little-endian), then JSON, or
the bytes of an array whose `shape` and `dtype` the header names. Plain JSON without a header is read too.
The payloads differ from those on MQTT; the bridge translates. A sensor in a key becomes `sensor_id`.
"""

SHAPES = {
    "event": "`event_type, source, data`; of the fleet also `ts, text, severity, asker?, command?, request?`",
    "telemetry": "as on MQTT, other fields beside `type` or in `fields`",
    "metrics": "as on MQTT, categories in `metrics` or at the top",
    "driverlog": "as on MQTT: `message, level`, and what else is told of who says it",
    "position": "`ts, x, y, z, qx, qy, qz, qw, frame_id?`",
    "joint_states": "`ts, names[], positions[], velocities[]?, efforts[]?, source_subtype?, workload_uuid?`",
    "battery": "`ts, voltage_v?, current_a?, charge_pct?`",
    "imu": "`ts, accel{x,y,z}, gyro{x,y,z}`",
    "depth": "array `[height, width]` of `uint16` (mm) or `float32` (m)",
    "pointcloud": "array `[..., 3]` (x y z, m) or `[..., 6]` (and r g b) of `float32`",
    "gps": "`ts, latitude, longitude, altitude, fix_type, satellite_count?, ...`",
}


def topic(suffix: str) -> str:
    """Return how a suffix is written in the tables."""
    namespace, _, rest = suffix.partition(":")
    if namespace not in NAMESPACES:
        return f"`T {suffix}`".replace("+", "{client_id}")
    level = "{execution}" if namespace == "workflow" else "{type}"
    return f"`J {rest}`" if namespace == "joint" else f"`{namespace}/{{uuid}}/{rest}`".replace("+", level)


def size(count: int) -> str:
    """Return a size in bytes as people say it."""
    return f"{count // MIB} MiB" if count >= MIB else f"{count // KIB} KiB"


def said_change(change: RuleChange) -> str:
    """Return what a profile changes of a topic."""
    if change.on is False:
        return "off"
    parts = [f"{change.rate:g} Hz" if change.rate else "", size(change.size) if change.size else ""]
    return ", ".join(filter(None, parts))


def profiles() -> Iterator[str]:
    """Yield the table of profiles: a row for each topic that one of them changes."""
    yield f"| topic | {' | '.join(f'`{name}`' for name in PROFILES)} |"
    yield f"|---|{'---|' * len(PROFILES)}"
    changed = dict.fromkeys(suffix for profile in PROFILES.values() for suffix in profile.changes)
    for suffix in changed:
        row = [
            said_change(profile.changes[suffix])
            if suffix in profile.changes
            else said_change(_own(RULES[suffix]))
            for profile in PROFILES.values()
        ]
        yield f"| `{topic_name(suffix)}` | {' | '.join(row)} |"
    yield f"| bytes that may wait | {' | '.join(size(one.backlog) for one in PROFILES.values())} |"


def _own(rule: TopicRule) -> RuleChange:
    """Return what the table says of a topic."""
    return RuleChange(rate=rule.max_rate, size=rule.size if rule.size > 64 * KIB else None)


def rate(hertz: float) -> str:
    """Return a rate, a dash for none."""
    return f"{hertz:g}" if hertz else "-"


def words(names: Iterable[str]) -> str:
    """Return names as code, separated by commas."""
    return ", ".join(f"`{name}`" for name in names)


def outbound() -> Iterator[str]:
    """Yield the table of what the edge sends."""
    yield "| topic | what | bus channel | class | QoS | at most, Hz | repeated at, Hz | age, s | size |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for rule in RULES.values():
        channel = f"`{rule.channel}`" if rule.channel else "-"
        rates = f"{rate(rule.max_rate)} | {rate(rule.repeat)} | {rate(rule.max_age)}"
        about = rule.about if rule.on else f"{rule.about} (off)"
        carried = f"{rule.traffic.word} | {rule.qos} | {rates} | {size(rule.size)}"
        yield f"| {topic(rule.suffix)} | {about} | {channel} | {carried} |"


def inbound() -> Iterator[str]:
    """Yield the table of what the edge subscribes to."""
    yield "| topic | what | goes to | QoS | at most, Hz | size |"
    yield "|---|---|---|---|---|---|"
    for rule in INWARD.values():
        goes = {True: "the robot", False: "the bridge"}[rule.taker.is_request]
        if rule.taker is Recipient.RELAY:
            key = f"cw/{{uuid}}/data/{rule.channel}"
            goes = f"`{key}/{{type}}`" if rule.suffix.endswith("+") else f"`{key}`"
        about = rule.about if rule.on else f"{rule.about} (off)"
        bounds = f"{rule.qos} | {rate(rule.max_rate)} | {size(rule.size)}"
        yield f"| {topic(rule.suffix)} | {about} | {goes} | {bounds} |"


def telemetry_parts() -> Iterator[str]:
    """Yield the table of the types of telemetry that are carried otherwise than the row says."""
    yield from (
        "| type | class | QoS | at most, Hz | age, s | one state for each |",
        "|---|---|---|---|---|---|",
    )
    for name, part in TELEMETRY.items():
        carried = f"{part.traffic.word} | {part.qos} | {rate(part.max_rate)} | {rate(part.max_age)}"
        yield f"| `{name}` | {carried} | {f'`{part.apart}`' if part.apart else '-'} |"


def verbs() -> Iterator[str]:
    """Yield the table of motion verbs."""
    yield from ("| command | moves along | own field |", "|---|---|---|")
    for name, verb in VERBS.items():
        yield f"| `{name}` | {'+' if verb.sign > 0 else '-'}{verb.axis} | `{verb.own_field}` |"


def channels() -> Iterator[str]:
    """Yield the table of the reports' channels on the bus."""
    yield from ("| key | payload | goes to |", "|---|---|---|")
    for channel, suffixes in CHANNEL_SUFFIXES.items():
        rule = RULES[suffixes[0]]
        own = (
            "as on MQTT; stamped by `timestamp`, `ts` or the header"
            if rule.form is TopicForm.DOCUMENT
            else ""
        )
        shape = SHAPES.get(channel) or own or "the report's fields, with `ts`"
        sensor = "/{type}" if rule.suffix.endswith("+") else "[/{sensor}]" if rule.sensors else ""
        yield f"| `cw/{{twin}}/data/{channel}{sensor}` | {shape} | {', '.join(map(topic, suffixes))} |"
    yield "| `cw/{twin}/data/commands/velocity` | `linear_x` to `angular_z`, signed | the robot: a setpoint |"
    yield (
        "| `cw/{twin}/data/commands/joint_positions` | as on `J update`, or arrays `names` and `positions` | "
        "the robot: joint targets |"
    )


def events() -> Iterator[str]:
    """Yield the rows of the table of events."""
    for kind, what in WHAT_HAPPENED.items():
        yield f"| `{kind.value}` | {what} | {A_MINUTE.get(kind, DEFAULT_A_MINUTE)} |"


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
    stops = (
        f"{words(sorted(STOP_WORDS))} and `estop` are obeyed on each of these topics, from anyone and at any "
        "age, whatever their stamp, sender or data is; also in other writing (`E-Stop`), beside another "
        "command, in a message that is cut short, in UTF-16 or in no JSON at all. The answer then says that "
        "the message was refused, too."
    )
    sections = [
        INTRODUCTION,
        "## From the edge to the cloud\n",
        *outbound(),
        "",
        CLASSES,
        PAYLOADS,
        TELEMETRY_TEXT,
        *telemetry_parts(),
        "",
        METRICS_TEXT,
        LAYOUTS_TEXT,
        HEALTH,
        "### Events\n",
        EVENTS.rstrip(),
        *events(),
        EVENT_BOUNDS,
        RULES_TEXT,
        *profiles(),
        "",
        "## From the cloud to the edge\n",
        *inbound(),
        "",
        REFUSED,
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
