"""Missions for the simulated autopilots, uploaded and started as a ground station does."""

from pymavlink.dialects.v20 import all as mav

LAT, LON = 473977420, 85455940


def item(seq, command, *, east=0, height=10.0, frame=6, p1=0.0):
    x, y = (LAT, LON + east) if command in {16, 21} else (0, 0)
    return mav.MAVLink_mission_item_int_message(1, 1, seq, frame, command, 0, 1, p1, 0, 0, 0, x, y, height, 0)


def plan(*, ardupilot):
    """Take off, two waypoints, land; ArduPilot's item 0 is home."""
    flown = [(22, 0), (16, 1000), (16, 2000), (21, 2000)]
    first = [item(0, 16, frame=0)] if ardupilot else []
    return first + [item(len(first) + n, command, east=east) for n, (command, east) in enumerate(flown)]


def upload(bench, items):
    bench.run(0.2)
    answers = bench.tell(mav.MAVLink_mission_count_message(1, 1, len(items), 0))
    requested = "MISSION_REQUEST" if bench.ardupilot else "MISSION_REQUEST_INT"
    for seq, message in enumerate(items):
        assert [(m.get_type(), m.seq) for m in answers] == [(requested, seq)]
        answers = bench.tell(message)
    assert [(m.get_type(), m.type) for m in answers] == [("MISSION_ACK", 0)]


def start(bench):
    if bench.ardupilot:
        bench.set_mode("GUIDED")
        assert bench.requests(400, 1) == [0]
    assert bench.requests(300) == [0]
