"""Commands of the lamps, in all their words."""

import pytest

from fleet import Refused


async def test_lamps_toggle_and_are_set_in_all_the_words_there_are(bench):
    for command, data, lamps in (
        ("chassis_light_toggle", {}, (255, 0)),
        ("camera_light_toggle", {}, (255, 255)),
        ("led_toggle", {}, (0, 0)),
        ("lights", {"pwm": 255}, (255, 255)),
        ("lights", {"io4": 10}, (10, 255)),
        ("lights", {"camera_light": 3}, (10, 3)),
        ("lights", {"data": [1, 2]}, (1, 2)),
        ("lights", {"all": 0}, (0, 0)),
    ):
        await bench.do(command, **data)
        await bench.pass_time(0.04)
        assert bench.board.lamps == lamps, command
    with pytest.raises(Refused, match="no brightness"):
        await bench.do("lights")
    for data in ({"all": 300}, {"pwm": -1}, {"data": [1, 256]}):
        with pytest.raises(Refused, match="must be 0 to 255"):
            await bench.do("lights", **data)
    assert bench.board.lamps == (0, 0)
