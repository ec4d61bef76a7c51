"""Durable messages out over a link with a round-trip time of 50 ms."""

from bench.bridge.sides import SIDES, carried
from bench.common import line, mosquitto, quantiles
from tests.tools.proxy import TcpProxy

ROUND_TRIP = 0.05  # s
OFFERED = {"fleet": 1000, "peer": 200, "floor": 1000}  # messages per second; the peer carries 20


def run():
    results = {}
    for name in SIDES:
        with mosquitto() as port, TcpProxy(port, delay=ROUND_TRIP / 2) as proxy:
            results[name] = carried(name, proxy.port, port, offered=OFFERED[name], seconds=8)
    for name, (rate, _, ages) in results.items():
        p50, p99 = (quantile * 1e3 for quantile in quantiles(ages))
        what = f"durable out over {ROUND_TRIP * 1e3:.0f} ms, {OFFERED[name]} /s offered: {name}"
        line(what, f"{rate:.0f} /s", f"p50 / p99 {p50:.0f} / {p99:.0f} ms")
    line("messages a second against the peer", f"{results['fleet'][0] / results['peer'][0]:.0f} x", "aim: 50")
    half = quantiles(results["fleet"][2])[0] - ROUND_TRIP / 2
    line("p50 beyond half the way", f"{half * 1e3:.1f} ms", "aim: at most 5")
