"""Small files as text: those in `files`, which use much of the grammar, decks in pieces, and files that are wrong."""

import tomllib
from pathlib import Path


def _file(name):
    return (Path(__file__).parent / "files" / name).read_text()


#: two cubes, one on the other, whose file includes "more.inp", `MORE`; two instances of a part
INP, MORE, PARTS = map(_file, ("cubes.inp", "cubes_more.inp", "parts.inp"))
#: a deck with every card that is rewritten where elements are cut; it includes "more.inp", `INCLUDED`
DECK, INCLUDED = map(_file, ("deck.inp", "deck_more.inp"))
MAIL, ASCII4, OLD = map(_file, ("plate.mail", "square.msh", "old.msh"))
#: A deck of a brick: its mesh, cards before the steps, and a step.
MESH, MODEL = map(_file, ("brick.inp", "brick_cards.inp"))


STEP = "*STEP\n*STATIC\n1., 1.\n{cards}*NODE PRINT, NSET=Nall\nU\n*END STEP\n"
#: format -> what is wrong: text, line, words of the message
WRONG = tomllib.loads(_file("wrong.toml"))
WRONG["inp"]["an endless keyword"] = ("*NODE" + ", A" * 3000 + "\n1, 0.\n", 1, "more than 4096 characters")


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
