"""An autopilot made of mavsdk's own server plug-ins (C++): ``python cpp_autopilot.py PORT``.

It speaks to 127.0.0.1:PORT as system 1. Its heartbeats say PX4 and go by mavsdk's own sender; commands,
parameters and missions are answered by the plug-ins.
"""

import json
import sys
import time

from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.action_server import ActionServer
from mavsdk.plugins.mavlink_direct_server import MavlinkDirectServer, MavlinkMessage
from mavsdk.plugins.mission_raw_server import MissionRawServer
from mavsdk.plugins.param_server import ParamServer

LOITER, ARMED = 0x03040000, 0x80
PARAMETERS = {"NAV_DLL_ACT": 0, "COM_LOW_BAT_ACT": 3, "COM_OBL_RC_ACT": 5}


def main():
    mavsdk = Mavsdk(Configuration.create_manual(1, 1, False))
    mavsdk.add_any_connection(f"udpout://127.0.0.1:{sys.argv[1]}")
    component = mavsdk.server_component(0)
    armed = [False]
    missions = MissionRawServer(component)
    direct = MavlinkDirectServer(component)
    parameters = ParamServer(component)
    for name, value in PARAMETERS.items():
        parameters.provide_param_int(name, value)
    action = ActionServer(component)
    action.set_armable(True, True)
    action.set_disarmable(True, True)

    def arm(_result, requested, _data):
        armed[0] = bool(requested.arm)

    action.subscribe_arm_disarm(arm)
    while missions:
        beat = {
            "type": 2,
            "autopilot": 12,
            "base_mode": ARMED * armed[0] + 1,
            "custom_mode": LOITER,
            "system_status": 3,
            "mavlink_version": 3,
        }
        direct.send_message(MavlinkMessage("HEARTBEAT", 1, 1, 0, 0, json.dumps(beat)))
        time.sleep(0.2)


main()
