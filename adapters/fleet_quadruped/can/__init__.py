"""CAN bus utilities: detection of other controllers, capture of the frames before a fault."""
