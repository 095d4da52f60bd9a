"""Clients of a dashboard over real sockets, and something for it to show."""

import http.client
import json
from urllib.parse import urlsplit

PATIENCE = 20.0  # s; only what never comes waits so long


def snapshot(rows=2, **parts):
    """A snapshot that is enough for the server, which does not look into its parts."""
    return {
        "place": {"title": "Lake"},
        "now": {"time": 1.0},
        "rows": [[0, i, 0.0, 0.0, 1.0] for i in range(rows)],
    } | parts


class Client:
    """One connection to a server."""

    def __init__(self, url, context=None):
        parts = urlsplit(url)
        kind = http.client.HTTPConnection if context is None else http.client.HTTPSConnection
        more = {} if context is None else {"context": context}
        host = "127.0.0.1" if parts.scheme == "https" else parts.hostname
        self.connection = kind(host or "", parts.port, timeout=PATIENCE, **more)

    def ask(self, path, method="GET", **headers):
        self.connection.request(method, path, headers={k.replace("_", "-"): v for k, v in headers.items()})
        answer = self.connection.getresponse()
        return answer.status, dict(answer.headers), answer.read()

    def stream(self, **headers):
        """Messages of the server as they come: (id, data)."""
        self.connection.request("GET", "/events", headers={k.replace("_", "-"): v for k, v in headers.items()})
        answer = self.connection.getresponse()
        assert answer.status == 200 and answer.headers["content-type"] == "text/event-stream"
        self.headers = dict(answer.headers)
        fields = {}
        for line in iter(answer.readline, b""):
            if line == b"\n":
                if "id" in fields:
                    yield fields["id"], json.loads(fields["data"])
                fields = {}
            else:
                name, _, told = line.decode("ascii").rstrip("\n").partition(": ")
                fields[name] = told

    def close(self):
        self.connection.close()
