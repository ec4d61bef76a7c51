from fleet.cloud.keepalive import Keepalive, KeepaliveAction


def test_a_quiet_link_is_pinged_once():
    watch = Keepalive(5.0, 0.0)
    assert watch.due(3.9) is KeepaliveAction.NOTHING
    assert watch.due(4.0) is KeepaliveAction.PING
    assert watch.due(4.1) is KeepaliveAction.NOTHING


def test_a_link_that_does_not_answer_is_given_up_within_its_limit():
    watch = Keepalive(5.0, 0.0)
    watch.due(4.0)
    assert watch.due(7.9) is KeepaliveAction.NOTHING
    assert watch.due(watch.limit) is KeepaliveAction.GIVE_UP


def test_any_bytes_show_that_the_link_lives():
    watch = Keepalive(5.0, 0.0)
    watch.due(4.0)
    watch.received(4.5)
    assert watch.due(8.4) is KeepaliveAction.PING
    assert watch.due(8.5) is KeepaliveAction.NOTHING


def test_a_client_that_only_hears_pings_so_that_the_broker_hears_it():
    watch = Keepalive(5.0, 0.0)
    watch.received(3.9)
    assert watch.due(4.0) is KeepaliveAction.PING


def test_a_client_that_only_talks_pings_so_that_it_hears_the_broker():
    watch = Keepalive(5.0, 0.0)
    watch.sent(3.9)
    assert watch.due(4.0) is KeepaliveAction.PING


def test_without_an_interval_nothing_is_due():
    assert Keepalive(0.0, 0.0).due(1e9) is KeepaliveAction.NOTHING
