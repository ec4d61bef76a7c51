"""The MQTT uplink; the only importer of the MQTT codec besides the demo broker."""
