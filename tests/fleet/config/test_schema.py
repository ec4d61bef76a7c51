import json

import pytest
from pydantic import BaseModel, ValidationError

from fleet.config.schema import FleetConfig
from fleet.config.text import printable
from fleet.robot_config import AdapterConfig, FenceConfig

ROBOT = "{name: a, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: toy, link: x}"


@pytest.fixture
def section(yard):
    """Load a file with this one more section."""

    def section(text, environ=None):
        return yard.load(f"edge: {{id: e}}\n{text}\nplugins: [plugins]\nrobots: [{ROBOT}]\n", environ).config

    return section


@pytest.fixture
def refused(yard):
    def refused(text, environ=None):
        whole = f"edge: {{id: e}}\n{text}\nplugins: [plugins]\nrobots: [{ROBOT}]\n"
        return yard.problems(whole, environ)

    return refused


def test_a_wrong_variable_is_reported_by_its_name(refused):
    assert refused("cloud: {host: h}", {"CYBERWAVE_MQTT_PORT": "no"}) == [
        (
            "fleet.yaml:2:8: cloud.port (from CYBERWAVE_MQTT_PORT): must be a whole number "
            "(Left out: CYBERWAVE_MQTT_PORT, else 8883.)"
        )
    ]


@pytest.mark.parametrize(
    "text", ["cloud: {host: h, tls: false, insecure: true}", "cloud: {host: '::1', tls: false}"]
)
def test_plain_text_is_allowed_here_or_when_it_is_asked_for(section, text):
    assert section(text).cloud.tls is False


def test_plain_text_to_another_computer_is_refused_at_its_key(refused):
    (problem,) = refused("cloud: {host: mqtt.example.com, tls: false}")
    assert problem.startswith("fleet.yaml:2:33: cloud.tls: plain text to another computer")


@pytest.mark.parametrize("host", ["mqtts://h", "h:1883", ""])
def test_a_host_is_a_name_alone(refused, host):
    assert refused(f"cloud: {{host: '{host}'}}")[0].startswith("fleet.yaml:2:15: cloud.host: must ")


@pytest.mark.parametrize(
    ("bus", "place"),
    [
        ("mode: client", "2:7: "),
        ("user: u", "2:7: "),
        ("listen: [tls/0.0.0.0:7447]", "2:7: "),
        ("listen: [tcp/0.0.0.0:7447]", "2:16: "),
        ("listen: ['tcp/[::]:7447']", "2:16: "),
        ("listen: [tcp/127.0.0.1:7447]", "2:16: "),
        ("scouting: true", "2:17: "),
        ("listen: [7447]", "2:16: "),
        ("listen: [tpc/127.0.0.1:7447]", "2:16: "),
        ("tls: {root_ca: none.pem, cert: none.pem, key: none.pem}", "2:22: "),
    ],
)
def test_a_bus_that_cannot_work_or_is_open_to_anyone_is_refused(refused, bus, place):
    assert refused(f"bus: {{{bus}}}")[0].startswith(f"fleet.yaml:{place}")


TLS = "tls: {root_ca: fleet.yaml, cert: fleet.yaml, key: fleet.yaml}"
ONE_SIDED = TLS.replace("}", ", mutual: false}")
LOOPBACK = "'tcp/127.0.0.1:7447', 'tcp/[::1]:1', tcp/localhost:1"


@pytest.mark.parametrize(
    "bus",
    [
        "listen: [unixsock-stream//run/fleet.sock]",
        f"listen: [{LOOPBACK}], insecure: local",
        f"listen: [{LOOPBACK}, unixsock-stream//run/fleet.sock], user: u, password: p",
        "listen: [tcp/0.0.0.0:7447], user: u, password: p",
        "listen: [tcp/0.0.0.0:7447], insecure: true",
        "mode: client, connect: [tcp/10.0.0.1:7447], insecure: true",
        "mode: client, connect: [tcp/127.0.0.1:7447], insecure: local",
        f"listen: [tls/0.0.0.0:7447], {TLS}",
        f"listen: [quic/0.0.0.0:7447], scouting: true, {TLS}",
        f"listen: [tls/0.0.0.0:7447], user: u, password: p, {ONE_SIDED}",
        f"connect: [tls/10.0.0.1:7447], {ONE_SIDED}",
    ],
)
def test_a_bus_that_is_guarded_is_taken(section, bus):
    assert section(f"bus: {{{bus}}}").bus


