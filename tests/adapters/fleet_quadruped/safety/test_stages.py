import pytest

from fleet_quadruped.safety.stages import FORCED, Mode, Stage, forced


@pytest.mark.parametrize("mode", [mode for mode in Mode if mode not in {Mode.OFF, Mode.DAMPED}])
def test_the_hard_stop_damps_whatever_the_dog_is_doing(mode):
    assert forced(Stage.DAMP, mode) is Mode.DAMPED


@pytest.mark.parametrize("stage", Stage)
def test_a_dog_that_is_off_stays_off(stage):
    assert forced(stage, Mode.OFF) is Mode.OFF


def test_a_dog_that_was_damped_is_not_made_to_hold_again():
    assert forced(Stage.SIT, Mode.DAMPED) is Mode.DAMPED


@pytest.mark.parametrize("mode", [Mode.STANDING, Mode.WALKING, Mode.RISING])
def test_the_soft_stop_sits_down(mode):
    assert forced(Stage.SIT, mode) is Mode.SITTING


def test_no_stop_leads_to_standing_or_walking():
    reached = {mode for table in FORCED.values() for mode in table.values()}
    assert reached <= {Mode.DAMPED, Mode.SITTING, Mode.OFF}
