"""The live view, as Foxglove sees it: a WebSocket by its published protocol, of a console with an edge."""

import asyncio
import contextlib
import json
import struct
import time

import jsonschema
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from fleet.bus import keys
from fleet.bus.bus import open_edge
from fleet.bus.settings import BusSettings
from fleet.clock import SystemClock
from fleet.console.foxglove.feed import Feed
from fleet.console.foxglove.protocol import PROTOCOLS
from fleet.console.foxglove.viewer import MOST_BAD
from fleet.console.login_links import LinkRequest, request_link
from fleet.console.task import link_socket
from fleet.errors import BusError
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.permission import Permission
from fleet.model.report import LogReport, PoseReport
from fleet.wire.databus import encode_report
from tests.tools.waiting import DEADLINE, wait_until

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
POSITION, LOG = f"cw/{TWIN}/data/position", f"cw/{TWIN}/data/driverlog"
FOXGLOVE = "https://app.foxglove.dev"
REQUESTED = LinkRequest("anna", Permission.VIEW, "foxglove")


def pose(x):
    return encode_report(PoseReport(time.time(), Vector3(x, 0.0, 0.0), Quaternion(1.0, 0.0, 0.0, 0.0)), 1)


def x_of(message):
    """Return x of a pose, None of anything else."""
    return message.get("pose", {}).get("position", {}).get("x")


class Viewer:
    """A client of the protocol."""

    def __init__(self, socket):
        self.socket = socket
        self.channels, self.statuses, self.messages = {}, [], []

    def request(self, op, **fields):
        self.socket.send(json.dumps({"op": op, **fields}))

    def read(self):
        data = self.socket.recv(timeout=DEADLINE)
        if isinstance(data, bytes):
            opcode, subscription, received = struct.unpack_from("<BIQ", data)
            assert opcode == 1
            assert abs(received / 1e9 - time.time()) < DEADLINE
            self.messages.append((subscription, json.loads(data[13:])))
            return
        message = json.loads(data)
        if message["op"] == "advertise":
            self.channels |= {each["topic"]: each for each in message["channels"]}
        elif message["op"] == "status":
            self.statuses.append(message["message"])
        else:
            assert (message["op"], message["capabilities"]) == ("serverInfo", [])

    def until(self, found):
        while not (what := found()):
            self.read()
        return what

    def subscribe(self, number, topic):
        channel = self.until(lambda: self.channels.get(topic))
        self.request("subscribe", subscriptions=[{"id": number, "channelId": channel["id"]}])
        return channel


@pytest.fixture(scope="module")
def served(runtime, serve_console):
    with serve_console(runtime, "foxglove") as console:
        yield console


@pytest.fixture(scope="module")
def address(runtime, served):
    return request_link(link_socket(runtime, "foxglove"), REQUESTED).link


@pytest.fixture(scope="module")
def edge(runtime):
    """Open the bus of an edge; what it is asked, it does not answer."""
    bus = open_edge(BusSettings("yard-1"), runtime)
    bus.control.declare_queryable(
        keys.state("yard-1", "rex"),
        lambda query: query.answer(
            json.dumps(
                {"name": "rex", "twin": TWIN, "adapter": "toy", "edge": "yard-1", "stamp": 1.0}
            ).encode()
        ),
    )
    yield bus
    bus.close()


@pytest.fixture
def open_viewer(address):
    with contextlib.ExitStack() as stack:

        def open_viewer(**options):
            options = {"origin": FOXGLOVE, "subprotocols": list(PROTOCOLS)} | options
            return Viewer(stack.enter_context(connect(address, **options)))

        yield open_viewer


def test_foxglove_is_offered_topics_and_sent_what_it_subscribes_to(open_viewer, edge):
    viewer = open_viewer()
    assert viewer.socket.subprotocol == PROTOCOLS[0]
    viewer.until(lambda: "/yard-1/rex/state" in viewer.channels)
    publisher = edge.reports.publisher(LOG)  # the console itself hears positions always
    wait_until("the reports to be wanted", lambda: publisher.wanted)
    edge.reports.put(POSITION, pose(1.0))
    channel = viewer.subscribe(5, "/yard-1/rex/position")
    viewer.subscribe(6, "/yard-1/rex/transform")
    assert channel["schemaName"] == "foxglove.PoseInFrame"
    viewer.until(lambda: {number for number, _ in viewer.messages} == {5, 6})
    edge.reports.put(POSITION, pose(2.0))
    found = viewer.until(
        lambda: [
            message
            for number, message in viewer.messages
            if number == 5 and message["pose"]["position"]["x"] == 2
        ]
    )
    jsonschema.validate(found[0], json.loads(channel["schema"]))
    assert found[0]["frame_id"] == "yard-1/rex/world"
    viewer.request("unsubscribe", subscriptionIds=[5])
    viewer.request("advertise", channels=[])
    viewer.until(lambda: viewer.statuses)  # so the unsubscription was taken
    viewer.messages.clear()
    edge.reports.put(POSITION, pose(3.0))
    viewer.until(lambda: viewer.messages)
    assert {number for number, _ in viewer.messages} == {6}


def test_a_new_subscription_gets_the_newest_message_at_once(open_viewer, edge):
    viewer = open_viewer(subprotocols=[PROTOCOLS[1]])
    assert viewer.socket.subprotocol == PROTOCOLS[1]
    viewer.subscribe(0, "/yard-1/rex/state")
    ((_, message),) = viewer.until(lambda: viewer.messages)
    assert message["name"] == "rex"


