"""Helpers of tests of pictures: the folder of examples, tones, and a browser without a window."""

import subprocess

import numpy as np

from lacmesh.drawing import rgb
from tests import REPOSITORY

DATA = REPOSITORY / "data"
#: a browser without a window that draws by software; what a page waits for comes at once
BROWSER = "chromium --headless=new --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
BROWSER += " --disable-dev-shm-usage --no-first-run --window-size=400,300 --virtual-time-budget=20000"
BROWSER += " --enable-logging=stderr"
#: presses the left button where a page has drawn, moves, and releases
DRAG = """<script>
const drawn = setInterval(() => {
  if (!(document.querySelector("canvas")?.width > 100)) return;
  clearInterval(drawn);
  const say = (kind, k, buttons) => {
    const at = {clientX: 200 - 16 * k, clientY: 150 - 10 * k, buttons, bubbles: true, pointerId: 1, isPrimary: true};
    document.elementFromPoint(200, 150).dispatchEvent(new PointerEvent(kind, {...at, pointerType: "mouse"}));
  };
  setTimeout(() => {
    say("pointerdown", 0, 1);
    for (let k = 1; k < 6; k++) say("pointermove", k, 1);
    say("pointerup", 5, 0);
  }, 2000);
}, 100);
</script>"""


def shown(page):
    """The picture of a page in the browser, and what the page says on the console."""
    picture = page.with_suffix(".png")
    words = [*BROWSER.split(), f"--user-data-dir={page.parent / 'browser'}", f"--screenshot={picture}", page.as_uri()]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300)
    return picture.read_bytes(), [line for line in done.stderr.splitlines() if "CONSOLE" in line]


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
