"""Helpers shared by the tests of pictures and of pages."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import lacmesh
from lacmesh import cut_skin
from lacmesh.cli import main
from lacmesh.scene import colours

DATA = Path(__file__).resolve().parents[1] / "data"


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
    for colour in colours.rgb(wanted).astype(float):
        tone = colour - colour.mean()
        likeness = hue @ tone / np.maximum(strength, 1e-9) / np.linalg.norm(tone)
        counts.append(int(((likeness > 0.98) & (strength > 0.5 * np.linalg.norm(tone))).sum()))
    return counts
