"""In-process MQTT broker, for the demo and for tests of faults; not for production.

It speaks MQTT 5 and 3.1.1, keeps everything in memory, and can inject faults (``BrokerFaults``).
"""

from fleet.sim.broker.faults import BrokerFaults
from fleet.sim.broker.limits import ClientLimits
from fleet.sim.broker.server import Broker
from fleet.sim.broker.thread import BrokerThread

__all__ = ["Broker", "BrokerFaults", "BrokerThread", "ClientLimits"]
