"""A program beside the edge that sends the pictures of a robot's camera as WebRTC video (extra ``video``)."""
