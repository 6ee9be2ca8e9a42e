"""Reactions and pressures of the punch in from_calculix.md, by CalculiX before and after the cut and by lacsolver."""

import json
import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import lacmesh


def of_calculix(name):
    """Reaction of the block, and x and pressure of every point in contact; x is the middle of the point's face."""
    mesh = lacmesh.read(f"{name}.inp")
    slave = np.unique(np.concatenate([nodes.ravel() for _, _, nodes in mesh.select(mesh.cell_groups["slave"])]))
    text = Path(f"{name}.dat").read_text()
    reaction = float(text.split("total force")[1].split("\n")[2].split()[1])
    rows = np.array([line.split()[:3] for line in re.findall(r"^ +\d+ +\d  +-?\d.*", text, re.MULTILINE)], float)
    middle = {}
    for number in np.unique(rows[:, 0]):
        ((_, _, nodes),) = mesh.select(np.flatnonzero(mesh.cell_number == number))
        middle[number] = mesh.points[np.intersect1d(nodes, slave), 0].mean()
    return reaction, np.array([middle[number] for number in rows[:, 0]]), rows[:, 2]


before, x_before, p_before = of_calculix("data/punch")
after, x_after, p_after = of_calculix("cut")
lac = np.genfromtxt("punch/contact_slave.csv", delimiter=",", names=True)
solved = json.loads(Path("punch/results.json").read_text())["steps"][-1]["reactions"]["bottom"][1]
print(f"reaction of the block: CalculiX {before:.1f}, CalculiX after the cut {after:.1f}, lacsolver {solved:.1f}")
for name, p in (("CalculiX", p_before), ("CalculiX after the cut", p_after), ("lacsolver", lac["pressure"])):
    print(f"largest pressure: {name} {p.max():.0f}")

figure, axes = plt.subplots(figsize=(12, 5), dpi=100)
axes.plot(x_before, p_before, "s", color="0.6", label="CalculiX, at its points of integration")
axes.plot(x_after, p_after, "x", color="tab:orange", label="the same, slave cut by lacmesh")
edges = np.append(lac["x"] - np.gradient(lac["x"]) / 2, lac["x"][-1])
axes.stairs(lac["pressure"], edges, color="tab:blue", label="lacsolver: one pressure for each macro-element")
axes.set(xlabel="x in mm", ylabel="contact pressure in MPa", xlim=(0, 0.7), ylim=(0, None))
axes.legend()
figure.savefig("punch.png", bbox_inches="tight")
