"""The console of the demo in a real browser: the fleet at once, a click that moves a robot, a stop by key."""

import time

import pytest

from fleet.testing.waiting import wait_until

UGV = "demo/ugv-1"
WAIT = 60_000  # ms


@pytest.fixture
def demo(fleet):
    return fleet("demo", "--drones", "1", "--ugvs", "1", "--dogs", "0", "--json")


def test_the_demo_prints_a_link_to_a_page_where_a_click_moves_a_robot_and_escape_stops_it(demo, page):
    link = demo.line(r"console +(http://127\.0\.0\.1:\d+/#token=\S+)")[1]
    demo.robot("ugv-1", "is well", lambda state: state["health"] == "ok")
    demo.robot("drone-1", "is well", lambda state: state["health"] == "ok")
    page.set_default_timeout(WAIT)
    began = time.monotonic()
    page.goto(link)
    page.wait_for_selector('#robots li[data-id="demo/drone-1"]')
    shown = time.monotonic() - began
    assert shown < 10, f"{shown:.1f} s; a second when the machine is idle"

    page.click(f'#robots li[data-id="{UGV}"]')
    page.wait_for_selector("button.command")
    x, y = wait_until("a pose", lambda: page.evaluate(f"fleetPage.whereIs('{UGV}')"))
    page.mouse.click(x + 90, y)
    page.click("#target button.primary")
    demo.robot("ugv-1", "moves", lambda state: state.get("speed") and state["speed"] > 0.05)

    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    stopped = page.locator("#stop-words", has_text="2 of 2 stops set")
    stopped.wait_for()
    page.locator("#stop-words", has_text="2 seen standing").wait_for()
    assert demo.robot("ugv-1", "stands", lambda state: state.get("emergency_stop"))["emergency_stop"]
