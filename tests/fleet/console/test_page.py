"""The page in a real browser: what it shows, and the stop that works whatever else does not."""

import functools
import json
import re
from pathlib import Path

import msgspec
import pytest
import yaml

from fleet.config.load import load
from fleet.history.record import Record
from fleet.model.change import ChangesAnswer
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.model.description import CommandDescription, ParameterDescription, RobotDescription
from fleet.model.event import EventKind, Requester
from fleet.model.geometry import Vector3
from fleet.model.permission import Permission
from fleet.model.site import Placement
from fleet.model.state import RobotState
from tests.tools.waiting import wait_until

pytestmark = pytest.mark.xdist_group("pages")  # in one process: to start a browser takes two seconds
WAIT = 60_000  # ms; busy computers are slow
AXE = Path(__file__).parents[2] / "data" / "axe" / "axe.min.js"  # axe-core 4.14.1, unchanged
SCRIPT = "<img src=x onerror=window.broken=1>"
REX, BEAST = "yard-1/rex", "yard-1/beast"


AT = Vector3(2.0, 1.0)
ROBOTS = {
    "rex": {
        "health": "ok",
        "reachable": True,
        "simulated": True,
        "site": AT,
        "position": Vector3(),
        "placement": Placement(AT),
        "twin": "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11",
    },
    "beast": {
        "health": "fault",
        "cause": f"{SCRIPT} the left wheel is stuck",
        "site": Vector3(-3.0, 0.0),
        "placement": Placement(),
    },
}


@pytest.fixture(scope="module")
def yard(play_edge):
    """Play an edge with two placed robots, one whose texts are scripts."""
    robots = {name: dict(fields) for name, fields in ROBOTS.items()}
    yard = play_edge("yard-1", robots=robots, groups={SCRIPT: ["rex"], "ground": ["rex", "beast"]})
    commands = (
        CommandDescription(
            "beep", "Sound.", (ParameterDescription("seconds", "number", unit="s", most=3.0),)
        ),
        CommandDescription("dock", refusal="the battery is full"),
    )
    limits = {"speed": 2.0, "yaw_rate": 1.0}
    yard.description = RobotDescription("rex", "toy", commands, drives=True, goals=True, limits=limits)
    answer = yard._replier(lambda: msgspec.json.encode(yard.description))
    yard.bus.control.declare_queryable("fleet/yard-1/robots/rex/description", answer)
    return yard


@pytest.fixture
def open_page(new_page, console, yard):
    """Open the console in a browser that remembers nothing; an error of the page fails the test."""

    def open_page(
        permission=Permission.ADMIN, prepare=lambda _page: None, *, loads=True, operator="anna", **options
    ):
        page = new_page(viewport={"width": 1200, "height": 800}, **options)
        prepare(page)
        page.goto(console.link(permission, operator), wait_until="load" if loads else "commit")
        if loads:
            page.wait_for_selector(row(REX))
            page.wait_for_selector(row(BEAST))
        return page

    return open_page


def row(robot):
    return f'#robots li[data-id="{robot}"]'


def becomes(yard, name, **fields):
    """Tell a robot's state as it is at first, but for some fields; never newer than what the edge answers."""
    state = {"twin": "", **ROBOTS[name], **fields}
    yard.bus.control.put(
        f"fleet/yard-1/robots/{name}/state",
        msgspec.json.encode(RobotState(name, adapter="toy", edge="yard-1", stamp=1.0, **state)),
    )


def stops_of(yard, request_count):
    return wait_until("the stop to reach the edge", lambda: yard.stops[request_count:])


def shows(page, selector, text):
    """Wait until a part of the page has a text."""
    page.locator(selector, has_text=text).wait_for(timeout=WAIT)


def words(page):
    return page.inner_text("#stop-words")


def test_the_fleet_is_shown_the_worst_first_and_what_robots_say_is_text(open_page):
    page = open_page()
    rows = page.locator("#robots li")
    assert [rows.nth(n).get_attribute("data-id") for n in range(2)] == [BEAST, REX]
    assert SCRIPT in rows.nth(0).inner_text()
    assert "SIM" in rows.nth(1).inner_text()
    assert "#token" not in page.url
    assert page.evaluate("window.broken") is None


def test_a_session_lasts_over_a_reload_and_in_another_tab(open_page, console):
    page = open_page()
    page.reload()
    page.wait_for_selector(row(REX))
    other = page.context.new_page()
    other.goto(console.base)
    other.wait_for_selector(row(REX), timeout=WAIT)


