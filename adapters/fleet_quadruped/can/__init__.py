"""CAN: frames, buses that recover, and the few messages of CANopen that every cycle needs."""
