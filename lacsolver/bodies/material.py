"""Laws of small strains, and the assignment of laws to cells.

A law is a frozen record of constants that gives, in the components of `space.COMPONENTS` (engineering shear),
C (6, 6): stress = C (strain - (T - T0) alpha), and alpha (6,): thermal strain per degree. A model reduces both: plane
strain and axisymmetry take the first four components, plane stress eliminates the free zz. The assembly reads
`Materials`: the number of its law for every cell, and one tensor of C per law. Laws of finite strains
(`bodies.hyperelastic`), metals that yield, and laws that users add are stored in `Materials` too: they give stress and
tangent at each point (`PointLaw`) instead of one C for a cell.

Units: young, shear and C in stress; expansion in 1 / temperature; density in mass / volume.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats, Ints
from lacsolver.bodies.dilatation import dilated_constants
from lacsolver.space.space import ModellingHypothesis, Space

#: row and column of each component of stress in its tensor
PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
_ROUNDING = 1e-12
Triple = tuple[float, float, float]


class Law(Protocol):
    """Interface of a law of small strains for the assembly."""

    @property
    def density(self) -> float:
        """Mass per volume."""

    @property
    def reference_temperature(self) -> float:
        """Temperature at which there is no thermal strain."""

    def elasticity(self) -> NDArray[np.floating]:
        """Return C (6, 6), symmetric and positive definite."""

    def thermal_strain(self) -> NDArray[np.floating]:
        """Return alpha (6,): strain per degree, with engineering shear."""


class PointResponse(NamedTuple):
    """Answer of a law at points (k,): `stress` P (k, 3, 3), `tangent` A (k, 3, 3, 3, 3), and `energy` (k,) per volume.

    P_si is force along s per undeformed area across i (first Piola; under small strains symmetric). A_sitj =
    dP_si/dH_tj has the symmetry A_sitj = A_tjsi. `history` (k, n_history): the new one, if the step ended here.
    """

    stress: Floats
    tangent: Floats
    energy: Floats
    history: Floats


class PointLaw(Protocol):
    """Interface of a law that is evaluated at points.

    With an attribute `mean_dilatation` that is True, linear cells give it their mean change of volume (`dilatation`).
    """

    #: True for a law of finite strains
    finite: bool
    #: number of values that a point keeps from step to step; 0 at the start
    n_history: int

    @property
    def density(self) -> float:
        """Mass per volume."""

    @property
    def reference_temperature(self) -> float:
        """Temperature at which there is no thermal strain; a law at points has none at any temperature."""

    def respond(self, H: Floats, history: Floats) -> PointResponse:
        """Return the response to gradients of displacement H (k, 3, 3), after a history (k, n_history)."""


@dataclass(frozen=True, eq=False)
class LinearLaw:
    """A linear law of small strains at points: `A` (3, 3, 3, 3), without the direction 22 in plane stress."""

    A: Floats
    mean_dilatation: bool = False

    finite: ClassVar[bool] = False
    n_history: ClassVar[int] = 0

    def respond(self, H: Floats, history: Floats, tangent: bool = True) -> PointResponse:
        """Return the response to gradients H (k, 3, 3), with an empty tangent unless it is asked for."""
        stress = H.reshape(-1, 9) @ self.A.reshape(9, 9)
        energy = 0.5 * np.einsum("ki,ki->k", stress, H.reshape(-1, 9))
        A = np.tile(self.A, (len(H) if tangent else 0, 1, 1, 1, 1))
        return PointResponse(stress.reshape(H.shape), A, energy, history)


@dataclass(frozen=True)
class Elastic:
    """Isotropic linear elasticity. Raises DataError for a stiffness that is zero or negative.

    `mean_dilatation`: True if linear cells of several points use the mean of the volume change over the cell, see
    `bodies.locking`. A case chooses it by poisson; here it is as given.

    >>> Elastic(young=200.0, poisson=0.25).elasticity()[0].tolist()
    [240.0, 80.0, 80.0, 0.0, 0.0, 0.0]
    """

    young: float
    poisson: float
    density: float = 0.0
    expansion: float = 0.0
    reference_temperature: float = 0.0
    mean_dilatation: bool = False

    finite: ClassVar[bool] = False  # True for laws of finite strains
    takes_mean: ClassVar[bool] = True  # False for laws without mean dilatation

    def __post_init__(self) -> None:
        _check_common(self.density, (self.expansion,), self.reference_temperature)
        if not (np.isfinite(self.young) and self.young > 0):
            raise DataError(f"young is a stiffness above 0, not {self.young}")
        if not -1 < self.poisson < 0.5:
            message = f"poisson lies between -1 and 0.5, both left out, and is {self.poisson}"
            raise DataError(f"{message}; take 0.49 for rubber" if self.poisson >= 0.5 else message)
        if self.mean_dilatation and not self.takes_mean:
            raise DataError(f"the law {type(self).__name__} has no mean dilatation; take NeoHookean")

    @property
    def lame(self) -> tuple[float, float]:
        """The constants lambda and mu: stress = lambda tr(strain) I + 2 mu strain."""
        mu = self.young / (2 * (1 + self.poisson))
        return 2 * mu * self.poisson / (1 - 2 * self.poisson), mu

    def elasticity(self) -> NDArray[np.floating]:
        """Return C (6, 6)."""
        lam, mu = self.lame
        C = np.diag([2 * mu] * 3 + [mu] * 3)
        C[:3, :3] += lam
        return C

    def thermal_strain(self) -> NDArray[np.floating]:
        """Return alpha (6,)."""
        return self.expansion * np.array([1.0, 1, 1, 0, 0, 0])


@dataclass(frozen=True)
class Orthotropic:
    """Orthotropic linear elasticity, with three planes of symmetry.

    `young` (E1, E2, E3); `poisson` (nu12, nu13, nu23), nu_ij = -strain_j / strain_i when stress_i acts alone, so that
    nu_ij / E_i = nu_ji / E_j; `shear` (G12, G13, G23). `axes`: axis 1, and a second vector that spans the plane of axes
    1 and 2 with it (it need be neither of unit length nor orthogonal); axis 3 follows by the right-hand rule.
    `expansion`: one number, or one along each axis. `mean_dilatation` as in `Elastic`. Raises DataError where the
    compliance is not positive definite.
    """

    young: Triple
    poisson: Triple
    shear: Triple
    axes: tuple[Sequence[float], Sequence[float]] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    density: float = 0.0
    expansion: float | Triple = 0.0
    reference_temperature: float = 0.0
    mean_dilatation: bool = False

    takes_mean: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for name in ("young", "poisson", "shear"):
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != (3,) or not np.isfinite(values).all():
                raise DataError(f"{name} of an orthotropic law is three numbers, not {getattr(self, name)}")
            if name != "poisson" and values.min() <= 0:
                raise DataError(f"{name} is a stiffness above 0, not {getattr(self, name)}")
        if np.shape(self.expansion) not in ((), (3,)):
            raise DataError(f"expansion is one number, or one along each axis, not {self.expansion}")
        _check_common(self.density, np.ravel(self.expansion), self.reference_temperature)
        least = np.linalg.eigvalsh(self._compliance()).min()
        if least <= 0:
            message = "these young and poisson of an orthotropic law store negative energy in some strain"
            raise DataError(f"{message}; nu_ij^2 < E_i / E_j must hold, and poisson is (nu12, nu13, nu23)")
        _ = self.directions

    @cached_property
    def directions(self) -> NDArray[np.floating]:
        """Unit vectors of the axes in x, y, z, one per row, (3, 3)."""
        axes = np.zeros((2, 3))
        if len(self.axes) != 2 or any(len(a) not in (2, 3) for a in self.axes):
            raise DataError(f"axes are two vectors of 2 or 3 components, not {self.axes}")
        for row, axis in zip(axes, self.axes, strict=True):
            row[: len(axis)] = axis
        third = np.cross(axes[0], axes[1])
        if not np.linalg.norm(third) > 1e-6 * np.linalg.norm(axes[0]) * np.linalg.norm(axes[1]):
            raise DataError(f"axes {self.axes} lie on one line; give two vectors that span the plane of axes 1 and 2")
        frame = np.stack([axes[0], np.cross(third, axes[0]), third])
        return np.asarray(frame / np.linalg.norm(frame, axis=1, keepdims=True))

    def _compliance(self) -> NDArray[np.floating]:
        """Return the compliance (3, 3) from normal stresses to normal strains, along the axes."""
        E, (nu12, nu13, nu23) = self.young, self.poisson
        S: NDArray[np.floating] = np.diag(1 / np.array(E, float))
        S[0, 1] = S[1, 0] = -nu12 / E[0]
        S[0, 2] = S[2, 0] = -nu13 / E[0]
        S[1, 2] = S[2, 1] = -nu23 / E[1]
        return S

    @property
    def equivalent_poisson(self) -> float:
        """Poisson's ratio of the isotropic body with the same compliance in volume and, on average, in shear.

        These are Reuss's averages over all directions; they do not depend on the axes.
        """
        S = self._compliance()
        straight, across = np.trace(S), (S.sum() - np.trace(S)) / 2
        bulk = 1 / S.sum()
        shear = 15 / (4 * (straight - across) + 3 * (1 / np.array(self.shear, float)).sum())
        return float((3 * bulk - 2 * shear) / (6 * bulk + 2 * shear))

    def elasticity(self) -> NDArray[np.floating]:
        """Return C (6, 6) in x, y, z."""
        G12, G13, G23 = self.shear
        C = np.zeros((6, 6))
        C[:3, :3] = np.linalg.inv(self._compliance())
        C[3:, 3:] = np.diag([G12, G23, G13])
        there = np.einsum("pi,qj,rk,sl,pqrs->ijkl", *[self.directions] * 4, _to_tensor(C), optimize=True)
        turned = _from_tensor(there)
        return (turned + turned.T) / 2

    def thermal_strain(self) -> NDArray[np.floating]:
        """Return alpha (6,) in x, y, z."""
        Q = self.directions
        alpha = (Q.T * np.broadcast_to(self.expansion, 3)) @ Q
        return np.array([alpha[i, j] * (1 if i == j else 2) for i, j in PLACES])


def _check_common(density: float, expansion: Iterable[float], reference_temperature: float) -> None:
    if not (np.isfinite(density) and density >= 0):
        raise DataError(f"density is 0 or more, not {density}")
    for name, value in (*(("expansion", a) for a in expansion), ("reference_temperature", reference_temperature)):
        if not np.isfinite(value):
            raise DataError(f"{name} is a number, not {value}")


def _to_tensor(C: Floats) -> NDArray[np.floating]:
    """Return the tensor (3, 3, 3, 3) of a matrix C of the first 4 or all 6 components."""
    out = np.zeros((3, 3, 3, 3))
    for k, (i, j) in enumerate(PLACES[: len(C)]):
        for m, (p, q) in enumerate(PLACES[: len(C)]):
            out[i, j, p, q] = out[j, i, p, q] = out[i, j, q, p] = out[j, i, q, p] = C[k, m]
    return out


def symmetric(strain: Floats) -> NDArray[np.floating]:
    """Return the tensor (3, 3) of the first 4 or all 6 components of a strain."""
    out = np.zeros((3, 3))
    for value, (i, j) in zip(strain, PLACES, strict=False):
        out[i, j] = out[j, i] = value if i == j else value / 2
    return out


def _from_tensor(C: Floats) -> NDArray[np.floating]:
    """Return the matrix (6, 6) of a tensor C (3, 3, 3, 3)."""
    return np.array([[C[i, j, p, q] for p, q in PLACES] for i, j in PLACES])


def reduced(law: Law, model: ModellingHypothesis) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return C (n, n) and alpha (n,) of a law in a model's n components.

    In plane stress zz is eliminated (its row and column are 0). Raises DataError for a law that couples a plane model
    with shear across its plane.
    """
    n = model.n_stress
    C, alpha = law.elasticity(), law.thermal_strain()
    if n < 6 and (np.abs(C[:n, n:]).max() > _ROUNDING * np.abs(C).max() or np.any(np.abs(alpha[n:]) > _ROUNDING)):
        message = f"the law's axes couple the plane of the model {model.name} with shear across it"
        raise DataError(f"{message}; let one axis stand along z, or use the model 3d")
    C, alpha = C[:n, :n].copy(), alpha[:n].copy()
    if model.plane_stress:
        C -= np.outer(C[:, 2], C[2]) / C[2, 2]
        C[2] = C[:, 2] = 0.0
    return C, alpha


