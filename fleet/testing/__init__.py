"""For adapter authors: contract tests, bad wires, a clock that tests turn."""
