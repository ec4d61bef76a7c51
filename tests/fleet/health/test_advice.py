import pytest

from fleet.health.advice import advice_for
from fleet.model.summary import Trouble


@pytest.mark.parametrize(
    ("cause", "link", "advice"),
    [
        ("No such file or directory; is it plugged in?", "serial:/dev/ttyUSB3", "check the cable, the hub"),
        ("no permission; add this user to the device's group", "serial:/dev/ttyACM0", "fleet doctor on barn"),
        ("quarantined after 3 failures in 60 s", "", "fleet send rex restart_adapter"),
        ("ended with exit code 1", "worker arms", "fleet logs shows why worker arms ended"),
        ("no heartbeat for 3 s", "udpin:0.0.0.0:14550", "power and link of the robot: udpin:0.0.0.0:14550"),
        ("something nobody knows {braces}", "", "fleet describe rex; fleet history rex"),
    ],
)
def test_a_cause_of_robots_has_a_next_thing_to_do(cause, link, advice):
    assert advice in advice_for(Trouble("fault", cause, 1.0, 1, "ugv", link, ("rex",)), "barn")


@pytest.mark.parametrize(
    ("cause", "reach", "advice"),
    [
        ("not on the bus", "gone", "power, network"),
        ("on the bus, but it sends no summary", "silent", "its event loop hangs"),
        ("the disk is full", "up", "fleet doctor looks at its disk"),
        ("something nobody knows", "up", "on barn: fleet doctor, fleet logs"),
    ],
)
def test_a_problem_of_the_edge_has_one_too(cause, reach, advice):
    assert advice in advice_for(Trouble("degraded", cause, 1.0), "barn", reach=reach)
