"""Draw the forces of the bolts of a flange joint against the moment that bends it, from the folder of a run.

python docs/tutorials/bolt_forces.py        reads the folder flange, writes flange_bolts.png; needs matplotlib
"""

import matplotlib

import lacsolver as ls

matplotlib.use("Agg")
from matplotlib import pyplot as plt

history = ls.read_results("flange").history
moment = 2e-6 * history["coupling.end.moment.y"]  # of both halves, kN m
force = {bolt: 1e-3 * history[f"pretension.{bolt}.force"] for bolt in ("bolt_1", "bolt_2")}
bending = {bolt: 1e-3 * history[f"pretension.{bolt}.moment.y"] for bolt in force}

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), dpi=100)
for bolt in force:
    left.plot(moment, force[bolt], "o-", label=bolt)
    right.plot(moment, bending[bolt], "o-", label=bolt)
left.set(xlabel="bending moment, kN m", ylabel="force of a bolt, kN", title="forces of the bolts")
right.set(xlabel="bending moment, kN m", ylabel="moment about y, N m", title="moments at the sections of the bolts")
left.legend()
right.legend()
figure.tight_layout()
figure.savefig("flange_bolts.png")
for time, m, one, two in zip(history["time"], moment, *force.values(), strict=True):
    print(f"t = {time:.2f}: {m:.1f} kN m, bolts {one:.1f} and {two:.1f} kN")