def _lame(A: Floats, rounding: Floats) -> NDArray[np.floating]:
    """Return lambda and mu (laws, 2) of those of some tensors A (laws, 3, 3, 3, 3) that are isotropic; 0 of others."""
    I = np.eye(3)  # noqa: E741
    out = np.stack([A[:, 0, 0, 1, 1], A[:, 0, 1, 0, 1]], axis=1)
    parts = np.stack([
        np.einsum("si,tj->sitj", I, I), np.einsum("st,ij->sitj", I, I) + np.einsum("sj,it->sitj", I, I)
    ])  # fmt: skip
    out[(np.abs(A - np.tensordot(out, parts, 1)) > rounding).any(axis=(1, 2, 3, 4))] = 0.0
    return out


class LawTerms(NamedTuple):
    """Nonzero entries of the constant A of linear laws, law by law: law k has rows start[k]:start[k + 1].

    `at` (m, 2): index of (s, t) among the pairs s <= t, and l i + j; `value` (m,): A_sitj. `lame` (laws, 2): lambda and
    mu of isotropic A; 0, 0 of the others. Laws with mean dilatation have the terms R (laws, 3, 3) and b (laws,) of a
    cell besides, see `dilatation`; they are 0 for the others.
    """

    start: Ints
    at: Ints
    value: Floats
    lame: Floats
    R: Floats
    b: Floats