def test_without_a_session_the_page_says_how_to_get_a_link(open_page, console):
    page = open_page()
    page.context.clear_cookies()
    page.goto(console.base)
    shows(page, "#silence", "fleet console --link")


@pytest.mark.parametrize("lost", ["request", "response"])
def test_a_page_whose_first_request_or_its_response_is_lost_repeats_it(open_page, lost):
    """A console under load answers late; a page that gave up could stop no robot."""
    tries = []

    def lose_one(route):
        tries.append(route.request.method)
        if len(tries) > 1:
            route.continue_()
            return
        if lost == "response":
            route.fetch()
        route.abort("timedout")

    page = open_page(prepare=lambda page: page.route("**/api/session", lose_one))
    assert tries[:2] == ["POST", "POST"]
    page.reload()
    page.wait_for_selector(row(REX))


def test_escape_twice_stops_everything_and_shows_who_stands_after_how_long(open_page, yard):
    page, before = open_page(), len(yard.stops)
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    assert stops_of(yard, before) == [[]]
    shows(page, "#stop-words", "2 seen standing")
    assert re.search(r"2 of 2 stops set within \d+ ms, 2 seen standing within \d+ ms", words(page))


def test_escape_once_and_once_more_a_second_later_stops_nobody(open_page, yard):
    page, before = open_page(), len(yard.stops)
    page.keyboard.press("Escape")
    page.evaluate("new Promise((resume) => setTimeout(resume, 701))")
    page.keyboard.press("Escape")
    page.click(row(REX))
    page.wait_for_selector("button.command")
    assert yard.stops[before:] == []


@pytest.mark.parametrize(("choice", "named"), [("button", ["rex"]), ("group", ["rex", "beast"])])
def test_one_robot_or_a_group_is_stopped(open_page, yard, choice, named):
    page, before = open_page(), len(yard.stops)
    if choice == "button":
        page.click(row(REX))
        page.click('[data-stop="selected"]')
    else:
        page.select_option("#stop-group", label="ground")
    assert stops_of(yard, before) == [named]


def hang(route):
    """Never answer."""


@pytest.mark.parametrize("missing", ["**/app.js", "**/map.js", "**/style.css"])
def test_a_stop_from_the_keyboard_works_while_the_page_still_loads(open_page, yard, missing):
    before = len(yard.stops)
    page = open_page(prepare=lambda page: page.route(missing, hang), loads=False)
    page.wait_for_selector("body", state="attached")
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    assert stops_of(yard, before) == [[]]


def test_a_stop_goes_by_the_second_way_when_the_websocket_does_not_answer(open_page, yard):
    page, before = open_page(), len(yard.stops)
    page.evaluate("fleetPage.sendBySocket = () => true")  # as if it were sent, and lost
    page.click('[data-stop="all"]')
    assert stops_of(yard, before) == [[]]
    shows(page, "#stop-words", "stops set")


def test_a_console_that_says_nothing_is_shown_as_such_and_a_stop_is_never_shown_as_taken(open_page):
    muted = []

    def route(socket):
        server = socket.connect_to_server()
        socket.on_message(lambda message: None if muted else server.send(message))
        server.on_message(lambda message: None if muted else socket.send(message))

    page = open_page(prepare=lambda page: page.route_web_socket(re.compile("/ws$"), route))
    muted.append(True)
    page.route("**/api/**", lambda route: route.abort())
    page.wait_for_selector("body.silent #silence")
    assert "what is shown is old" in page.inner_text("#silence")
    page.click('[data-stop="all"]')
    shows(page, "#stop-words", "NOT ANSWERED")
    assert "fleet stop --all" in words(page)


def test_a_click_on_the_map_and_a_confirmation_send_the_selected_robot(open_page, yard):
    requested = yard.answers(
        "rex", Reply("navigate", ReplyStatus.ACCEPTED), Reply("navigate", ReplyStatus.ACCEPTED, done=True)
    )
    page = open_page()
    page.mouse.click(*page.evaluate(f"fleetPage.whereIs('{REX}')"))
    page.wait_for_selector(f'{row(REX)}[aria-selected="true"]')
    page.mouse.click(*page.evaluate("fleetPage.whereIsPoint(3, 2)"))
    assert requested == []
    page.click("#target button.primary")
    wait_until("the goal to be asked", lambda: requested)
    message = json.loads(requested[0].payload)
    assert message["position"] == pytest.approx([1.0, 1.0, 0.0], abs=0.1)
    assert (message["command"], message["session_id"]) == ("goto", "anna")
    assert requested[0].parameters["kind"] == "navigate"
    shows(page, "#answers", "done")


