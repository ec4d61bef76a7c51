"""ODrive (firmware 0.6 and later) by its CAN Simple protocol."""
