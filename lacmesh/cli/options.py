"""Arguments that commands share: types with their flags and help, and groups of options with what is done with them."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from shlex import quote
from typing import Annotated, Any, Literal

from typer import Argument, Option

import lacmesh
from lacmesh.cli.program import Run, number
from lacmesh.errors import RequestError, listed

EPILOG = """\
A group is named as in the file, or by its tag (5), or dimension and tag
(2:5); an elementary entity is entity:2:17.
Exit status: 0 done, 1 the data are wrong, 2 the command is wrong,
3 a file cannot be read or written, 130 interrupted, 143 terminated."""


# options of two panels of the help, beside the usual ones
search = partial(Option, rich_help_panel="Contact search")
length = partial(search, metavar="LENGTH", parser=partial(number, low=0, high=sys.float_info.max, what="length"))
angle = partial(search, metavar="DEGREES", parser=partial(number, low=0, high=180, what="angle from 0 to 180 degrees"))
output = partial(Option, rich_help_panel="Output")

MeshFile = Annotated[str, Argument(metavar="IN", help="mesh: .msh, .med, .mail, .inp, .vtu, .xdmf and more")]
MeshName = Annotated[str | None, Option("--mesh", metavar="NAME", help="which mesh, in a file that holds several")]
Target = Annotated[str | None, output("--output", "-o", metavar="OUT", help="default: beside IN, with another ending")]
Force = Annotated[bool, output("--force", help="replace an existing output")]
AsJson = Annotated[bool, Option("--json", help="print one JSON object")]
Names = list[str] | None
Direction = tuple[float, float, float] | None
#: whom a mesh may be for: the keys of lacmesh.exchange.targets.TARGETS
_Programs = Literal["gmsh", "aster", "calculix", "abaqus", "fenics", "lacsolver"]
ForProgram = Annotated[
    _Programs | None,
    output("--for", help="refuse cells that it does not support; whose .inp to write (default: calculix)"),
]


@dataclass
class Skins:
    """The skins of a contact."""

    slave: Annotated[Names, Option(metavar="GROUP", help="slave surface; may be repeated")] = None
    master: Annotated[Names, Option(metavar="GROUP", help="master surface; may be repeated")] = None
    pair: Annotated[
        Names, Option(metavar="SLAVE:MASTER", help="for several contacts, in place of both; may be repeated")
    ] = None

    def check(self, *, needed: bool = True) -> None:
        """Check the options before a mesh is read; `needed`: there must be a slave. Raises RequestError."""
        if self.pair and (self.slave or self.master):
            raise RequestError("--pair names the slaves and masters; leave out --slave and --master")
        if needed and not (self.slave or self.pair):
            raise RequestError("no slave was named; give --slave GROUP, or --pair SLAVE:MASTER")

    def sides(self, mesh: lacmesh.Mesh, command: str, source: str, *, compared: bool = True) -> dict[str, Any]:
        """Return slave and master, or the pairs, of a mesh as keyword arguments of `lacmesh.check`.

        With pairs slave and master are set to all of theirs. `compared`: several slaves with several masters are an
        error, since they are compared. Raises RequestError.
        """
        if self.pair:
            from lacmesh.checks.request import split_pairs

            pairs = split_pairs(mesh, self.pair)
            self.slave, self.master = (list(dict.fromkeys(names)) for names in zip(*pairs, strict=True))
            return {"pairs": pairs}
        if compared and self.master:
            from lacmesh.checks.request import check_one_pair

            example = f"lacmesh {command} {quote(source)}"
            check_one_pair(self.slave or mesh.zones, self.master, example)
        return {"slave": self.slave, "master": self.master or []}


@dataclass
class Facing:
    """How slave and master are compared: keyword arguments of `lacmesh.check`."""

    dirichlet: Annotated[Names, search(metavar="GROUP", help="where displacements are prescribed; may be repeated")] = (
        None
    )
    axisymmetric: Annotated[bool, search("--axisymmetric", help="a plane mesh about y: areas include 2 pi x")] = False
    search_distance: Annotated[
        float | None,
        length(help="default: a quarter of the smaller surface's diagonal, or twice its largest macro-element"),
    ] = None
    max_penetration: Annotated[
        float | None, length(help="deepest overlap that is found (default: half the local element size)")
    ] = None
    surface: Annotated[
        Literal["smooth", "faces"], search(help="gaps of linear cells: between the smooth surfaces, or the faces")
    ] = "smooth"
    crease_angle: Annotated[
        float | None, angle(help="sharp edges turn by more (default: 40, or more on five to eight faces per turn)")
    ] = None


@dataclass
class Recognition:
    """Which slave faces are those of an earlier cut."""

    recut: Annotated[bool, Option("--recut", help="treat slave faces as not cut, even with records of a cut")] = False
    recognise: Annotated[bool, Option("--recognise", help="recognise a cut without records by its pattern")] = False

    def choice(self) -> bool | None:
        """Return whether to recognise a cut; None: only by its records. Raises RequestError."""
        if self.recut and self.recognise:
            raise RequestError("--recut and --recognise exclude each other; leave one out")
        return self.recognise or (False if self.recut else None)


@dataclass
class MshOutput:
    """How a .msh file is written."""

    msh: Annotated[Literal["4.1", "2.2"] | None, output(help="version of .msh (default: the input's, or 4.1)")] = None
    ascii: Annotated[bool, output("--ascii", help="write .msh, .vtu or .xdmf as text (default: as the input)")] = False
    force: Force = False

    def check(self, run: Run, target: Path) -> None:
        """Check early that a mesh can be written with these options. Raises RequestError, WriteError."""
        from lacmesh.formats.registry import format_of, takers

        options = format_of(target).options
        for option in ("msh", "ascii", "plane", "all_cells", "lenient"):
            name = "binary" if option == "ascii" else option  # of lacmesh.write
            if getattr(self, option, None) and name not in options:
                suffixes = listed([taker.suffixes[0] for taker in takers(name)], "or")
                of = f"{'an' if suffixes.startswith('.i') else 'a'} {suffixes} output"
                raise RequestError(f"--{option.replace('_', '-')} is for {of}, and {target} is none")
        run.will_write(target, force=self.force)


@dataclass
class MeshOutput(MshOutput):
    """How a mesh is written."""

    plane: Annotated[
        Literal["CPS", "CPE", "CAX"] | None,
        output(help="elements of a plane mesh in .inp (default: the input's, or CPS)"),
    ] = None
    all_cells: Annotated[
        bool, output("--all-cells", help=".inp: cells below the mesh's dimension are elements too")
    ] = False
    lenient: Annotated[
        bool, output("--lenient", help=".inp to .inp: leave out, with a warning, lines that cannot be carried")
    ] = False
    mesh_only: Annotated[bool, output("--mesh-only", help=".inp to .inp: without the other cards")] = False

    def target(self, run: Run, source: str, path: str | None, ending: str) -> Path:
        """Return the checked path to write to: as `-o` says, or the input with an ending before its suffix.

        Raises ReadError, RequestError, WriteError.
        """
        beside = Path(source)
        suffix = beside.suffix or f".{lacmesh.formats.detect_format(beside).format}"
        target = Path(path) if path else beside.with_name(f"{beside.stem}.{ending}{suffix}")
        self.check(run, target)
        return target

    def write(self, target: Path, mesh: lacmesh.Mesh, source: str, program: str | None = None) -> None:
        """Write a mesh; what the options leave open is taken from the input."""
        from lacmesh.formats.registry import format_of

        coding, options = lacmesh.formats.detect_format(source), format_of(target).options
        lacmesh.write(
            target,
            replace(mesh, deck=None) if self.mesh_only else mesh,
            msh=(self.msh or coding.version or None) if "msh" in options else None,
            binary=(coding.binary and not self.ascii) if "binary" in options else None,
            target=program if "target" in options and program in ("calculix", "abaqus") else None,
            plane=self.plane,
            all_cells=self.all_cells,
            lenient=self.lenient,
            force=self.force,
        )
