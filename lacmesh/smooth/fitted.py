"""Description of the skin of a group for users: its exact shapes, its parts of free form, and which are too coarse."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError
from lacmesh.facts import Described
from lacmesh.mesh import Floats, Ints, Mesh, MeshLike, Spec, as_mesh, mask_of
from lacmesh.smooth.find import FoundShape
from lacmesh.smooth.heights import Smooth, smooth_of
from lacmesh.smooth.parents import Bools
from lacmesh.surface.record import Surface
from lacmesh.topology.orientation import skin_cells

#: shapes without a curve
_FLAT = ("plane", "line")
#: curved shapes of a group that a line names
_SHOWN = 4
#: names in the plane
_IN_PLANE = {"plane": "line", "sphere": "circle"}


@dataclass(frozen=True, eq=False, repr=False)
class FittedShape(Described):
    """A part of a skin and the shape on which its nodes lie; lengths and coordinates are those of the mesh.

    `shape`: plane, cylinder, sphere, cone or torus; line or circle in the plane; or free form. `faces`: indices of the
    mesh's cells; `nodes`: number of nodes of the faces before the cut. Parameters that a shape does not have are None:
    `radius` (of a torus, that of its circle), `tube` (the radius of a torus' tube), `angle` (of a cone, between axis
    and side, in degrees), `centre` (3,) (of a plane or line a point, of a cylinder the middle of the range of its nodes
    along the axis, of a cone the apex), `axis` (3,) unit (of a plane or line the outward normal, of a cone from the
    apex into it). `distance`: the largest of a node from the shape. `turn`: largest angle between two of its faces, in
    degrees, where it is taken for a shape although they turn by more than the crease angle; else None. `no_height`:
    number of faces of free form without a fit.

    >>> from lacmesh import read
    >>> (plane,) = fit_surface(read("data/two_blocks.msh"), "slave")
    >>> plane.shape, plane.axis.round(12).tolist(), plane.nodes
    ('plane', [0.0, 0.0, -1.0], 49)
    """

    shape: str
    faces: Ints
    nodes: int
    radius: float | None = None
    tube: float | None = None
    angle: float | None = None
    centre: Floats | None = None
    axis: Floats | None = None
    distance: float | None = None
    turn: float | None = None
    no_height: int = 0

    def __str__(self) -> str:
        """Describe the shape in words: `cylinder, radius 12, 98 nodes within 1e-13`."""
        words = [self.shape]
        if self.tube is not None:
            words.append(f"radii {self.radius:.6g} and {self.tube:.6g}")
        elif self.radius is not None:
            words.append(f"radius {self.radius:.6g}")
        if self.angle is not None:
            words.append(f"half angle {self.angle:.6g} degrees")
        words.append(f"{self.nodes:,} nodes" + ("" if self.distance is None else f" within {self.distance:.0e}"))
        if self.turn is not None:
            words.append(f"taken as one over edges of up to {self.turn:.3g} degrees")
        if self.no_height:
            words.append(f"{self.no_height:,} face{'s' if self.no_height > 1 else ''} without a fit")
        return ", ".join(words)

    @property
    def flat(self) -> bool:
        """True for a plane or a line."""
        return self.shape in _FLAT

    def as_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: the `text` in words, the number of `faces`, and all other fields."""
        own = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in asdict(self).items()}
        return own | {"text": str(self), "faces": len(self.faces)}


def fit_surface(mesh: MeshLike, group: Spec, crease_angle: float | None = None) -> tuple[FittedShape, ...]:
    """Find the shapes of a group's skin, the one with the most faces first; free form by connected parts.

    `group`: named as in `Mesh.group`. `crease_angle` (degrees): adjacent faces with a larger angle between their
    normals belong to two shapes; None: 40, but for five to eight faces on one circle, cylinder, sphere or cone. Faces
    of quadratic types are curved themselves, and are left out.

    Raises GroupNotFoundError, and DataError if the group holds no skin.

    >>> angle = np.linspace(0, 2, 9)
    >>> arc = Mesh.create(3 * np.stack([np.cos(angle), np.sin(angle)], axis=1),
    ...     [("SEG2", np.stack([np.arange(8), np.arange(1, 9)], axis=1))], cell_groups={"arc": np.arange(8)})
    >>> [(one.shape, round(one.radius, 12), one.nodes) for one in fit_surface(arc, "arc")]
    [('circle', 3.0, 9)]
    """
    mesh = as_mesh(mesh)
    surface = Surface.of(mesh, skin_cells(mesh, group))
    return fitted_shapes(smooth_of(mesh, surface, crease_angle), surface)


