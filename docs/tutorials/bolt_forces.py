"""Draw the forces of bolt and gasket of a flange joint, and how far its pipe turns, from the folder of a run.

python docs/tutorials/bolt_forces.py        reads the folder flange, writes flange_bolts.png; needs matplotlib
"""

import matplotlib

import lacsolver as ls

matplotlib.use("Agg")
from matplotlib import pyplot as plt

BOLTS = 8
history = ls.read_results("flange").history
bolt = 1e-3 * history["pretension.shank.force"]  # kN
gasket = -1e-3 * history["contact.gasket.fz"]  # of one sector, kN
pull = BOLTS * (bolt - gasket)  # by the balance of forces
torque = BOLTS * 1e-3 * history["coupling.end.moment.z"]  # N m
turn = 1e3 * history["coupling.end.rotation.z"]  # mrad

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), dpi=100)
left.plot(pull, bolt, "o-", label="bolt")
left.plot(pull, gasket, "o-", label="gasket, of one sector")
left.set(xlabel="pull on the joint, kN", ylabel="force, kN", title="forces while the pipe is pulled", ylim=(0, 22))
left.legend()
right.plot(torque[history["time"] >= 2], turn[history["time"] >= 2], "o-")
right.set(xlabel="torque, N m", ylabel="rotation of the pipe's end, mrad", title="rotation while the pipe is twisted")
figure.tight_layout()
figure.savefig("flange_bolts.png")
for time, *values in zip(history["time"], pull, torque, bolt, gasket, strict=True):
    values = [round(float(value), 3) + 0.0 for value in values]  # and no -0
    print("t = {:.2f}: pull {:.1f} kN, torque {:.0f} N m, bolt {:.2f} kN, gasket {:.2f} kN".format(time, *values))
