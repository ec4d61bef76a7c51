"""``fleet run --watch`` takes a saved drop-in file into use: at once for simulated robots, others at rest."""

import os

import pytest

from fleet.host.edge.drop_in_watch import FIRST, LONGEST, DropInWatch, WatchedFile


class Desk:
    """A file, and a worker that is asked to take it."""

    def __init__(self, path, *, simulated):
        self.requested, self.moves, self.refuses = [], "", ""
        self.path = path
        path.write_text("one")
        self.watch = DropInWatch(
            [WatchedFile(path, "toy", "limbs", simulated)], self.request, lambda _: self.moves
        )

    async def request(self, worker, adapter, force):
        self.requested.append((worker, adapter, force))
        return self.refuses

    def save(self, text):
        before = self.path.stat().st_mtime_ns
        self.path.write_text(text)
        os.utime(self.path, ns=(before, before + 1_000_000))

    async def looks(self, number):
        for _ in range(number):
            await self.watch.poll()


@pytest.fixture
def desk(tmp_path):
    return lambda simulated: Desk(tmp_path / "toy.py", simulated=simulated)


async def test_a_file_that_was_saved_is_taken_once_it_is_whole(desk):
    desk = desk(simulated=True)
    await desk.looks(3)
    assert desk.requested == []
    desk.save("half")
    await desk.looks(1)
    desk.save("whole")
    await desk.looks(1)
    assert desk.requested == []  # it was being written
    await desk.looks(3)
    assert desk.requested == [("limbs", "toy", True)]


async def test_a_real_robot_that_moves_goes_on_and_its_worker_is_asked_when_it_rests(desk, caplog):
    desk = desk(simulated=False)
    desk.moves = "arm, of the same worker, does not rest"
    desk.save("two")
    await desk.looks(4)
    assert desk.requested == []
    assert caplog.text.count("not taken into use yet: arm") == 1
    desk.moves = ""
    await desk.looks(3)
    assert desk.requested == [("limbs", "toy", False)]


async def test_a_file_that_is_refused_is_reported_and_asked_again_after_the_next_save(desk, caplog):
    desk = desk(simulated=True)
    desk.refuses = "toy.py: SyntaxError"
    desk.save("broken")
    await desk.looks(5)
    assert (len(desk.requested), caplog.text.count("not taken into use: toy.py: SyntaxError")) == (1, 1)
    desk.refuses = ""
    desk.save("mended")
    await desk.looks(3)
    assert len(desk.requested) == 2


async def test_a_worker_that_does_not_take_a_file_is_asked_again_ever_less_often(desk, caplog):
    desk = desk(simulated=False)
    desk.refuses = "arm is commanded; stop it first"
    desk.save("two")
    await desk.looks(FIRST + 2)
    assert len(desk.requested) == 2
    await desk.looks(FIRST)
    assert len(desk.requested) == 2
    desk.refuses = ""
    await desk.looks(FIRST + 1)
    assert len(desk.requested) == 3
    assert caplog.text.count("arm is commanded") == 1
    await desk.looks(LONGEST)
    assert len(desk.requested) == 3, "it has taken it"


async def test_an_ask_that_fails_does_not_end_the_watch(desk, caplog):
    desk = desk(simulated=True)
    request = desk.watch._request

    async def fails(*_):
        raise OSError("the bus is gone")

    desk.watch._request = fails
    desk.save("two")
    await desk.looks(3)
    assert "could not be asked: OSError: the bus is gone" in caplog.text
    desk.watch._request = request
    await desk.looks(FIRST)
    assert len(desk.requested) == 1


async def test_a_file_that_is_gone_is_no_change(desk):
    desk = desk(simulated=True)
    desk.path.unlink()
    await desk.looks(3)
    assert desk.requested == []
