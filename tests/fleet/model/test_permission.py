"""Permissions of persons at a console."""

import pytest

from fleet.model.permission import Permission, needed_for_command


def test_each_permission_includes_those_before_it():
    assert not Permission.ADMIN.refusal(Permission.OPERATE)
    assert not Permission.OPERATE.refusal(Permission.OPERATE)
    assert Permission.VIEW.refusal(Permission.OPERATE) == "it needs the permission operate; yours is view"


@pytest.mark.parametrize(
    ("command", "needed"),
    [("walk", Permission.OPERATE), ("reboot", Permission.ADMIN), ("set_parameters", Permission.ADMIN)],
)
def test_commands_that_outlast_a_motion_need_more(command, needed):
    assert needed_for_command(command) is needed
