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

#: what stands in ASCII4, what is put there, and the error that this gives
DAMAGES = [
    ("4.1 0 8", "4 0 8", "line 2: msh version 4 is not read (2.0 to 2.2 and 4.1 are); open it in gmsh and save"),
    ("4.1 0 8", "4.1 0 4", "line 2: numbers of 4 bytes are not read"),
    ("4.1 0 8", "4.1 1 8", "says that it is binary, but its byte order mark is missing"),
    ("4.1 0 8", "4.1 0", "$MeshFormat should hold a version, 0 or 1, and a size"),
    ("$MeshFormat", "$NOD", "line 1: this is msh version 1; open it in gmsh"),
    ("$EndMeshFormat\n", "", "line 3: the section $MeshFormat should end here"),
    ("$PhysicalNames\n1", "$PhysicalNames\n2", "line 6: 2 names should follow here, and there are 1"),
    ("$PhysicalNames\n1", "$PhysicalNames\n-1", "line 5: the section $PhysicalNames should say here how much"),
    ('2 5 "five"', "2 five", "line 6: '2 five' should be a dimension, a tag and a name"),
    ('2 5 "five"', '4 5 "five"', "should be a dimension, a tag and a name"),
    ("$EndPhysicalNames\n", "", "line 4: the section $PhysicalNames has no $EndPhysicalNames"),
    ("0 0 1 0\n", "0 0 1000000000000 0\n", "$Entities ends too early"),
    ("0 0 1 0\n", "0 0 -1 0\n", "line 9: a negative count stands here"),
    ("1 5 0\n", "1000000000000 5 0\n", "line 10: 1000000000000 values should follow here"),
    ("1 4 1 4\n", "1 5 1 4\n", "line 12: $Nodes announces 5 nodes and holds another number"),
    ("2 1 0 4\n", "2 1 0 1000000000000\n", "1000000000000 values should follow here"),
    ("2 1 0 4\n", "2 1 0 -4\n", "line 14: a negative count stands here"),
    ("2 1 0 4\n", "2 1 0 3\n", "$Nodes should end here"),
    ("2 1 0 4\n", "5 1 0 4\n", "line 14: there cannot be an entity 1 of dimension 5"),
    ("2 1 0 4\n", "2 1.5 0 4\n", "line 14: an integer should stand here"),
    ("\n4\n0", "\n3\n0", "line 12: two nodes have the number 3"),
    ("\n4\n0", "\n0\n0", "line 12: a node has the number 0"),
    ("1 1 0\n0 1", "1 nan 0\n0 1", "line 12: the coordinates of nodes 3 are not finite"),
    ("1 1 0\n0 1", "1 1e400 0\n0 1", "the coordinates of nodes 3 are not finite"),
    ("1 1 0\n0 1", "1 abc 0\n0 1", "line 21: '1 abc 0' should be numbers"),
    ("1 1 0\n0 1", "1 1\n0 1", "12 values should follow here, and $Nodes ends too early"),
    ("$EndNodes\n", "", "line 12: the section $Nodes has no $EndNodes"),
    ("2 1 2 2\n", "2 1 99 2\n", "line 26: there are elements of type 99 of gmsh, which lacmesh does not know"),
    ("2 1 2 2\n", "2 1 2 1000000000000\n", "4000000000000 values should follow here"),
    ("2 1 3 4\n", "2 1 3 9\n", "line 24: the TRIA3 2 has node 9, which $Nodes does not hold"),
    ("2 1 3 4\n", "2 1 3 0\n", "the TRIA3 2 has node 0, which"),
    ("2 1 3 4\n", "2 1 3 -1\n", "the TRIA3 2 has node -1, which"),
    ("2 1 3 4\n", "2 1 3 99999999999999999999\n", "the TRIA3 2 has node 9223372036854775807, which"),
    ("2 1 3 4\n", "1 1 3 4\n", "line 24: two cells have the number 1"),
    ("2 1 3 4\n", "0 1 3 4\n", "line 24: a cell has the number 0"),
    ("2 1 3 4\n", "2 1 3\n", "8 values should follow here, and $Elements ends too early"),
    ("2 1 3 4\n", "2 1 3 4 5\n", "line 28: the section $Elements should end here"),
    ("1 2 1 2\n", "1 3 1 2\n", "$Elements announces 3 elements and holds 2"),
    ("$EndElements\n", "$EndElements\nrubbish\n", "line 30: a section ($...) should start here"),
    ("$EndElements\n", "$EndElements\n$Nodes\n0 0 0 0\n$EndNodes\n", "line 30: there is a second section $Nodes"),
    ("$EndElements\n", "$EndElements\n$LacMesh\n{}\n$EndLacMesh\n", "line 30: the section $LacMesh is damaged"),
    ("$EndElements\n", '$EndElements\n$NodeData\n1\n"T"\n0\n3\n0\n1\n9\n1 5\n$EndNodeData\n', "line 38: 18 values"),
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
