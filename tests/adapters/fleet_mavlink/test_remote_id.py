"""Remote ID: what the autopilot is told, and the take-off that its transmitter keeps from happening."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import NotReady
from fleet.errors import CommandError
from fleet_mavlink.broadcast_messages import OpenDroneIdArmStatus
from fleet_mavlink.remote_id import everything, trouble_of, ua_type, update
from fleet_mavlink.remote_id_config import RemoteIdConfig
from fleet_mavlink.state import VehicleState

OPERATOR = {
    "operator_id": "FIN87astrdge12k8",
    "latitude": 47.3977,
    "longitude": -8.5456,
    "altitude": 535.0,
    "serial_number": "1596F1A2B3C4D5E6",
    "description": "roof survey",
    "category": "open",
    "class_eu": 3,
}
CONFIG = RemoteIdConfig.model_validate(OPERATOR)
GOOD, BAD = OpenDroneIdArmStatus(0, ""), OpenDroneIdArmStatus(1, "missing OP_ID ")
NOON = 1_795_000_000.0
REMOTE_ID = ("remote_id",)


def read(message, frame):
    """Return a message of ours as pymavlink reads it."""
    return mav.MAVLink(None).decode(bytearray(frame(message)))


@pytest.fixture
def packed():
    """Frame messages as the adapter does."""
    from fleet_mavlink.codec import pack  # noqa: PLC0415

    return lambda message: pack(message, 245, 191, 0)


def test_the_operator_is_reported_as_the_foreign_decoder_reads_it(packed):
    messages = {
        each.get_type(): each for each in (read(each, packed) for each in everything(CONFIG, 7, 2, NOON))
    }
    assert {(each.target_system, each.target_component) for each in messages.values()} == {(7, 1)}
    system = messages["OPEN_DRONE_ID_SYSTEM"]
    assert (system.operator_latitude, system.operator_longitude) == (473_977_000, -85_456_000)
    assert system.operator_altitude_geo == 535.0
    assert system.timestamp == NOON - 1_546_300_800
    assert system.operator_location_type == mav.MAV_ODID_OPERATOR_LOCATION_TYPE_FIXED
    assert (system.classification_type, system.category_eu, system.class_eu) == (1, 1, 3)
    assert messages["OPEN_DRONE_ID_OPERATOR_ID"].operator_id == "FIN87astrdge12k8"
    assert messages["OPEN_DRONE_ID_SELF_ID"].description == "roof survey"
    basic = messages["OPEN_DRONE_ID_BASIC_ID"]
    assert (basic.id_type, basic.ua_type) == (mav.MAV_ODID_ID_TYPE_SERIAL_NUMBER, 2)
    assert bytes(basic.uas_id).rstrip(b"\0") == b"1596F1A2B3C4D5E6"


def test_the_place_is_reported_again_as_an_update(packed):
    said = read(update(CONFIG, 7, NOON), packed)
    assert said.get_type() == "OPEN_DRONE_ID_SYSTEM_UPDATE"
    assert (said.target_system, said.operator_latitude, said.operator_longitude) == (
        7,
        473_977_000,
        -85_456_000,
    )


def test_what_is_not_known_is_not_sent(packed):
    config = RemoteIdConfig(latitude=1.0, longitude=2.0)
    said = {each.get_type(): each for each in (read(each, packed) for each in everything(config, 1, 2, NOON))}
    assert "OPEN_DRONE_ID_BASIC_ID" not in said
    assert said["OPEN_DRONE_ID_SYSTEM"].operator_altitude_geo == -1000.0
    assert said["OPEN_DRONE_ID_SYSTEM"].classification_type == 0


@pytest.mark.parametrize(("kind", "expected"), [(2, 2), (13, 2), (1, 1), (22, 4), (10, 15)])
def test_the_kind_of_aircraft_is_reported(kind, expected):
    assert ua_type(kind) == expected


@pytest.mark.parametrize(
    ("status", "age", "wanted", "trouble"),
    [
        (None, 0, False, None),
        (None, 0, True, "nothing is received from its Remote ID transmitter"),
        (GOOD, 1, True, ""),
        (GOOD, 1, False, ""),
        (GOOD, 9, False, "nothing was received from its Remote ID transmitter for 9 s"),
        (BAD, 1, False, "Remote ID: missing OP_ID"),
        (OpenDroneIdArmStatus(1, ""), 1, False, "Remote ID: not ready"),
    ],
)
def test_what_keeps_it_from_taking_off(status, age, wanted, trouble):
    state = VehicleState(remote_id=status, remote_id_at=100.0)
    assert trouble_of(state, 100.0 + age, wanted=wanted) == trouble


def found(answer, name):
    return next((each for each in answer["checks"] if each["check"] == name), None)


def test_it_takes_off_with_remote_id(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", accessories=REMOTE_ID, remote_id=OPERATOR) as it:
            await it.wait_until_known()
            await it.until(lambda: it.state.remote_id == GOOD)
            assert found(await it.do("check_ready"), "remote ID")["ok"] is True
            await it.do("takeoff", altitude=5.0)
            known = it.sim.equipment.remote_id
            before = known.heard["SYSTEM_UPDATE"]
            await it.until(lambda: known.heard["SYSTEM_UPDATE"] > before, within=1.5)
            await it.do("land")

    run_in_sim_time(main())


def test_it_does_not_take_off_without_what_the_transmitter_misses(run_in_sim_time, sim_flight):
    async def main():
        operator = {name: value for name, value in OPERATOR.items() if name != "serial_number"}
        async with sim_flight("ardupilot", accessories=REMOTE_ID, remote_id=operator) as it:
            await it.wait_until_known()
            await it.until(
                lambda: it.state.remote_id is not None and it.state.remote_id.error == "missing ID"
            )
            check = found(await it.do("check_ready"), "remote ID")
            assert (check["ok"], check["words"]) == (False, ["Remote ID: missing ID"])
            with pytest.raises(NotReady, match="Remote ID: missing ID"):
                await it.do("takeoff", altitude=5.0)
            assert not it.armed

    run_in_sim_time(main())


def test_a_transmitter_that_falls_silent_keeps_it_on_the_ground_and_not_from_landing(
    run_in_sim_time, sim_flight
):
    async def main():
        async with sim_flight("ardupilot", accessories=REMOTE_ID, remote_id=OPERATOR) as it:
            await it.wait_until_known()
            await it.until(lambda: it.state.remote_id == GOOD)
            await it.do("takeoff", altitude=5.0)
            it.sim.set_fault("remote_id_silent", 1.0)
            await it.until(
                lambda: "ODID: lost transmitter" in {s.text for s in it.adapter._session.vehicle.sentences}
            )
            await it.do("land")
            with pytest.raises(NotReady, match="received from its Remote ID transmitter for"):
                await it.do("takeoff", altitude=5.0)

    run_in_sim_time(main())


def test_a_vehicle_that_must_have_a_transmitter_and_has_none_stays_on_the_ground(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", remote_id=OPERATOR) as it:
            await it.wait_until_known()
            with pytest.raises(NotReady, match="nothing is received from its Remote ID transmitter"):
                await it.do("takeoff", altitude=5.0)

    run_in_sim_time(main())


def test_the_simulated_autopilot_refuses_by_itself_and_no_force_helps(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", accessories=REMOTE_ID) as it:  # nothing is told of the operator
            await it.wait_until_known()
            flight = it.adapter._session.flight
            await flight.enter("GUIDED")
            for force in (False, True):
                with pytest.raises(CommandError, match="OpenDroneID: UA_TYPE required in BasicID"):
                    await flight.arming._switch(on=True, force=force)

    run_in_sim_time(main())


def test_a_vehicle_without_remote_id_has_no_such_check(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            assert found(await it.do("check_ready"), "remote ID") is None

    run_in_sim_time(main())
