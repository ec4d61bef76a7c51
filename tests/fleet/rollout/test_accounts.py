"""The accounts of a NATS server for roll-outs; that the server keeps to them is in test_nats_store."""

from fleet.rollout.accounts import edge_permissions, server_users


def test_an_edge_may_name_no_subject_of_another_edge():
    allowed = edge_permissions("yard-1")
    subjects = [*allowed["publish"]["allow"], *allowed["subscribe"]["allow"]]
    shared = [each for each in subjects if "yard-1" not in each]
    assert shared == ["$JS.API.DIRECT.GET.KV_fleet_bundles.$KV.fleet_bundles.*.*"]


def test_each_edge_and_operator_has_a_user():
    text = server_users(["yard-1", "yard-2"], ["alice"])
    assert [text.count(f'"user":"{name}"') for name in ("yard-1", "yard-2", "alice")] == [1, 1, 1]
