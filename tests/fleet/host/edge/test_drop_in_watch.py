"""``fleet run --watch`` takes a saved drop-in file into use: at once for simulated robots, others at rest."""

import os

import pytest

from fleet.host.edge.drop_in_watch import FIRST, LONGEST, DropInWatch, WatchedFile


class Bench:
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
def bench(tmp_path):
    return lambda simulated: Bench(tmp_path / "toy.py", simulated=simulated)


async def test_a_file_that_was_saved_is_taken_once_it_is_whole(bench):
    bench = bench(simulated=True)
    await bench.looks(3)
    assert bench.requested == []
    bench.save("half")
    await bench.looks(1)
    bench.save("whole")
    await bench.looks(1)
    assert bench.requested == []  # it was being written
    await bench.looks(3)
    assert bench.requested == [("limbs", "toy", True)]


async def test_a_real_robot_that_moves_goes_on_and_its_worker_is_asked_when_it_rests(bench, caplog):
    bench = bench(simulated=False)
    bench.moves = "arm, of the same worker, does not rest"
    bench.save("two")
    await bench.looks(4)
    assert bench.requested == []
    assert caplog.text.count("not taken into use yet: arm") == 1
    bench.moves = ""
    await bench.looks(3)
    assert bench.requested == [("limbs", "toy", False)]


async def test_a_file_that_is_refused_is_reported_and_asked_again_after_the_next_save(bench, caplog):
    bench = bench(simulated=True)
    bench.refuses = "toy.py: SyntaxError"
    bench.save("broken")
    await bench.looks(5)
    assert (len(bench.requested), caplog.text.count("not taken into use: toy.py: SyntaxError")) == (1, 1)
    bench.refuses = ""
    bench.save("mended")
    await bench.looks(3)
    assert len(bench.requested) == 2


async def test_a_worker_that_does_not_take_a_file_is_asked_again_ever_less_often(bench, caplog):
    bench = bench(simulated=False)
    bench.refuses = "arm is commanded; stop it first"
    bench.save("two")
    await bench.looks(FIRST + 2)
    assert len(bench.requested) == 2
    await bench.looks(FIRST)
    assert len(bench.requested) == 2
    bench.refuses = ""
    await bench.looks(FIRST + 1)
    assert len(bench.requested) == 3
    assert caplog.text.count("arm is commanded") == 1
    await bench.looks(LONGEST)
    assert len(bench.requested) == 3, "it has taken it"


async def test_an_ask_that_fails_does_not_end_the_watch(bench, caplog):
    bench = bench(simulated=True)
    request = bench.watch._request

    async def fails(*_):
        raise OSError("the bus is gone")

    bench.watch._request = fails
    bench.save("two")
    await bench.looks(3)
    assert "could not be asked: OSError: the bus is gone" in caplog.text
    bench.watch._request = request
    await bench.looks(FIRST)
    assert len(bench.requested) == 1


async def test_a_file_that_is_gone_is_no_change(bench):
    bench = bench(simulated=True)
    bench.path.unlink()
    await bench.looks(3)
    assert bench.requested == []
