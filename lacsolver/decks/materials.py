"""Materials: cards of laws and their constants, orientations and sections, and the [[material]] records."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lacmesh.deck import key_of
from lacmesh.errors import on_page, some
from lacmesh.mesh import Floats, Ints
from lacsolver.case import CaseError, Material
from lacsolver.decks.cards import Card, DeckLine, Refused, look_up
from lacsolver.decks.import_ import MODELS, DeckMaterial, DeckSection, Import

_FINITE = {"elastic": "saint_venant_kirchhoff", "neo_hookean": "neo_hookean", "plastic": "plastic"}


def material(import_: Import, card: Card) -> None:
    """Begin a material."""
    name = card.needed("NAME")
    if key_of(name) in import_.materials:
        raise Refused(f"there are two materials named {name!r}; rename one")
    import_.materials[key_of(name)] = DeckMaterial(name, card)


def _without_law(import_: Import) -> dict[str, Any]:
    """Return the keys of the material begun last. Raises Refused if it has an elastic law."""
    if "law" in import_.material.keys:
        raise Refused("this material has an elastic law already; keep one")
    return import_.material.keys


def elastic(import_: Import, card: Card) -> None:
    """Take Young's modulus and Poisson's ratio, or the constants of three axes of symmetry."""
    keys = _without_law(import_)
    kind = card.word("TYPE", "ISOTROPIC")
    if kind in ("ISO", "ISOTROPIC"):
        row = card.single("Young's modulus and Poisson's ratio")
        keys |= {"law": "elastic", "young": row.number(0, "Young's modulus"), "poisson": row.number(1, "nu", 0.0)}
    else:
        keys |= {"law": "orthotropic", **_engineering_constants(card, kind)}


def hyperelastic(import_: Import, card: Card) -> None:
    """Take a neo-Hookean law; the other forms have no place in lacsolver."""
    if "NEOHOOKE" not in card.options:
        form = next((k for k in card.options if k not in ("N", "MODULI")), "MOONEY-RIVLIN")
        raise Refused(f"the hyperelastic law NEO HOOKE is supported, and {form} is not; fit NEO HOOKE to your data")
    keys = _without_law(import_)
    keys |= {"law": "neo_hookean", **rubber(card.single("C10 and D1"))}
    import_.warn(
        card,
        "the neo-Hookean law of lacsolver has the same moduli at small strains, and another energy of the change of "
        f"volume ({on_page('theory')}): results differ where the volume changes much",
    )


def plastic(import_: Import, card: Card) -> None:
    """Take the hardening of a metal that yields, isotropic by a table or kinematic by two lines."""
    keys = import_.material.keys
    if keys.get("law") != "elastic":
        raise Refused("it should follow an isotropic *ELASTIC of the same material")
    kind = card.word("HARDENING", "ISOTROPIC")
    if kind not in ("ISOTROPIC", "KINEMATIC"):
        raise Refused(f"hardening is ISOTROPIC or KINEMATIC in lacsolver, and not {kind}; fit one of these")
    rows = card.table("the yield stress", "the plastic strain", blank=0.0)
    check_rows(card, rows, lambda some: Material(law="plastic", young=1.0, poisson=0.0, hardening=some))
    keys["law"] = "plastic"
    if kind == "ISOTROPIC" or len(rows) == 1:
        keys["hardening"] = rows
        return
    (first, _), (second, strain), *rest = rows
    slope = (second - first) / strain
    if any(abs(first + slope * p - y) > 1e-6 * y for y, p in rest):
        raise Refused("kinematic hardening is linear in lacsolver; give two lines, with the mean slope", card.rows[2])
    keys |= {"hardening": [[first, 0.0]], "kinematic": slope}
    if slope and not rest:
        import_.note(card, "kinematic hardening goes on beyond its last line with the same slope")


def check_rows(card: Card, rows: list[list[float]], make: Callable[[list[list[float]]], object]) -> None:
    """Raise Refused with what a record of a case finds wrong in a table, at the first line with which it does."""

    def wrong(some_rows: list[list[float]]) -> str:
        try:
            make(some_rows)
        except CaseError as error:
            return error.problems[0].message
        return ""

    if message := wrong(rows):
        count = next(n for n in range(1, len(rows) + 1) if wrong(rows[:n]) == message)
        raise Refused(f"it {message.partition(' ')[2]}", card.rows[count - 1])


def density(import_: Import, card: Card) -> None:
    """Take the density of a material."""
    import_.material.keys["density"] = card.single("the density").number(0, "the density")


def expansion(import_: Import, card: Card) -> None:
    """Take thermal expansion, one number or one for each axis; ZERO has no effect on constant expansion."""
    kind = card.word("TYPE", "ISO")
    count = {"ISO": 1, "ORTHO": 3}.get(kind, 0)
    if not count:
        raise Refused(f"expansion of type {kind} is not supported; give ISO, or ORTHO with an orthotropic material")
    values = card.single("the expansion").numbers(0, count, "the expansion")
    import_.material.keys["expansion"] = values[0] if count == 1 else values


def damping(import_: Import, card: Card) -> None:
    """Take the Rayleigh damping of a material: ALPHA times its mass, BETA times its stiffness."""
    import_.material.damping = (card.number("ALPHA", 0.0), card.number("BETA", 0.0))


def orientation(import_: Import, card: Card) -> None:
    """Take the axes of an orientation, two points in the plane of axes 1 and 2."""
    if card.word("SYSTEM", "RECTANGULAR") not in ("RECTANGULAR", "R"):
        raise Refused("only rectangular orientations are taken; give the axes of each part as SYSTEM=RECTANGULAR")
    if len(card.rows) > 1:
        raise Refused("an orientation that is rotated about an axis is not supported; give its axes", card.rows[1])
    numbers = card.first("two points").numbers(0, 6, "a coordinate")
    import_.orientations[key_of(card.needed("NAME"))] = (tuple(numbers[:3]), tuple(numbers[3:]))


def section(import_: Import, card: Card) -> None:
    """Take the material, orientation and thickness of an element set."""
    if key_of(card.needed("ELSET")) in import_.couplers:
        import_.note(card, "elements of a *DISTRIBUTING COUPLING have no material")
        return
    name, cells = import_.names.cells(card.needed("ELSET"), None)
    thickness = card.rows[0].number(0, "the thickness", 1.0) if card.rows else 1.0
    if not thickness > 0:
        raise Refused(f"the thickness should be positive, not {thickness:g}", card.rows[0])
    made = DeckSection(name, cells, card.needed("MATERIAL"), card.options.get("ORIENTATION", ""), thickness, card)
    import_.sections.append(made)


#: places in the 21 constants of anisotropy (upper triangle of the stiffness, column by column) of the 9 of orthotropy
_ORTHOTROPIC = (0, 1, 2, 3, 4, 5, 9, 14, 20)
#: how many constants each type of orthotropic or anisotropic *ELASTIC has
_CONSTANTS = {"ENGINEERINGCONSTANTS": 9, "ORTHO": 9, "ORTHOTROPIC": 9, "ANISO": 21, "ANISOTROPIC": 21}


def _engineering_constants(card: Card, kind: str) -> dict[str, Any]:
    """Return young, poisson and shear of an orthotropic *ELASTIC. Raises Refused.

    ENGINEERING CONSTANTS are E1, E2, E3, nu12, nu13, nu23, G12, G13, G23; ORTHO is D1111, D1122, D2222, D1133, D2233,
    D3333, D1212, D1313, D2323; ANISO is the upper triangle of the stiffness, column by column.
    """
    count = _CONSTANTS.get(kind, 0)
    if not count:
        raise Refused(f"elasticity of type {kind} is not supported; ISO, ORTHO and ENGINEERING CONSTANTS are")
    fields = [(row, k) for row in card.rows for k in range(len(row.fields))]
    if not count <= len(fields) <= count + 1:
        raise Refused(f"it should list {count} constants for one temperature, and lists {len(fields)}")
    values = [row.number(k, "a constant") for row, k in fields[:count]]
    if count == 21:
        if any(value for k, value in enumerate(values) if k not in _ORTHOTROPIC):
            raise Refused(
                "lacsolver has materials with three axes of symmetry, and this one couples shear and stretch in its "
                "axes; give its axes in *ORIENTATION if it has such, and ENGINEERING CONSTANTS"
            )
        values = [values[k] for k in _ORTHOTROPIC]
    if kind == "ENGINEERINGCONSTANTS":
        return {"young": values[:3], "poisson": values[3:6], "shear": values[6:]}
    return _from_stiffness(values)


def _from_stiffness(values: list[float]) -> dict[str, Any]:
    """Return the engineering constants of the nine of a stiffness. Raises Refused if it is singular."""
    d11, d12, d22, d13, d23, d33 = values[:6]
    D = np.array([[d11, d12, d13], [d12, d22, d23], [d13, d23, d33]])
    if not np.linalg.eigvalsh(D)[0] > 1e-14 * np.abs(D).max():
        raise Refused("its stiffness is not positive definite: its strain energy could be below 0")
    S = np.linalg.inv(D)
    young = 1 / np.diag(S)
    poisson = [-S[0, 1] * young[0], -S[0, 2] * young[0], -S[1, 2] * young[1]]
    return {"young": young.tolist(), "poisson": [float(nu) for nu in poisson], "shear": values[6:]}


def rubber(row: DeckLine) -> dict[str, float]:
    """Return young and poisson of C10 and D1, which are half the shear modulus and two over the bulk modulus.

    D1 = 0 means incompressible in Abaqus, and a Poisson's ratio of 0.475 in CalculiX. Raises Refused for it.

    >>> {k: round(v, 12) for k, v in rubber(DeckLine(("0.5", "1.0"), "", 1)).items()}
    {'young': 2.571428571429, 'poisson': 0.285714285714}
    """
    c10, d1 = row.number(0, "C10"), row.number(1, "D1", 0.0)
    if not (c10 > 0 and d1 > 0):
        raise Refused(
            "C10 and D1 should be positive; a D1 of 0 (no compression) is for mixed elements, so give one", row
        )
    shear, bulk = 2 * c10, 2 / d1
    total = 3 * bulk + shear
    return {"young": 9 * bulk * shear / total, "poisson": (3 * bulk - 2 * shear) / (2 * total)}


# ---- records


def top(import_: Import) -> None:
    """Set the model, the thickness and the kinematics. Raises Refused."""
    if import_.dim != 3 and import_.names.mesh.plane not in MODELS:
        message = "its elements are of several plane kinds, or of none: lacsolver has one of CPS, CPE, CAX in a model"
        raise Refused(message, None, Card.from_deck(next(import_.names.deck.named("ELEMENT"))))
    import_.top["model"] = import_.model
    if import_.model.startswith("plane"):
        import_.top["thickness"] = _thickness(import_)
    if import_.large:
        import_.top["kinematics"] = "finite"


def _thickness(import_: Import) -> float | dict[str, float]:
    """Return the thickness of the sections, or that of a group of cells for each that they have."""
    thickness = np.zeros(import_.names.mesh.n_cells)
    for one in import_.sections:
        thickness[one.cells] = one.thickness
    values = np.unique(thickness[thickness > 0]).tolist()
    if len(values) < 2:
        return values[0] if values else 1.0
    out = {}
    for value in values:
        names = [one.name for one in import_.sections if one.thickness == value]
        name = names[0] if len(names) == 1 else "thick"
        out[import_.groups.add("cells", name, np.flatnonzero(thickness == value))] = value
    return out


def materials(import_: Import) -> None:
    """Add a [[material]] for each material, orientation and initial temperature. Raises Refused."""
    mesh = import_.names.mesh
    solid = np.flatnonzero(mesh.cell_dim == mesh.dim)
    section_of = np.full(mesh.n_cells, -1)
    for k, one in enumerate(import_.sections):
        section_of[one.cells] = k
    if (bare := solid[section_of[solid] < 0]).size:
        raise Refused(f"elements {some(mesh.cell_number[bare])} have no *SOLID SECTION; give them one")
    kinds = [_kind(import_, one) for one in import_.sections]
    start = initial_temperatures(import_)
    laws = {kind: k for k, kind in enumerate(dict.fromkeys(kinds))}
    law_of = np.array([laws[kind] for kind in kinds])[section_of[solid]]
    temperature, which = np.unique(start[solid], return_inverse=True)
    both = law_of * len(temperature) + which.ravel()
    for code in np.unique(both).tolist():
        law, T = list(laws)[code // len(temperature)], float(temperature[code % len(temperature)])
        cells = solid[both == code]
        keys = _material_keys(import_, import_.materials[law[0]], law[1], T)
        if len(cells) < len(solid):
            first = import_.sections[int(section_of[cells[0]])]
            name = first.name if np.array_equal(cells, first.cells) else import_.materials[law[0]].name
            keys = {"groups": [import_.groups.add("cells", name, cells)]} | keys
        import_.add("material", keys, import_.materials[law[0]].card)


def _kind(import_: Import, section: DeckSection) -> tuple[str, str]:
    """Return the keys of the material and the orientation of a section. Raises Refused."""
    key = look_up(import_.materials, section.material, "*MATERIAL")
    axes = look_up(import_.orientations, section.axes, "*ORIENTATION") if section.axes else ""
    return key, axes if import_.materials[key].keys.get("law") == "orthotropic" else ""


def _material_keys(import_: Import, material: DeckMaterial, axes: str, T: float) -> dict[str, Any]:
    """Return the keys of a material. Raises Refused for a law that its kinematics do not have."""
    keys, called = dict(material.keys), f"material {material.name}"
    law = keys.get("law")
    if law is None:
        raise Refused(f"{called} has no *ELASTIC and no *HYPERELASTIC; give it one")
    if import_.large and law not in _FINITE:
        raise Refused(f"{called} is orthotropic, which lacsolver supports for small displacements only; remove NLGEOM")
    if not import_.large and law == "neo_hookean":
        raise Refused(f"{called} is hyperelastic, which lacsolver supports for finite displacements only; add NLGEOM")
    if import_.large and law == "elastic":
        import_.note(
            material.card,
            f"with NLGEOM {called} has the law saint_venant_kirchhoff, as in CalculiX: it is meant for "
            "small strains, and crushed to less than 0.577 of its length its force falls; neo_hookean does not",
        )
    keys["law"] = _FINITE[law] if import_.large else law
    if law == "orthotropic":
        keys["axes"] = import_.orientations.get(axes, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    elif isinstance(keys.get("expansion"), list):
        raise Refused(f"{called} is isotropic and has an expansion for each axis; give one")
    if keys.get("expansion") and T:
        keys["reference_temperature"] = T
    return keys


def initial_temperatures(import_: Import) -> Floats:
    """Return the initial temperature (n_cells,) of each cell; 0 where no cell expands. Raises Refused."""
    mesh = import_.names.mesh
    nodal, lines = np.zeros(mesh.n_nodes), [one for one in import_.lines("temperature") if one.step < 0]
    for line in lines:
        nodal[line.items] = line.value
    out = np.zeros(mesh.n_cells)
    for _, cells, nodes in mesh.select(expanding(import_)) if lines else ():
        T = nodal[nodes]
        uneven = (T[:, :1] != T).any(axis=1)
        if uneven.any():
            raise Refused(
                f"the nodes of elements {some(mesh.cell_number[cells[uneven]])} have several initial temperatures, and "
                "an element has one in lacsolver",
                lines[-1].row,
            )
        out[cells] = T[:, 0]
    return out


def expanding(import_: Import) -> Ints:
    """Return the cells (k,) whose material expands."""
    return np.flatnonzero(import_.of_cells("expansion"))
