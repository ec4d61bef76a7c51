"""Equipment besides the autopilot: a restart ends what it does, and takes nothing away."""

from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.equipment import Equipment
from fleet_mavlink.sim.gimbal import SimGimbal
from fleet_mavlink.sim.remote_id import SimRemoteId

ardupilots = pytest.mark.parametrize("ardupilot", [True, False])


def pilot(**faults):
    said = []
    return SimpleNamespace(time=1.0, faults=faults, say=lambda *words: said.append(words), said=said)


def ask_log(equipment, number=1):
    equipment.logs.requested_data(mav.MAVLink_log_request_data_message(1, 1, number, 0, 40_000))


@ardupilots
def test_the_logs_begin_at_the_number_of_the_autopilot(ardupilot):
    every = mav.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF)
    entries = Equipment(ardupilot=ardupilot).logs.requested_list(every)
    assert min(entry.id for entry in entries) == (1 if ardupilot else 0)


@ardupilots
def test_px4_tells_of_its_compass_in_texts_and_ardupilot_in_messages(ardupilot):
    assert Equipment(ardupilot=ardupilot).compass.words is not ardupilot


@ardupilots
def test_only_px4_serves_a_list_of_events(ardupilot):
    assert bool(Equipment(ardupilot=ardupilot).files._files) is not ardupilot


def test_a_log_that_is_asked_for_comes_step_by_step():
    equipment = Equipment(ardupilot=True)
    assert equipment.tick(pilot(), 0.02) == []
    ask_log(equipment)
    assert {type(each).__name__ for each in equipment.tick(pilot(), 0.02)} == {"MAVLink_log_data_message"}


def test_a_restart_ends_a_transfer_a_calibration_and_a_session_and_keeps_the_gimbal():
    equipment = Equipment(ardupilot=False)
    gimbal = equipment.gimbal = SimGimbal()
    equipment.remote_id = known = SimRemoteId()
    ask_log(equipment)
    equipment.compass.start(0.0, pilot())
    equipment.files._open = b"a file"
    equipment.reboot()
    assert not equipment.compass.calibrating
    assert equipment.compass.words
    assert equipment.files._open is None
    assert equipment.logs.pending() == []
    assert equipment.gimbal is gimbal
    assert equipment.remote_id is not None
    assert equipment.remote_id is not known  # it is told everything again


def test_without_a_transmitter_a_restart_brings_none():
    equipment = Equipment(ardupilot=True)
    equipment.reboot()
    assert equipment.remote_id is None
    assert equipment.gimbal is None


def test_a_gimbal_turns_as_time_passes():
    equipment = Equipment(ardupilot=True)
    equipment.gimbal = SimGimbal()
    equipment.gimbal._pitch.request(-90.0, 0.0)
    equipment.tick(pilot(), 0.5)
    assert equipment.gimbal.pitch == pytest.approx(-30.0)
