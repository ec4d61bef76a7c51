"""What a robot of this process says of itself."""

import json

import pytest
from cyberwave_contracts import SourceTypeEnvelopeV1

from fleet.model.report import JointReport, JointTags
from fleet.robot_config import AdapterConfig
from fleet.wire.databus import decode_report, encode_report
from fleet.wire.reports import sender, to_mqtt
from tests.fleet.host.field import Field, Walker

SHARED_KEYS = 30  # attributes beyond which CPython gives each instance a dictionary of its own
TWIN = "6f0c9a1e-0000-4000-8000-000000000001"


class Arm(AdapterConfig):
    link: str = "memory:arm"


@pytest.mark.parametrize(
    ("config", "word"),
    [
        ({}, "edge"),
        ({"role": "leader"}, "edge_leader"),
        ({"role": "follower"}, "edge_follower"),
        ({"role": "leader", "link": "sim:arm"}, "sim"),
    ],
)
def test_the_state_of_a_robot_says_which_of_two_arms_it_is(config, word):
    by = sender(source_type=Arm(name="arm", twin=TWIN, **config).source_type)
    _, payload = to_mqtt(JointReport(1.0, {"hip": 0.5}), by)[0]
    message = json.loads(payload)
    SourceTypeEnvelopeV1.model_validate(message)
    assert message["source_type"] == word


@pytest.mark.parametrize("role", ["leader", "follower"])
@pytest.mark.parametrize("layout", ["", "single", "flat"])
def test_a_plugin_with_both_arms_on_one_twin_says_of_each_report_which_it_is(role, layout):
    report = JointReport(1.0, {"hip": 0.5}, tags=JointTags(role=role))
    across = decode_report("joint_states", encode_report(report, 1))
    for link, word in (("memory:arm", f"edge_{role}"), ("sim:arm", "sim")):
        by = sender(source_type=Arm(name="arm", twin=TWIN, link=link).source_type, layout=layout)
        for _, payload in to_mqtt(across, by):
            message = json.loads(payload)
            assert message["source_type"] == word
            assert "role" not in message


async def test_an_adapter_sees_an_emergency_stop_from_its_latching_to_its_release():
    async with Field({"rex": (Walker, (0.0, 0.0, 0.0))}).running() as field:
        robot, latch = field.made["rex"].robot, field.robots["rex"].controller.latch
        assert not robot.emergency_stop
        field.robots["rex"].controller.emergency("asked by desk")
        assert robot.emergency_stop
        latch.release()
        assert not robot.emergency_stop


async def test_a_robot_takes_little_memory():
    """An edge may have a thousand: one attribute too many in one class is a megabyte and a half."""
    robot = Field({"rex": (Walker, (0.0, 0.0, 0.0))}).robots["rex"]
    assert len(vars(robot)) < SHARED_KEYS
    assert len(vars(robot.controller)) < SHARED_KEYS
    assert not hasattr(robot.controller.guard.apart, "__dict__")
