"""CiA 402 drives in cyclic synchronous position mode, over CANopen."""