def shapes_of_groups(mesh: Mesh) -> dict[str, tuple[FittedShape, ...]]:
    """Find the shapes of each curved group of linear faces that is a skin: of a body, or a surface without solids."""
    shapes_of = {}
    for name, cells in mesh.cell_groups.items():
        dim = mesh.group_dim(name)
        if not len(cells) or dim not in (1, 2) or dim == mesh.dim == mesh.space_dim or dim < mesh.space_dim - 1:
            continue
        try:
            shapes = fit_surface(mesh, name)
        except DataError:  # of another kind: of order 3, or lines that are not plane
            continue
        if not all(one.flat for one in shapes):
            shapes_of[name] = shapes
    return shapes_of


def fitted_shapes(smooth: Smooth, surface: Surface) -> tuple[FittedShape, ...]:
    """Describe the shapes found in a surface, as `fit_surface` does."""
    fitted = [*_exact(smooth, surface), *_free(smooth, surface)]
    return tuple(sorted(fitted, key=lambda one: -len(one.faces)))


def few_faces_text_of(mesh: Mesh, surface: Surface, crease_angle: float | None = None) -> str:
    """Say which faces of a surface are taken as one shape although they turn by more than 40 degrees; "" if none."""
    taken = surface.height is not None and surface.height.taken is not None
    return few_faces_text(smooth_of(mesh, surface, crease_angle)) if taken else ""


def few_faces_text(smooth: Smooth) -> str:
    """Say which faces are taken as one shape although they turn by more than the crease angle; "" if none are."""
    few = [one for one in smooth.fit.shapes if one.turn is not None]
    if not few:
        return ""
    one = max(few, key=lambda shape: len(shape.faces))
    shape, dim = one.shape, smooth.fit.patches.dim
    kind = _IN_PLANE.get(shape.kind, shape.kind) if dim == 1 else shape.kind
    size = f"half angle {np.degrees(shape.size[0]):.6g} degrees" if kind == "cone" else f"radius {shape.size[0]:.6g}"
    others = f" (and {len(few) - 1:,} more such parts)" if len(few) > 1 else ""
    return (
        f"{len(one.faces):,} faces that turn by up to {one.turn:.3g} degrees lie on one {kind} "
        f"of {size} and are taken as it{others}"
    )


def shapes_text(shapes: Iterable[Mapping[str, Any]]) -> str:
    """Summarise shapes, given as for JSON, in one line: the first few curved ones, and the number of planes.

    >>> flat, curved = (FittedShape(shape, np.arange(3), 5).as_dict() for shape in ("plane", "free form"))
    >>> shapes_text([flat, curved])
    'free form, 5 nodes; 1 plane'
    """
    shapes = list(shapes)
    curved = [one["text"] for one in shapes if one["shape"] not in _FLAT]
    flat = [one["shape"] for one in shapes if one["shape"] in _FLAT]
    more = [f"{len(curved) - _SHOWN} more curved"] if len(curved) > _SHOWN else []
    planes = [f"{len(flat)} {flat[0]}{'s' if len(flat) > 1 else ''}"] if flat else []
    return "; ".join([*curved[:_SHOWN], *more, *planes])


def cells_of(smooth: Smooth, surface: Surface, faces: Ints) -> Ints:
    """Return the mesh's cells that some linear parents (rows) are, or into which they were cut."""
    mine = mask_of(len(smooth.parents.faces), smooth.rows[faces])
    return np.sort(surface.cell[mine[smooth.parents.of]])


def _exact(smooth: Smooth, surface: Surface) -> Iterator[FittedShape]:
    dim = smooth.fit.patches.dim
    for one in smooth.fit.shapes:
        kind = one.shape.kind
        size = one.shape.size.tolist()
        axis, centre = _placed(smooth, one)
        yield FittedShape(
            _IN_PLANE[kind] if dim == 1 else kind,
            cells_of(smooth, surface, one.faces),
            one.nodes,
            radius=None if kind in ("plane", "cone") else size[0],
            tube=size[1] if kind == "torus" else None,
            angle=float(np.degrees(size[0])) if kind == "cone" else None,
            centre=centre + smooth.origin,
            axis=None if kind == "sphere" else axis,
            distance=one.distance,
            turn=one.turn,
        )


