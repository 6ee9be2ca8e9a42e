"""medcoupling, asked in a process of its own (it can abort): `python med_peer.py say FILE ...`.

It prints what it finds in MED files, as JSON.
"""

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


if __name__ == "__main__":
    print("\n" + json.dumps({given: say(given) for given in sys.argv[2:]}))
