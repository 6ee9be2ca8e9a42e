"""Draw what sticks and what slides: a clamp that is pulled until it slips, and two cylinders that are sheared.

python docs/tutorials/stick_and_slip.py        writes clamp.png and cylinders.png; needs matplotlib
"""

import matplotlib
import numpy as np

import lacsolver as ls

matplotlib.use("Agg")
from matplotlib import pyplot as plt

MU, STICKS, SLIDES = 0.2, 1, 2
BLUE, ORANGE = "#2b6cb0", "#e8701a"  # as in the pictures of lacsolver plot

# ---- the clamp

states = list(ls.march("data/friction/clamp.toml"))
zones = [state.contact["joint"] for state in states]
end = states[0].mesh.points[:, 0] == 80.0
moved = [1000 * state.u[end, 0].mean() for state in states]
carried = [float(zone.shear_vector[:, 0] @ zone.area) for zone in zones]  # of the slave on the master
bound = [MU * float(zone.pressure @ zone.area) for zone in zones]

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), dpi=100)
left.plot(moved, carried, "o-", label="friction")
left.plot(moved, bound, "k--", label="0.2 times the normal force")
left.set(
    xlabel="displacement of the pulled end, micrometres", ylabel="force, N/mm", title="the clamp holds, then slips"
)
left.legend()
for state, zone in zip(states, zones, strict=True):
    for status, colour in ((STICKS, BLUE), (SLIDES, ORANGE)):
        on = zone.status == status
        right.plot(zone.centre[on, 0], np.full(on.sum(), state.time), "s", color=colour, markersize=5)
right.set(xlabel="x, mm", ylabel="time", title="what sticks (blue) and what slides (orange)")
figure.tight_layout()
figure.savefig("clamp.png")
print(f"the clamp carries {carried[-1]:.1f} N/mm of {bound[-1]:.1f}")

# ---- the cylinders

zone = ls.solve("data/friction/cylinders.toml").contact["line"]
a, p0 = 0.6808, 9.351  # Hertz
c = a * np.sqrt(1 - 0.93616 / (MU * 10))
x = np.linspace(-0.9, 0.9, 400)
outer, inner = (MU * p0 * r / a * np.sqrt(np.maximum(1 - (x / r) ** 2, 0)) for r in (a, c))

figure, axes = plt.subplots(figsize=(11, 4.6), dpi=100)
axes.plot(x, outer, "k--", label="0.2 times the pressure, half-spaces")
axes.plot(x, outer - inner, "k-", label="Cattaneo and Mindlin")
for status, colour, label in ((STICKS, BLUE, "sticks"), (SLIDES, ORANGE, "slides")):
    on = zone.status == status
    axes.plot(zone.centre[on, 0], np.abs(zone.shear_vector[on, 0]), "o", color=colour, label=label)
axes.set(xlabel="x", ylabel="shear stress", title="two cylinders, pressed together and sheared")
axes.legend(loc="upper right")
figure.tight_layout()
figure.savefig("cylinders.png")
wide = float(zone.area[zone.status == STICKS].sum()) / 2
print(f"the cylinders stick on {wide:.3f} to either side of the middle; half-spaces: {c:.3f}")
