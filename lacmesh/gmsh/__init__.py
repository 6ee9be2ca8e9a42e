"""gmsh's current model: as a mesh, cut in place, or made from a mesh; and CAD files meshed for contact (`mesh_cad`).

    mesh = to_mesh()                      all that gmsh's current model holds of its mesh   (model)
    cut = cut_model("slave")              the model's mesh cut, the model's geometry kept    (update)
    from_mesh(mesh, name="part")          a new, discrete model                              (update)
    update_model(mesh)                    the current model brought to a mesh that came from it

gmsh must be initialised by the caller (`gmsh.initialize()`), and is never finalised here. Data of a mesh that
gmsh's model has no place for (node groups, zones, TRIA7) are kept in its attribute `LacMesh`, which gmsh writes into a
msh 4.1 file as the section that lacmesh reads; fields, the records of a cut among them, are views.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lacmesh.cutting.cut import Cut
    from lacmesh.mesh import Mesh

__all__ = ["cut_model", "from_mesh", "to_mesh", "update_model"]


def to_mesh() -> Mesh:
    """Read gmsh's current model as a mesh: numbers, groups (also unnamed ones), entities, periodic links, order, views.

    The mesh is the one that `lacmesh.read` makes of the model saved as msh 4.1 with everything in it. Raises
    RequestError where gmsh is missing or holds no mesh.
    """
    from lacmesh.gmsh.model import read_model

    return read_model().mesh


def cut_model(
    slave: str | int | Sequence[str | int],
    *,
    hexa: str = "pyramid",
    interface: str = "both",
    orient: str = "keep",
    skin_only: bool = False,
    node_groups: str = "extend",
    ring: float = 1 / 3,
    depth: float = 1 / 2,
    recognise: bool | None = None,
    views: bool = True,
) -> Cut:
    """Cut the mesh of gmsh's current model in place; options as `lacmesh.cut_skin`.

    Replaced cells are removed from their entities, children and new nodes added: geometry, parametric coordinates,
    physical groups, periodic links and partitions stay as they are, and all that was not cut is not touched. `views`:
    the records of the cut become gmsh's views, of which `lac_macro` is shown, so that `Cut(to_mesh())` finds the cut
    again. Returns the cut. Whatever is wrong is found before the model is changed. Raises as `lacmesh.cut_skin`, and
    RequestError where gmsh is missing or holds no mesh.
    """
    from lacmesh.cutting.cut import cut_skin
    from lacmesh.gmsh.model import read_model
    from lacmesh.gmsh.update import apply_cut

    before = read_model()
    cut = cut_skin(
        before.mesh,
        slave,
        hexa=hexa,
        interface=interface,
        orient=orient,
        skin_only=skin_only,
        node_groups=node_groups,
        ring=ring,
        depth=depth,
        recognise=recognise,
    )
    if cut.mesh is not before.mesh:
        apply_cut(before, cut.mesh, views)
    return cut


def from_mesh(mesh: Mesh, name: str | None = None) -> None:
    """Make a mesh gmsh's current model: a new one called `name` (the mesh's own name by default), of discrete entities.

    Entities are those of msh (`lacmesh.formats.entities.assign`). Fields become views, TRIA7 cells are kept in the
    model's attribute only, partitions are left out with a warning. Raises RequestError where gmsh is missing or has a
    model of that name.
    """
    from lacmesh.gmsh.update import new_model

    new_model(mesh, mesh.name if name is None else name)


def update_model(mesh: Mesh) -> None:
    """Update gmsh's current model to `mesh`, which came from it (`to_mesh`) and was changed since.

    What is the same is not touched; geometry stays attached. An entity is split, into discrete ones, only where the
    mesh's groups differ inside it. If nodes are gone, the whole mesh is made anew (and periodic links are lost). Raises
    RequestError where gmsh is missing or holds no mesh.
    """
    from lacmesh.gmsh.model import read_model
    from lacmesh.gmsh.update import apply_mesh

    apply_mesh(read_model(), mesh)
