"""What is noted of a rehearsal: the nearest that robots came to each other."""

from fleet.host.safety.separation import Occupant
from fleet.missions.rehearsal import Approach
from fleet.model.geometry import Vector3
from fleet.rehearsal.recording import Distances

MOVES = Vector3(1.0)


def at(name, x, velocity=MOVES):
    return Occupant(name, 0.4, 1.0, Vector3(x), velocity=velocity)


def seen(*looks, taking_part=("a",)):
    distances = Distances(taking_part)
    for moment, robots in looks:
        distances.look({robot.name: robot for robot in robots}, moment)
    return distances


def nearest(*looks, **more):
    return seen(*looks, **more).nearest()


def test_who_comes_nearer_than_both_radii_is_too_near_and_who_began_so_is_not():
    def between(*ways):
        looks = [(float(at), [at_(0.0), at_(way, "b")]) for at, way in enumerate(ways)]
        return [each.metres for each in seen(*looks).too_near()]

    def at_(x, name="a"):
        return at(name, x)

    assert between(3.0, 0.7, 3.0) == [0.7]
    assert between(3.0, 0.9, 3.0) == []
    assert between(0.7, 0.7, 3.0) == []
    assert between(0.7, 0.5, 3.0) == [0.5]


def test_the_nearest_approach_of_each_pair_is_kept_with_its_moment_the_nearest_pair_first():
    looks = [(t, [at("a", t), at("b", 5.0), at("c", 7.04)]) for t in (1.0, 4.0, 6.0)]
    assert nearest(*looks) == (
        Approach(("a", "b"), 1.0, 4.0, 0.8),
        Approach(("a", "c"), 1.04, 6.0, 0.8),
    )


def test_robots_that_stand_and_pairs_of_which_none_takes_part_do_not_count():
    stands = Vector3()
    assert nearest((1.0, [at("a", 0.0, stands), at("b", 1.0, stands)])) == ()
    assert nearest((1.0, [at("b", 0.0), at("c", 1.0)])) == ()