@pytest.mark.parametrize(
    ("bus", "expected"),
    [
        (
            f"listen: [tls/0.0.0.0:1, tcp/0.0.0.0:2], {TLS}",
            {"listen[1]: anyone on the network could command"},
        ),
        (f"listen: [tls/0.0.0.0:1, tcp/127.0.0.1:2], {TLS}", {"listen[1]: every user of this computer"}),
        (f"listen: [tls/0.0.0.0:1], {ONE_SIDED}", {"listen[0]: anyone on the network could command"}),
        (f"listen: [tls/127.0.0.1:1], {ONE_SIDED}", {"listen[0]: every user of this computer"}),
        (f"listen: [udp/0.0.0.0:1, ws/0.0.0.0:2], {TLS}", {"listen[0]: anyone", "listen[1]: anyone"}),
        ("listen: [tcp/0.0.0.0:1], insecure: local", {"listen[0]: anyone on the network"}),
        ("listen: [tcp/localhost.example.com:1], insecure: local", {"listen[0]: anyone on the network"}),
        ("listen: ['tcp/0.0.0.0:1#x=/127.0.0.1:1'], insecure: local", {"listen[0]: anyone on the network"}),
        ("connect: [tcp/10.0.0.1:1]", {"connect[0]: anyone on the network could answer there instead"}),
        (
            "connect: [tcp/127.0.0.1:1]",
            {"connect[0]: every user of this computer could answer there instead"},
        ),
        ("listen: [unixpipe//run/fleet.pipe]", {"listen[0]: every user of this computer could command"}),
        (
            "listen: [unixsock-stream//tmp/f.sock]",
            {"listen[0]: every user of this computer may write to"},
        ),
        ("connect: [unixsock-stream//tmp/f.sock]", {"connect[0]: every user of this computer may write to"}),
        ("scouting: true, user: u, password: p", {"scouting: anyone on the network could announce itself"}),
        (f"scouting: true, connect: [tcp/10.0.0.1:1], {TLS}", {"scouting: anyone", "connect[0]: anyone"}),
        (f"listen: ['tls/0.0.0.0:1#enable_mtls=false'], {TLS}", {"listen[0]: enable_mtls cannot be set for"}),
        (
            f"connect: ['tls/a:1#verify_name_on_connect=0'], {TLS}",
            {"connect[0]: verify_name_on_connect cannot"},
        ),
        ("listen: [unixsock-stream//run/" + "x" * 95 + "]", {"listen[0]: the path has 100 bytes"}),
        ("connect: [unixsock-stream//run/" + "x" * 103 + "]", {"connect[0]: the path has 108 bytes"}),
    ],
)
def test_each_endpoint_of_the_bus_is_judged_by_itself(refused, bus, expected):
    problems = [problem.partition("bus.")[2] for problem in refused(f"bus: {{{bus}}}")]
    assert len(problems) == len(expected)
    assert all(any(problem.startswith(start) for problem in problems) for start in expected), problems


def test_a_password_over_the_open_network_is_taken_with_a_warning(yard):
    bus = "bus: {listen: [tcp/0.0.0.0:7447, tcp/127.0.0.1:1], user: u, password: p}"
    (warning,) = yard.load(f"edge: {{id: e}}\n{bus}\nplugins: [plugins]\nrobots: [{ROBOT}]\n").warnings
    assert "bus.listen[0]: the password is required, but the traffic can be read" in str(warning)


