"""Case files that are right; together they give every key a value of its own, and name every option."""

from __future__ import annotations

from lacsolver.case.case import Solver
from lacsolver.case.keys import keys_of

SMALL = """
mesh = "two_blocks.med"
model = "3d"
kinematics = "small"
[[material]]
groups = ["lower", 7, "3:8"]
law = "elastic"
young = 2000
poisson = 0.3
density = 1e-9
expansion = 1e-5
reference_temperature = 20.0
[[material]]
groups = ["wood"]
law = "orthotropic"
young = [11000.0, 400.0, 300]
poisson = [0.3, 0.4, 0.3]
shear = [700.0, 600.0, 100.0]
axes = [[0.0, 1.0, 0.0], [1, 0, 0]]
expansion = [1e-5, 2e-5, 3e-5]
[[material]]
groups = ["steel"]
law = "plastic"
young = 210e3
poisson = 0.3
hardening = [[250.0, 0.0], [300, 0.05]]
kinematic = 1e3
[[contact]]
name = "joint"
slave = "Group_1"
master = "Group_2"
hexa = "hexa"
type = "bilateral"
stiffness = 1e4
normals = "smoothed"
surface = "faces"
crease_angle = 30.0
geometry = "current"
measure = "current"
clearance = -0.01
search_distance = 5.0
max_penetration = 0.5
coverage_threshold = 0.01
[[contact]]
slave = "Group_3"
master = "Group_4"
hexa = "auto"
type = "unilateral"
law = "exponential"
pressure_at_contact = 2.0
clearance_at_zero = 0.1
normals = "master"
surface = "smooth"
geometry = "reference"
measure = "reference"
initial = "all"
clearance = "1e-3 * x + t"
friction = "0.3 + 0.1 * x"
cohesion = [[0, 0.0], [1, 2.0]]
shear_limit = 5
[[contact]]
slave = "Group_5"
master = "Group_6"
hexa = "pyramid"
normals = "slave"
initial = "none"
law = "table"
pressures = [[0.0, 0.0], [1.0, 0.1], [5, 0.2]]
[[contact]]
slave = "Group_7"
master = "Group_8"
initial = "gap"
[[contact]]
name = "which"
surfaces = ["Group_11", "Group_12"]
[[tie]]
name = "glue"
slave = "Group_9"
master = "Group_10"
hexa = "auto"
search_distance = 1.0
coverage_threshold = 0.5
surface = "faces"
[[tie]]
name = "which tie"
surfaces = ["Group_13", "Group_14"]
[[rigid]]
group = "plate"
kind = "cell"
centre = [0.0, 0.0, 1.0]
ux = "sin(t)"
uy = [[0.0, 0.0], [1.0, 2.0]]
uz = -1.0
rotation = [0.0, "0.1 * t", [[0, 0], [1, 0.5]]]
[[rigid]]
group = "ball"
kind = "node"
fx = 1.0
fy = 2.0
fz = 3.0
moment = [1.0, 0.0, 0.0]
[[displacement]]
group = "bottom"
kind = "node"
ux = 0.1
uy = "x * z"
uz = [[0, 0], [0.5, 1], [1, 0]]
[[displacement]]
group = "side"
kind = "cell"
un = 0.0
[[displacement]]
at = [0.0, 0.0, 1.5]
ux = 0.0
[[spring]]
group = "corner"
kind = "node"
kx = 1.0
ky = 2.0
kz = 3.0
[[spring]]
at = [1, 2, 3]
kx = 1
[[spring]]
group = "corner"
to = "eye"
k = 2.5
[[pressure]]
group = "top"
value = 25.0
[[traction]]
group = "top"
tx = 1.0
ty = "y"
tz = [[0, 1], [1, 1]]
[[force]]
group = "top"
kind = "cell"
fx = 1.0
fy = 2.0
fz = 3.0
[[force]]
at = [1, 2, 3]
fx = 1.0
[[force]]
group = "top"
fx = 1.0
total = true
[[body_force]]
groups = ["lower"]
fx = 1.0
fy = 2.0
fz = 3.0
[gravity]
gx = 0.5
gy = 0.25
gz = -9810.0
[[temperature]]
groups = ["lower"]
value = "100 + x"
[[probe]]
group = "PA"
kind = "node"
name = "tip"
[[probe]]
at = [0, 0, 0]
name = "origin"
[steps]
end = 2.0
count = 4
growth = 1.5
max_halvings = 3
[solver]
backend = "rslab"
threads = 2
tolerance = 1e-8
max_iterations = 20
tangent = "symmetric"
[output]
format = "med"
every = 2
"""

FINITE = """
mesh = "ball.msh"
model = "axisymmetric"
kinematics = "finite"
[[material]]
law = "neo_hookean"
young = 1.0
poisson = 0.49
[[contact]]
slave = "ball"
master = "plate"
[[rigid]]
group = "plate"
uy = -1.0
[[pressure]]
group = "inside"
value = 1.0
follower = true
[steps]
times = [0.25, 0.5, 2.0]
[solver]
tangent = "consistent"
[output]
units = "N, mm, MPa"
format = "vtu"
times = [0.5, 2.0]
"""

