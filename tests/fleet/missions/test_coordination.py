"""The lease by which an edge coordinates robots of another."""

from fleet.missions.coordination import LAPSES_AFTER, CoordinatorLeases, ExpiredLease, RobotLeaseRequest


def test_a_lease_lasts_while_it_is_renewed_and_lapses_once():
    leases = CoordinatorLeases()
    leases.grant(RobotLeaseRequest("r1", "yard", {"rex": "hold"}, begins=True), 0.0)
    leases.grant(RobotLeaseRequest("r1", "yard", {"rex": "land"}), 2.0)
    assert leases.robots("yard", "r1") == {"rex"}
    assert leases.lapsed(2.0 + LAPSES_AFTER - 0.1) == []
    assert leases.lapsed(2.0 + LAPSES_AFTER) == [ExpiredLease("r1", "yard", "rex", "land")]
    assert leases.lapsed(100.0) == []
    assert leases.robots("yard", "r1") == frozenset()


def test_what_is_given_back_does_not_lapse():
    leases = CoordinatorLeases()
    leases.grant(RobotLeaseRequest("r1", "yard", {"rex": "hold", "max": "hold"}, begins=True), 0.0)
    leases.grant(RobotLeaseRequest("r2", "yard", {"ada": "hold"}, begins=True), 0.0)
    leases.grant(RobotLeaseRequest("r1", "yard", {"max": "hold"}), 1.0)
    leases.grant(RobotLeaseRequest("r2", "yard", {}), 1.0)
    assert [lapsed.robot for lapsed in leases.lapsed(10.0)] == ["max"]