@pytest.mark.parametrize("folder", ["none", "fleet.yaml"])
def test_plugin_folders_must_be_folders(yard, folder):
    assert yard.problems(f"edge: {{id: e}}\nplugins: [plugins, {folder}]\nrobots: [{ROBOT}]\n")[0].startswith(
        "fleet.yaml:2:20: plugins[1]: "
    )


def test_secrets_are_not_printed_by_the_models(section):
    config = section("cloud: {host: h, token: cw_canary, username: anna, password: pw_canary}")
    assert "canary" not in repr(config) + config.model_dump_json() + str(config.model_dump())


def all_models(model):
    """Return a model and every model in its fields."""
    seen, open_ = set(), [model]
    while open_:
        each = open_.pop()
        if each in seen:
            continue
        seen.add(each)
        for field in each.model_fields.values():
            stack = [field.annotation]
            while stack:
                kind = stack.pop()
                stack += getattr(kind, "__args__", ())
                if isinstance(kind, type) and issubclass(kind, BaseModel):
                    open_.append(kind)
    return seen


@pytest.mark.parametrize("model", sorted(all_models(FleetConfig), key=lambda each: each.__name__))
def test_every_key_is_described_and_every_model_frozen(model):
    assert model.model_config["frozen"]
    assert model.model_config["extra"] == "forbid"
    assert [name for name, field in model.model_fields.items() if not field.description] == []


def test_robots_are_a_part_of_what_is_described():
    assert AdapterConfig in all_models(FleetConfig)


@pytest.mark.parametrize(
    ("text", "safe"),
    [("a\x1b[2Jb", "a\\x1b[2Jb"), ("a\tb", "a b"), ("\u202e\x9b", "\\u202e\\x9b"), ("größe", "größe")],
)
def test_nothing_that_steers_a_terminal_is_printed(text, safe):
    assert printable(text) == safe


# -- topics -------------------------------------------------------------------------------------------

TOPICS = """\
edge: {id: yard-1}
cloud:
  host: 127.0.0.1
  tls: false
  profile: lte
  rules:
    position: {rate: 5}
    joint/update: {on: false}
  inbound:
    alert: {size: 1000}
  channels:
    thermal: {topic: sensors/thermal}
  environments: [6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c50]
plugins: [plugins]
robots:
  - name: rex
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
    adapter: toy
    link: sim:toy
    rules:
      pointcloud: {rate: 1, max_age: 2, size: 1000000, traffic: stream}
"""


def test_topics_have_rules_for_all_robots_and_for_one(yard):
    loaded = yard.load(TOPICS)
    cloud, (robot, _) = loaded.config.cloud, loaded.robots[0]
    assert cloud.changes().outward["joint:update"].on is False
    assert robot.changes().outward["pointcloud"].size == 1_000_000
    assert cloud.channels["thermal"].channel().suffix == "sensors/thermal"


@pytest.mark.parametrize(
    ("right", "wrong", "problem"),
    [
        ("    position:", "    positon:", "did you mean 'position'?"),
        ("    alert:", "    allert:", "did you mean 'alert'?"),
        ("rate: 5", "rat: 5", "did you mean 'rate'?"),
        ("rate: 5", "rate: fast", "must be a number"),
        ("rate: 5", "rate: 5 Hz", "write the number alone, without 'Hz'"),
        ("profile: lte", "profile: lt", "did you mean 'lte'?"),
        ("traffic: stream", "traffic: strem", "did you mean 'stream'?"),
        ("thermal: {topic: s", "position: {topic: s", "knows the channel 'position'"),
        ("thermal: {topic: s", "cloud: {topic: s", "knows the channel 'cloud'"),
        ("sensors/thermal", "command", "means something of its own in the cloud"),
        ("on: false", "on: no", "did you mean false?"),
        ("joint/update: {on: false}", "rotation: {rate: 1}", "rotation is made with position"),
        ("size: 1000}", "traffic: event}", "unknown key"),
        ("2f4a1d0b7c50]", "2f4a1d0b7c5]", "must be a uuid"),
        ("  inbound:", "  listen:", "it is called inbound now"),
    ],
)
def test_a_mistake_in_a_rule_is_reported_once_at_its_line_with_a_near_miss(yard, right, wrong, problem):
    text = TOPICS.replace(right, wrong, 1)
    (reported,) = yard.problems(text)
    line = next(number for number, row in enumerate(text.splitlines(), 1) if wrong.strip() in row)
    place = int(reported.partition(":")[2].partition(":")[0])
    assert problem in reported
    assert place == line or text.splitlines()[place - 1].strip() in ("rules:", "inbound:")


