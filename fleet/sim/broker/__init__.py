"""An MQTT broker inside the process, for the demo and for tests of what goes wrong; not for production.

It speaks MQTT 5 and 3.1.1, keeps everything in memory, and can be told to misbehave (``BrokerFaults``).
"""

from fleet.sim.broker.faults import BrokerFaults
from fleet.sim.broker.limits import ClientLimits
from fleet.sim.broker.server import Broker
from fleet.sim.broker.thread import BrokerThread

__all__ = ["Broker", "BrokerFaults", "BrokerThread", "ClientLimits"]
