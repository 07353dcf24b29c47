# SPDX-License-Identifier: BSD-3-Clause
"""versavis-web as a process of a test in Python."""
import json
import re
import socket
import subprocess
import urllib.error
import urllib.request

from live import die_with_parent


class WebServer:
    """versavis-web, on a port of its own."""

    def __init__(self, programs, instance, *options):
        self.process = subprocess.Popen(
            [programs / "versavis-web", "--instance", instance, "--port", "0", *options],
            stdout=subprocess.PIPE, text=True, preexec_fn=die_with_parent)
        self.url = self.process.stdout.readline().split("?")[0].strip()
        self.port = int(re.search(r":(\d+)/", self.url)[1])

    def get(self, path, method="GET", **headers):
        """Status, headers and body."""
        request = urllib.request.Request(
            self.url + path, method=method,
            headers={name.replace("_", "-"): value for name, value in headers.items()})
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                return answer.status, answer.headers, answer.read()
        except urllib.error.HTTPError as refused:
            with refused:
                return refused.code, refused.headers, refused.read()

    def state(self):
        return json.loads(self.get("api/state")[2])

    def connect(self):
        return socket.create_connection(("127.0.0.1", self.port), timeout=20)

    def stop(self):
        self.process.terminate()
        self.process.stdout.close()
        return self.process.wait(20)
