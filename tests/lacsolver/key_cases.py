# ruff: noqa: E501 (an equation a line)
"""Small cases that together use every key of a case file; what each must come to is in `test_every_key.py`.

A key a line: the test leaves out one line after the other, and wants the answer to be another one each time; but for
lines that say `# held`, which only keep a body from moving, or are looked at in another case.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from lacmesh import Mesh
from tests.lacsolver.key_meshes import (
    apart,
    bolted,
    cube,
    gapped,
    linked,
    overhang,
    pair,
    plane,
    punch,
    roof,
    tower,
    towers,
    wedge,
)


class KeyCase(NamedTuple):
    """A mesh, and the text of a case on it."""

    mesh: Callable[[], Mesh]
    text: str


LOADS = """
mesh = "blocks.msh"
model = "3d"
kinematics = "small"
[[material]]
groups = ["left"]
law = "elastic"
young = 1000.0
poisson = 0.3
density = 2.0
[[material]]
groups = ["right"]
young = 500.0
poisson = 0.25
density = 1.0
[[displacement]]
group = "z0"
kind = "cell"
ux = 0.0
uy = 0.0
uz = 0.0
[[traction]]
group = "z1"
tx = 1.0
ty = "2 + x"
tz = [[0, 0], [1, 3]]
[[pressure]]
group = "x1"
value = "1 + y * t"
[[force]]
group = "z1"
kind = "node"
fx = 0.1
fy = 0.2
fz = 0.3
[[force]]
group = "y1"
kind = "cell"
fy = 0.01
[[force]]
group = "y1"
fx = 0.04
total = true
[[force]]
at = [1.0, 1.0, 1.0]
fx = 0.07
[[body_force]]
groups = ["right"]
fx = 0.5
fy = "x"
fz = [[0, 0], [2, 0.8]]
[gravity]
gx = 0.05
gy = -0.03
gz = -9.81
[steps]
end = 2.0
count = 4
[output]
format = "vtu"
every = 2
"""

FIELDS = """
mesh = "blocks.msh"
model = "3d"
[[material]]
groups = ["left"]
law = "orthotropic"
young = [1000.0, 2000.0, 500.0]
poisson = [0.2, 0.3, 0.25]
shear = [400.0, 300.0, 200.0]
axes = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
expansion = [1e-4, 2e-4, 3e-4]
reference_temperature = 20.0
[[material]]
groups = ["right"]
young = 1500.0
poisson = 0.1
expansion = 5e-5
[[temperature]]
groups = ["left"]
value = 50.0
[[temperature]]
groups = ["right"]
value = "10 * t"
[[displacement]]
group = "x0"
ux = "1e-3 * (y + z) * t"
uy = "1e-3 * (2 * y - z) * t"
uz = "1e-3 * (y - 2 * z) * t"
[[displacement]]
group = "x1"
ux = "1e-3 * (3 + y + z) * t"
uy = "1e-3 * (4 + 2 * y - z) * t"
uz = "1e-3 * (5 + y - 2 * z) * t"
[[displacement]]
group = "y0"
ux = "1e-3 * (3 * x + z) * t"
uy = "1e-3 * (4 * x - z) * t"
uz = "1e-3 * (5 * x - 2 * z) * t"
[[displacement]]
group = "y1"
un = "1e-3 * (4 * x + 2 - z) * t"
[[displacement]]
at = [0.5, 1.0, 0.5]
ux = 3e-3
uz = 2.5e-3
[[displacement]]
at = [0.5, 1.0, 0.0]
ux = 2.5e-3
uz = 3.5e-3
[[displacement]]
group = "z0"
kind = "node"
ux = "1e-3 * (3 * x + y + 1) * t"
uy = "1e-3 * (4 * x + 2 * y - 1) * t"
uz = "1e-3 * (5 * x + y - 2) * t"
[[displacement]]
at = [0.5, 0.5, 0.0]
ux = 2e-3
uy = 3e-3
uz = 3e-3
[[displacement]]
at = [0.5, 0.5, 0.5]
ux = 2.5e-3
uy = 2.5e-3
uz = 2e-3
[[probe]]
group = "z1"
kind = "node"
name = "corners"
[[probe]]
group = "y1"
kind = "cell"
[[probe]]
at = [0.5, 1.0, 0.5]
name = "middle"
"""

SPRINGS = """
mesh = "blocks.msh"
model = "3d"
[[material]]
young = 1e7
poisson = 0.0
[[spring]]
group = "z0"
kind = "cell"
kx = 1.0
ky = 2.0
kz = 3.0
[[spring]]
group = "z1"
kind = "node"
kx = 4.0
ky = 5.0
kz = 6.0
[[spring]]
at = [1.0, 0.5, 0.5]
ky = 7.0
[[force]]
at = [1.0, 1.0, 1.0]
fx = 0.5
fy = -0.25
fz = 1.0
[[probe]]
at = [1.0, 1.0, 1.0]
name = "corner"
[[probe]]
at = [0.0, 1.0, 0.0]
name = "other"
"""

LINKED = """
mesh = "blocks.msh"  # held
model = "3d"  # held
[[material]]
young = 1000.0  # held
poisson = 0.3  # held
[[rigid]]
group = "lower"
[[rigid]]
group = "upper"
fx = 1.0
fy = -2.0
fz = 0.5
[[spring]]
group = "eye"
to = "hook"
k = 7.0
[[spring]]
group = "eye"
to = "hook"
kx = 2.0
ky = 3.0
kz = 4.0
axes = { x = [3.0, 4.0, 0.0], xy = [0.0, 1.0, 0.0] }
[[probe]]
group = "hook"
"""

EQUATED = """
mesh = "blocks.msh"  # held
model = "3d"  # held
[[material]]
young = 1000.0  # held
poisson = 0.3  # held
[[displacement]]
group = "z0"
kind = "cell"  # held
ux = 0.0  # held
uy = 0.0  # held
uz = 0.0  # held
[[force]]
at = [1.0, 1.0, 1.0]
fx = 10.0
fz = 5.0
[[equation]]
name = "sum"
terms = [{ factor = 2, component = "ux", at = [1, 1, 1] }, { factor = -1, component = "uy", group = "y1", kind = "node"}]
value = 0.03
[[equation]]
group = "x1"
kind = "cell"
same = ["uy"]
[[equation]]
name = "two"
group = "z1"
kind = "node"
same = ["uz"]
[[probe]]
at = [1.0, 1.0, 1.0]
name = "corner"
[[probe]]
at = [1.0, 0.5, 0.5]
name = "middle"
[[probe]]
at = [0.0, 0.0, 1.0]
name = "a"
[[probe]]
at = [0.0, 0.5, 1.0]
name = "b"
"""

AXES = """
mesh = "blocks.msh"  # held
model = "3d"  # held
[[material]]
young = 1e7  # held
poisson = 0.0  # held
[[displacement]]
group = "z0"
uz = 0.0  # held
[[displacement]]
at = [1.0, 0.5, 0.5]
ux = 1e-6
axes = { x = [3.0, 4.0, 0.0], xy = [0.0, 1.0, 0.0] }
[[spring]]
group = "z0"
kx = 2.0
ky = 3.0
kz = 5.0
axes = { x = [3.0, 4.0, 0.0], xy = [0.0, 1.0, 0.0] }
[[force]]
group = "x1"
fx = 1.0
fy = 2.0
fz = 4.0
total = true
axes = { origin = [1.0, -1.0, 0.0], axis = [1.0, 0.0, 0.0] }
"""

COUPLED = """
mesh = "blocks.msh"
model = "3d"  # held
[[material]]
young = 1000.0  # held
poisson = 0.3  # held
[[displacement]]
group = "z0"
kind = "cell"  # held
ux = 0.0  # held
uy = 0.0  # held
uz = 0.0  # held
[[coupling]]
name = "hook"
group = "x1"
kind = "distributing"
at = [2.0, 0.5, 0.75]
weights = "1 + z"
axes = { x = [0.0, 1.0, 0.0], xy = [1.0, 0.0, 0.0] }
ux = 1e-3
fy = 0.25
fz = "0.5 * t"
moment = [0.0, 0.0, 0.125]
[[coupling]]
group = "z1"
kind = "rigid"
components = ["ux", "uz"]
fx = 0.5
uz = 2e-3
rotation = [0.0, 1e-3, 0.0]
[[coupling]]
name = "pin"
group = "x0"
uy = [[0, 0], [1, 1e-3]]
[[force]]
group = "z1"
moment = [0.0, 0.0, 0.375]
total = true
"""

TIGHTENED = """
mesh = "blocks.msh"  # held
model = "3d"  # held
[[material]]
young = 1000.0  # held
poisson = 0.0  # held
[[displacement]]
group = "z0"  # held
ux = 0.0  # held
uy = 0.0  # held
uz = 0.0  # held
[[displacement]]
group = "z1"  # held
ux = 0.0  # held
uy = 0.0  # held
uz = 0.0  # held
[[pretension]]
group = "shank"
name = "bolt"
normal = [0.0, 0.3, 1.0]
force = [[0, 0], [1, 10], [2, 20]]
lock = 1.0
[[pretension]]
group = "second"
shortening = "0.015 * t"
[steps]
times = [1.0, 2.0]
"""

LATE = """
mesh = "blocks.msh"  # held
model = "3d"  # held
[[material]]
young = 1000.0
poisson = 0.0
[[displacement]]
group = "x0"  # held
ux = 0.0  # held
uy = 0.0  # held
uz = 0.0  # held
[[displacement]]
group = "x1"
ux = 0.05
begin = 1.0
reached = 1.5
[[traction]]
group = "x1"
tx = [[0, 0], [1, 10], [2, 30]]
[steps]
times = [1.5, 2.0]
"""

SECTOR = """
mesh = "blocks.msh"  # held
model = "3d"  # held
[[material]]
young = 1000.0  # held
poisson = 0.0  # held
[[cyclic]]
name = "side"
slave = "a"
master = "b"
sectors = 6
axis = [1.0, 0.0, 0.0]
origin = [0.0, 1.0, 0.0]
harmonic = 0
ring = true
hexa = "{hexa}"
[[displacement]]
group = "in"
ux = 0.0  # held
uy = "0.01 * (y - 1) * t"  # held
uz = "0.01 * z * t"  # held
[[displacement]]
group = "out"
ux = 0.0  # held
uy = "0.01 * (y - 1) * t"  # held
uz = "0.01 * z * t"  # held
"""

RIGID = """
mesh = "blocks.msh"
model = "3d"
[[material]]
young = 1000.0  # held
poisson = 0.3
[[displacement]]
group = "bottom"
ux = 0.0  # held
uy = 0.0  # held
uz = 0.0  # held
[[displacement]]
group = "top"
ux = 0.0
uy = 0.0
uz = 0.0
[[rigid]]
group = "low"
kind = "cell"
centre = [0.25, 0.0, 1.0]
ux = 1e-3
uy = "2e-3 * t"
uz = [[0, 0], [1, 3e-3]]
rotation = [1e-3, "-2e-3 * t", [[0, 0], [1, 4e-3]]]
[[rigid]]
group = "master"
kind = "node"
centre = [0.5, 0.25, 2.5]
fx = 1.0
fy = "2 * t"
fz = [[0, 0], [1, 3]]
moment = [0.25, "0.5 * t", -1.0]
[[probe]]
at = [1.0, 1.0, 1.0]
name = "corner"
[steps]
count = 2
"""

SEARCHED = """
mesh = "blocks.msh"
model = "plane_stress"
thickness = 2.5
[[material]]
young = 1000.0
poisson = 0.3
[[contact]]
name = "joint"
slave = "slave"
master = "master"
type = "unilateral"
search_distance = 0.7
coverage_threshold = 0.55
initial = "all"
clearance = "0.01 + 0.02 * x"
geometry = "reference"
measure = "reference"
normals = "facet"
[[displacement]]
group = "bottom"
ux = 0.0  # held
uy = 0.0  # held
[[displacement]]
group = "top"
ux = 0.0  # held
uy = 0.0  # held
"""

RUBBED = """
mesh = "blocks.msh"
model = "plane_strain"
[[material]]
young = 1000.0
poisson = 0.3
[[contact]]
name = "joint"  # held
slave = "slave"
master = "master"
friction = 0.3
cohesion = 0.2
shear_limit = 4.8
[[displacement]]
group = "bottom"
ux = 0.0
uy = 0.0
[[displacement]]
group = "top"
ux = 0.1
uy = -0.04
[steps]
count = 2
"""

SUNK = """
mesh = "blocks.msh"
model = "plane_stress"
[[material]]
young = 1000.0
poisson = 0.0
[[contact]]
slave = "slave"
master = "master"
max_penetration = 0.9
[[displacement]]
group = "bottom"
ux = 0.0  # held
uy = 0.0  # held
[[displacement]]
group = "top"
ux = 0.0  # held
uy = 0.0  # held
"""

CHOSEN = """
mesh = "blocks.msh"  # held
model = "plane_stress"  # held
[[material]]
young = 1000.0  # held
poisson = 0.0  # held
[[contact]]
name = "joint"  # held
surfaces = ["master", "slave"]
search_distance = 0.7  # held
[[displacement]]
group = "bottom"
ux = 0.0  # held
uy = 0.0  # held
[[displacement]]
group = "top"
ux = 0.0  # held
uy = -0.7  # held
"""

GLUED = """
mesh = "blocks.msh"
model = "plane_stress"
thickness = 2.5
[[material]]
young = 1000.0
poisson = 0.0
[[tie]]
name = "glue"
slave = "slave"
master = "master"
search_distance = 0.7
coverage_threshold = 0.55
[[displacement]]
group = "bottom"
uy = 0.0
[[displacement]]
group = "x0"
ux = 0.0
[[pressure]]
group = "top"
value = -2.0
"""

STRAIN = """
mesh = "blocks.msh"
model = "plane_strain"
[[material]]
young = 1000.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
type = "bilateral"
stiffness = 500.0
[[displacement]]
group = "bottom"
uy = 0.0
[[displacement]]
group = "x0"
ux = 0.0
[[pressure]]
group = "top"
value = -2.0
[[probe]]
group = "top"
"""

SOFT = """
mesh = "blocks.msh"
model = "plane_strain"
[[material]]
young = 1000.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
{law}
[[displacement]]
group = "bottom"
uy = 0.0
[[displacement]]
group = "x0"
ux = 0.0
[[pressure]]
group = "top"
value = 2.0
[[probe]]
group = "top"
"""
#: a gap that is closed before the solution
ADJUSTED = SOFT.format(law="adjust = 0.02")
SOFT_LAWS = {
    "linear": 'law = "linear"\nstiffness = 400.0',
    "exponential": 'law = "exponential"\npressure_at_contact = 0.5\nclearance_at_zero = 0.002',
    "table": 'law = "table"\npressures = [[0.0, 0.0], [1.0, 0.004], [3.0, 0.006]]',
}

YIELDING = """
mesh = "blocks.msh"
model = "3d"
[[material]]
law = "plastic"
young = 1000.0
poisson = 0.2
hardening = [[2.0, 0.0], [3.0, 0.02]]
kinematic = 40.0
[[displacement]]
group = "x0"
ux = [[0, 0], [1, -0.01], [2, 0.004]]
[[displacement]]
group = "y0"
uy = 0.0
[[displacement]]
group = "z0"
uz = 0.0
kind = "cell"
[[displacement]]
group = "x1"
ux = 0.0
[steps]
end = 2.0
count = 2
"""

ROUND = """
mesh = "blocks.msh"
model = "axisymmetric"
[[material]]
young = 1000.0
poisson = 0.0
[[contact]]
slave = "slave"
master = "master"
initial = "none"
clearance = -0.004
[[rigid]]
group = "top"
fy = -6.0
[[displacement]]
group = "bottom"
uy = 0.0
[steps]
times = [0.25, 1.0, 2.0]
[output]
format = "med"
units = "kN, m, kPa"
times = [0.5, 2.0]
"""

MEASURED = """
mesh = "blocks.msh"
model = "plane_strain"
[[material]]
young = 100.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
geometry = "current"
measure = "current"
initial = "gap"
[[displacement]]
group = "bottom"
uy = 0.0
[[displacement]]
group = "x0"
ux = 0.0
[[pressure]]
group = "top"
value = 10.0
"""

SLID = """
mesh = "blocks.msh"
model = "plane_strain"
[[material]]
young = 100.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
geometry = "current"
clearance = 0.01
[[displacement]]
group = "bottom"
ux = 0.0
uy = 0.0  # held
[[displacement]]
group = "top"
ux = 0.5
uy = -0.005
[steps]
count = 2
"""

ROOF = """
mesh = "blocks.msh"
model = "plane_strain"
[[material]]
young = 100.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
normals = "smoothed"
surface = "faces"
[[displacement]]
group = "bottom"
ux = 0.0  # held
uy = 0.0  # held
[[displacement]]
group = "top"
ux = 0.0  # held
uy = 0.0  # held
"""
_ROOFED = 'normals = "smoothed"\nsurface = "faces"\n'
_CREASED = 'surface = "smooth"\ncrease_angle = 20.0\n'

PUNCH = """
mesh = "blocks.msh"
model = "plane_strain"
[[material]]
young = 1000.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
geometry = "current"  # held
[[displacement]]
group = "bottom"
ux = 0.0  # held
uy = 0.0  # held
[[displacement]]
group = "top"
ux = 0.0  # held
uy = -0.04  # held
[solver]
"""

TOWER = """
mesh = "blocks.msh"
model = "3d"
[[material]]
young = 1000.0
poisson = 0.3
[[contact]]
slave = "slave1"
master = "master1"
hexa = "{hexa}"
[[tie]]
slave = "slave2"
master = "master2"
hexa = "{hexa}"
[[displacement]]
group = "bottom"
uz = 0.0
[[displacement]]
group = "x0"
ux = 0.0
[[displacement]]
group = "y0"
uy = 0.0
[[pressure]]
group = "top"
value = 1.0
"""

SOLVED = (
    TOWER.format(hexa="pyramid")
    + """
