"""The page at a second of the recordings: everything as it was then, and no control but the stop."""

import math
import time
from datetime import UTC, datetime
from pathlib import Path

import pytest

from fleet.model.geometry import Quaternion, Vector3
from fleet.model.permission import Permission
from fleet.model.report import PoseReport
from fleet.record.export import recorded
from fleet.wire.databus import encode_report
from tests.tools.recordings import TWINS, write_recording
from tests.tools.waiting import wait_until

AXE = Path(__file__).parents[2] / "data" / "axe" / "axe.min.js"
pytestmark = pytest.mark.xdist_group("pages")  # in one process: to start a browser takes two seconds
REX, ANN = "yard-1/rex", "yard-1/ann"
LENGTH = 400  # s of the recording


@pytest.fixture(scope="module")
def begins():
    """When the recording begins: an hour ago, at a whole second."""
    return float(round(time.time()) - 3600)


@pytest.fixture(scope="module")
def served(runtime, serve_console, tmp_path_factory, begins):
    """Serve a console with a recording of an edge; the robot rex is there now, too."""
    folder = tmp_path_factory.mktemp("past") / "recordings"
    write_recording(folder, begins, LENGTH)
    with serve_console(runtime, "past", recordings=(str(folder),)) as served:
        yield served


@pytest.fixture(scope="module")
def yard(play_edge):
    """Play the edge as it is now."""
    rex = {"twin": TWINS["rex"], "health": "ok", "activity": "idle now", "reachable": True}
    return play_edge("yard-1", robots={"rex": rex})


@pytest.fixture
def open_past(new_page, served, yard):
    """Open the page; an error of it fails the test."""

    def open_past(permission=Permission.ADMIN, at=None, **options):
        page = new_page(viewport={"width": 1200, "height": 800}, **options)
        page.goto(served.link(permission))
        page.wait_for_selector(f'#robots li[data-id="{REX}"]')
        if at is not None:
            page.evaluate("location.hash = `t=${new Date(%f).toISOString()}`" % (at * 1000))
            page.wait_for_selector("body.past")
        return page

    return open_past


def pose(page, robot):
    """Return where the page shows a robot."""
    return page.evaluate(
        "async (robot) => (await import('/store.js')).store.poses[robot]?.slice(0, 2)", robot
    )


def goes_to(page, at):
    """Go to a moment by the slider."""
    page.locator("#past input[type=range]").evaluate(
        "(slider, at) => { slider.value = at; slider.dispatchEvent(new Event('input')); }", at
    )


def shows_at(page, robot, where):
    """Wait until the page shows a robot there."""
    wait_until("the robot to be there", lambda: pose(page, robot) == where)


def plot(page, robot, number):
    """Select a robot, and plot a recorded number of it."""
    page.click(f'#robots li[data-id="{robot}"]')
    page.locator("#robot .plots option", has_text=number).wait_for(state="attached")
    page.select_option("#robot .plots select", number)


def plotted(page):
    """Return the picture of the plot, and the columns of the line at the moment in it."""
    return page.evaluate(
        """() => {
          const canvas = document.querySelector(".plot canvas");
          const { width, height } = canvas;
          const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
          const [red, green, blue] = [0x7a, 0x3e, 0x00];
          const columns = new Set();
          for (let at = 0; at < data.length; at += 4)
            if (data[at] === red && data[at + 1] === green && data[at + 2] === blue)
              columns.add((at / 4) % width);
          return [canvas.toDataURL(), [...columns].sort((one, other) => one - other), width];
        }"""
    )


def values_shown(page):
    """Return the value beside each plot."""
    return page.locator(".plot .value").all_inner_texts()


def test_the_fleet_at_a_second_is_reported_with_its_poses_health_runs_and_events(served, begins):
    with served.page(Permission.VIEW) as page:
        page.request("moment", request="one", at=begins + 12.0)
        moment = page.answer("one")["moment"]
    entries = moment["entries"]
    assert entries["poses"][REX] == [22.0, 0.0, 0.0, 0.0, True]
    assert entries["poses"][ANN] == [0.0, 3.0, 0.0, 0.0, True]
    assert (entries["robots"][REX]["emergency_stop"], entries["robots"][ANN]["health"]) == (True, "ok")
    assert entries["runs"]["yard-1/r1"]["phase"] == "step"
    (event,) = moment["events"]
    assert (event["robot"], event["by"], event["text"]) == (REX, "berta", "stopped: too close")
    assert moment["tracks"][REX][0] == [10.0, 0.0]
    assert moment["recorded"] == begins + 12.0


