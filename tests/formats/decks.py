"""Decks and jobs of our own, two bodies in contact with a little of all that decks hold; and CalculiX's answers."""

import re
import subprocess
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import lacmesh
from lacmesh import generate
from lacmesh.cells import CELLS
from lacmesh.formats.inp.elements import element
from tests.lacsolver.deck_texts import Block
from tests.meshes import lenient

#: Young's modulus, pressure, stiffness of the contact (pressure over overclosure).
E, P, K = 1000.0, 2.0, 1e5
FILES = Path(__file__).parent / "files"
#: Cards behind the mesh; {across} are the degrees of freedom across the pressure, {load} what presses.
CARDS = (FILES / "pressed_cards.inp").read_text()


def pressed(name):
    """A deck of two blocks of elements `name`, the upper one pressed on faces of its elements."""
    kind = element(name).type
    plane = CELLS[kind].dim == 2
    mesh = two_blocks(kind)
    rows = _faces_of(mesh, "press")
    nodes = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups["press"])]))
    groups = {g: cells for g, cells in mesh.cell_groups.items() if g != "press"}
    mesh = replace(mesh, cell_groups=groups, node_groups={**mesh.node_groups, "top": nodes})
    text = re.sub(r"TYPE=C\w+$", f"TYPE={name}", _written(mesh), flags=re.MULTILINE)
    return text + CARDS.format(
        E=E,
        K=K,
        up=2 if plane else 3,
        across="1, 1" if plane else "1, 2",
        thickness="1." if name.startswith(("CPS", "CPE")) else "",
        load="\n".join(f"{number}, P{face}, {P}" for number, face in rows),
    ).replace("\n\n", "\n")


def _faces_of(mesh, group):
    """Elements and face numbers of a skin group, by what *SURFACE says of it."""
    text = _written(replace(mesh, cell_groups={group: mesh.cell_groups[group]}))
    return re.findall(r"^(\d+), S(\d)$", text, re.MULTILINE)


def _written(mesh):
    with TemporaryDirectory() as folder, lenient():
        path = Path(folder, "a.inp")
        lacmesh.write(path, mesh)
        return path.read_text()


def solved(path, program):
    """Run a deck, and return CalculiX's .dat without its heading and date; empty if it prints nothing."""
    done = subprocess.run(
        [program, path.stem], cwd=path.parent, capture_output=True, text=True, timeout=300, check=False
    )
    assert "Job finished" in done.stdout, done.stdout[-2000:]
    results = path.with_suffix(".dat")
    return results.read_text() if results.exists() else ""


def tables(text):
    """Numbers of a .dat, by what they are: (what, the rows of one table) in order."""
    found, head = [], ""
    for part in re.split(r"\n\s*\n", text):
        rows = [row.split() for row in part.splitlines() if row.strip()]
        try:
            numbers = [[float(word) for word in row] for row in rows]
        except ValueError:
            head = " ".join(part.split())
            continue
        if numbers:
            found.append((head, np.array(numbers)))
    return found


# ---- jobs on meshes that lacmesh wrote as mesh.inp

#: To be filled with springs, three at each node: their elements, and sets of those along x, y and z.
ONE_FACET = f"""\
*INCLUDE, INPUT=mesh.inp
{{springs}}
*MATERIAL, NAME=M
*ELASTIC
{E}, 0.
*SOLID SECTION, ELSET=body, MATERIAL=M
*STEP
*STATIC
*DSLOAD
slave, P, {P}
*NODE PRINT, NSET=all
U
*END STEP
"""


def on_springs(n_nodes, section="", axes=(1, 2, 3)):
    """`ONE_FACET` with springs of stiffness E at nodes 1 to n_nodes; `section`: of a plane cell, or a shell."""
    lines = []
    for axis in axes:
        lines.append(f"*ELEMENT, TYPE=SPRING1, ELSET=along{axis}")
        lines += [f"{1000 * axis + node}, {node}" for node in range(1, n_nodes + 1)]
        lines += [f"*SPRING, ELSET=along{axis}", f"{axis}", f"{E}"]
    job = ONE_FACET.replace("{springs}", "\n".join(lines))
    return job.replace("*SOLID SECTION, ELSET=body, MATERIAL=M", section) if section else job


def two_blocks(kind):
    """Unit cubes, or squares one unit from the axis, of 2 and 3 cells a side, the second on the first.

    Their groups are those of `PRESSED`; other sides have no cells.
    """
    make, corner = (generate.rectangle, (1, 0)) if CELLS[kind].dim == 2 else (generate.box, (0, 0, 0))
    mesh = generate.stack(*(make(n, 1.0, kind, corner=corner) for n in (2, 3)), slave="lower")
    mesh = mesh.renamed(bottom="base", top="press").only("lower", "base", "slave", "upper", "master", "press")
    return replace(mesh, node_groups={"all": np.arange(mesh.n_nodes)})


# ---- parts

LOWER = Block(cells=(2, 2, 1))
UPPER = Block("C", (0, 0, 1), (1, 1, 2), (3, 3, 1))
#: two parts with numbers of their own, and names that a part and the assembly share, as Abaqus/CAE writes them
TWO = (FILES / "press.inp").read_text()
NODE = int(UPPER.at(2, 2)[0])


def two(**parts):
    made = {"lower": LOWER.text(), "upper": UPPER.text(), "gap": "0.", "node": NODE} | parts
    return TWO.format(**made)
