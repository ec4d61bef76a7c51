import pytest

from fleet.bus import keys
from fleet.bus.zenoh_session import keys_intersect


@pytest.mark.parametrize(
    ("one", "many"),
    [
        (keys.command("yard", "rex"), keys.command("*", "*")),
        (keys.state("yard", "rex"), keys.state("*", "*")),
        (keys.health("yard"), keys.health("*")),
        (keys.stop("yard"), keys.stop("*")),
        (keys.robot("yard", "rex"), keys.robot("yard", "*")),
    ],
)
def test_a_star_addresses_many(one, many):
    assert keys_intersect(one, many)


def test_the_tokens_of_edges_and_robots_are_distinguished():
    assert not keys_intersect(keys.edge("*"), keys.robot("yard", "rex"))
    assert not keys_intersect(keys.worker("yard", "arm"), keys.robot("*", "*"))


def test_a_heartbeat_is_no_token():
    assert not keys_intersect(keys.heartbeat("yard", "arm"), keys.worker("yard", "*"))
