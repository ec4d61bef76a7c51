"""ODrive (firmware 0.6 and later) with its CAN Simple protocol."""