[solver]
backend = "{backend}"
threads = 3
"""
)

FINITE = """
mesh = "blocks.msh"
model = "plane_strain"
kinematics = "finite"
[[material]]
law = "{law}"
young = 1000.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
[[displacement]]
group = "bottom"
uy = 0.0
[[displacement]]
group = "x0"
ux = 0.0
[[pressure]]
group = "top"
value = 100.0
follower = true
"""

THROWN = """
mesh = "blocks.msh"
model = "3d"
[[material]]
young = 1000.0
poisson = 0.3
density = 2.0
[[rigid]]
group = "lower"
fx = 1.5
moment = [0.0, 0.0, 0.6]
mass = 3.0
inertia = [1.0, 2.0, 2.5]
[dynamics]
scheme = "newmark"
beta = 0.4
gamma = 0.6
rayleigh = [0.5, 0.01]
[[initial]]
groups = ["upper"]
vx = 0.1
vy = "0.2"
vz = 0.3
rotation = [0.0, 0.0, 0.4]
centre = [0.25, 0.5, 1.6]
ux = 0.01
uy = 0.02
uz = 0.03
[steps]
end = 1.0 # held
count = 4 # held
"""

DAMPED = """
mesh = "blocks.msh" # held
model = "plane_strain" # held
[[material]]
young = 1000.0 # held
poisson = 0.3 # held
density = 2.0 # held
[[contact]]
slave = "slave" # held
master = "master" # held
stiffness = 50.0
damping = 5.0
[[displacement]]
group = "x0" # held
ux = 0.0 # held
[[displacement]]
group = "bottom" # held
uy = 0.0 # held
[dynamics]
[[initial]]
groups = ["upper"] # held
vy = -0.1 # held
[steps]
end = 0.2 # held
count = 4 # held
"""

FALLING = """
mesh = "blocks.msh" # held
model = "plane_strain" # held
[[material]] # held
young = 1000.0 # held
poisson = 0.3 # held
density = 2.0 # held
[[contact]] # held
slave = "slave" # held
master = "master" # held
[[displacement]] # held
group = "x0" # held
ux = 0.0 # held
[[displacement]] # held
group = "lower" # held
uy = 0.0 # held
[dynamics]
{lines}
[[initial]] # held
groups = ["upper"] # held
vy = 0.5 # held
[steps]
end = 1.0 # held
count = 4 # held
"""
LINES = {
    "skins": 'scheme = "hht"\nmassless = "skins"\nmass = "consistent"\nalpha = 0.1\nrayleigh = [0.5, 0.0]',
    "slave": 'massless = "slave"\nmass = "lumped"',
    "internal": 'massless = "internal"',
    "none": 'massless = "none"\nstart = 0.5\nrayleigh = [0.0, 0.0]',
}

CASES = {
    "thrown": KeyCase(apart, THROWN),
    "damped": KeyCase(plane, DAMPED),
    **{f"massless {name}": KeyCase(pair, FALLING.format(lines=lines)) for name, lines in LINES.items()},
    "loads": KeyCase(cube, LOADS),
    "fields": KeyCase(cube, FIELDS),
    "springs": KeyCase(cube, SPRINGS),
    "linked": KeyCase(linked, LINKED),
    "equated": KeyCase(cube, EQUATED),
    "axes": KeyCase(cube, AXES),
    "coupled": KeyCase(cube, COUPLED),
    "tightened": KeyCase(bolted, TIGHTENED),
    "late": KeyCase(cube, LATE),
    **{f"sector {hexa}": KeyCase(wedge, SECTOR.format(hexa=hexa)) for hexa in ("pyramid", "hexa", "auto")},
    "rigid": KeyCase(towers, RIGID),
    "searched": KeyCase(lambda: overhang(0.6), SEARCHED),
    "rubbed": KeyCase(plane, RUBBED),
    "sunk": KeyCase(lambda: overhang(-0.8), SUNK),
    "chosen": KeyCase(lambda: overhang(0.6), CHOSEN),
    "tied chosen": KeyCase(lambda: overhang(0.6), CHOSEN.replace("[[contact]]", "[[tie]]")),
    "glued": KeyCase(lambda: overhang(0.6), GLUED),
    "strain": KeyCase(plane, STRAIN),
    "yielding": KeyCase(cube, YIELDING),
    "adjusted": KeyCase(gapped, ADJUSTED),
    **{f"soft {name}": KeyCase(plane, SOFT.format(law=law)) for name, law in SOFT_LAWS.items()},
    "round": KeyCase(plane, ROUND),
    "measured": KeyCase(plane, MEASURED),
    "slid": KeyCase(plane, SLID),
    "smooth": KeyCase(roof, ROOF),
    "by the master": KeyCase(roof, ROOF.replace("smoothed", "master")),
    "creased": KeyCase(roof, ROOF.replace(_ROOFED, _CREASED)),
    "tied faces": KeyCase(roof, ROOF.replace(_ROOFED, 'surface = "faces"\n').replace("contact", "tie")),
    "tied creased": KeyCase(roof, ROOF.replace(_ROOFED, _CREASED).replace("contact", "tie")),
    "tolerant": KeyCase(punch, PUNCH + "tolerance = 1e-3\n"),
    "symmetric": KeyCase(punch, PUNCH + 'tangent = "symmetric"\n'),
    "consistent": KeyCase(punch, PUNCH + 'tangent = "consistent"\n'),
    "halved": KeyCase(punch, PUNCH + "max_iterations = 4\n[steps]\ngrowth = 1.0\n"),
    "given up": KeyCase(punch, PUNCH + "max_iterations = 3\n[steps]\nmax_halvings = 1\n"),
    "pyramid": KeyCase(lambda: tower(4.0), TOWER.format(hexa="pyramid")),
    "hexa": KeyCase(lambda: tower(1.0), TOWER.format(hexa="hexa")),
    "auto": KeyCase(lambda: tower(4.0), TOWER.format(hexa="auto")),
    "saint venant": KeyCase(plane, FINITE.format(law="saint_venant_kirchhoff")),
    "neo-hookean": KeyCase(plane, FINITE.format(law="neo_hookean")),
}
#: one for each backend
BACKENDS = ("auto", "rslab", "pardiso", "mumps", "cholmod", "superlu", "multigrid")
SOLVERS = {word: KeyCase(lambda: tower(1.0), SOLVED.format(backend=word)) for word in BACKENDS}
#: one for each engine, and for each backend that only the engine petsc has
ENGINES = {
    word: KeyCase(lambda: tower(1.0), TOWER.format(hexa="pyramid") + f"[solver]\n{line}\n")
    for word, line in {
        **{word: f'engine = "{word}"' for word in ("auto", "serial", "petsc")},
        **{word: f'backend = "{word}"' for word in ("gamg", "hypre")},
    }.items()
}
