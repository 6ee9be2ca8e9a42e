"""Small msh files as text, what can be wrong in them, and the other byte order."""

from __future__ import annotations

OLD = """$MeshFormat
{version} 0 8
$EndMeshFormat
$PhysicalNames
2
{names}
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
{n}
{elements}
$EndElements
"""

ASCII4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
1
2 5 "five"
$EndPhysicalNames
$Entities
0 0 1 0
1 0 0 0 1 1 0 1 5 0
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0 0 0
1 0 0
1 1 0
0 1 0
$EndNodes
$Elements
1 2 1 2
2 1 2 2
1 1 2 3
2 1 3 4
$EndElements
"""

#: what stands in ASCII4, what is put there, and the error that this gives; many more are in `tests/bad_input`
DAMAGES = [
    ("4.1 0 8", "4.1 0", "$MeshFormat should hold a version, 0 or 1, and a size"),
    ("$EndMeshFormat\n", "", "line 3: the section $MeshFormat should end here"),
    ("$PhysicalNames\n1", "$PhysicalNames\n-1", "line 5: the section $PhysicalNames should say here how much"),
    ("1 5 0\n", "1000000000000 5 0\n", "line 10: 1000000000000 values should follow here"),
    ("2 1 3 4\n", "2 1 3\n", "8 values should follow here, and $Elements ends too early"),
    ("2 1 3 4\n", "2 1 3 4 5\n", "line 28: the section $Elements should end here"),
]

#: mark after which numbers follow -> their sizes in bytes
WORDS = {
    "4.1": {
        b"$MeshFormat\n4.1 1 8\n": "4",
        b"$Entities\n": "8888" + "4" + "8" * 6 + "84" + "8",
        b"$Nodes\n": "8888" + "4448" + "8" * 4 + "8" * 12,
        b"$Elements\n": "8888" + "4448" + "8" * 4,
        b"3\n0\n3\n4\n": "4888" * 4,
    },
    "2.2": {
        b"$MeshFormat\n2.2 1 8\n": "4",
        b"$Nodes\n4\n": "4888" * 4,
        b"$Elements\n1\n": "4" * 9,
        b"3\n0\n3\n4\n": "4888" * 4,
    },
}


def swapped(content, version):
    """A binary file of one triangle, four nodes, a group and a field of three components, in the other byte order."""
    for mark, sizes in WORDS[version].items():
        at = content.index(mark) + len(mark)
        for n in map(int, sizes):
            content = content[:at] + content[at : at + n][::-1] + content[at + n :]
            at += n
    return content
