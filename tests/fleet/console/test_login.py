"""The login: name and password for a session, with waits after failures, and told in the history."""

import asyncio

import pytest

from fleet.console import login as module
from fleet.console.attempts import BY_ADDRESS, BY_NAME
from fleet.console.login import BUSY, MOST_WAITING, WRONG, Login, LoginRefused
from fleet.console.people import People, Person, add_person, change_person, remove_person
from fleet.console.sessions import NewSession
from fleet.model.permission import Permission
from fleet.testing.clock import ManualClock

HERE = "10.0.0.9"


class RecordedLogins:
    """What the history was told."""

    def __init__(self):
        self.events = []

    def logged_in(self, name, address):
        self.events.append((name, address))

    def failed(self, name, address, wait):
        self.events.append((name, address, wait))


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "people.json"
    add_person(path, Person("anna", "operate", "hash of right"))
    return path


@pytest.fixture
def verified(monkeypatch):
    """Verify without argon2, which has tests of its own; return what was verified."""
    requested = []

    def verify(kept, password):
        requested.append(kept)
        return kept == f"hash of {password}"

    monkeypatch.setattr(module, "verify_password", verify)
    return requested


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def recorded():
    return RecordedLogins()


@pytest.fixture
def login(path, recorded, clock, verified):
    return Login(People(path), recorded, clock)


async def test_a_name_with_its_password_gets_a_session_with_its_permission(login, recorded):
    opened = await login.log_in("anna", "right", HERE)
    operator = login.sessions.operator_of({login.sessions.cookie: opened.cookie}, opened.proof)
    assert (operator.name, operator.permission) == ("anna", Permission.OPERATE)
    assert login.sessions.cookie.startswith("__Host-")
    assert recorded.events == [("anna", HERE)]


async def test_an_unknown_name_gets_the_same_answer_after_the_same_work_and_is_not_written(
    login, recorded, verified
):
    wrong = await login.log_in("anna", "wrong", HERE)
    unknown = await login.log_in("my secret password", "right", HERE)
    assert wrong == unknown == LoginRefused(403, WRONG)
    assert verified == ["hash of right", None]
    assert recorded.events == [("anna", HERE, 0.0), ("", HERE, 0.0)]


async def test_a_name_waits_after_failures_even_with_the_right_password_and_from_elsewhere(login, clock):
    for number in range(BY_NAME.free + 1):
        await login.log_in("anna", "wrong", f"10.0.1.{number}")
    refused = await login.log_in("anna", "right", "10.0.2.1")
    assert (refused.status, refused.wait) == (429, 2)
    assert refused.why == "too many failed logins: try again in 2 s"
    clock.advance(2.0)
    assert isinstance(await login.log_in("anna", "right", "10.0.2.1"), NewSession)


async def test_a_name_that_nobody_has_waits_just_the_same(login):
    for number in range(BY_NAME.free + 1):
        await login.log_in("nobody", "wrong", f"10.0.1.{number}")
    assert (await login.log_in("nobody", "wrong", "10.0.2.1")).status == 429


async def test_an_address_waits_after_failures_with_many_names_and_a_login_does_not_clear_it(login, verified):
    for number in range(BY_ADDRESS.free):
        await login.log_in(f"name-{number}", "wrong", HERE)
    assert isinstance(await login.log_in("anna", "right", HERE), NewSession)
    assert (await login.log_in("one-more", "wrong", HERE)).status == 403
    done = len(verified)
    assert (await login.log_in("anna", "right", HERE)).status == 429
    assert isinstance(await login.log_in("anna", "right", "10.0.0.10"), NewSession)
    assert len(verified) == done + 1


async def test_tries_at_the_same_moment_are_verified_one_by_one_and_wait_too(login, verified):
    tries = [login.log_in("anna", "wrong", HERE) for _ in range(MOST_WAITING + 3)]
    answers = await asyncio.gather(*tries)
    assert [each for each in answers if each.why == BUSY] == [LoginRefused(503, BUSY, 1)] * 3
    assert len(verified) == BY_NAME.free + 1


@pytest.mark.parametrize(
    "change",
    [
        lambda path: remove_person(path, "anna"),
        lambda path: change_person(path, "anna", permission="view"),
        lambda path: change_person(path, "anna", permission="admin"),
        lambda path: change_person(path, "anna", password="another"),
        lambda path: path.chmod(0o644),
        lambda path: path.unlink(),
    ],
    ids=["removed", "lowered", "raised", "password", "readable by others", "file gone"],
)
async def test_a_session_ends_at_once_when_its_person_is_changed(login, path, change):
    opened = await login.log_in("anna", "right", HERE)
    cookies = {login.sessions.cookie: opened.cookie}
    assert login.sessions.operator_of(cookies, opened.proof) is not None
    change(path)
    assert login.sessions.operator_of(cookies, opened.proof) is None


async def test_a_file_that_cannot_be_read_is_reported_as_such(login, path):
    path.write_text("garbage")
    refused = await login.log_in("anna", "right", HERE)
    assert (refused.status, "file of people cannot be read" in refused.why) == (503, True)
