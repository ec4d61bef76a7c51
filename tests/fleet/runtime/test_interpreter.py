"""Settings of the whole interpreter are given back, whoever had changed them and however that ended."""

import gc
import sys

import pytest

from fleet.runtime.interpreter import freeze_new_objects, interpreter_settings


def settings():
    return sys.getswitchinterval(), gc.get_threshold(), gc.isenabled(), gc.get_freeze_count()


def test_they_hold_in_the_block_and_are_given_back_after_it():
    before = settings()
    with interpreter_settings(switch_interval=0.001, young=20_000, collect=False):
        assert sys.getswitchinterval() == pytest.approx(0.001)
        assert (gc.get_threshold()[0], gc.isenabled()) == (20_000, False)
        assert gc.get_freeze_count() > 0
    assert settings() == before


def test_they_are_given_back_when_the_block_fails():
    before = settings()
    with pytest.raises(ValueError, match="wrong"), interpreter_settings(collect=False):
        raise ValueError("wrong")
    assert settings() == before


def test_of_two_blocks_the_last_to_end_gives_them_back():
    before = settings()
    first, second = interpreter_settings(young=20_000), interpreter_settings(switch_interval=0.001)
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert (sys.getswitchinterval(), gc.get_threshold()[0]) == (pytest.approx(0.001), 20_000)
    second.__exit__(None, None, None)
    assert settings() == before


def test_nothing_is_kept_from_the_collector_outside_of_a_block():
    before = gc.get_freeze_count()
    freeze_new_objects()
    assert gc.get_freeze_count() == before
