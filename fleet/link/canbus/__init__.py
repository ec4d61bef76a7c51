"""CAN buses over python-can: frames, buses that recover, and a bus as the link of one robot."""
