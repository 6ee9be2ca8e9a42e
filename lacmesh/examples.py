"""Examples that come with lacmesh: meshes, a CAD file, a deck, and cases for lacsolver, with the files of each.

They are the files of `data/`: in the wheel beside this module, in a checkout at its top.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from lacmesh.errors import RequestError, did_you_mean
from lacmesh.formats.output import check_place, replace_file


class Example(NamedTuple):
    """An example: its files, below the folder of all, the first of which a command takes; what it is; that command."""

    files: tuple[str, ...]
    words: str
    command: str


def _case(folder: str, name: str, words: str, more: str = "--plot pressure.png") -> Example:
    return Example((f"{folder}{name}.toml", f"{folder}{name}.msh"), words, f"lacsolver run {name}.toml {more}".strip())


#: meshes and geometries, for lacmesh
MESHES: Mapping[str, Example] = {
    "two_blocks": Example(
        ("two_blocks.msh",), "a foot of HEXA8 on a block of TETRA4", "lacmesh cut two_blocks.msh --slave slave"
    ),
    "disc_on_block": Example(
        ("disc_on_block.msh",), "a disc on a block, in the plane", "lacmesh cut disc_on_block.msh --slave slave"
    ),
    "press_fit": Example(("press_fit.msh",), "a hub on a shaft, TETRA4", "lacmesh quality press_fit.msh"),
    "pin_in_lug": Example(
        ("pin_in_lug.step",), "a pin in the bore of a lug, as CAD", "lacmesh mesh pin_in_lug.step --list"
    ),
    "punch": Example(("punch.inp",), "a punch on a block, a deck for CalculiX", "lacmesh cut punch.inp --slave slave"),
}
#: cases, for lacsolver
CASES: Mapping[str, Example] = {
    "two_blocks": _case("", "two_blocks", "a foot on a block, in space: the shortest case"),
    "press_fit": _case("", "press_fit", "a hub upon a shaft that is too large by 0.02 mm, in space"),
    "clamp": _case("friction/", "clamp", "two plates under a bolt, pulled until they slip: friction"),
    "cylinders": _case("friction/", "cylinders", "Cattaneo and Mindlin: two cylinders, pressed and sheared"),
    "flange": _case(
        "flange/", "flange", "a flange joint by sectors: bolts tightened, then a pull and a torque; friction, a gasket"
    ),
    "imprint": _case("plastic/", "imprint", "a ball that leaves an imprint in a metal, axisymmetric"),
    "bar_on_wall": _case("impact/", "bar_on_wall", "a bar that hits a rigid wall: waves, with inertia"),
    "dropping_ball": _case("impact/", "dropping_ball", "a rubber ball that bounces, axisymmetric, with inertia"),
    "ring": _case("sliding/", "ring", "half a ring that is pushed deep into a soft block: large strains"),
    "ironing_2d": _case("sliding/", "ironing_2d", "a half-cylinder that is dragged over rubber, in the plane"),
    "ironing_3d": _case("sliding/", "ironing_3d", "the same in space"),
    "ball": _case("sliding/", "ball", "a rubber ball between two plates, axisymmetric: two contacts"),
    "snap_fit": _case("sliding/", "snap_fit", "a hook that snaps in behind a ledge: large sliding"),
    "punch": Example(
        ("punch.inp",), "a punch on a block, a deck for CalculiX: import it first", "lacsolver import punch.inp"
    ),
}


def data_folder() -> Path:
    """Return the folder of all examples."""
    installed = Path(__file__).parent / "data"
    return installed if installed.is_dir() else Path(__file__).parents[1] / "data"


def example_of(name: str, among: Mapping[str, Example]) -> Example:
    """Return the example of a name. Raises RequestError.

    >>> example_of("two_bloks", MESHES)
    Traceback (most recent call last):
    lacmesh.errors.RequestError: there is no example 'two_bloks'; did you mean two_blocks?
    """
    if name not in among:
        raise RequestError(f"there is no example {name!r}{did_you_mean(name, among)}")
    return among[name]


def example(file: str) -> Path:
    """Return the path of a file that comes with lacmesh, such as `two_blocks.msh`, or `clamp.toml` for lacsolver.

    Raises RequestError for another name; `lacmesh example` and `lacsolver example` list all.

    >>> import lacmesh
    >>> lacmesh.read(lacmesh.example("two_blocks.msh")).n_nodes
    476
    """
    places = {Path(path).name: path for one in (*MESHES.values(), *CASES.values()) for path in one.files}
    if file not in places:
        raise RequestError(f"there is no example file {file!r}{did_you_mean(file, places)}")
    return data_folder() / places[file]


def copy_example(chosen: Example, folder: Path, *, force: bool = False) -> list[Path]:
    """Copy the files of an example into a folder, which is made if need be; return their paths.

    Raises RequestError for files that exist, unless `force`; WriteError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    targets = [folder / Path(file).name for file in chosen.files]
    for target in targets:
        check_place(target, force=force)
    for file, target in zip(chosen.files, targets, strict=True):
        replace_file(target, (data_folder() / file).read_bytes())
    return targets
