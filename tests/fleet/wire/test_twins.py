"""A message for one twin that names another is refused, whatever it asks, unless it stops the robot."""

import json

import pytest

from fleet.errors import WireError
from fleet.host.requests.decode import RequestDecoder
from fleet.host.safety.verb_speeds import VerbSpeeds
from fleet.model.command import Transport
from fleet.robot_config import AdapterConfig, Limits

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"
OTHER = "6f0c9a1e-0000-4000-8000-000000000002"
DECODER = RequestDecoder(AdapterConfig(name="rex", twin=TWIN), VerbSpeeds(Limits()).of, planar=False)
POINT = {"latitude": 47, "longitude": 8, "altitude_m": 500}
PLAN = {
    "contract": "aerial.mission.v1",
    "name": "m",
    "altitude_reference": "amsl",
    "items": [{"type": "waypoint", **POINT}],
}
MESSAGES = [
    ("command", {"command": "takeoff", "data": {"altitude": 2}}),
    ("command", {"command": "move_forward", "data": {"linear_x": 0.1}}),
    ("command", {"command": "release_emergency_stop"}),
    ("motion", {"linear": {"x": 0.1}}),
    ("navigate", {"command": "goto", "position": [1, 2, 3]}),
    ("navigate", {"command": "resume"}),
    ("joints", {"source_type": "tele", "_1": 0.5}),
    ("mission", {"command": "start", "mission_execution_uuid": "e", "mission": PLAN}),
]


def decode(kind, message):
    return DECODER.decode(kind, json.dumps(message).encode(), transport=Transport.CLOUD)


@pytest.mark.parametrize("other", [OTHER, "rex", "6f0c9a1e"])
@pytest.mark.parametrize(("kind", "message"), MESSAGES)
def test_a_message_that_names_another_twin_is_refused(kind, message, other):
    with pytest.raises(WireError, match=f"twin_uuid: '{other}' is not this twin, which is {TWIN}"):
        decode(kind, message | {"twin_uuid": other})


@pytest.mark.parametrize("named", [{}, {"twin_uuid": None}, {"twin_uuid": TWIN}, {"twin_uuid": TWIN.upper()}])
@pytest.mark.parametrize(("kind", "message"), MESSAGES)
def test_a_message_that_names_this_twin_or_none_is_read(kind, message, named):
    assert decode(kind, message | named) is not None


@pytest.mark.parametrize(
    ("kind", "word"),
    [
        ("command", "stop"),
        ("command", "emergency_stop"),
        ("command", "hover"),
        ("navigate", "stop"),
        ("navigate", "cancel"),
        ("mission", "cancel"),
    ],
)
@pytest.mark.parametrize("named", [OTHER, 5, {}])
def test_a_stop_is_obeyed_whichever_twin_it_names(kind, word, named):
    assert decode(kind, {"command": word, "twin_uuid": named}) is not None
