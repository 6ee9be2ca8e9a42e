"""medcoupling, asked in a process of its own (it can abort): `python med_peer.py COMMAND FILE ...`.

`say` prints what medcoupling finds in MED files, as JSON; `make` and `raised` let medcoupling write files.
"""

from __future__ import annotations

import json
import subprocess
import sys

NORM = {
    **{"PO1": "POINT1", "SE2": "SEG2", "SE3": "SEG3", "SE4": "SEG4", "TR3": "TRI3", "TR6": "TRI6", "TR7": "TRI7"},
    **{"QU4": "QUAD4", "QU8": "QUAD8", "QU9": "QUAD9", "TE4": "TETRA4", "T10": "TETRA10", "PY5": "PYRA5"},
    **{"P13": "PYRA13", "PE6": "PENTA6", "P15": "PENTA15", "P18": "PENTA18", "HE8": "HEXA8", "H20": "HEXA20"},
    **{"H27": "HEXA27"},
}


def ask(command, *arguments, timeout=600):
    """The JSON that a child process prints last; fails with its last words where it dies."""
    words = [sys.executable, __file__, command, *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=timeout, check=False)
    assert done.returncode == 0, (
        f"{command} {arguments} ended with {done.returncode}: {(done.stdout + done.stderr)[-900:]}"
    )
    return json.loads(done.stdout.splitlines()[-1])


def say(path):
    """Contents of a MED file as medcoupling reads it: cells are (MED type, index in the type)."""
    import medcoupling as mc

    names = {getattr(mc, f"NORM_{norm}"): name for name, norm in NORM.items()}
    data = mc.MEDFileData(path)
    mesh = data.getMeshes()[0]
    said = {"name": mesh.getName(), "space_dim": mesh.getSpaceDimension(), "points": _rows(mesh.getCoords())}
    said |= {"types": {}, "groups": {}, "node_groups": {}, "node_number": _numbers(mesh, 1)}
    for level in mesh.getNonEmptyLevels():
        part = mesh[level]
        where = []
        numbers = _numbers(mesh, level) or [None] * part.getNumberOfCells()
        for cell in range(part.getNumberOfCells()):
            name = names[part.getTypeOfCell(cell)]
            kept = said["types"].setdefault(name, {"nodes": [], "number": []})
            where.append([name, len(kept["nodes"])])
            kept["nodes"].append(list(part.getNodeIdsOfCell(cell)))
            kept["number"].append(numbers[cell])
        for group in mesh.getGroupsOnSpecifiedLev(level):
            ids = mesh.getGroupArr(level, group).getValues()
            said["groups"][group] = sorted(said["groups"].get(group, []) + [where[i] for i in ids])
    for group in mesh.getGroupsOnSpecifiedLev(1):
        said["node_groups"][group] = sorted(mesh.getGroupArr(1, group).getValues())
    said["all_groups"] = sorted(mesh.getGroupsNames())
    said["fields"] = _fields(mc, data.getFields(), names)
    return said


def _rows(array):
    width, values = array.getNumberOfComponents(), array.getValues()
    return [values[k : k + width] for k in range(0, len(values), width)]


def _numbers(mesh, level):
    numbers = mesh.getNumberFieldAtLevel(level)
    return None if numbers is None else numbers.getValues()


def _fields(mc, fields, names):
    """name -> [[number, order, time, {type or NOE: [places (None: all), rows]}], ...]."""
    said = {}
    for field in fields or []:
        for step in field:
            rows = _rows(step.getUndergroundDataArray())
            parts = {}
            for kind, pieces in step.getFieldSplitedByType():
                for entity, (lo, hi), profile, _ in pieces:
                    places = step.getProfile(profile).getValues() if profile else None
                    parts["NOE" if entity == mc.ON_NODES else names[kind]] = [places, rows[lo:hi]]
            number, order, time = step.getTime()
            said.setdefault(field.getName(), []).append([number, order, time, parts])
    return said


