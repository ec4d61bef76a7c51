"""The router's configuration in the guide does what the guide says, between two routers on this computer."""

import contextlib
import json
import pathlib
import re
import threading

import pytest

from fleet.bus import keys
from fleet.bus.settings import BusSettings, zenoh_settings
from fleet.bus.zenoh_session import ZenohSession
from tests.tools.waiting import wait_until

PAGE = pathlib.Path(__file__).parents[2] / "docs" / "how-to" / "several-edges.md"
TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


@pytest.fixture
def opened():
    with contextlib.ExitStack() as stack:

        def opened(mode, *, listen=(), connect=(), **more):
            settings = zenoh_settings(
                BusSettings("x", listen=listen, connect=connect), mode=mode, listen=listen, connect=connect
            )
            session = ZenohSession(
                {name: value for name, value in settings.items() if "/tls" not in name} | more
            )
            stack.callback(session.close)
            return session

        yield opened


@pytest.fixture
def fleet_and_edge(opened, free_port, tmp_path):
    """Open a fleet's router with who looks at it, and below it a site's router with an edge."""
    above, here = f"tcp/127.0.0.1:{free_port}", f"unixsock-stream/{tmp_path}/site.sock"
    (given,) = re.findall(r"```json\n(.*?)```", PAGE.read_text(), re.DOTALL)
    access = json.loads(given)["access_control"]
    access["subjects"] = [{"id": "the fleet", "link_protocols": ["tcp"]}]  # no certificates in this test
    opened("router", listen=(above,))
    opened("router", listen=(here,), connect=(above,), access_control=access)
    edge = opened("client", connect=(here,))
    return opened("client", connect=(above,)), edge


def test_only_summaries_go_up_and_questions_and_stops_pass(fleet_and_edge):
    view, edge = fleet_and_edge
    heard, stopped = [], threading.Event()
    view.subscribe("**", lambda key, _: heard.append(key))
    view.watch_tokens("fleet/**", lambda key, alive: heard.append(f"token {key}"))
    edge.declare_queryable(
        keys.history("yard-1"), lambda question: (question.reply(b"told"), question.close())
    )
    edge.subscribe(keys.stop("*"), lambda *_: stopped.set())
    for token in (keys.robot("yard-1", "rex"), keys.claim("yard-1", TWIN, 1), keys.edge("yard-1")):
        edge.token(token)

    def put():
        for key in (
            f"cw/{TWIN}/data/pose",
            keys.state("yard-1", "rex"),
            keys.health("yard-1"),
            keys.summary("yard-1"),
        ):
            edge.put(key, b"x")
        return keys.summary("yard-1") in heard and f"token {keys.edge('yard-1')}" in heard

    wait_until("summary and token of the edge go up", put)
    answers = wait_until("questions pass", lambda: list(view.request(keys.history("*"), b"", timeout=1)))
    assert answers == [(keys.history("yard-1"), b"told")]

    def stop():
        view.put(keys.stop("*"), b"[]", urgent=True)
        return stopped.wait(0.1)

    wait_until("stops pass", stop)
    assert set(heard) == {keys.summary("yard-1"), f"token {keys.edge('yard-1')}", keys.stop("*")}
