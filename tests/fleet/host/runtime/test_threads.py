"""Calls beside: in turn, each once, and none that keeps the others for long."""

import threading

from fleet.host.runtime.threads import NAME, call_sequentially


def join_aside():
    for thread in threading.enumerate():
        if thread.name == NAME:
            thread.join()


def test_calls_are_made_in_their_order_on_one_thread():
    made = []
    calls = [lambda n=n: made.append((n, threading.get_ident())) for n in range(5)]
    call_sequentially(calls, wait=20)
    assert [number for number, _ in made] == list(range(5))
    assert len({thread for _, thread in made}) == 1
    assert threading.get_ident() not in {thread for _, thread in made}


def test_calls_that_are_held_up_keep_the_others_from_nothing_and_are_made_once():
    free, made = threading.Event(), []

    def held_up():
        made.append("held up")
        free.wait(20)

    call_sequentially([held_up, held_up, held_up, lambda: made.append("good")], wait=0.01)
    assert made == ["held up"] * 3 + ["good"]
    free.set()
    join_aside()
    assert len(made) == 4


def test_no_calls_need_no_thread(monkeypatch):
    monkeypatch.setattr(threading, "Thread", None)
    call_sequentially([], wait=1)
