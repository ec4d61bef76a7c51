import pytest
from cyberwave.mqtt.command_response import STATUSES

from fleet.model.command import Command, Reply, ReplyStatus, Setpoint
from fleet.model.geometry import ZERO_VELOCITY


def test_the_answers_are_those_of_the_contract():
    assert {status.value for status in ReplyStatus} == STATUSES


@pytest.mark.parametrize("status", ReplyStatus)
def test_only_what_the_robot_took_is_ok(status):
    assert Reply("land", status).ok == (status is ReplyStatus.ACCEPTED)


def test_what_is_asked_cannot_be_changed_on_its_way():
    for requested in (Command("land"), Setpoint(ZERO_VELOCITY), Reply("land", ReplyStatus.ACCEPTED)):
        with pytest.raises(AttributeError, match="immutable"):
            requested.id = "other"
