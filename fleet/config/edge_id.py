"""Environment variable with the edge of a pair on this computer, set by ``fleet run --edge-id``."""

EDGE_ID = "FLEET_EDGE_ID"