def test_fences_joints_and_schedules_are_as_they_were(served, begins):
    def at(moment):
        with served.page(Permission.VIEW) as page:
            page.request("moment", request="one", at=begins + moment)
            return page.answer("one")["moment"]["entries"]

    before, after = at(12.0), at(27.0)
    for entries, reach, knee in ((before, 40.0, 1.2), (after, 20.0, 2.7)):
        described = entries["descriptions"][REX]
        assert described["fence"]["inclusion"][0][1] == [reach, -1.0]
        assert (described["commands"], described["body"][0]["joint"]) == ([], "knee")
        assert entries["numbers"][REX]["joint_states.positions.knee"] == knee
        assert entries["numbers"][REX]["position.qw"] == 1.0
    enabled = [entries["schedules"]["yard-1/nightly"]["enabled"] for entries in (before, after)]
    assert enabled == [True, False]


def test_the_page_draws_the_body_and_shows_schedules_without_buttons_in_the_past(open_past, begins):
    page = open_past(at=begins + 15)
    page.locator("#robot ul.schedules", has_text="switched off").wait_for()
    assert page.locator("#robot .schedules button").count() == 0
    page.click(f'#robots li[data-id="{REX}"]')
    page.wait_for_selector(".body3d")

    def knee():
        return page.evaluate("fleetPage.partEnds()").get("leg", [0])[0]

    wait_until("the joint", lambda: knee() == pytest.approx(-math.sin(1.5)))
    assert page.locator("#robot button.command").count() == 0
    assert page.locator(".pad").count() == 0
    goes_to(page, begins + 5)
    wait_until("the joint before", lambda: knee() == pytest.approx(-math.sin(0.5)))


def test_a_time_of_which_nothing_is_recorded_is_refused_and_one_after_it_is_reported_as_old(served, begins):
    with served.page() as page:
        page.request("moment", request="before", at=begins - 60.0)
        assert "nothing is recorded" in page.answer("before")["reason"]
        page.request("moment", request="nan", at=1e300)
        assert "no valid time" in page.answer("nan")["reason"]
        page.request("moment", request="after", at=begins + 600.0)
        moment = page.answer("after")["moment"]
    assert moment["recorded"] == begins + LENGTH - 0.5
    assert not moment["entries"]["edges"]["yard-1"]["alive"]


def test_one_slider_takes_the_whole_page_to_a_second_and_back(open_past, yard, begins):
    page = open_past(at=begins + 8)
    shows_at(page, REX, [18.0, 0.0])
    assert "PAST" in page.inner_text("#past")
    assert "3600" not in page.inner_text("#past")
    assert "round" in page.inner_text("#robot .runs")
    goes_to(page, begins + 25)
    shows_at(page, REX, [35.0, 0.0])
    assert "the left wheel is stuck" in page.inner_text("#robot .causes")
    assert "stopped: too close" in page.inner_text("#robot .events")
    page.click("text=Back to now")
    page.wait_for_selector("body:not(.past)")

    def shows_now():
        yard.publish_state("rex")
        return "idle now" in page.inner_text("#robots")

    wait_until("the present", shows_now)
    assert "#" not in page.url


def test_a_link_to_a_moment_opens_it_and_has_no_token(open_past, begins):
    page = open_past(at=begins + 8)
    moment = datetime.fromtimestamp(begins + 8, UTC).strftime("%Y-%m-%dT%H:%M:%S.0Z")
    assert page.url.endswith(f"/#t={moment}")
    page.reload()
    page.wait_for_selector("body.past")
    shows_at(page, REX, [18.0, 0.0])


def test_in_the_past_every_control_is_gone_but_the_stop_which_acts_on_now(open_past, yard, begins):
    page = open_past(at=begins + 8)
    page.click(f'#robots li[data-id="{REX}"]')
    left = page.eval_on_selector_all(
        "main button:not([hidden]), main input", "all => all.map((each) => each.id).filter(Boolean)"
    )
    assert set(left) == {"zoom-in", "zoom-out", "zoom-fit"}
    page.locator("#map").click(position={"x": 300, "y": 300})
    assert not page.is_visible("#target")
    sent = page.evaluate(
        "async (robot) => (await import('/store.js')).ask({ask: 'command', robot, command: 'go'}, () => 0)",
        REX,
    )
    assert sent is False
    known = len(yard.stops)
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    wait_until("the stop to reach the edge", lambda: yard.stops[known:])
    assert "acts on now" in page.inner_text("#past")