def _placed(smooth: Smooth, one: FoundShape) -> tuple[Floats, Floats]:
    """Axis and centre of a shape, normalised so that they do not depend on how it was found."""
    patches, shape = smooth.fit.patches, one.shape
    axis, centre = shape.axis, shape.centre
    if shape.kind == "plane":
        outward = patches.area[one.faces] @ patches.normal[one.faces]
        return axis * np.copysign(1.0, axis @ outward), centre
    if shape.kind == "cone":
        return axis, centre
    axis = axis * np.copysign(1.0, axis[np.abs(axis).argmax()])
    if shape.kind == "cylinder":
        node = patches.node[one.faces]
        along = (patches.x[node[node >= 0]] - centre) @ axis
        centre = centre + (along.min() + along.max()) / 2 * axis
    return axis, centre


def _free(smooth: Smooth, surface: Surface) -> Iterator[FittedShape]:
    fit = smooth.fit
    lacking = smooth.heights[1]
    patch = fit.patches.patch
    rows = np.flatnonzero(fit.free)
    rows = rows[np.argsort(patch[rows], kind="stable")]
    for faces in np.split(rows, np.flatnonzero(np.diff(patch[rows])) + 1) if len(rows) else []:
        node = fit.patches.node[faces]
        cells = cells_of(smooth, surface, faces)
        yield FittedShape("free form", cells, len(np.unique(node[node >= 0])), no_height=int(lacking[faces].sum()))


#: faces that turn by more (radians) from one to the next, fewer than sixteen to a turn, are too few for a fit
_COARSE = 2 * np.pi / 16
#: heights that may be off by more than this part of a face's size are told: worth such a part of Young's modulus
DOUBTFUL = 5e-3


class Faceted(NamedTuple):
    """Faces of free form that are too coarse: `cells` of the mesh, the largest angle `turn` to a neighbour (degrees).

    `no_height`: number of faces, before the cut, that have no fit though they have a neighbour. `doubt`: how far the
    heights of any of them may be off, over the face's size.
    """

    cells: Ints
    turn: float
    no_height: int
    doubt: float


def faceted(smooth: Smooth, surface: Surface) -> Faceted:
    """Find faces of free form that have no fit or a doubtful one, or turn by more than a 16th of a circle."""
    turn, lacking = _turns(smooth), _lacking(smooth)
    free = smooth.fit.free
    cells = cells_of(smooth, surface, np.flatnonzero(free & ((turn > _COARSE) | (smooth.doubt > DOUBTFUL)) | lacking))
    doubt = float(smooth.doubt.max(initial=0.0))
    return Faceted(cells, float(np.degrees(turn[free].max(initial=0.0))), int(lacking.sum()), doubt)


def doubt_text(doubt: float) -> str:
    """Say how far gaps to a curved skin may be off, over the size of a face; after `its` or `their`."""
    return f"curvature changes within few faces, so that gaps may be off by {doubt:.2g} of a face's size"


def unresolved(mesh: Mesh, surface: Surface, *, how: str = "smooth", crease_angle: float | None = None) -> Floats:
    """(k,): largest angles (radians) to a neighbour of the linear faces whose curvature contact does not represent.

    With `how` = `faces` these are all faces that turn from a neighbour; with `smooth` those of free form that are too
    coarse for a fit or have none.
    """
    smooth = smooth_of(mesh, surface, crease_angle)
    turn = _turns(smooth)
    if how == "smooth":
        return turn[smooth.fit.free & (turn > _COARSE) | _lacking(smooth)]
    return turn[turn > 0]


def _turns(smooth: Smooth) -> NDArray[np.floating]:
    """(k,): largest angle (radians) between a linear parent and a neighbour joined to it without a crease."""
    patches = smooth.fit.patches
    i, j = patches.joints.i, patches.joints.j
    out = np.zeros(len(patches.normal))
    angle = np.arccos(np.clip((patches.normal[i] * patches.normal[j]).sum(axis=1), -1.0, 1.0))
    for one in (i, j):
        np.maximum.at(out, one, angle)
    return out


def _lacking(smooth: Smooth) -> Bools:
    """(k,): True for linear parents of free form that have a neighbour but no fit."""
    patches, free = smooth.fit.patches, smooth.fit.free
    i, j = patches.joints.i, patches.joints.j
    both = free[i] & free[j]
    joined = np.zeros(len(free), bool)
    joined[i[both]] = joined[j[both]] = True
    return smooth.heights[1] & joined
