"""What is noted of a rehearsal: where robots went, and the nearest that they came to each other."""

from fleet.host.safety.separation import Occupant
from fleet.missions.rehearsal import ClosestApproach, RehearsedTrack
from fleet.model.geometry import Vector3
from fleet.rehearsal.recording import MOST_POINTS, Distances, Tracks

MOVES = Vector3(1.0)


def at(name, x, velocity=MOVES):
    return Occupant(name, 0.4, 1.0, Vector3(x), velocity=velocity)


def seen(*looks, taking_part=("a",)):
    distances = Distances(taking_part)
    for moment, robots in looks:
        distances.sample({robot.name: robot for robot in robots}, moment)
    return distances


def nearest(*looks, **more):
    return seen(*looks, **more).nearest()


def test_who_comes_nearer_than_both_radii_is_too_near_and_who_began_so_is_not():
    def between(*distances):
        looks = [(float(at), [at_(0.0), at_(distance, "b")]) for at, distance in enumerate(distances)]
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
        ClosestApproach(("a", "b"), 1.0, 4.0, 0.8),
        ClosestApproach(("a", "c"), 1.04, 6.0, 0.8),
    )


def test_robots_that_stand_and_pairs_of_which_none_takes_part_do_not_count():
    stands = Vector3()
    assert nearest((1.0, [at("a", 0.0, stands), at("b", 1.0, stands)])) == ()
    assert nearest((1.0, [at("b", 0.0), at("c", 1.0)])) == ()


def tracked(points):
    tracks = Tracks(["a", "unplaced"])
    for moment, x in points:
        tracks.sample({robot.name: robot for robot in (at("a", x), at("b", x))}, moment)
    return tracks.all()


def test_a_track_has_the_points_of_a_robot_that_takes_part_and_each_stand():
    samples = [
        (0.0, 0.0),
        (0.1, 0.04),
        (0.2, 0.12),
        (0.3, 0.12),
        (5.0, 0.12),
        (5.1, 0.3),
        (5.2, 0.31),
        (6.0, 0.31),
    ]
    expected = ((0.0, 0.0), (0.2, 0.12), (5.0, 0.12), (5.1, 0.3), (6.0, 0.31))
    assert tracked(samples) == (RehearsedTrack("a", tuple((moment, x, 0.0, 0.0) for moment, x in expected)),)


def test_a_long_track_gets_coarser_from_its_beginning_to_its_end():
    ((track),) = tracked((number * 0.1, number * 0.2) for number in range(20_000))
    assert MOST_POINTS / 3 < len(track.points) <= MOST_POINTS + 1
    assert (track.points[0][:2], track.points[-1][:2]) == ((0.0, 0.0), (1999.9, 3999.8))
    apart = [later[0] - sooner[0] for sooner, later in zip(track.points, track.points[1:-1], strict=False)]
    assert max(apart) < 2.2 * min(apart)
