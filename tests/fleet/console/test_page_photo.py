"""A robot's picture in a real browser, for who has a session."""

import base64
import time

import pytest

from fleet.model.report import PhotoReport
from fleet.wire.databus import encode_report
from tests.tools.waiting import wait_until

WAIT = 60_000  # ms; busy computers are slow
TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
# One grey pixel.
JPEG = base64.b64decode(
    "/9j/4AAQSkZJRgABAQAAAQABAAD/2wBDAAgGBgcGBQgHBwcJCQgKDBQNDAsLDBkSEw8UHRofHh0aHBwgJC4nICIsIxwcKDcpLDAxNDQ0Hyc5"
    "PTgyPC4zNDL/wAALCAABAAEBAREA/8QAHwAAAQUBAQEBAQEAAAAAAAAAAAECAwQFBgcICQoL/8QAtRAAAgEDAwIEAwUFBAQAAAF9AQIDAAQR"
    "BRIhMUEGE1FhByJxFDKBkaEII0KxwRVS0fAkM2JyggkKFhcYGRolJicoKSo0NTY3ODk6Q0RFRkdISUpTVFVWV1hZWmNkZWZnaGlqc3R1dnd4"
    "eXqDhIWGh4iJipKTlJWWl5iZmqKjpKWmp6ipqrKztLW2t7i5usLDxMXGx8jJytLT1NXW19jZ2uHi4+Tl5ufo6erx8vP09fb3+Pn6/9oACAEB"
    "AAA/APf6/9k="
)


@pytest.fixture(scope="module")
def yard(play_edge):
    return play_edge("yard-1", robots={"rex": {"twin": TWIN, "health": "ok"}})


def publish(yard):
    report = PhotoReport(time.time(), JPEG, "jpeg", 1, 1)
    yard.bus.reports.put(f"cw/{TWIN}/data/photo", encode_report(report, 1))


def test_a_picture_is_shown_when_the_robot_has_taken_one(program, module_at, console, yard):
    with module_at("browser.py").open_page(program("chromium")) as page:
        page.set_default_timeout(WAIT)
        page.goto(console.link())
        page.click('#robots li[data-id="yard-1/rex"]')
        loaded = "document.querySelector('img.photo')?.naturalWidth || 0"
        wait_until("the picture", lambda: publish(yard) or page.evaluate(loaded) == 1)
        assert "camera of rex" in page.get_attribute("img.photo", "alt")


def test_a_picture_is_sent_only_to_who_has_a_session(console, yard):
    with console.page() as page:
        page.request("watch", robot="yard-1/rex")
        while "yard-1/rex" not in page.entries.get("photos", {}):
            publish(yard)
            page.next("news")
        status, headers, body = console.request("GET", "/api/photos/yard-1/rex", cookie=console.cookie())
    assert (status, headers["content-type"], body) == (200, "image/jpeg", JPEG)
    assert console.request("GET", "/api/photos/yard-1/rex")[0] == 401
    found = console.request("GET", "/api/photos/yard-1/max", cookie=console.cookie())
    assert (found[0], found[1]["content-type"]) == (404, "application/json")
