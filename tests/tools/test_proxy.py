"""Tests of the proxy against an echo server."""

import socket
import threading
import time

import pytest

from tests.tools.proxy import TcpProxy
from tests.tools.waiting import DEADLINE


@pytest.fixture
def echo():
    """Serve an echo; gives its port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        threads = [threading.Thread(target=serve, args=(server, lambda: threads))]
        threads[0].start()
        yield server.getsockname()[1]
        server.shutdown(socket.SHUT_RDWR)
        for thread in threads:
            thread.join()


def serve(server, threads):
    while True:
        try:
            opened, _ = server.accept()
        except OSError:
            return
        thread = threading.Thread(target=answer, args=(opened,))
        threads().append(thread)
        thread.start()


def answer(opened):
    with opened:
        try:
            while data := opened.recv(65536):
                opened.sendall(data)
        except ConnectionError:
            return


@pytest.fixture
def proxy(echo):
    with TcpProxy(echo) as proxy:
        yield proxy


@pytest.fixture
def client(proxy):
    with socket.create_connection(("127.0.0.1", proxy.port)) as client:
        client.settimeout(DEADLINE)
        assert said(client, b"hello") == b"hello"
        yield client


def said(client, data):
    """Say something; return as many bytes of the answer."""
    client.sendall(data)
    heard = b""
    while len(heard) < len(data):
        heard += client.recv(65536)
    return heard


def test_bytes_pass_both_ways_in_order(client):
    data = bytes(range(256)) * 4096
    assert said(client, data) == data


def test_a_delay_is_added_each_way(proxy, client):
    proxy.delay = 0.1
    began = time.monotonic()
    assert said(client, b"late") == b"late"
    assert time.monotonic() - began >= 0.2


def test_a_cut_is_an_orderly_end(proxy, client):
    proxy.cut()
    assert client.recv(1) == b""


def test_a_reset_is_a_reset_and_the_next_connection_works(proxy, client):
    proxy.reset()
    with pytest.raises(ConnectionResetError):
        client.recv(1)
    with socket.create_connection(("127.0.0.1", proxy.port)) as again:
        assert said(again, b"x") == b"x"
    assert proxy.accepted == 2


def test_a_blackhole_swallows_and_says_nothing(proxy, client):
    proxy.blackhole = True
    client.sendall(b"gone")
    client.settimeout(0.2)
    with pytest.raises(TimeoutError):
        client.recv(1)


def test_whoever_is_refused_is_reset(proxy):
    proxy.refuse = True
    with socket.create_connection(("127.0.0.1", proxy.port)) as client:
        client.settimeout(DEADLINE)
        with pytest.raises(ConnectionResetError):
            client.recv(1)


def test_an_absent_target_is_a_reset(echo):
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        port = nobody.getsockname()[1]
    with TcpProxy(port) as proxy, socket.create_connection(("127.0.0.1", proxy.port)) as client:
        client.settimeout(DEADLINE)
        with pytest.raises(ConnectionResetError):
            client.recv(1)
