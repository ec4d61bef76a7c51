"""A robot follows another only where both are placed and the other has reported its position lately."""

from types import SimpleNamespace

import pytest

from fleet.errors import NotReady
from fleet.host.robot.relative_positions import LOST, RelativePositions
from fleet.model.geometry import Vector3
from fleet.model.site import Placement


class Others:
    """Seen positions of robots, by name: (where, age in s)."""

    def __init__(self, **seen):
        self._seen = {name: SimpleNamespace(at=at, age=age) for name, (at, age) in seen.items()}

    def seen(self, _own, name):
        return self._seen.get(name)


HERE = Placement()


def keeper(placement=HERE, **seen):
    positions = RelativePositions()
    positions.among = SimpleNamespace(name="rex", placement=placement, others=Others(**seen))
    return positions


def test_a_position_is_given_in_the_world_of_the_robot_that_follows():
    positions = keeper(Placement(Vector3(10.0, 0.0)), max=(Vector3(12.0, 3.0), 0.5))
    at, age = positions.of("max")
    assert ((at.x, at.y, at.z), age) == ((2.0, 3.0, 0.0), 0.5)
    assert positions.trouble("max") == ""


def test_the_edge_of_the_age_still_counts_and_more_does_not():
    assert keeper(max=(Vector3(), LOST)).of("max")[1] == LOST
    with pytest.raises(NotReady, match=r"max has not reported its position for 2\.1 s"):
        keeper(max=(Vector3(), LOST + 0.1)).of("max")


@pytest.mark.parametrize(
    ("positions", "other", "why"),
    [
        (RelativePositions(), "max", "it is not placed in the site's frame, and cannot follow max"),
        (keeper(placement=None), "max", "rex is not placed in the site's frame, and cannot follow max"),
        (keeper(), "max", "the position of max in the frame of rex is unknown"),
        (keeper(rex=(Vector3(), 0.0)), "rex", "the position of rex in the frame of rex is unknown"),
    ],
)
def test_what_is_not_known_is_refused_with_the_reason(positions, other, why):
    with pytest.raises(NotReady) as refused:
        positions.of(other)
    assert refused.value.reason == why
    assert why in positions.trouble(other)
