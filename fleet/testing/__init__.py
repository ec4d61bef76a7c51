"""For the authors of adapters: the contract as tests, a robot that records, a clock to turn, bad wires.

``contract`` needs pytest; the rest needs nothing that the host does not need.
"""
