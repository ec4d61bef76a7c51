"""Video program: a process beside the edge that sends a robot's camera as WebRTC (extra ``video``)."""