def test_a_box_on_the_map_selects_the_robots_in_it(open_page):
    page = open_page()
    (x, y), (to_x, to_y) = page.evaluate("[fleetPage.whereIsPoint(-4, 3), fleetPage.whereIsPoint(3, -1)]")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(to_x, to_y, steps=4)
    page.mouse.up()
    shows(page, "#robot", "2 robots")
    assert page.locator("#robots [aria-selected=true]").count() == 2


def test_buttons_come_from_the_declared_commands_with_units_limits_and_why_not_now(open_page, yard):
    requested = yard.answers("rex", Reply("beep", ReplyStatus.ACCEPTED, done=True))
    page = open_page()
    page.click(row(REX))
    page.click("text=beep…")
    field = page.locator(".command-form input")
    assert (field.get_attribute("max"), page.inner_text(".command-form small")) == ("3", "s to 3")
    field.fill("2.5")
    page.click("text=Send beep")
    wait_until("the command to be asked", lambda: requested)
    message = json.loads(requested[0].payload)
    assert (message["command"], message["data"]) == ("beep", {"seconds": 2.5})
    dock = page.locator("button.command", has_text="dock")
    assert dock.get_attribute("aria-disabled") == "true"
    assert "Not now dock the battery is full" in " ".join(page.inner_text("#robot .cannot").split())


def test_any_number_that_a_robot_reports_is_plotted(open_page, yard):
    page = open_page()
    page.click(row(REX))
    twin = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
    currents = iter(range(1_000_000))

    def offered():
        message = {"percent": 80.0, "current": next(currents)}
        yard.bus.reports.put(f"cw/{twin}/data/battery", json.dumps(message).encode())
        return page.locator("#robot .plots option", has_text="battery.current").count()

    wait_until("it is offered", offered)
    page.select_option("#robot .plots select", "battery.current")
    page.wait_for_selector(".plot canvas")
    wait_until("it moves", lambda: offered() == 0 and int(page.inner_text(".plot .value")) > 3)
    page.click(".plot button.link")
    assert page.locator(".plot").count() == 0


def test_a_release_is_an_act_of_its_own_that_shows_who_stopped(open_page, yard):
    requested = yard.answers("rex", Reply("release_emergency_stop", ReplyStatus.ACCEPTED, done=True))
    page = open_page()
    page.click(row(REX))
    page.click('[data-stop="selected"]')
    page.wait_for_selector(f"{row(REX)} .tag.halt")
    page.click("#robot button.release")
    assert "stopped by" in page.inner_text("#robot .confirm")
    assert requested == []
    page.click("#robot .confirm button.release")
    wait_until("the release to be asked", lambda: requested)
    assert json.loads(requested[0].payload)["command"] == "release_emergency_stop"


def test_the_history_of_a_robot_is_shown_when_it_is_asked_for(open_page, yard):
    stopped = Record(5.0, "rex", EventKind.STOP, f"{SCRIPT} asked", asker=Requester(Transport.BUS, "bob"))
    yard.tells("fleet/yard-1/history", [stopped])
    page = open_page()
    page.click(row(REX))
    page.click("#robot .history button")
    shows(page, "#robot ul.history", f"{SCRIPT} asked bob (claimed)")


def test_who_may_only_view_is_offered_nothing_that_moves_and_may_stop(open_page, yard):
    page, before = open_page(Permission.VIEW), len(yard.stops)
    page.click(row(REX))
    page.wait_for_selector("button.command")
    assert page.locator("button.command:not([aria-disabled])").count() == 0
    page.click('[data-stop="selected"]')
    assert stops_of(yard, before) == [["rex"]]


DRAWN = {
    "place": ([(1, 2)], "places:\n  drawn: {at: [1, 2]}\n"),
    "area": ([(0, 0), (2, 0), (2, 2)], "polygon: [[0, 0], [2, 0], [2, 2]]"),
    "path": ([(0, 0), (2, 1)], "path: [[0, 0], [2, 1]]"),
    "fence": ([(0, 1), (3, 1), (3, 2)], "fence: {inclusion: [[[-2, 0], [1, 0], [1, 1]]]}"),
}


