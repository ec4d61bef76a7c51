"""Flights and drives of real autopilots, done again by the simulated ones: answers, modes, heights, noses."""

import functools

import pytest

RECORDINGS = [
    "ap_copter_body_moves",
    "ap_copter_full_flight",
    "px4_body_moves",
    "px4_full_flight",
    "px4_takeoff_low",
    "px4_takeoff_variants",
]
DRIVES = ["ap_rover", "ap_rover_drive", "ap_rover_stops"]
ON_GROUND = 1
COMES_DOWN = {0x06040000, 0x05040000, 6, 9}  # modes that take the ground's time
UNDECIDED = {
    ("px4_body_moves", 6),  # 2 m away the real nose turned by 40 degrees once, by 177 another time
    ("ap_copter_full_flight", 14),  # its stream of velocities was thinned out, so that it is elsewhere
}
SOON, NEAR, SAME_WAY = 4.0, 1.8, 25.0  # s, m, degrees


@pytest.fixture(scope="module")
def flights(module_at):
    golden = module_at("data/mavlink/golden.py")

    @functools.cache
    def of(name):
        recording = golden.Recording(name)
        flown = golden.Flown(recording)
        return recording, flown

    return of


@pytest.mark.parametrize("name", [*RECORDINGS, *DRIVES])
def test_commands_are_answered_as_recorded(flights, name):
    recording, flown = flights(name)
    assert flown.seen.acks == recording.seen.acks


@pytest.mark.parametrize("name", [*RECORDINGS, *DRIVES])
@pytest.mark.parametrize("kind", ["mode", "armed", "landed"])
def test_it_goes_through_the_recorded_states(flights, name, kind):
    recording, flown = flights(name)
    recorded = recording.seen.lasting(kind, recording.end)
    if kind == "landed" and recording.rarely_tells_landing:
        assert {value for value, _ in recorded} <= {value for value, _ in flown.seen.lasting(kind, flown.now)}
        return
    simulated = flown.seen.lasting(kind, flown.now)
    assert [value for value, _ in simulated] == [value for value, _ in recorded]
    for (value, took), (_, takes) in list(zip(recorded, simulated, strict=True))[:-1]:
        if kind == "mode" and value not in COMES_DOWN:
            assert takes == pytest.approx(took, abs=SOON), f"{value:#x}"


@pytest.mark.parametrize("name", RECORDINGS)
def test_it_stands_as_recorded_when_it_is_asked(flights, name):
    recording, flown = flights(name)
    compared = 0
    for place, (real, simulated) in enumerate(zip(recording.seen.stands, flown.seen.stands, strict=True)):
        command, height, nose, landed = real
        if landed == ON_GROUND or height < 1.5 or (name, place) in UNDECIDED:
            continue
        compared += 1
        assert simulated[0] == command
        assert simulated[1] == pytest.approx(height, abs=NEAR), (place, command)
        assert abs((simulated[2] - nose + 180) % 360 - 180) < SAME_WAY, (place, command)
    assert compared >= 2
