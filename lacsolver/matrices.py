"""Contact matrices for use in another solver: B, G, w of one pair of skins, without material or load."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, overload
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray
from scipy.io import mmwrite
from scipy.sparse import csr_array

import lacmesh
from lacmesh.errors import ReadError, RequestError, WriteError
from lacmesh.facts import Described
from lacmesh.formats.output import replacing
from lacmesh.mesh import Floats, Ints, Mesh, MeshLike, as_mesh
from lacsolver.case import Case, read_case
from lacsolver.case.value import Value, ValueLike
from lacsolver.contact import Interface, Pairing, Zone, integrate
from lacsolver.contact.interface import with_shear
from lacsolver.numbering import selection, unknown_of_each
from lacsolver.problem.pair import ContactPair
from lacsolver.problem.problem import build
from lacsolver.problem.roles import only_master_is_plane
from lacsolver.problem.skin import mesh_of

#: names of the arrays of B in a file, those of `scipy.sparse.save_npz`, and of the arrays beside it
_CSR = ("data", "indices", "indptr", "shape")
_ARRAYS = ("G", "w", "area", "coverage", "normal", "centre", "macro", "node")


@dataclass(frozen=True, eq=False, repr=False)
class ContactMatrices(Described):
    """Contact matrices of two skins in one configuration, one row per macro-element (m,).

    `B` (m, d n_nodes): B v = int (v(x) - v(x_bar)).n; the gap integral at displacement u is `G` - B u. `w`: measure of
    the covered part; `area`; `coverage`: w / area. `normal`, `centre` (m, d). `macro` (m,): number of the macro-element
    in the cut; `node` (n_nodes,): node numbers of the file: columns d i .. d i + d - 1 are those of node i. `mesh`: the
    cut mesh. Areas are those of the full circle in axisymmetry, of unit thickness in a plane.

    For friction, computed when it is asked for: `B_T` (m (d - 1), d n_nodes), whose row m (d - 1) + k is the slip
    integral of macro-element m along its tangent k, and `tangents` (m, d - 1, d), their means.

    >>> from lacmesh import read
    >>> matrices = contact_matrices(read("data/two_blocks.msh"), "slave", "master")
    >>> matrices.B.shape, matrices.B.shape[1] == 3 * matrices.mesh.n_nodes, float(matrices.w.sum().round(12))
    ((36, 1536), True, 0.851851851852)
    """

    B: csr_array
    G: NDArray[np.floating]
    w: NDArray[np.floating]
    area: NDArray[np.floating]
    coverage: NDArray[np.floating]
    normal: NDArray[np.floating]
    centre: NDArray[np.floating]
    macro: Ints
    node: Ints
    mesh: Mesh
    _interface: Interface
    _numbering: csr_array | None = None

    @property
    def B_T(self) -> csr_array | None:
        """Slip integrals along the tangents (m (d - 1), d n_nodes); None for a tie."""
        B_T = self._sheared.B_T
        return B_T if B_T is None or self._numbering is None else csr_array(B_T @ self._numbering)

    @property
    def tangents(self) -> NDArray[np.floating] | None:
        """Mean tangents (m, d - 1, d); None for a tie."""
        return self._sheared.frame

    @cached_property
    def _sheared(self) -> Interface:
        """The interface with its tangential rows, which a tie does not have: its jump has d rows a macro-element."""
        face = self._interface
        is_tie = face.B.shape[0] != len(face.w)
        return face if is_tie or face.B_T is not None else with_shear(face)

    def renumber(
        self,
        unknowns: str | Any = "nodes",
        *,
        nodes: Any = None,
        points: Any = None,
        n: int | None = None,
        u0: Floats | None = None,
    ) -> ContactMatrices:
        """Return these matrices on the displacement unknowns of another program.

        `unknowns`: "nodes" (component k of node i is unknown d i + k), "components" (it is unknown i + k N of N
        nodes), or an array (N, d) of the unknown of each node and component, -1 for one that is eliminated. Its N
        nodes are numbered as those of `mesh`, unless `nodes` says otherwise: an array (n_nodes,) of the program's
        number of each node of the mesh, -1 for a node that it does not have; or the program's cells by type,
        {"TETRA10": (k, 10)}, in the order of `mesh.block(type)` with the nodes of each in any order, and the
        coordinates (N, d) of its nodes, `points`, by which they are found. `n`: number of unknowns, by default one
        more than the largest. `u0` (n_nodes, d): values of displacements that are eliminated, nodes as in `mesh`; 0 by
        default.

        Raises RequestError where numbers do not fit together: a node in contact that the program does not have, an
        unknown twice, a cell whose nodes lie elsewhere, friction with eliminated displacements that are not 0.

        >>> import lacsolver as ls
        >>> pair = ls.contact_matrices("data/two_blocks.msh", "slave", "master")
        >>> u = np.random.default_rng(0).uniform(size=(pair.mesh.n_nodes, 3))
        >>> bool(np.allclose(pair.renumber("components").B @ u.T.ravel(), pair.B @ u.ravel()))
        True
        """
        d = self.normal.shape[1]
        in_contact = np.unique(self.B.indices // d)
        columns = unknown_of_each(self.mesh, d, in_contact, unknowns=unknowns, nodes=nodes, points=points, n=n)
        values = np.where(columns < 0, 0.0 if u0 is None else np.asarray(u0, float).reshape(-1, d), 0.0).ravel()
        if values.any() and self.B_T is not None and np.any(self.B_T @ values):
            message = "friction counts slips from 0, so that an eliminated displacement that is not 0 would be lost"
            raise RequestError(f"{message}; keep these unknowns, and prescribe them by fixed and u0 of solve_contact")
        P = selection(columns, n)
        return replace(self, B=csr_array(self.B @ P), G=self.G - self.B @ values, _numbering=P)

    def _facts(self) -> dict[str, str]:
        on = self.coverage > 0
        facts = {"B": f"{self.B.shape}, {self.B.nnz:,} entries; G, w, area, coverage ({len(self.G)},)"}
        facts["paired"] = (
            f"{int(on.sum()):,} of {len(on):,} macro-elements, {self.w.sum():.6g} of {self.area.sum():.6g}"
        )
        gap = self.G[on] / self.w[on] if on.any() else np.array([np.nan])
        return facts | {"mean gaps": f"{gap.min():.6g} to {gap.max():.6g}"}

    @classmethod
    def of(cls, interface: Interface, mesh: Mesh) -> ContactMatrices:
        """Return the contact matrices of an interface of a mesh."""
        names = ("B", "G", "w", "area", "coverage", "normal", "centre")
        of_interface = {name: getattr(interface, name) for name in names}
        return cls(**of_interface, macro=interface.zone.number, node=mesh.node_number, mesh=mesh, _interface=interface)


@overload
def contact_matrices(case: Case | str | Path, mesh: MeshLike | None = None, /) -> dict[str, ContactMatrices]: ...
@overload
def contact_matrices(
    mesh: MeshLike, slave: str, master: str, *, hexa: str = ..., normals: str = ..., crease_angle: float | None = ...,
    surface: str = ..., search_distance: float | None = ..., max_penetration: float | None = ..., measure: str = ...,
    axisymmetric: bool = ..., thickness: float = ..., clearance: ValueLike = ..., t: float = ...,
    x: Floats | None = ...,
) -> ContactMatrices: ...  # fmt: skip
def contact_matrices(
    mesh: Any,
    slave: Any = None,
    master: str | None = None,
    *,
    hexa: str = "pyramid",
    normals: str = "facet",
    crease_angle: float | None = None,
    surface: str = "smooth",
    search_distance: float | None = None,
    max_penetration: float | None = None,
    measure: str = "reference",
    axisymmetric: bool = False,
    thickness: float = 1.0,
    clearance: ValueLike = 0.0,
    t: float = 1.0,
    x: Floats | None = None,
) -> Any:
    """Return the contact matrices of two groups of skin cells, or those of a case, by the name of each contact and tie.

    `contact_matrices(case, mesh)`: as the case says, at the end of its steps; `mesh` is that of the case if None. They
    are `assemble(case, mesh).contact`. `contact_matrices(mesh, slave, master)`: without a case; a slave that is not cut
    is cut first (`hexa`). Options as in the case's [[contact]]: `clearance` is a number, a formula, a table of times or
    a function of points (n, 3) and the time `t`. `axisymmetric`: areas are those of the full circle around the axis y;
    `thickness` of a plane model. `x` (n_nodes of the cut mesh, 3): deformed coordinates of the nodes; None for those of
    the mesh. Raises CaseError, GroupNotFoundError, CutError, DataError, ReadError, RequestError.

    >>> low = [[0, 0], [1, 0], [1, 1], [0, 1]]
    >>> up = [[0, 1], [1, 1], [1, 2], [0, 2]]
    >>> cells = [("QUAD4", [[0, 1, 2, 3], [4, 5, 6, 7]]), ("SEG2", [[2, 3], [4, 5]])]
    >>> groups = {"top": [2], "bottom": [3]}
    >>> made = contact_matrices(Mesh.create(low + up, cells, cell_groups=groups), "top", "bottom")
    >>> made.B.shape, made.coverage.round(12).tolist(), made.w.round(12).tolist()
    ((1, 24), [1.0], [1.0])
    >>> [*contact_matrices("data/two_blocks.toml")]
    ['joint']
    """
    if isinstance(mesh, Case) or (isinstance(mesh, (str, Path)) and master is None):
        case = mesh if isinstance(mesh, Case) else read_case(Path(mesh), matrices=True)
        parts = build(case, mesh_of(case, slave), bodies=False)
        return matrices_of(parts.pairs, parts.mesh, case.steps.last)
    if not isinstance(slave, str) or master is None:
        message = "contact_matrices takes a case and its mesh, or a mesh and the groups slave and master"
        raise RequestError(f"{message}: contact_matrices(case, mesh), contact_matrices(mesh, slave, master)")
    mesh = lacmesh.cut_skin(as_mesh(mesh), slave, hexa=hexa).mesh
    zone = Zone.of(mesh, slave, master, surface=surface, crease_angle=crease_angle)
    if normals == "facet" and only_master_is_plane(zone, crease_angle):
        normals = "master"
    elif normals == "slave":
        normals = "facet"
    pairing = Pairing(
        normals, crease_angle, search_distance, max_penetration, axisymmetric, thickness, measure, _value(clearance)
    )
    return ContactMatrices.of(integrate(zone, zone.slave.dim + 1, pairing, x=x, t=t), mesh)


def _value(clearance: ValueLike) -> Any:
    """Return a clearance as a number or a function of points (n, 3) and time. Raises RequestError for a wrong one."""
    if callable(clearance):
        return clearance
    try:
        value = Value.of(clearance)
    except ValueError as error:
        raise RequestError(f"clearance: {error}") from None
    return value.source if isinstance(value.source, float) else value


def matrices_of(pairs: Iterable[ContactPair], mesh: Mesh, t: float) -> dict[str, ContactMatrices]:
    """Return the matrices of pairs on the undeformed mesh, by their names, with the clearances at time t."""
    matrices = {}
    for pair in pairs:
        zone = pair.zone
        face = integrate(zone, zone.slave.dim + 1, pair.pairing, t=t, tie=pair.law.all_components)
        matrices[pair.name] = ContactMatrices.of(face, mesh)
    return matrices


def read_matrices(path: str | Path) -> tuple[csr_array, dict[str, NDArray]]:
    """Return B (m, n) and the other arrays by name from a file of `lacsolver matrices`. Raises ReadError.

    Of a contact with friction also `B_T`, sparse, and `tangents`.

    >>> from tempfile import TemporaryDirectory
    >>> from lacmesh import read
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "joint.npz")
    ...     write_matrices(path, contact_matrices(read("data/two_blocks.msh"), "slave", "master"))
    ...     B, arrays = read_matrices(path)
    >>> B.shape, arrays["G"].shape
    ((36, 1536), (36,))
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            names = ("B_data", "B_indices", "B_indptr", "B_shape") if "B_data" in file else _CSR  # of earlier versions
            data, indices, indptr, shape = (file[name] for name in names)
            arrays = {name: file[name] for name in _ARRAYS}
            if "B_T_data" in file:
                of_shear = [file[f"B_T_{name}"] for name in _CSR]
                arrays["B_T"] = csr_array(tuple(of_shear[:3]), shape=tuple(of_shear[3]))
                arrays["tangents"] = file["tangents"]
        return csr_array((data, indices, indptr), shape=tuple(shape)), arrays
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile) as error:
        raise ReadError(path, f"holds no contact matrices ({getattr(error, 'strerror', None) or error})") from None


