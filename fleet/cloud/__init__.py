"""The way to the Cyberwave cloud: one MQTT connection, and nothing of what the messages mean."""
