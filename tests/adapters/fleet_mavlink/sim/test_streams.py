"""What a vehicle sends by itself, how often, and what it does not send yet."""

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, DENIED = 0, 2


@pytest.fixture
def ap(bench):
    return bench("ardupilot")


def test_only_heartbeats_and_texts_come_unasked(ap):
    ap.run(30)
    assert {m.get_type() for m in ap.heard} == {"HEARTBEAT", "STATUSTEXT", "HOME_POSITION"}
    assert 29 <= len(ap.said("HEARTBEAT")) <= 32


def test_the_ekf_report_shows_a_usable_position(bench):
    ap = bench("ardupilot", ready_after=10.0)
    ap.run(1)
    ap.requests(512, 193)
    assert ap.last("EKF_STATUS_REPORT").flags == 0xA7
    ap.run(10)
    ap.requests(512, 193)
    assert ap.last("EKF_STATUS_REPORT").flags == 0x33F


def test_data_streams_can_be_asked_for(ap):
    ap.run(0.2)
    ap.tell(mav.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
    ap.run(10)
    assert 38 <= len(ap.said("ATTITUDE")) <= 42
    assert 38 <= len(ap.said("SYS_STATUS")) <= 42


def test_message_rates(ap):
    ap.run(0.2)
    assert ap.requests(511, 30, 20000) == [ACCEPTED]
    assert ap.requests(511, 30, 2500) == [DENIED]
    assert ap.requests(511, 9999, 100000) == [DENIED]
    ap.heard.clear()
    ap.run(10)
    assert 495 <= len(ap.said("ATTITUDE")) <= 505
    ap.requests(511, 30, 0)
    ap.heard.clear()
    ap.run(2)
    assert not ap.said("ATTITUDE")
