"""MQTT client of the Cyberwave cloud: one connection; the content of messages is the business of others."""