@pytest.mark.parametrize("kind", DRAWN)
def test_what_is_drawn_on_the_map_is_downloaded_as_yaml_of_a_fleet_file(open_page, tmp_path, kind):
    points, expected = DRAWN[kind]
    page = open_page()
    page.click(row(REX))
    page.click("#draw")
    page.select_option("#drawing select", kind)
    for x, y in points:
        page.mouse.click(*page.evaluate(f"fleetPage.whereIsPoint({x}, {y})"))
    if kind != "fence":
        page.fill("#drawing input", "drawn")
    with page.expect_download() as download:
        page.click("#drawing button.primary")
    text = re.sub(r"-?\d+\.\d+", lambda found: str(round(float(found[0]))), download.value.path().read_text())
    assert expected in text
    fleet = yaml.safe_load(FLEET) | ({} if kind == "fence" else yaml.safe_load(text))
    if kind == "fence":
        fleet["robots"][0] |= yaml.safe_load(text)
    (tmp_path / "fleet.yaml").write_text(yaml.safe_dump(fleet))
    assert load(tmp_path / "fleet.yaml").problems == ()


FLEET = """
edge: {id: yard-1}
site: {origin: [47.0, 8.0, 400.0]}
robots:
  - {name: rex, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: mavlink, link: "sim:px4"}
"""


def driven(requested):
    """Return the velocities forward that a robot was asked for."""
    messages = [json.loads(each.payload) for each in list(requested) if each.parameters["kind"] == "motion"]
    return [message["linear_x"] for message in messages]


@pytest.fixture
def pad(open_page, yard):
    """Hold the pad's button for forward; returns the page and the velocities that the robot is asked for."""
    requested = yard.answers("rex", Reply("motion", ReplyStatus.ACCEPTED))

    def hold(page=None, **prepared):
        page = page or open_page(**prepared)
        page.click(row(REX))
        wait_until("three velocities without an end", lambda: held(page, requested))
        return page, requested

    return hold


def held(page, requested):
    """Press the pad's button; return whether the pad is driving after three velocities.

    A busy computer may answer later than the pad waits, which ends it: then it must be pressed again. So it
    must after it has moved on the page, as by the button that releases a stop.
    """
    requested.clear()
    page.hover(".axis.forward")
    page.mouse.down()
    # The page is asked each time, because the browser's messages pass only then.
    wait_until(
        "velocities",
        lambda: (
            "has moved" in page.inner_text(".pad [role=status]")
            or driven(requested).count(1.0) >= 3
            or 0.0 in driven(requested)
        ),
    )
    if driven(requested).count(1.0) >= 3 and 0.0 not in driven(requested):
        return True
    page.mouse.up()
    return False


ENDS = {
    "release": lambda page: page.mouse.up(),
    "escape": lambda page: page.keyboard.press("Escape"),
    "blur": lambda page: page.evaluate("dispatchEvent(new Event('blur'))"),
    "stop": lambda page: page.select_option("#stop-group", label="ground"),
    "selection": lambda page: page.evaluate("document.querySelector('#robots li').click()"),
    "closed tab": lambda page: page.close(),
}


def test_a_robot_is_driven_only_while_the_pad_is_held(pad):
    page = None
    for end in ENDS.values():  # the closed tab is the last
        page, requested = pad(page)
        end(page)
        wait_until("the zero", functools.partial(has_zero, requested))
        assert set(driven(requested)[driven(requested).index(0.0) :]) == {0.0}
        if not page.is_closed():
            page.mouse.up()


def has_zero(requested):
    return 0.0 in driven(requested)


def test_a_pad_ends_when_the_answers_take_too_long(pad):
    muted = []

    def route(socket):
        server = socket.connect_to_server()
        server.on_message(lambda message: None if muted and "drove" in message else socket.send(message))

    page, requested = pad(prepare=lambda page: page.route_web_socket(re.compile("/ws$"), route))
    muted.append(True)
    shows(page, ".pad [role=status]", "no answer within 300 ms")
    wait_until("the zero", lambda: driven(requested)[-1] == 0.0)


GAMEPAD = """window.gamepad = {connected: true, axes: [0, 0, 0, 0], buttons: Array(16).fill({})};
navigator.getGamepads = () => [window.gamepad];
window.hold = (button, forward) => {
    gamepad.buttons = gamepad.buttons.map((_, index) => ({pressed: index === button}));
    gamepad.axes = [0, -forward, 0, 0];
};"""


