"""Accounts of a NATS server for roll-outs; test_nats_store checks that a server enforces them."""

import pytest

from fleet.rollout.accounts import AccountsError, edge_permissions, server_accounts


def test_an_edge_may_name_no_subject_of_another_edge():
    allowed = edge_permissions("yard-1")
    subjects = [*allowed["publish"]["allow"], *allowed["subscribe"]["allow"]]
    shared = [each for each in subjects if "yard-1" not in each]
    assert shared == ["$JS.API.DIRECT.GET.KV_fleet_bundles.$KV.fleet_bundles.*.*"]


def test_each_edge_and_operator_has_a_user_and_each_edge_an_account():
    text = server_accounts(["yard-1", "yard-2"], ["alice"])
    assert [text.count(f'"user":"{name}"') for name in ("yard-1", "yard-2", "alice")] == [1, 1, 1]
    assert [text.count(f'"FLEET_EDGE_{name}": {{') for name in ("yard-1", "yard-2")] == [1, 1]


@pytest.mark.parametrize("name", ["*", ">", "yard.>", 'a"', "yard 1", "", "Yard"])
def test_an_invalid_name_of_an_edge_is_refused(name):
    with pytest.raises(AccountsError, match="no name of an edge"):
        server_accounts([name], ["alice"])


@pytest.mark.parametrize(("edges", "operators"), [(["a", "a"], []), (["a"], ["a"]), ([], ["a", "a"])])
def test_a_name_given_twice_is_refused(edges, operators):
    with pytest.raises(AccountsError, match="a is named twice"):
        server_accounts(edges, operators)
