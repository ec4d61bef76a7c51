"""Remote ID of the simulated ArduCopter refuses as AP_OpenDroneID does, in its order and words."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.remote_id import SimRemoteId
from fleet_mavlink.sim.spec import VehicleSpec

NOBODY = [0] * 20
GOOD = mav.MAVLink_open_drone_id_arm_status_message(0, b"")
BAD = mav.MAVLink_open_drone_id_arm_status_message(1, b"missing OP_ID")


def basic(id_type=1):
    return mav.MAVLink_open_drone_id_basic_id_message(1, 1, NOBODY, id_type, 2, NOBODY)


def system(latitude=473_977_000):
    place = (latitude, 85_456_000 if latitude else 0)
    return mav.MAVLink_open_drone_id_system_message(
        1, 1, NOBODY, 2, 1, *place, 1, 0, -1000, -1000, 1, 3, 535.0, 9
    )


def update(latitude=473_977_000):
    return mav.MAVLink_open_drone_id_system_update_message(1, 1, latitude, 85_456_000, 535.0, 10)


@pytest.fixture
def known():
    return SimRemoteId()


def test_what_is_missing_is_said_in_order(known):
    assert known.refusal(10.0) == "UA_TYPE required in BasicID"
    known.handle_message(basic(id_type=0), 10.0)
    assert known.refusal(10.0) == "UA_TYPE required in BasicID"
    known.handle_message(basic(), 10.0)
    assert known.refusal(10.0) == "operator location must be set"
    known.handle_message(system(latitude=0), 10.0)
    assert known.refusal(10.0) == "operator location must be set"
    known.handle_message(system(), 10.0)
    assert known.refusal(10.0) == "ARM_STATUS not available"
    known.handle_arm_status(BAD, 10.0)
    assert known.refusal(10.0) == "missing OP_ID"
    known.handle_arm_status(GOOD, 10.0)
    assert known.refusal(10.0) == ""
    known.handle_arm_status(GOOD, 13.5)
    assert known.refusal(13.5) == "SYSTEM not available"
    known.handle_message(update(), 13.5)
    assert known.refusal(13.5) == ""
    assert known.refusal(17.0) == "ARM_STATUS not available"


def test_an_update_counts_only_after_the_whole(known):
    known.handle_message(basic(), 1.0)
    known.handle_arm_status(GOOD, 1.0)
    known.handle_message(update(), 1.0)
    assert known.refusal(1.0) == "operator location must be set"


def test_the_transmitter_says_what_it_misses(known):
    assert known.missing_data(1.0, located=False) == "missing LOC ID SELF_ID OP_ID SYS zero OP_LOC"
    known.handle_message(basic(), 1.0)
    known.handle_message(system(), 1.0)
    known.handle_message(mav.MAVLink_open_drone_id_self_id_message(1, 1, NOBODY, 0, b"survey"), 1.0)
    assert known.missing_data(1.0, located=True) == "missing OP_ID"
    known.handle_message(mav.MAVLink_open_drone_id_operator_id_message(1, 1, NOBODY, 0, b"FIN87"), 1.0)
    assert known.missing_data(1.0, located=True) == ""
    assert known.missing_data(4.5, located=True) == "missing SYS"
    assert known.missing_data(24.0, located=True) == "missing SELF_ID OP_ID SYS"


def test_only_ardupilot_is_simulated_with_it():
    assert VehicleSpec.parse("sim:ardupilot?with=remote_id").accessories == ("remote_id",)
    with pytest.raises(ValueError, match="only ArduPilot is simulated with remote_id"):
        VehicleSpec.parse("sim:px4?with=remote_id")
