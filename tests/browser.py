"""A real browser for tests: a page of a headless Chromium, driven by Playwright.

The page is Playwright's own, of its synchronous interface, so tests that use it are plain functions; what
needs a loop runs on the fixture ``background_loop`` or in a process. Each test has a browser of its own,
which starts in about a second and remembers nothing.
"""

import contextlib

from playwright.sync_api import sync_playwright

# Without these it asks its maker's servers for updates and lists at every start. All pages are ours, so none
# needs a sandbox, which a container often has not to give, nor much shared memory.
ARGUMENTS = (
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)


@contextlib.contextmanager
def open_page(program):
    """Open an empty page in the browser ``program``; errors that the page has told raise AssertionError."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=ARGUMENTS)
        page = browser.new_page()
        errors = errors_of(page, console=True)
        try:
            yield page
        finally:
            browser.close()
        assert not errors, errors


def errors_of(page, *, console):
    """Return a list to which a page adds its uncaught errors, and with ``console`` those in its console."""
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    if console:
        page.on("console", lambda said: errors.append(said.text) if said.type == "error" else None)
    return errors
