"""The map under the robots: its pictures in the right places, and archives that are damaged."""

import asyncio
import json
import math
import os
import random

import pytest

from fleet.console.basemap import MapTiles
from fleet.console.task import Basemap
from fleet.model.geodesy import GeoOrigin, GeoPoint, world_from_geo
from fleet.model.geometry import Vector3
from fleet.model.site import Placement
from fleet.testing.clock import ManualClock
from tests.tools.waiting import wait_until

ORIGIN = (47.397742, 8.545594, 488.0)
ZOOM = 19
RED, GREEN, BLUE = (200, 30, 30), (30, 160, 30), (30, 30, 200)
WAIT = 60_000  # ms


def tile_of(latitude, longitude, zoom):
    """Return column and row, with fractions (Web Mercator)."""
    row = (1 - math.asinh(math.tan(math.radians(latitude))) / math.pi) / 2
    return (longitude + 180) / 360 * 2**zoom, row * 2**zoom


def place_of(column, row, zoom):
    """Return latitude and longitude."""
    return math.degrees(math.atan(math.sinh(math.pi * (1 - 2 * row / 2**zoom)))), column / 2**zoom * 360 - 180


COLUMN, ROW = map(int, tile_of(*ORIGIN[:2], ZOOM))
COLORS = {(ZOOM, COLUMN, ROW): RED, (ZOOM, COLUMN + 1, ROW): GREEN, (ZOOM, COLUMN, ROW + 1): BLUE}


@pytest.fixture(scope="module")
def archive(tmp_path_factory, module_at):
    """Write an archive of three pictures, around the site's origin."""
    tools = module_at("tools/map_archive.py")
    path = tmp_path_factory.mktemp("map") / "area.pmtiles"
    return tools.write_archive(path, {place: tools.png(*color) for place, color in COLORS.items()})


@pytest.fixture(scope="module")
def served(runtime, serve_console, archive):
    with serve_console(runtime, "mapped", basemap=Basemap(str(archive), ORIGIN)) as console:
        yield console


def test_a_page_learns_how_to_place_the_pictures(served):
    status, _, body = served.request("GET", "/api/basemap", cookie=served.cookie())
    assert status == 200
    assert json.loads(body) == {
        "origin": list(ORIGIN),
        "zooms": [ZOOM, ZOOM],
        "attribution": "© the surveyor",
    }


def test_a_picture_is_served_to_who_is_signed_in_alone(served):
    path = f"/api/tiles/{ZOOM}/{COLUMN}/{ROW}"
    status, headers, body = served.request("GET", path, cookie=served.cookie())
    assert (status, headers["content-type"], body[:4]) == (200, "image/png", b"\x89PNG")
    assert served.request("GET", path)[0] == 401
    assert served.request("GET", "/api/basemap")[0] == 401


@pytest.mark.parametrize("place", [f"{ZOOM}/{COLUMN + 9}/{ROW}", "0/0/0", "3/8/0", "25/0/0", f"{10**9}/0/0"])
def test_where_there_is_no_picture_none_is_served(served, place):
    status, _, body = served.request("GET", f"/api/tiles/{place}", cookie=served.cookie())
    assert (status, body) == (204, b"")


@pytest.mark.parametrize("place", ["1/-1/0", "a/0/0", "1/0", "../../etc/passwd"])
def test_what_is_no_place_is_not_found(served, place):
    assert served.request("GET", f"/api/tiles/{place}", cookie=served.cookie())[0] == 404


def test_a_console_without_a_map_has_none(console):
    assert console.request("GET", "/api/basemap", cookie=console.cookie())[2] == b"{}"
    assert console.request("GET", "/api/tiles/0/0/0", cookie=console.cookie())[0] == 204