def test_a_gamepad_drives_only_while_a_shoulder_button_is_held_and_from_sticks_in_the_middle(open_page, yard):
    requested = yard.answers("rex", Reply("motion", ReplyStatus.ACCEPTED))
    page = open_page()
    page.click(row(REX))
    page.wait_for_selector(".pad")
    page.evaluate(GAMEPAD)
    page.evaluate("dispatchEvent(new Event('gamepadconnected'))")
    page.evaluate("hold(null, 1)")  # a stick alone moves nothing
    page.evaluate("new Promise((resume) => setTimeout(resume, 120)).then(() => hold(5, 1))")
    shows(page, ".pad [role=status]", "Let go of the sticks")
    assert driven(requested) == []
    page.evaluate("hold(5, 0)")
    wait_until("it holds", lambda: page.evaluate("1") and driven(requested))
    page.evaluate("hold(5, 1)")
    wait_until("it drives", lambda: page.evaluate("1") and 1.0 in driven(requested))
    page.evaluate("hold(null, 1)")
    wait_until("the zero", lambda: page.evaluate("1") and driven(requested)[-1] == 0.0)


def buttons(page):
    """Return the places of the pad's first button and of the first command's."""
    return [page.locator(each).first.bounding_box() for each in (".axis.forward", "button.command")]


def is_released(page, yard):
    """Tell that rex is not stopped, and wait until the page shows it."""
    becomes(yard, "rex")
    page.locator("#robot .stopped button").wait_for(state="detached", timeout=WAIT)


def test_pad_and_commands_keep_their_places_whatever_is_shown_meanwhile(open_page, yard, monkeypatch):
    page = open_page()
    page.click(row(REX))
    is_released(page, yard)
    places = buttons(page)
    refused = (*yard.description.commands, CommandDescription("sit", refusal="ben has control for 3 s more"))
    monkeypatch.setattr(yard, "description", msgspec.structs.replace(yard.description, commands=refused))
    shows(page, "#robot ul.cannot", "ben has control for 3 s more")
    assert buttons(page) == places
    long = {
        "cause": "the joint is warm. " * 20,
        "last_command": "x" * 300,
        "separation": "waits for beast " * 9,
    }
    becomes(yard, "rex", health="degraded", run="3f2a", **long)
    for selector, text in {".cause": "the joint is warm", ".facts": "xxx", "dd": "waits for beast"}.items():
        shows(page, f"#robot {selector}", text)
    assert buttons(page) == places


def test_a_pad_that_was_moved_drives_only_after_half_a_second(open_page, yard):
    requested = yard.answers("rex", Reply("motion", ReplyStatus.ACCEPTED))
    page = open_page()
    page.click(row(REX))
    becomes(yard, "rex", emergency_stop=True, stop_cause="smoke")
    shows(page, "#robot .stopped", "Release rex")
    is_released(page, yard)
    page.dispatch_event(".axis.forward", "pointerdown", {"button": 0, "pointerId": 1})
    shows(page, ".pad [role=status]", "The pad has moved. Press again.")
    assert driven(requested) == []
    page.evaluate("new Promise((resume) => setTimeout(resume, 500))")
    page.hover(".axis.forward")
    page.mouse.down()
    wait_until("it drives", lambda: page.evaluate("1") and 1.0 in driven(requested))
    page.mouse.up()


def test_a_refusal_ends_the_pad_and_is_shown(open_page, yard):
    yard.answers("beast", Reply("motion", ReplyStatus.REJECTED, "anna has control"))
    yard.tells("fleet/yard-1/robots/beast/description", RobotDescription("beast", "toy", (), drives=True))
    page = open_page()
    page.click(row(BEAST))
    page.focus(".pad")
    page.keyboard.down("w")
    shows(page, ".pad [role=status]", "rejected: anna has control")


def test_what_is_wrong_is_shown_by_cause_while_no_robot_is_selected(open_page, yard):
    page = open_page()
    stuck = RobotState("beast", "", "toy", "yard-1", 1.0, health="fault", cause=f"{SCRIPT} is stuck")
    yard.bus.control.put("fleet/yard-1/robots/beast/state", msgspec.json.encode(stuck))
    shows(page, "#robot .causes", f"{SCRIPT} is stuck")
    shows(page, "#robot .causes", "since ")
    shows(page, "#robot .causes .next", "Look at its history")
    page.click(".causes button.link >> nth=0")
    page.wait_for_selector('#robots [aria-selected="true"]')


