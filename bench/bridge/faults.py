"""Faults between edge and cloud, for our bridge and the peer: messages lost, commands executed twice.

The broker is killed (SIGKILL) and restarted while a program on the bus publishes durable messages. Then the
network resets connections while commands arrive. Unanswered commands to our bridge are repeated, as a careful
client does, and the guarantees are checked on the journal. The peer does not answer, so its commands are sent
once.
"""

import collections
import contextlib
import random
import time

from bench.bridge.sides import DurableReceiver, side, source
from bench.common import free_port, line, listener, mosquitto
from tests.tools.command_client import CommandClient, counted, executed
from tests.tools.promises import Rules, What, broken
from tests.tools.proxy import TcpProxy

KILLS = 5
COMMANDS = 60  # per kill of the broker
TWINS = 4
RATE = 200  # durable messages per second
SEED = 1
AWAY = (0.2, 1.5)  # s without the broker
BACK = 1.5  # s with the broker
RESET_EVERY = 50  # commands, about once a second
PAUSE = 0.02  # s between commands
PROMISES = Rules(max_age=6.0, gate=What.RECEIVED, replies=False)


def settle(client, within=60.0):
    """Repeat commands until all are answered."""
    end = time.monotonic() + within
    while client.unanswered() and time.monotonic() < end:
        time.sleep(0.5)
        client.retry_until_accepted()


def kills(name, number):
    """Kill the broker ``number`` times; return the durable messages published, lost, and out of order."""
    rng, port = random.Random(SEED), free_port()
    with contextlib.ExitStack() as stack:
        broker = stack.enter_context(contextlib.ExitStack())
        broker.enter_context(mosquitto(port))
        running = stack.enter_context(side(name, port, number=TWINS))
        with DurableReceiver(port) as receiver:
            with source(running, RATE) as published:
                time.sleep(BACK)
                for _ in range(number):
                    listener(port).kill()
                    broker.close()
                    time.sleep(rng.uniform(*AWAY))
                    broker.enter_context(mosquitto(port))
                    receiver.reconnect()
                    time.sleep(BACK)
            receiver.wait_until_quiet()
            return published.total, *receiver.lost(published)


def storm(name, commands):
    """Send commands through connection resets, while durable messages flow out.

    Returns the commands executed, those executed twice, the reasons of refusals, the durable messages lost,
    and the broken guarantees.
    """
    with contextlib.ExitStack() as stack:
        port = stack.enter_context(mosquitto())
        proxy = stack.enter_context(TcpProxy(port))
        running = stack.enter_context(side(name, proxy.port, number=TWINS, heard_at=port))
        names = {f"puppet-{number}": twin for number, twin in enumerate(running.twins)}
        client = stack.enter_context(contextlib.closing(CommandClient(port, names)))
        receiver = stack.enter_context(DurableReceiver(port))
        with source(running, RATE) as published:
            for number in range(commands):
                client.request(f"puppet-{number % TWINS}")
                if number % RESET_EVERY == RESET_EVERY - 1:
                    proxy.reset()
                if number % RESET_EVERY == RESET_EVERY // 2 and name == "fleet":
                    client.retry_until_accepted()
                time.sleep(PAUSE)
        if name == "fleet":
            settle(client)
        receiver.wait_until_quiet()
        did = executed(running.journal, client.requests)
        lines = broken([*client.events(), *did], PROMISES) if name == "fleet" else []
        reasons = collections.Counter(
            request.refusal for request in client.requests.values() if request.refusal
        )
    counts = counted(did).values()
    return len(counts), sum(count > 1 for count in counts), reasons, receiver.lost(published)[0], lines


def run(number=KILLS):
    number = int(number)
    commands = number * COMMANDS
    for name in ("fleet", "peer"):
        published, lost, unordered = kills(name, number)
        what = f"broker killed {number} times, {published} durable messages"
        line(f"{what}: {name}", f"{lost} lost, {unordered} unordered", "aim: 0 lost, 0 unordered")
    for name in ("fleet", "peer"):
        done, twice, reasons, lost, lines = storm(name, commands)
        again = "asked until answered" if name == "fleet" else "asked once"
        what = f"storm of resets, {commands} commands {again}: {name}"
        line(what, f"{done} done, {reasons.total()} refused, {twice} twice", "aim: all, 0 twice")
        for reason, count in reasons.items():
            print(f"    {count} x {reason}")
        line("durable messages lost in it", str(lost), "aim: 0")
        if name == "fleet":
            line("promises broken in it", str(len(lines)), "aim: 0")
        for each in lines[:10]:
            print("   ", each)
