"""Posts a notice to an address, within one time limit for everything, however slow the server is."""

from __future__ import annotations

import threading
import urllib.error
import urllib.request


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """Follows no redirect: a notice goes only to the address in fleet.yaml."""

    def redirect_request(self, *_: object) -> None:
        """Refuse."""


class Webhook:
    """One address (http or https)."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._opener = urllib.request.build_opener(_NoRedirect)
        self._last: threading.Thread | None = None

    def send(self, body: bytes, within: float) -> None:
        """Post JSON; raises OSError for a failure, or after ``within`` seconds."""
        if self._last is not None and self._last.is_alive():
            raise TimeoutError("the last request has not ended yet")
        ended: list[OSError | None] = []

        def post() -> None:
            ended.append(self._post(body, within))

        self._last = threading.Thread(target=post, name="fleet-webhook", daemon=True)
        self._last.start()
        self._last.join(within)
        if not ended:
            raise TimeoutError(f"no answer within {within:g} s")
        if ended[0] is not None:
            raise ended[0]

    def _post(self, body: bytes, within: float) -> OSError | None:
        """Post; return the error, without the address."""
        request = urllib.request.Request(  # noqa: S310 - the schema admits only http and https
            self._url, body, {"Content-Type": "application/json", "User-Agent": "fleet"}
        )
        try:
            with self._opener.open(request, timeout=within):
                return None
        except urllib.error.HTTPError as error:
            error.close()
            return OSError(f"HTTP {error.code}")
        except urllib.error.URLError as error:
            return OSError(str(error.reason))
        except OSError as error:
            return error
        except Exception as error:  # noqa: BLE001 - http.client's own errors are not OSErrors
            return OSError(type(error).__name__)
