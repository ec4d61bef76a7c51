import pytest

from fleet.bus import keys
from fleet.bus.lane import keys_meet


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
    assert keys_meet(one, many)


def test_the_tokens_of_edges_and_robots_are_told_apart():
    assert not keys_meet(keys.edge("*"), keys.robot("yard", "rex"))
    assert not keys_meet(keys.worker("yard", "arm"), keys.robot("*", "*"))


def test_a_heartbeat_is_no_token():
    assert not keys_meet(keys.heartbeat("yard", "arm"), keys.worker("yard", "*"))