def test_no_line_of_a_log_is_lost_to_a_viewer_that_reads(open_viewer, edge):
    viewer = open_viewer()
    publisher = edge.reports.publisher(LOG)
    wait_until("the reports to be wanted", lambda: publisher.wanted)
    lines = [f"line {number}" for number in range(200)]
    edge.reports.put(LOG, encode_report(LogReport(time.time(), "INFO", "first"), 1))
    viewer.subscribe(1, "/yard-1/rex/driverlog")
    viewer.until(lambda: viewer.messages)
    viewer.messages.clear()
    for number, line in enumerate(lines):
        edge.reports.put(LOG, encode_report(LogReport(time.time(), "INFO", line), number + 2), urgent=True)
    viewer.until(lambda: len(viewer.messages) == len(lines))
    assert [message["message"] for _, message in viewer.messages] == lines


def test_nothing_is_heard_for_nobody(open_viewer, edge):
    viewer = open_viewer()
    publisher = edge.reports.publisher(LOG)
    wait_until("the reports to be wanted", lambda: publisher.wanted)
    viewer.socket.close()
    wait_until("the reports to be wanted no more", lambda: not publisher.wanted)


@pytest.mark.parametrize("op", ["advertise", "setParameters", "callService", "fetchAsset", "playbackControl"])
def test_it_takes_no_wish_but_subscriptions(open_viewer, edge, op):
    viewer = open_viewer()
    viewer.request(op)
    viewer.until(lambda: viewer.statuses)
    assert viewer.statuses == [f"this view is read-only: {op} is not taken"]


def test_data_and_garbage_are_reported_and_too_much_of_it_ends_the_view(open_viewer, edge):
    viewer = open_viewer()
    viewer.subscribe(1, "/yard-1/rex/state")
    viewer.request("subscribe", subscriptions=[{"id": 1, "channelId": 10_000}])
    viewer.until(lambda: viewer.statuses)
    assert viewer.statuses == ["there is no channel 10000"]
    viewer.subscribe(1, "/yard-1/rex/state")
    viewer.until(lambda: len(viewer.statuses) == 2)
    assert "is subscribed already" in viewer.statuses[1]
    for _ in range(MOST_BAD - 2):
        viewer.socket.send(b"\x01\0\0\0\0{}")
    with pytest.raises(ConnectionClosed) as ended:
        viewer.until(lambda: False)
    assert ended.value.rcvd.code == 1008


@pytest.mark.parametrize(
    "changed",
    [
        {"origin": "https://evil.example"},
        {"origin": "https://app.foxglove.dev.evil.example"},
        {"origin": "http://app.foxglove.dev"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:1"},
        {"subprotocols": None},
        {"subprotocols": ["fleet.console"]},
    ],
    ids=str,
)
def test_a_foreign_page_is_refused_even_with_the_address(open_viewer, changed):
    with pytest.raises(InvalidStatus) as refused:
        open_viewer(**changed)
    assert refused.value.response.status_code == 403


def test_a_foreign_name_of_this_computer_is_refused(served, address):
    requested = {
        "connection": "Upgrade",
        "upgrade": "websocket",
        "sec_websocket_version": "13",
        "sec_websocket_key": "AAAAAAAAAAAAAAAAAAAAAA==",
        "sec_websocket_protocol": PROTOCOLS[0],
    }
    path = "/foxglove/" + address.rpartition("/")[2]
    assert served.request("GET", path, host=f"evil.example:{served.port}", **requested)[0] == 403


@pytest.mark.parametrize("origin", [None, "file://", FOXGLOVE])
def test_foxglove_as_program_and_page_and_other_programs_are_let_in(open_viewer, origin):
    assert open_viewer(origin=origin).socket.subprotocol == PROTOCOLS[0]


@pytest.mark.parametrize("token", ["", "x", "../ws", "A" * 43])
def test_without_the_token_nobody_is_let_in(served, token):
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{served.port}/foxglove/{token}", subprotocols=list(PROTOCOLS))
    assert refused.value.response.status_code in {403, 404}


def test_its_token_opens_nothing_else_and_other_tokens_do_not_open_it(served, address):
    token = address.rpartition("/")[2]
    assert served.post("/api/session", {"token": token})[0] == 403
    with pytest.raises(InvalidStatus):
        connect(f"ws://127.0.0.1:{served.port}/foxglove/{served.token()}", subprotocols=list(PROTOCOLS))
    with pytest.raises(InvalidStatus):
        connect(f"ws://127.0.0.1:{served.port}/ws", origin=FOXGLOVE, subprotocols=list(PROTOCOLS))


def test_more_viewers_than_it_serves_are_asked_to_come_again(open_viewer):
    viewers = [open_viewer() for _ in range(9)]
    with pytest.raises(ConnectionClosed) as ended:
        viewers[-1].until(lambda: False)
    assert ended.value.rcvd.code == 1013
    viewers[0].request("x")
    viewers[0].until(lambda: viewers[0].statuses)


class StillSocket:
    """A viewer that asks for nothing."""

    scope = {"subprotocols": list(PROTOCOLS)}

    async def accept(self, _protocol):
        pass

    async def send_text(self, _text):
        pass

    async def receive(self):
        await asyncio.Event().wait()


async def test_an_edge_that_joins_while_another_is_asked_is_heard_and_one_that_fails_takes_none_away(caplog):
    joined = {"a": object(), "b": object()}
    feed, begun = Feed(joined, SystemClock()), asyncio.Event()
    loop = asyncio.get_running_loop()

    def begin(edge, _heard, _loop):
        joined["c"] = object()
        if edge == "a":
            raise BusError("it does not answer")
        if edge == "c":
            loop.call_soon_threadsafe(begun.set)

    feed._begin = begin
    viewing = asyncio.create_task(feed.serve(StillSocket(), feed.tokens.new()))
    await asyncio.wait_for(begun.wait(), DEADLINE)
    assert "gets nothing of edge a" in caplog.text
    viewing.cancel()
    await asyncio.gather(viewing, return_exceptions=True)
