"""Who has the robot, and for how long."""

from fleet.host.safety.control_lease import ControlLease


def test_the_one_who_moves_the_robot_keeps_it_for_a_while():
    lease = ControlLease(3.0)
    lease.acquire("anna", 0.0)
    assert lease.refusal("anna", 1.0) is None
    assert lease.refusal("bert", 2.0) == "anna has control for 1.0 s more"
    assert lease.refusal("bert", 3.0) is None


def test_a_freed_lease_is_anybodys():
    lease = ControlLease(3.0)
    lease.acquire("anna", 0.0)
    lease.free("gone")
    assert lease.refusal("bert", 0.0) is None


def test_who_stops_gives_up_the_lease_and_nobody_elses():
    lease = ControlLease(3.0)
    lease.acquire("anna", 0.0)
    lease.release("bert")
    assert lease.refusal("bert", 0.0) == "anna has control for 3.0 s more"
    lease.release("anna")
    assert lease.refusal("bert", 0.0) is None


def test_a_holder_without_a_name_is_reported_as_another_operator():
    lease = ControlLease(3.0)
    lease.acquire("", 0.0)
    assert lease.refusal("bert", 0.0) == "another operator has control for 3.0 s more"
