"""A bus that keeps what is sent on it."""

import pytest


class Wire:
    """A bus: ``sent`` frames, and what is ``heard``, look after look."""

    def __init__(self, name="a"):
        self.name, self.sent, self.heard, self.looks = name, [], [], 0

    def send(self, frame):
        self.sent.append(frame)

    def receive(self, wait):
        self.looks += 1
        return self.heard.pop(0) if self.heard else []

    @property
    def data(self):
        """Return the data of the frames sent since the last look."""
        data, self.sent = [frame.data for frame in self.sent], []
        return data


@pytest.fixture
def wire():
    return Wire()


@pytest.fixture
def wires():
    return {name: Wire(name) for name in ("a", "b")}
