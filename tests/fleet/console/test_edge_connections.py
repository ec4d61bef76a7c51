"""Edges that come, go, and say what cannot be read."""

from tests.tools.waiting import wait_until


def test_an_edge_that_starts_later_is_shown_and_so_is_its_end(runtime, serve_console, play_edge):
    with serve_console(runtime, "later") as later, later.page() as page:
        played = play_edge("late-1", robots={"rex": {"health": "ok"}})
        assert page.wait_for("robots", "late-1/rex")["health"] == "ok"
        played.answer_garbage("max")
        played.bus.close()
        assert page.wait_for("edges", "late-1", lambda edge: not edge["alive"])["problem"]


def test_what_cannot_be_read_is_left_out_and_logged(runtime, serve_console, play_edge, caplog):
    played = play_edge("odd-1", robots={"rex": {"health": "ok"}})
    played.answer_garbage("max")
    with serve_console(runtime, "odd") as odd, odd.page() as page:
        page.wait_for("robots", "odd-1/rex")
        wait_until("the log", lambda: "robots/max/state cannot be read" in caplog.text)
        assert "odd-1/max" not in page.entries["robots"]
