import os
import struct
import threading

import pytest

from fleet_quadruped.control.exchange import SIZE, SharedValue, new_memory
from fleet_quadruped.control.orders import DogState, Order


@pytest.fixture
def memory():
    descriptor = new_memory()
    yield descriptor
    os.close(descriptor)


def test_the_newest_value_arrives(memory):
    writer, reader = SharedValue(memory, Order), SharedValue(memory, Order)
    assert reader.get() == Order()
    for speed in (0.1, 0.2):
        writer.put(Order(x=speed))
    assert reader.get() == Order(x=0.2)
    assert reader.sequence == 2


def test_half_a_value_is_not_taken(memory):
    writer, reader = SharedValue(memory, Order), SharedValue(memory, Order)
    writer.put(Order(x=0.1))
    reader.get()
    writer.put(Order(x=0.2))
    os.pwrite(memory, b"\xff", 20)
    assert reader.get() == Order(x=0.1)


def test_a_length_that_is_nonsense_is_not_taken(memory):
    reader = SharedValue(memory, Order)
    os.pwrite(memory, struct.pack("<QII", 7, 1 << 31, 0), 0)
    assert reader.get() == Order()


def test_many_threads_may_write(memory):
    writer, reader = SharedValue(memory, Order), SharedValue(memory, Order)
    threads = [
        threading.Thread(target=lambda: [writer.put(Order(stop=n)) for n in range(50)]) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert reader.get().stop == 49
    assert reader.sequence == 200


def test_what_does_not_fit_is_refused(memory):
    with pytest.raises(ValueError, match="does not fit"):
        SharedValue(memory, DogState).put(DogState(fault="x" * SIZE))
