"""Defaults of the ``cloud:`` section from Cyberwave's environment variables."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from fleet.config.yaml import Document

_VARIABLES: Mapping[str, tuple[str, ...]] = {
    "host": ("CYBERWAVE_MQTT_HOST",),
    "port": ("CYBERWAVE_MQTT_PORT",),
    "tls": ("CYBERWAVE_MQTT_USE_TLS",),
    "ca_file": ("CYBERWAVE_MQTT_TLS_CA_CERT",),
    "username": ("CYBERWAVE_MQTT_USERNAME",),
    "password": ("CYBERWAVE_MQTT_PASSWORD",),
    "token": ("CYBERWAVE_API_KEY",),
    "protocol": ("CYBERWAVE_MQTT_PROTOCOL",),
    "prefix": ("CYBERWAVE_MQTT_TOPIC_PREFIX", "CYBERWAVE_TOPIC_PREFIX", "CYBERWAVE_ENVIRONMENT"),
}
_BOOLEANS = {"1": "true", "yes": "true", "on": "true", "0": "false", "no": "false", "off": "false"}
_SECRET = ("password", "token")


def cloud_from_environment(document: Document, environ: Mapping[str, str]) -> None:
    """Complete an existing ``cloud:``; errors in the values are reported at the ``cloud:`` section."""
    data = document.data
    if "cloud" not in data:
        return
    if data["cloud"] is None:
        data["cloud"] = {}
    if isinstance(data["cloud"], dict):
        _fill(data["cloud"], document, environ)


def _fill(cloud: dict[str, object], document: Document, environ: Mapping[str, str]) -> None:
    """Fill each missing field from the first of its variables that is set."""
    section = document.marks["cloud",]
    for field, variables in _VARIABLES.items():
        variable = next((name for name in variables if environ.get(name)), None)
        if field in cloud or variable is None:
            continue
        value = environ[variable]
        if variable == "CYBERWAVE_ENVIRONMENT" and value.strip().lower() == "production":
            continue
        path = ("cloud", field)
        cloud[field] = _BOOLEANS.get(value.lower(), value.lower()) if field == "tls" else value
        document.marks[path] = msgspec.structs.replace(section, path=("cloud", f"{field} (from {variable})"))
        document.texts.add(path)
        if field in _SECRET:
            document.secrets.add(value)
