"""What a dog is made of: its description in YAML, checked when it is read."""
