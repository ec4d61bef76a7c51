"""moteus servos with their register protocol on CAN FD."""
