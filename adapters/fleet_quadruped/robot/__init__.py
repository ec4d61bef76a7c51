"""Description of a quadruped: a YAML file, validated when it is read."""
