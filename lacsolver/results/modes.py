"""Record of natural modes: frequencies and shapes of free vibration, with the rigid-body modes beside them."""

from __future__ import annotations

from dataclasses import dataclass

from lacmesh.facts import Described
from lacmesh.mesh import Floats


@dataclass(frozen=True, eq=False, repr=False)
class NaturalModes(Described):
    """Natural modes of a problem, from the lowest frequency on.

    `frequencies` (k,): cycles per unit of time; `shapes` (k, n_nodes, dim), each with a largest displacement of 1;
    `modal_masses` (k,): twice the kinetic energy of a shape at unit velocity. `axes`: the axes along which the whole
    model can be moved; `effective_masses` (k, axes) of the modes along them, `rigid_masses` (axes,) of all rigid-body
    modes together; those of all modes of a model that nothing holds add up to its `mass`. `rigid`: each rigid-body
    mode in words, and `rigid_shapes` (r, n_nodes, dim) their shapes. `unknowns`: their number; `held`: number of
    contact rows that are held closed, by contact or tie. `time` of the state about which the model vibrates, None for
    the undeformed bodies. `sectors`: number of sectors of the ring of which the model is one, 0 without [[cyclic]]: all
    of them move alike in these modes, without nodal diameters, and only a motion along the axis has an effective mass.
    """

    frequencies: Floats
    shapes: Floats
    modal_masses: Floats
    effective_masses: Floats
    rigid: tuple[str, ...]
    rigid_shapes: Floats
    rigid_masses: Floats
    axes: str
    mass: float
    unknowns: int
    held: dict[str, int]
    time: float | None = None
    sectors: int = 0

    @property
    def count(self) -> int:
        """Number of all modes, rigid-body modes included."""
        return len(self.rigid) + len(self.frequencies)