def test_the_window_before_a_moment_is_saved_as_a_file(open_past, begins, tmp_path):
    page = open_past(at=begins + 20)
    with page.expect_download() as saving:
        page.select_option("select[aria-label='Export MCAP']", "60")
    saving.value.save_as(tmp_path / "window.mcap")
    found = recorded(tmp_path / "window.mcap")
    assert (found.begins, found.ends) == (begins, begins + 19.5)


def test_who_may_not_export_is_not_offered_it(open_past, begins):
    page = open_past(Permission.OPERATE, at=begins + 8)
    assert page.is_disabled("select[aria-label='Export MCAP']")
    assert "admin" in page.get_attribute("select[aria-label='Export MCAP']", "title")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_barrier_in_the_past(open_past, begins, scheme):
    def barriers():
        found = page.evaluate("axe.run()")["violations"]
        return [(each["id"], [node["html"] for node in each["nodes"]]) for each in found]

    page = open_past(at=begins + 25, color_scheme=scheme)
    page.evaluate(AXE.read_text())
    assert barriers() == []
    plot(page, REX, "position.x")
    page.wait_for_selector(".plot canvas")
    assert barriers() == []


def test_a_plot_of_the_past_shows_the_recorded_values_around_the_moment_and_follows_the_slider(
    open_past, yard, begins
):
    page = open_past(at=begins + 100)
    plot(page, REX, "position.x")
    offered = page.locator("#robot .plots option").all_inner_texts()
    assert {"position.qw", "joint_states.positions.knee"} <= set(offered)
    page.wait_for_selector(".plot canvas")
    wait_until("the value of the moment", lambda: values_shown(page) == ["100"])
    before, line, width = plotted(page)
    assert width / 3 < min(line) <= max(line) < min(line) + 4
    goes_to(page, begins + 140)
    wait_until("the value of the moment after", lambda: values_shown(page) == ["140"])
    after, same_line, _ = plotted(page)
    assert (after != before, same_line) == (True, line)
    goes_to(page, begins + 390)
    wait_until("a value far away", lambda: values_shown(page) == ["390"])
    page.select_option("#robot .plots select", "joint_states.positions.knee")
    wait_until("the other number", lambda: values_shown(page) == ["390", "39"])
    assert page.locator("#robot button.command, .pad").count() == 0

    def live():
        pose = PoseReport(time.time(), Vector3(7.0), Quaternion())
        yard.bus.reports.put(f"cw/{TWINS['rex']}/data/position", encode_report(pose, 1))
        return values_shown(page) == ["7", "not reported"]

    page.click("text=Back to now")
    wait_until("the live values", live)
    assert plotted(page)[1] == []


def test_a_plot_without_recorded_values_says_so(open_past, begins):
    page = open_past(at=begins + 100)
    plot(page, ANN, "position.x")
    wait_until("the value", lambda: values_shown(page) == ["0"])
    goes_to(page, begins + LENGTH + 29)
    wait_until("its age", lambda: values_shown(page) == ["0 (30 s before)"])
    goes_to(page, begins + LENGTH + 300)
    wait_until("no value", lambda: values_shown(page) == ["not recorded"])
    page.locator("#robot .plots", has_text="no number was recorded around this moment").wait_for()


def test_a_curve_is_broken_where_no_value_was_recorded(open_past):
    page = open_past()
    curve = page.evaluate("async () => (await import('/pastplots.js')).broken([[0, 1, 9], [3, 4, 5]])")
    assert curve == [[0, 1, 5, 9], [3, 4, None, 5]]


def test_who_may_view_gets_series_of_recorded_numbers_and_why_a_request_is_refused(served, begins):
    window = {"robot": REX, "since": begins + 4, "until": begins + 6, "names": ["position.x"]}
    with served.page(Permission.VIEW) as page:
        page.request("series", request="one", **window)
        series = page.answer("one")["series"]
        page.request("series", request="two", **(window | {"until": begins}))
        assert "begins before it ends" in page.answer("two")["reason"]
        page.request("series", request="three", **(window | {"robot": "../../etc"}))
        assert "its name is EDGE/ROBOT" in page.answer("three")["reason"]
        page.request("series", request="four", **(window | {"points": 10**9}))
        assert "points" in page.answer("")["reason"]
        page.request("series", request="five", **(window | {"since": begins - 90, "until": begins - 60}))
        empty = page.answer("five")["series"]
    assert series["values"]["position.x"][1] == [4.0, 4.5, 5.0, 5.5, 6.0]
    assert (empty["names"], empty["values"]) == ([], {"position.x": [[], []]})
