"""Half-width and largest pressure of the contact in own_mesh.md, from the table of its macro-elements."""

import numpy as np

table = np.genfromtxt("cylinder/contact_line.csv", delimiter=",", names=True)
table = np.sort(table[table["time"] == table["time"].max()], order="x")
x, p, closed = table["x"], table["pressure"], table["status"] == 1

print(f"last macro-element in contact at x = {x[closed].max():.3f}, first open one at x = {x[~closed].min():.3f}")
print(f"contact area: {(table['area'] * table['coverage'])[closed].sum():.4f}")

# Hertz: p^2 = p0^2 (1 - x^2 / a^2) is a line in x^2.
slope, p0_squared = np.polyfit(x[closed] ** 2, p[closed] ** 2, 1)
print(f"fit:   a = {np.sqrt(-p0_squared / slope):.4f}, p0 = {np.sqrt(p0_squared):.1f}")

force, radius, modulus = 2 * 500.0, 10.0, 210000.0 / (2 * (1 - 0.3**2))
a = np.sqrt(4 * force * radius / (np.pi * modulus))
print(f"Hertz: a = {a:.4f}, p0 = {2 * force / (np.pi * a):.1f}")
