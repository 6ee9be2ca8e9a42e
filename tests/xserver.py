"""An X server without a screen, for programs that open windows or draw with one."""

from __future__ import annotations

import os
import subprocess
from contextlib import contextmanager

SIZE = "1400x900x24"


@contextmanager
def display():
    """The environment of a program that runs on an X server of its own; the server answers when the block begins."""
    reading, writing = os.pipe()
    words = [
        "Xvfb",
        "-displayfd",
        str(writing),
        "-screen",
        "0",
        SIZE,
        "-nolisten",
        "tcp",
        "-noreset",
    ]  # else it starts anew when a client ends
    with subprocess.Popen(words, pass_fds=[writing], stderr=subprocess.DEVNULL) as server:
        os.close(writing)
        try:
            with os.fdopen(reading) as line:
                number = line.readline().strip()  # written once the server is ready; empty if it ended
            assert number, "Xvfb did not start"
            yield {**os.environ, "DISPLAY": f":{number}"}
        finally:
            server.terminate()
