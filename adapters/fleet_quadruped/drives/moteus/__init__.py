"""moteus by its register protocol on CAN FD."""