@dataclass(frozen=True, eq=False)
class Materials:
    """The law of every cell: `laws`, and for each block of the space the index (k,) of each cell's law in `laws`.

    `groups`: the cell groups of each law, None for every cell; () if nothing is known of them.
    """

    model: ModellingHypothesis
    laws: tuple[Law, ...]
    law: tuple[Ints, ...]
    groups: tuple[tuple[str, ...] | None, ...] = ()

    @classmethod
    def of(cls, space: Space, given: Law | Sequence[tuple[Law, Sequence[str] | None]]) -> Materials:
        """Assign one law to the whole mesh, or laws to cell groups by pairs; None in place of groups means every cell.

        Raises GroupNotFoundError; DataError for cells with no law or with two, or a group without cells of the body.
        """
        pairs = [(given, None)] if not isinstance(given, Sequence) else list(given)
        chosen = np.full(space.mesh.n_cells, -1, np.int16)
        for k, (_, groups) in enumerate(pairs):
            cells = space.cells(None if groups is None else tuple(groups))
            twice = cells[chosen[cells] >= 0]
            if len(twice):
                named = space.mesh.cell_names(twice)
                numbers = space.mesh.cell_number[twice]
                raise DataError(f"cells {named} have two materials; their groups must not overlap", numbers)
            chosen[cells] = k
        cells = space.cells()
        without = cells[chosen[cells] < 0]
        if len(without):
            numbers = space.mesh.cell_number[without]
            message = f"{len(without)} cells have no material: {space.mesh.cell_names(without)}"
            raise DataError(f"{message}; name a group that holds them, or leave out the groups", numbers)
        theirs = tuple(None if groups is None else tuple(groups) for _, groups in pairs)
        made = cls(space.model, tuple(law for law, _ in pairs), tuple(chosen[b.cell] for b in space.blocks), theirs)
        _ = made.tensors
        return made

    @cached_property
    def tensors(self) -> NDArray[np.floating]:
        """Tensors A (laws, 3, 3, 3, 3) of the laws at rest in the model; 0 of laws that have no `elasticity`."""
        return np.stack([_to_tensor(C) for C, _ in self._reduced])

    @cached_property
    def thermal_strain(self) -> NDArray[np.floating]:
        """Thermal strain (laws, 3, 3) per degree; 0 of laws that have none."""
        return np.stack([symmetric(alpha) for _, alpha in self._reduced])

    @cached_property
    def _reduced(self) -> list[tuple[NDArray[np.floating], NDArray[np.floating]]]:
        """C (n, n) and alpha (n,) of each law in the model's components."""
        n = self.model.n_stress
        none, constants = (np.zeros((n, n)), np.zeros(n)), ("elasticity", "thermal_strain")
        lacking = [
            own and not all(hasattr(law, name) for name in constants)
            for law, own in zip(self.laws, self.pointwise, strict=True)
        ]
        return [none if lacks else reduced(law, self.model) for law, lacks in zip(self.laws, lacking, strict=True)]

    @cached_property
    def at_points(self) -> tuple[Any, ...]:
        """The laws as they are evaluated at points."""
        laws = zip(self.laws, self.tensors, self.mean, self.pointwise, strict=True)
        return tuple(law if own else LinearLaw(A, bool(mean)) for law, A, mean, own in laws)

    @cached_property
    def terms(self) -> LawTerms:
        """Constant terms of the stiffness in cells without mean dilatation."""
        return self._terms(mean=False)

    @cached_property
    def mean_terms(self) -> LawTerms:
        """Constant terms of the stiffness in cells with mean dilatation, for the laws that have it."""
        return self._terms(mean=True)

    def _terms(self, mean: bool) -> LawTerms:
        """Return the entries of linear laws that are not zero (above rounding), for s <= t, since K is symmetric."""
        A, R, b = self.tensors.copy(), np.zeros((len(self.laws), 3, 3)), np.zeros(len(self.laws))
        A[np.array(self.pointwise)] = 0.0
        for k, law in enumerate(self.at_points):
            if mean and isinstance(law, LinearLaw) and law.mean_dilatation:
                A[k], R[k], b[k] = dilated_constants(law.A)
        d, rows, S = self.model.dim, self.model.rows, self.model.selector
        none = 1e-15 * np.abs(self.tensors).max(axis=(1, 2, 3, 4))[:, None, None, None, None]
        lame = _lame(A, none)
        A = np.einsum("pqis,cpqab,abjt->csitj", S, A, S)
        used = np.abs(A) > none
        used &= (np.arange(d)[:, None] <= np.arange(d))[None, :, None, :, None]
        which, s, i, t, j = np.nonzero(used)
        start = np.searchsorted(which, np.arange(len(self.laws) + 1))
        return LawTerms(start, np.stack([d * s + t - s * (s + 1) // 2, rows * i + j], axis=1), A[used], lame, R, b)

    @cached_property
    def mean(self) -> NDArray[np.bool_]:
        """Mask (laws,) of the laws with mean dilatation."""
        return np.array([getattr(law, "mean_dilatation", False) for law in self.laws])

    @cached_property
    def pointwise(self) -> tuple[bool, ...]:
        """True for each law that is not linear: it is evaluated at points by its own `respond`."""
        return tuple(hasattr(law, "respond") for law in self.laws)

    def check_small(self) -> None:
        """Raise RequestError if a law is one of finite strains."""
        for law in self.laws:
            if getattr(law, "finite", False):
                message = f"the law {type(law).__name__} is for finite strains, and this is linear elasticity"
                raise RequestError(f"{message}; take lacsolver.bodies.pointwise.DisplacedBodies, or the law Elastic")

    def check_finite(self) -> None:
        """Raise RequestError if a law is not one of finite strains that is evaluated at points."""
        for law in self.laws:
            if not (getattr(law, "finite", False) and hasattr(law, "respond")):
                message = f"the law {type(law).__name__} is for small strains"
                raise RequestError(f"{message}; finite kinematics take saint_venant_kirchhoff, neo_hookean or plastic")

    def densities(self, block: int) -> NDArray[np.floating]:
        """Return the mass per volume (k,) of each cell of a block."""
        return np.array([law.density for law in self.laws])[self.law[block]]
