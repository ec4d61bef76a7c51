"""Who asks from a console, by the key of the question."""

from types import SimpleNamespace

import pytest

from fleet.errors import Refused
from fleet.host.requests.console_asker import ConsoleAsker, console_asker, console_refusal
from fleet.model.permission import Permission


def question(suffix):
    return SimpleNamespace(suffix=suffix)


@pytest.mark.parametrize("console", ["desk", "_local"])
def test_the_key_names_the_console_and_the_permission(console):
    asker = console_asker(question(f"/as/operate/{console}"))
    assert asker == ConsoleAsker(console, Permission.OPERATE)


def test_a_program_has_no_permission_and_may_ask():
    assert console_asker(question("")) is None
    assert console_refusal(question(""), Permission.ADMIN) == ""


@pytest.mark.parametrize(
    "suffix", ["/as/root/desk", "/as/*/desk", "/as/admin/*", "/as/admin/_other", "/as/admin/"]
)
def test_a_key_that_names_neither_is_refused(suffix):
    with pytest.raises(Refused, match="names no permission and console"):
        console_asker(question(suffix))
    assert "names no permission" in console_refusal(question(suffix), Permission.VIEW)


def test_a_permission_that_is_too_low_is_told():
    asked = question("/as/view/desk")
    assert console_refusal(asked, Permission.VIEW) == ""
    assert console_refusal(asked, Permission.OPERATE) == "it needs the permission operate; yours is view"
