"""The numbers in what a robot reports."""

import json

from fleet.console.numbers import MOST, numbers_in
from fleet.wire.samples import json_sample

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


def numbers(channel, message):
    return numbers_in(f"cw/{TWIN}/data/{channel}", json.dumps(message).encode())


def test_each_number_is_named_by_its_place():
    message = {
        "ts": 5.0,
        "percent": 81.5,
        "cells": [3.7, 3.8],
        "cell": {"worst": 2},
        "name": "x",
        "full": True,
    }
    assert numbers("battery", message) == {
        "battery.percent": 81.5,
        "battery.cells.0": 3.7,
        "battery.cells.1": 3.8,
        "battery.cell.worst": 2,
    }


def test_what_is_aligned_with_names_is_named_by_them():
    message = {"names": ["hip", "knee"], "positions": [0.1, -0.2], "efforts": [None, 3.0]}
    assert numbers("joint_states", message) == {
        "joint_states.positions.hip": 0.1,
        "joint_states.positions.knee": -0.2,
        "joint_states.efforts.knee": 3.0,
    }


def test_a_header_and_a_sensor_are_understood():
    sample = json_sample(b'{"value": 3}', stamp=1.0, sequence=1)
    assert numbers_in(f"cw/{TWIN}/data/metrics/left", sample) == {"metrics/left.value": 3}


def test_pictures_velocities_and_what_is_no_json_have_none():
    assert numbers("photo", {"width": 3}) == {}
    assert numbers("commands/velocity", {"linear_x": 3}) == {}
    assert numbers_in(f"cw/{TWIN}/data/battery", b"\xff\x00garbage") == {}
    assert numbers_in("fleet/yard/health", b'{"a": 1}') == {}


def test_a_report_has_only_so_many_and_none_so_deep():
    assert len(numbers("metrics", {f"n{number}": number for number in range(2 * MOST)})) == MOST
    deep = 1.0
    for _ in range(30):
        deep = {"in": deep}
    assert numbers("metrics", {"value": deep, "big": 10**400}) == {}
