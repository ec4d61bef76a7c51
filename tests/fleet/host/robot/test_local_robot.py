"""What a robot of this process says of itself."""

import json

import pytest
from cyberwave_contracts import SourceTypeEnvelopeV1

from fleet.host.robot.local_robot import source_type
from fleet.model.report import JointReport
from fleet.robot_config import AdapterConfig
from fleet.wire.reports import sender, to_mqtt

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
    by = sender(source_type=source_type(Arm(name="arm", twin=TWIN, **config)))
    _, payload = to_mqtt(JointReport(1.0, {"hip": 0.5}), by)[0]
    message = json.loads(payload)
    SourceTypeEnvelopeV1.model_validate(message)
    assert message["source_type"] == word