def test_the_fleet_file_of_an_edge_is_shown_with_what_is_wrong_and_as_text(open_page, yard):
    answer = ChangesAnswer((), "/etc/fleet.yaml", "it cannot be used", (SCRIPT,), text=f"robots: {SCRIPT}\n")
    yard.tells("fleet/yard-1/changes", answer)
    page = open_page()
    page.click("text=Show fleet.yaml of yard-1")
    shows(page, ".configuration .cause", "it cannot be used")
    assert SCRIPT in page.inner_text(".configuration .file")
    assert page.evaluate("window.broken") is None


def test_who_has_control_is_asked_for_it_and_gives_it_which_stops_the_robot(open_page, yard):
    requested = yard.answers("beast", Reply("stop", ReplyStatus.ACCEPTED, done=True))
    anna, ben = open_page(), open_page(operator="ben")
    becomes(yard, "beast", control="ben")
    anna.click(row(BEAST))
    anna.click("button.ask-control")
    shows(anna, "#asks", "ben is asked for beast")
    shows(ben, "#asks", "anna asks for control of beast")
    ben.click("#asks button.primary")
    wait_until("the stop", lambda: ben.evaluate("1") and requested)
    message = json.loads(requested[0].payload)
    assert (message["command"], message["session_id"]) == ("stop", "ben")
    shows(anna, "#asks", "ben gave beast")


NOTED = """window.noted = [];
window.Notification = class { constructor(title, told) { window.noted.push([title, told.body]); } };
Notification.permission = "granted";
window.tones = 0;
AudioContext.prototype.createOscillator = new Proxy(AudioContext.prototype.createOscillator, {
    apply: (call, context) => { window.tones += 1; return Reflect.apply(call, context, []); },
});"""


def test_a_fault_sounds_and_is_notified_only_where_that_is_wanted(open_page, yard):
    page = open_page(prepare=lambda page: page.add_init_script(NOTED))

    def is_shown(health):
        becomes(yard, "rex", health=health, cause="its wheel is stuck")
        page.wait_for_selector(f"{row(REX)} .mark.{health}")

    is_shown("fault")
    is_shown("degraded")
    assert page.evaluate("[noted, tones]") == [[], 0]
    page.click("#alerts")
    is_shown("fault")
    of_rex = "noted.filter(([title]) => title.startsWith('rex'))"  # the other robot may be silent by now
    assert wait_until("it is notified", lambda: page.evaluate(of_rex)) == [
        ["rex: fault", "its wheel is stuck"]
    ]
    assert page.evaluate("tones") >= 1
    assert page.get_attribute("#alerts", "aria-pressed") == "true"
    is_shown("ok")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_of_the_page_can_be_read(open_page, scheme):
    page = open_page(color_scheme=scheme)
    page.click(row(REX))
    page.click('[data-stop="selected"]')
    page.wait_for_selector("#stop-detail table")
    assert page.evaluate(CONTRASTS) == []


def test_axe_finds_no_barrier_on_the_overview_on_a_robots_page_and_while_one_is_stopped(open_page, yard):
    page = open_page()
    checked = AXE.read_text()

    def barriers():
        page.evaluate(checked)
        found = page.evaluate("axe.run()")
        assert len(found["passes"]) > 15
        return [(each["id"], [node["html"] for node in each["nodes"]]) for each in found["violations"]]

    assert barriers() == []
    page.click(row(REX))
    page.wait_for_selector("button.command")
    page.click("text=beep…")
    assert barriers() == []
    page.click('[data-stop="selected"]')
    page.click("#robot button.release")
    page.wait_for_selector("#robot .confirm")
    assert barriers() == []


CONTRASTS = """() => {
    const parse = (text) => text.match(/[\\d.]+/g).map(Number);
    const light = ([r, g, b]) => [r, g, b].map((c) => c / 255)
        .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
        .reduce((sum, c, n) => sum + c * [0.2126, 0.7152, 0.0722][n], 0);
    const ground = (element) => {
        for (let each = element; each; each = each.parentElement) {
            const color = parse(getComputedStyle(each).backgroundColor);
            if (color.length === 3 || color[3] > 0.99) return color;
        }
        return [255, 255, 255];
    };
    const bad = [];
    for (const each of document.querySelectorAll('body *')) {
        const own = [...each.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
        if (!own || !each.checkVisibility()) continue;
        const [one, other] = [light(parse(getComputedStyle(each).color)), light(ground(each))];
        const contrast = (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);
        if (contrast < 4.5) bad.push(`${each.textContent.trim().slice(0, 40)}: ${contrast.toFixed(2)}`);
    }
    return bad;
}"""