PLANE = """
mesh = "plate.msh"
model = "plane_stress"
thickness = 2.5
kinematics = "finite"
[[material]]
law = "saint_venant_kirchhoff"
young = 1.0
poisson = -0.2
[[contact]]
slave = "a"
master = "b"
geometry = "reference"
[[rigid]]
group = "c"
centre = [1.0, 2.0]
rotation = 0.5
fx = 1.0
[[displacement]]
at = [1.0, 2.0]
ux = 1.0
"""

STRAIN = """
mesh = "plate.msh"
model = "plane_strain"
[[material]]
young = 1.0
poisson = 0.0
[[tie]]
slave = "a"
master = "b"
hexa = "hexa"
surface = "smooth"
crease_angle = 20
[[tie]]
slave = "e"
master = "d"
hexa = "pyramid"
[[spring]]
group = "top"
kind = "cell"
kx = 1.0
[[force]]
group = "top"
kind = "node"
fx = 1.0
[[probe]]
group = "top"
kind = "cell"
[[rigid]]
group = "c"
rotation = [[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]]
"""

SOLVERS = [
    f'mesh = "a"\nmodel = "3d"\nmaterial = [{{young = 1, poisson = 0}}]\nsolver.{name} = "{word}"\n'
    for name in ("engine", "backend")
    for word in keys_of(Solver)[name].kind.known
]
MOTION = """
mesh = "balls.msh"
model = "3d"
[[material]]
groups = ["ball"]
young = 1.0
poisson = 0.3
density = 2.0
[[rigid]]
group = "c"
fx = 1.0
moment = [0.0, 0.0, 1.0]
mass = 2.0
inertia = [1.0, 2.0, 2.5]
[dynamics]
scheme = "newmark"
beta = 0.3
gamma = 0.6
start = 0.5
massless = "internal"
mass = "lumped"
rayleigh = [0.1, 0.2]
[[initial]]
groups = ["ball"]
vx = 1.0
vy = "x"
vz = 0.0
rotation = [0.0, 0.0, 1.0]
centre = [0.0, 1.0, 0.0]
"""

IMPACTS = [
    f"""
mesh = "balls.msh"
model = "plane_strain"
[[material]]
young = 1.0
poisson = 0.3
density = 2.0
[dynamics]
alpha = 0.1
massless = "{massless}"
[[initial]]
ux = 1.0
uy = 2.0
"""
    for massless in ("slave", "none")
]
DISPLACED = """
mesh = "balls.msh"
model = "3d"
[[material]]
young = 1.0
poisson = 0.3
density = 2.0
[[contact]]
slave = "ball"
master = "floor"
stiffness = [[0.0, 10.0], [0.5, 20.0]]
damping = 5.0
adjust = 0.05
[dynamics]
[[initial]]
uz = 1.0
"""
JOINTS = """
mesh = "flange.msh"
model = "3d"
[[material]]
young = 1.0
poisson = 0.3
[[displacement]]
group = "a"
ux = 0.0
axes = { origin = [0, 0, 0], axis = [0, 0, 1] }
[[spring]]
group = "a"
kx = 1.0
axes = { x = [1, 0, 0], xy = [0, 1, 0] }
[[force]]
group = "a"
fx = 1.0
axes = { origin = [0, 0, 0], x = [1, 0, 0], xy = [0, 1, 0] }
[[force]]
group = "a"
moment = [0, 0, 1]
total = true
[[cyclic]]
name = "side"
slave = "left"
master = "right"
sectors = 12
axis = [0, 1, 0]
origin = [0, 0, 1]
harmonic = 0
ring = true
hexa = "auto"
[[coupling]]
name = "hook"
group = "a"
kind = "distributing"
at = [0, 0, 1]
weights = [[1, 2.0], [2, 1.0]]
axes = { x = [1, 0, 0], xy = [0, 1, 0] }
ux = 1.0
fy = 1.0
fz = 2.0
moment = [0, 0, 1]
[[coupling]]
group = "b"
kind = "rigid"
components = ["ux", "uy"]
uy = 1.0
uz = 0.0
rotation = [0, 0, "t"]
fx = 0.0
[[equation]]
name = "sum"
terms = [{ factor = 1.0, component = "ux", node = 3 }, { factor = -2, component = "uz", at = [0, 0, 1] }]
value = 0.1
[[equation]]
group = "a"
kind = "cell"
same = ["ux", "uz"]
[[equation]]
group = "b"
kind = "node"
same = ["uy"]
"""
TIGHTENED = """
mesh = "bolt.msh"
model = "3d"
[[material]]
young = 1.0
poisson = 0.3
[[pretension]]
group = "shank"
name = "bolt 1"
normal = [0, 0, 2]
force = [[0, 0], [1, 5.0]]
lock = 1
[[pretension]]
group = "second"
shortening = "0.1 * t"
[[displacement]]
group = "second"
ux = 0.0
begin = 1
reached = 1.5
[steps]
times = [1, 2]
"""
SECTORS = [
    f"""
mesh = "ring.msh"
model = "plane_strain"
[[material]]
young = 1.0
poisson = 0.3
[[cyclic]]
slave = "a"
master = "b"
sectors = 3
hexa = "{hexa}"
"""
    for hexa in ("pyramid", "hexa")
]
VALID = [TIGHTENED, JOINTS, *SECTORS, MOTION, DISPLACED, *IMPACTS, SMALL, FINITE, PLANE, STRAIN, *SOLVERS]