def write_matrices(path: Path, matrices: ContactMatrices, *, mtx: bool = False, friction: bool = False) -> None:
    """Write matrices to `path` (.npz): B as `scipy.sparse.load_npz` reads it, the other arrays beside it by name.

    `mtx`: write B also to a second file, in Matrix Market's format; `friction`: write B_T too. Raises WriteError.

    >>> from tempfile import TemporaryDirectory
    >>> from lacmesh import read
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "joint.npz")
    ...     write_matrices(path, contact_matrices(read("data/two_blocks.msh"), "slave", "master"))
    ...     len(np.load(path)["G"])
    36
    """
    B = matrices.B
    arrays = {
        "format": np.array(b"csr"), "_is_array": np.array(True),
        "data": B.data, "indices": B.indices, "indptr": B.indptr, "shape": np.array(B.shape),
        **{name: getattr(matrices, name) for name in _ARRAYS},
    }  # fmt: skip
    B_T = matrices.B_T if friction else None
    if B_T is not None and matrices.tangents is not None:
        arrays |= {f"B_T_{name}": np.asarray(getattr(B_T, name)) for name in _CSR} | {"tangents": matrices.tangents}
    paths = [path, *([path.with_suffix(".mtx")] if mtx else [])]
    try:
        with replacing(*paths) as beside:
            with beside[0].open("wb") as file:
                np.savez_compressed(file, **arrays)
            if mtx:
                with beside[1].open("wb") as file:
                    mmwrite(file, B.tocoo(), comment="contact matrix B: macro-elements x displacement components")
    except OSError as error:
        raise WriteError(path, error.strerror or str(error)) from None
