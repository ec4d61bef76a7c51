"""``fleet rollout``: what it needs, and the accounts of a server; the rest is in tests/system."""

import asyncio
import importlib.util
import json

import pytest

from fleet.cli import rollout
from fleet.rollout import driver, nats_store
from fleet.rollout.installation import Installation


@pytest.fixture
def settings(place):
    (place / "rollout.yaml").write_text(json.dumps({"servers": ["nats://127.0.0.1:1"]}))


def test_accounts_are_printed_for_the_configuration_of_the_server(fleet):
    printed = fleet("rollout", "accounts", "yard-1", "yard-2", "--operator", "alice").out
    assert printed.startswith("accounts {")
    assert printed.count('"user"') == 3


@pytest.mark.parametrize("command", ["status", "resume", "abort"])
def test_a_store_that_does_not_answer_is_reported(fleet, settings, command, monkeypatch):
    monkeypatch.setattr(driver, "SILENT_FOR", 0.0)  # how long it is asked again is tested with the driver
    result = fleet("rollout", command)
    assert (result.code, "does not answer OPERATOR" in result.err) == (1, True)


def test_an_agent_needs_an_edge(fleet, settings):
    assert "names no edge" in fleet("rollout", "agent").err


async def test_an_agent_ends_at_ctrl_c_though_its_store_swallows_the_cancellation(
    settings, place, monkeypatch
):
    swallowed, closed = [], []

    class Store:
        def __init__(self, *_):
            pass

        async def desired(self):
            try:
                await asyncio.Event().wait()
            except asyncio.CancelledError:
                if swallowed:
                    raise
                swallowed.append(1)

        async def close(self):
            closed.append(1)

    monkeypatch.setattr(nats_store, "NatsEdgeStore", Store)
    monkeypatch.setattr(
        rollout, "end_by_signal", lambda end: asyncio.get_running_loop().call_later(0.01, end)
    )
    monkeypatch.setattr("fleet.rollout.agent.Agent._report", lambda _self: asyncio.sleep(0))
    async with asyncio.timeout(20):
        await rollout._serve("yard-1", Installation(place))
    assert (swallowed, closed) == ([1], [1])


def test_without_the_client_of_nats_it_says_what_to_install(fleet, settings, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    assert "pip install 'zenoh-fleet[standby]'" in fleet("rollout", "status").err
