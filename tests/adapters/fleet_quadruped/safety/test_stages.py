import pytest

from fleet_quadruped.safety.stages import FORCED, BodyMode, StopStage, forced


@pytest.mark.parametrize("mode", [mode for mode in BodyMode if mode not in {BodyMode.OFF, BodyMode.DAMPED}])
def test_the_hard_stop_damps_whatever_the_dog_is_doing(mode):
    assert forced(StopStage.DAMP, mode) is BodyMode.DAMPED


@pytest.mark.parametrize("stage", StopStage)
def test_a_dog_that_is_off_stays_off(stage):
    assert forced(stage, BodyMode.OFF) is BodyMode.OFF


def test_a_dog_that_was_damped_is_not_made_to_hold_again():
    assert forced(StopStage.SIT, BodyMode.DAMPED) is BodyMode.DAMPED


@pytest.mark.parametrize("mode", [BodyMode.STANDING, BodyMode.WALKING, BodyMode.RISING])
def test_the_soft_stop_sits_down(mode):
    assert forced(StopStage.SIT, mode) is BodyMode.SITTING


def test_no_stop_leads_to_standing_or_walking():
    reached = {mode for table in FORCED.values() for mode in table.values()}
    assert reached <= {BodyMode.DAMPED, BodyMode.SITTING, BodyMode.OFF}
