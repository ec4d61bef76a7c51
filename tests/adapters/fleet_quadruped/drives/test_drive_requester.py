"""Requests to drives: repeated to those that are silent, and no longer than until all have answered."""

from types import SimpleNamespace

import pytest

from fleet import CanFrame, LinkLost
from fleet_quadruped.drives.drive_requester import DriveRequester

NOISE = CanFrame(0x110, b"")


class Asked:
    """Drives on two buses; each answers the n-th request to it."""

    def __init__(self, joint_of, wires, *answers):
        self.wires, self.taken, self.requests = wires, [], []
        self.drives = [
            SimpleNamespace(joint=joint_of(name, bus=bus, number=number), bus=wires[bus], patience=patience)
            for name, bus, number, patience in answers
        ]
        self._requester = DriveRequester(wires, lambda *taken: self.taken.append(taken))

    def run(self):
        self._requester.request(self.drives, self._question, self._answered)

    def _question(self, drive):
        self.requests.append(drive.joint.name)
        if self.requests.count(drive.joint.name) >= drive.patience:
            drive.bus.heard.append([CanFrame(drive.joint.id, b"yes")])
        return CanFrame(drive.joint.id, b"?")

    def _answered(self, drive):
        return (drive.joint.bus, CanFrame(drive.joint.id, b"yes"), 0.0) in self.taken


@pytest.fixture
def asked(joint_of, wires):
    return lambda *answers: Asked(joint_of, wires, *answers)


def test_each_drive_is_asked_on_its_bus_and_once_if_it_answers(asked, wires):
    it = asked(("hip", "a", 2, 1), ("knee", "b", 3, 1))
    it.run()
    assert [frame.id for frame in wires["a"].sent] == [2]
    assert [frame.id for frame in wires["b"].sent] == [3]


def test_only_a_silent_drive_is_asked_again(asked):
    it = asked(("hip", "a", 2, 1), ("knee", "a", 3, 3))
    it.run()
    assert it.requests == ["hip", "knee", "knee", "knee"]


def test_a_drive_that_answers_the_fifth_request_is_no_silent_one(asked):
    it = asked(("hip", "a", 2, 5))
    it.run()
    assert len(it.requests) == 5


def test_a_drive_that_answers_no_request_is_named_with_what_to_check(asked):
    it = asked(("FL_hip", "a", 2, 1), ("FL_knee", "b", 3, 9), ("FR_knee", "a", 4, 9))
    with pytest.raises(LinkLost) as caught:
        it.run()
    assert str(caught.value) == "FL_knee: id 3 on bus 'b' is silent; check power, wiring, id"
    assert it.requests.count("FL_knee") == 5


def test_an_answer_is_waited_for_while_others_speak(asked, wires):
    it = asked(("hip", "a", 2, 1))
    wires["b"].heard = [[NOISE]] * 12
    wires["a"].heard = [[NOISE]] * 12
    it.run()
    assert it.requests == ["hip"]
    assert len(it.taken) > 12, "everything is heard meanwhile"


def test_others_that_never_fall_silent_do_not_keep_it_waiting(asked, wires):
    it = asked(("hip", "a", 2, 9))
    wires["b"].heard = [[NOISE]] * 1000
    with pytest.raises(LinkLost):
        it.run()
    assert len(wires["b"].heard) == 900, "20 looks after each of 5 requests"


def test_quiet_buses_are_not_listened_to_any_longer(asked, wires):
    it = asked(("hip", "a", 2, 9))
    with pytest.raises(LinkLost):
        it.run()
    assert (wires["a"].looks, wires["b"].looks) == (5, 5), "once after each request"


def test_drives_that_have_answered_already_are_not_asked(asked):
    it = asked()
    it.run()
    assert it.requests == []