def test_a_damaged_archive_costs_the_picture_and_nothing_else(archive, tmp_path):
    whole = archive.read_bytes()
    rng = random.Random(1)
    damaged = tmp_path / "damaged.pmtiles"
    for _ in range(300):
        data = bytearray(whole[: rng.randrange(len(whole) + 1)] if rng.random() < 0.3 else whole)
        for _ in range(rng.randrange(4)):
            if data:
                data[rng.randrange(min(len(data), 400))] = rng.randrange(256)
        damaged.write_bytes(data)
        tiles = MapTiles(Basemap(str(damaged), ORIGIN), ManualClock())
        assert tiles.description["origin"] == ORIGIN
        asyncio.run(tiles.tile(ZOOM, COLUMN, ROW))


def test_an_archive_that_is_overwritten_or_cut_while_it_is_shown_costs_only_its_pictures(archive, tmp_path):
    copy = tmp_path / "area.pmtiles"
    copy.write_bytes(archive.read_bytes())
    tiles = MapTiles(Basemap(str(copy), ORIGIN), ManualClock())
    os.truncate(copy, 200)
    assert asyncio.run(tiles.tile(ZOOM, COLUMN, ROW)) is None


def test_a_directory_that_is_too_large_is_not_decoded(tmp_path, module_at, monkeypatch):
    monkeypatch.setattr("fleet.console.basemap.LARGEST_DIRECTORY", 100)
    tiles = {(9, column, 0): b"%d" % column for column in range(200)}
    path = module_at("tools/map_archive.py").write_archive(tmp_path / "area.pmtiles", tiles)
    assert asyncio.run(MapTiles(Basemap(str(path), ORIGIN), ManualClock()).tile(9, 0, 0)) is None


@pytest.fixture(scope="module")
def yard(play_edge):
    """Play an edge with a robot at the origin of the site."""
    robot = {"health": "ok", "reachable": True, "site": Vector3(), "placement": Placement(Vector3())}
    return play_edge("yard-1", robots={"rex": robot})


@pytest.fixture
def page(served, yard, program, module_at):
    """Open the page, and see so much of the map that all its pictures are on the screen."""
    with module_at("browser.py").open_page(program("chromium")) as page:
        page.set_default_timeout(WAIT)
        page.goto(served.link())
        page.wait_for_selector('#robots li[data-id="yard-1/rex"]')
        page.locator("#basemap").wait_for()
        for _ in range(16):
            page.click("#zoom-out")
        wait_until("the pictures", lambda: page.evaluate("fleetPage.basemap.loaded()") == len(COLORS))
        yield page


def test_the_pictures_lie_under_the_robots_where_they_are_on_earth_and_can_be_taken_away(page):
    for (zoom, column, row), color in COLORS.items():
        latitude, longitude = place_of(column + 0.5, row + 0.37, zoom)
        at = world_from_geo(GeoOrigin(*ORIGIN), GeoPoint(latitude, longitude, ORIGIN[2]))
        assert page.evaluate(f"fleetPage.basemap.siteOf({latitude}, {longitude})") == pytest.approx(
            [at.x, at.y], abs=0.01
        )
        assert page.evaluate(f"fleetPage.basemap.geoOf({at.x}, {at.y})") == pytest.approx(
            [latitude, longitude]
        )
        seen = wait_until("the colour", lambda at=at: color_at(page, at.x, at.y))
        assert max(range(3), key=lambda part: seen[part]) == max(range(3), key=lambda part: color[part])
    assert page.inner_text("#map-credit") == "© the surveyor"
    button = page.locator("#basemap")
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    assert page.locator("#map-credit").is_hidden()


def color_at(page, x, y):
    """Return red, green and blue of the map at a point of the site; nothing where nothing is painted."""
    return page.evaluate(
        """([x, y]) => {
            const canvas = document.getElementById('map'), box = canvas.getBoundingClientRect();
            const [px, py] = fleetPage.whereIsPoint(x, y);
            const scale = canvas.width / box.width;
            const at = [(px - box.left) * scale, (py - box.top) * scale];
            const { data } = canvas.getContext('2d').getImageData(...at, 1, 1);
            return data[3] ? [...data.slice(0, 3)] : null;
        }""",
        [x, y],
    )
