"""Write docs/how-to/console.png and console-dark.png: the console of the running demo, in a real browser.

python docs/how-to/make_console_pictures.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
from typing import IO

from playwright.sync_api import Page, sync_playwright

FOLDER = pathlib.Path(__file__).parent
ROOT = FOLDER.parents[1]
LINK = re.compile(r"http://127\.0\.0\.1:\d+/#token=\S+")
SIZE = {"width": 1280, "height": 760}
WAIT = 120_000  # ms


def main() -> None:
    """Run the demo, have two robots move, and take both pictures."""
    sys.path.insert(0, str(ROOT / "tests"))
    from programs import find  # noqa: PLC0415 - the tests' own browser

    with tempfile.TemporaryDirectory(prefix="fc") as runtime:
        environment = os.environ | {"FLEET_RUNTIME_DIR": runtime, "USER": "anna", "PYTHONUNBUFFERED": "1"}
        command = [sys.executable, "-m", "fleet", "demo", "--json"]
        demo = subprocess.Popen(  # noqa: S603 - ourselves
            command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        try:
            assert demo.stderr is not None
            link = link_in(demo.stderr)
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(executable_path=find("chromium"), args=["--no-sandbox"])
                take_pictures(browser.new_page(viewport=SIZE), link)  # type: ignore[arg-type]
                browser.close()
        finally:
            demo.send_signal(signal.SIGINT)
            demo.communicate()


def link_in(lines: IO[str]) -> str:
    """Return the link that the demo prints."""
    for line in lines:
        if found := LINK.search(line):
            return found[0]
    raise SystemExit("the demo ended without a link")


def take_pictures(page: Page, link: str) -> None:
    """Send the wheeled robot and the drone on their way, and take the page in both schemes."""
    page.set_default_timeout(WAIT)
    page.goto(link)
    for robot in ("dog-1", "drone-1", "ugv-1"):
        page.locator(f'#robots li[data-id="demo/{robot}"]', has_text="ok").wait_for()
    command(page, "drone-1", "takeoff…", "Send takeoff")
    page.locator("#answers li", has_text="done").wait_for()
    go(page, "drone-1", 6.0, 8.0)
    go(page, "ugv-1", 3.0, -1.0)
    page.wait_for_timeout(5000)
    page.mouse.move(640, 700)
    page.screenshot(path=FOLDER / "console.png")
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(500)
    page.screenshot(path=FOLDER / "console-dark.png")


def command(page: Page, robot: str, button: str, send: str) -> None:
    """Send a command with its defaults."""
    page.click(f'#robots li[data-id="demo/{robot}"]')
    page.click(f"button.command:has-text('{button}'):not([aria-disabled])")
    page.click(f"text={send}")


def go(page: Page, robot: str, x: float, y: float) -> None:
    """Send a robot to a point by a click on the map."""
    page.click(f'#robots li[data-id="demo/{robot}"]')
    page.mouse.click(*page.evaluate(f"fleetPage.whereIsPoint({x}, {y})"))
    page.click("#target button.primary")


if __name__ == "__main__":
    main()