def test_a_word_that_was_renamed_is_refused_with_its_new_name(yard):
    (reported,) = yard.problems(TOPICS + "    battery_policy: {action: tell}\n")
    assert "it is called warn now" in reported


def test_figures_are_for_this_computer_unless_said_otherwise(yard):
    base = TOPICS.replace("plugins:", "metrics: {host: 0.0.0.0}\nplugins:")
    (reported,) = yard.problems(base)
    assert "other computers could read it without a password; set insecure: true" in reported
    assert yard.load(base.replace("0.0.0.0}", "0.0.0.0, insecure: true}")).config.metrics.port == 9464
    assert yard.load(TOPICS).config.metrics is None


def test_a_stop_input_is_read(section):
    (found,) = section(
        "stop_inputs: [{name: button, kind: gpio, device: /dev/gpiochip0, line: 4, robots: [a]}]"
    ).stop_inputs
    assert (found.kind, found.line, found.timeout, found.robots) == ("gpio", 4, 0.5, ("a",))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{name: b, kind: usb, device: /dev/x}", "kind"),
        ("{name: b, kind: serial, device: ttyUSB0}", "device"),
        ("{name: b, kind: serial, device: /dev/x, baud: 12}", "baud"),
        ("{name: b, kind: gpio, device: /dev/x}", "a GPIO line, and no other, has line:"),
        ("{name: b, kind: hid, device: /dev/x, line: 3}", "a GPIO line, and no other, has line:"),
        ("{name: b, kind: hid, device: /dev/x, heartbeat: AB}", "only a serial line says text"),
        ("{name: b, kind: hid, device: /dev/x, timeout: 0}", "timeout"),
        ("{name: b, kind: hid, device: /dev/x, robots: [aa]}", "there is no robot or group 'aa'"),
        (
            "{name: b, kind: hid, device: /x}, {name: b, kind: hid, device: /y}",
            "another stop input has this name",
        ),
    ],
)
def test_a_stop_input_that_cannot_be_what_was_meant_is_refused(refused, text, why):
    assert why in "; ".join(refused(f"stop_inputs: [{text}]"))


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("password: abc", "cloud.password: a password needs the username:"),
        ("token: ''", "cloud.token: is empty"),
        ("token: '  '", "cloud.token: is empty"),
        ("username: anna, password: ''", "cloud.password: is empty"),
        ("username: '', password: abc", "cloud.username: is empty"),
    ],
)
def test_credentials_that_let_nobody_in_are_reported(refused, given, expected):
    (problem,) = refused(f"cloud: {{host: h, {given}}}")
    assert expected in problem


def test_a_token_as_password_needs_no_user_name(section):
    assert section("cloud: {host: h, password: cw_1234}").cloud.username is None


SQUARE = "[0, 0], [9, 0], [9, 9], [0, 9]"


@pytest.mark.parametrize(
    "polygons",
    [
        f"[{SQUARE}]",
        "[0, 0, 9, 9]",
        f"[[{SQUARE}], {SQUARE}]",
        f"[[[{SQUARE}]]]",
        "[[0, 0, 9, 0, 9, 9]]",
    ],
)
@pytest.mark.parametrize("key", ["inclusion", "exclusion"])
def test_a_bracket_too_few_or_too_many_in_a_fence_is_one_problem(key, polygons):
    with pytest.raises(ValidationError) as caught:
        FenceConfig.model_validate_json(json.dumps({key: json.loads(polygons)}), strict=True)
    assert caught.value.error_count() == 1
    assert "bracket is missing or too many" in str(caught.value)
