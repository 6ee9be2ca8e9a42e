"""Helpers of tests of pictures and pages: a browser without a window, tones.

The browser is driven by Chromium's DevTools protocol over `--remote-debugging-pipe`: JSON messages that end with a zero
byte.
"""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import subprocess
import sys
import time

import numpy as np

import lacmesh
from lacmesh import cut_skin
from lacmesh.cli import main
from lacmesh.drawing import rgb
from tests import REPOSITORY

DATA = REPOSITORY / "data"
#: names that the browser may have
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
#: WebGL by software
DRAWING = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
#: seconds without a word after which a browser is taken for lost
PATIENCE = 60
#: the protocol wants its pipes as file descriptors 3 and 4
PLUMBING = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(end), fcntl.F_DUPFD, 10) for end in sys.argv[1:3]]
for end, wanted in zip(ends, (3, 4)):
    os.dup2(end, wanted)
os.execv(sys.argv[3], sys.argv[3:])
"""


class Browser:
    """One browser and one tab; `said`: what the page, or the browser about it, said on the console."""

    def __init__(self, folder, flags=DRAWING, size=(1200, 800)):
        down, up = os.pipe(), os.pipe()
        command = [next(filter(None, map(shutil.which, NAMES))), "--headless=new", "--no-sandbox", *flags]
        command += ["--disable-dev-shm-usage", f"--user-data-dir={folder}", "--no-first-run"]
        command += ["--remote-debugging-pipe", f"--window-size={size[0]},{size[1]}", "about:blank"]
        plumbing = [sys.executable, "-c", PLUMBING, str(down[0]), str(up[1]), *command]
        quiet = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        self.process = subprocess.Popen(plumbing, pass_fds=(down[0], up[1]), start_new_session=True, **quiet)
        os.close(down[0])
        os.close(up[1])
        self.writing, self.reading, self.received = os.fdopen(down[1], "wb"), up[0], b""
        self.count, self.said, self.session = 0, [], {}
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.session = {"sessionId": session}
        for domain in ("Page", "Runtime", "Log"):
            self.ask(f"{domain}.enable")
        screen = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        self.ask("Emulation.setDeviceMetricsOverride", **screen)

    def ask(self, method, **params):
        """Send a command and wait for its answer; console messages that arrive meanwhile are kept."""
        self.count += 1
        message = {"id": self.count, "method": method, "params": params, **self.session}
        self.writing.write(json.dumps(message).encode() + b"\0")
        self.writing.flush()
        while (answer := self._next()).get("id") != self.count:
            keys = {"Runtime.consoleAPICalled": "args", "Runtime.exceptionThrown": "exceptionDetails"}
            key = (keys | {"Log.entryAdded": "entry"}).get(answer.get("method"))
            self.said += [str(answer["params"][key])] if key else []
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def _next(self):
        """Read the next message; raises if none comes or if the page stops at a dialog."""
        while b"\0" not in self.received:
            if not select.select([self.reading], [], [], PATIENCE)[0]:
                raise TimeoutError(f"the browser says nothing for {PATIENCE} s")
            more = os.read(self.reading, 1 << 16)
            if not more:
                raise RuntimeError("the browser ended")
            self.received += more
        message, _, self.received = self.received.partition(b"\0")
        event = json.loads(message)
        if event.get("method") == "Page.javascriptDialogOpening":
            raise RuntimeError(f"the page opened a dialog: {event['params']['message']}")
        return event

    def wait(self, expression, seconds=300):
        """The value of an expression of JavaScript, once it is true."""
        until = time.monotonic() + seconds
        while not (value := self.value(expression)):
            if time.monotonic() > until:
                raise TimeoutError(f"{expression} is not true after {seconds} s; {self.said}")
            time.sleep(0.05)
        return value

    def value(self, expression):
        """The value of an expression of JavaScript in the page."""
        found = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise RuntimeError(str(found["exceptionDetails"]))
        return found["result"].get("value")

    def screenshot(self):
        """The picture of the page, as text."""
        return self.ask("Page.captureScreenshot", format="png")["data"]

    def mouse(self, kind, x, y, **rest):
        """A `mousePressed`, `mouseReleased` or `mouseMoved` at a point of the page."""
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **rest)

    def drag(self, start, end):
        """Press the left button at a point, move to another in steps, release."""
        self.mouse("mousePressed", *start, button="left", clickCount=1)
        for k in range(1, 6):
            x, y = (a + (b - a) * k / 5 for a, b in zip(start, end, strict=True))
            self.mouse("mouseMoved", x, y, button="left", buttons=1)
        self.mouse("mouseReleased", *end, button="left", clickCount=1)

    def close(self):
        """End the browser."""
        self.writing.close()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)  # a session of its own: the browser and its children
            self.process.wait()
        os.close(self.reading)


def cut_blocks(folder):
    """The two blocks, cut, in a file."""
    target = folder / "blocks.msh"
    lacmesh.write(target, cut_skin(lacmesh.read(DATA / "two_blocks.msh"), "slave").mesh)
    return target


def status(capsys, *arguments):
    """The exit status of the command, and what it said."""
    code = main(["view", *map(str, arguments)])
    said = capsys.readouterr()
    return code, said.out + said.err


def tones(path, *wanted):
    """Count the pixels of each tone: the light changes a colour's strength, not its tone."""
    from PIL import Image

    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3).astype(float)
    hue = pixels - pixels.mean(axis=1, keepdims=True)
    strength = np.linalg.norm(hue, axis=1)
    counts = []
    for colour in rgb(wanted).astype(float):
        tone = colour - colour.mean()
        likeness = hue @ tone / np.maximum(strength, 1e-9) / np.linalg.norm(tone)
        counts.append(int(((likeness > 0.98) & (strength > 0.5 * np.linalg.norm(tone))).sum()))
    return counts
