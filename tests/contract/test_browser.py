"""The browser that tests of pages use: a real one, in which nothing goes wrong unseen."""

import pytest


def test_a_page_is_shown_and_can_be_asked(page):
    page.set_content("<h1>yard-1</h1>")
    assert page.locator("h1").inner_text() == "yard-1"
    assert page.evaluate("1 + 1") == 2


@pytest.mark.parametrize(
    "script", ["console.error('went wrong')", "setTimeout(() => { throw new Error('went wrong') })"]
)
def test_an_error_that_the_page_tells_or_does_not_catch_fails_the_test(program, module_at, script):
    def show():
        with module_at("browser.py").open_page(program("chromium")) as page:
            page.set_content(f"<script>{script}; setTimeout(() => document.title = 'done')</script>")
            page.wait_for_function("document.title == 'done'")

    with pytest.raises(AssertionError, match="went wrong"):
        show()