def make(path):
    """Files PATH.30.med ... PATH.42.med: one mesh with everything, written by medcoupling in each version of MED."""
    import medcoupling as mc

    points = [[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))] + [[2, 0, 0], [9, 9, 9]]
    coords = mc.DataArrayDouble([float(x) for p in points for x in p], len(points), 3)
    solid, skin = mc.MEDCouplingUMesh("maillage é", 3), mc.MEDCouplingUMesh("maillage é", 2)
    for part, cells in (
        (solid, [("TETRA4", [1, 2, 8, 5]), ("HEXA8", [0, 3, 2, 1, 4, 7, 6, 5])]),
        (skin, [("TRI3", [1, 2, 8]), ("QUAD4", [0, 1, 2, 3])]),
    ):
        part.setCoords(coords)
        part.allocateCells(2)
        for name, nodes in cells:
            part.insertNextCell(getattr(mc, f"NORM_{name}"), len(nodes), nodes)
    mesh = mc.MEDFileUMesh()
    mesh[0], mesh[-1] = solid, skin
    mesh.setName("maillage é")
    for level, groups in ((-1, {"peau à 2": [0], "B": [0, 1]}), (0, {"V": [0]}), (1, {"N": [2, 9]})):
        arrays = []
        for name, ids in groups.items():
            arrays.append(mc.DataArrayInt(ids))
            arrays[-1].setName(name)
        mesh.setGroupsAtLevel(level, arrays)
    for level, numbers in ((1, range(10, 110, 10)), (0, [7, 8]), (-1, [70, 80])):
        mesh.setRenumFieldArr(level, mc.DataArrayInt(list(numbers)))
    fields = mc.MEDFileFields()
    steps = mc.MEDFileFieldMultiTS()
    for k in (0, 1):
        steps.pushBackTimeStep(_field(mc, mc.ON_CELLS, "moved", solid, [1.0 + k, 2.0, 3.0, 4.0], 2, (0.5 * k, k, -1)))
    fields.pushField(steps)
    fields.pushField(_alone(mc, _field(mc, mc.ON_GAUSS_NE, "elno", solid, [float(k) for k in range(12)], 1)))
    partial = mc.MEDCouplingFieldDouble(mc.ON_NODES)
    partial.setName("partial")
    partial.setArray(mc.DataArrayDouble([1.0, 2.0, 3.0]))
    partial.setTime(0.0, -1, -1)
    places = mc.DataArrayInt([1, 4, 9])
    places.setName("three")
    one = mc.MEDFileField1TS()
    one.setFieldProfile(partial, mesh, 1, places)
    fields.pushField(_alone(mc, one))
    data, meshes = mc.MEDFileData(), mc.MEDFileMeshes()
    meshes.pushMesh(mesh)
    data.setMeshes(meshes)
    data.setFields(fields)
    for version in ("30", "33", "40", "41"):
        getattr(data, f"write{version}")(f"{path}.{version}.med", 2)
    data.write(f"{path}.42.med", 2)
    return True


def _field(mc, where, name, mesh, values, width, time=(0.0, -1, -1)):
    field = mc.MEDCouplingFieldDouble(where)
    field.setName(name)
    field.setMesh(mesh)
    field.setArray(mc.DataArrayDouble(values, len(values) // width, width))
    field.setTime(*time)
    one = mc.MEDFileField1TS()
    one.setFieldNoProfileSBT(field)
    return one


def _alone(mc, one):
    steps = mc.MEDFileFieldMultiTS()
    steps.pushBackTimeStep(one)
    return steps


def raised(path):
    """Files of one cell made quadratic by medcoupling: PATH.TYPE.0.med, and with centres PATH.TYPE.1.med."""
    import medcoupling as mc

    cells = {
        "TETRA4": [[0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1]],
        "PYRA5": [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0], [0.4, 0.3, 1]],
        "PENTA6": [[0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1]],
        "HEXA8": [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0], [0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1]],
        "TRI3": [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        "QUAD4": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    }
    for centres in (0, 1):
        for name, corners in cells.items():
            mesh = mc.MEDCouplingUMesh("one", 2 if name in ("TRI3", "QUAD4") else 3)
            mesh.setCoords(mc.DataArrayDouble([float(x) for p in corners for x in p], len(corners), 3))
            mesh.allocateCells(1)
            mesh.insertNextCell(getattr(mc, f"NORM_{name}"), len(corners), list(range(len(corners))))
            try:
                mesh.convertLinearCellsToQuadratic(centres)
            except mc.InterpKernelException:  # it has no such conversion
                continue
            mc.WriteUMesh(f"{path}.{name}.{centres}.med", mesh, True)
    return True


if __name__ == "__main__":
    chosen = {"say": say, "make": make, "raised": raised}[sys.argv[1]]
    print("\n" + json.dumps({given: chosen(given) for given in sys.argv[2:]}))
