"""Which edge of a pair this computer is: the variable by which ``fleet run --edge-id`` says it."""

EDGE_ID = "FLEET_EDGE_ID"
