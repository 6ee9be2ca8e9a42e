"""The peers' problems for Kratos, run by a Python that has it: python peer_kratos.py PAIR.npz ANSWER.npz.

Dual mortar with an augmented Lagrangian, pairs searched by radius, Newton's method. With friction the top goes down in
`PRESSES` steps and then aside in as many, as one step did not converge. Writes its input where it runs.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import KratosMultiphysics as KM  # noqa: N817
import KratosMultiphysics.ContactStructuralMechanicsApplication as CSMA  # noqa: N817
import KratosMultiphysics.LinearSolversApplication
import numpy as np
from KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis import StructuralMechanicsAnalysis
from peer_problems import PRESSES, load

#: relative changes at which the search ends; the most iterations
TOLERANCE, LIMIT, LIMIT_WITH_FRICTION = 1e-9, 50, 20
#: element, condition, law by dimension
KINDS = {
    2: ("SmallDisplacementElement2D4N", "LineLoadCondition2D2N", "LinearElasticPlaneStrain2DLaw"),
    3: ("SmallDisplacementElement3D8N", "SurfaceLoadCondition3D4N", "LinearElastic3DLaw"),
}
WHERE = "KratosMultiphysics"


def written(pair, path):
    """Write the mesh, a part for each body and for each side; where loads act they have conditions."""
    element, condition, _ = KINDS[pair.dim]
    nodes, elements, conditions, parts = [], [], [], []
    first = 1
    for k, (name, body) in enumerate(zip(("lower", "upper"), pair.bodies, strict=True), 1):
        points = np.column_stack([body.points, np.zeros((len(body.points), 3 - pair.dim))])
        nodes += [f"{first + i} {' '.join(f'{c:.17g}' for c in x)}" for i, x in enumerate(points)]
        at = len(elements)
        elements += [_row(at + i + 1, k, cell + first) for i, cell in enumerate(body.cells)]
        parts.append((name, np.arange(len(points)) + first, range(at + 1, len(elements) + 1), ()))
        for side, faces in body.sides.items():
            at = len(conditions)
            conditions += [_row(at + i + 1, k, face + first) for i, face in enumerate(faces)]
            parts.append((f"{name}_{side}", np.unique(faces) + first, (), range(at + 1, len(conditions) + 1)))
        first += len(points)
    blocks = [("Properties 1", ()), ("Properties 2", ()), ("Nodes", nodes), (f"Elements {element}", elements)]
    text = "".join(_block(name, rows) for name, rows in [*blocks, (f"Conditions {condition}", conditions)])
    for name, *held in parts:
        inside = (_block(f"SubModelPart{what}", held[i]) for i, what in enumerate(("Nodes", "Elements", "Conditions")))
        text += _block(f"SubModelPart {name}", "".join(inside).splitlines())
    path.with_suffix(".mdpa").write_text(text)


def _row(number, kind, nodes):
    return f"{number} {kind} {' '.join(map(str, nodes))}"


def _block(name, rows):
    return "\n".join([f"Begin {name}", *map(str, rows), f"End {name.split()[0]}", ""])


def settings(pair, path):
    """The project's parameters; materials are written beside the mesh."""
    law = {"name": KINDS[pair.dim][2]}
    materials = [
        {
            "model_part_name": f"Structure.{name}",
            "properties_id": k,
            "Material": {
                "constitutive_law": law,
                "Variables": {"YOUNG_MODULUS": body.young, "POISSON_RATIO": pair.poisson, "THICKNESS": 1.0},
                "Tables": {},
            },
        }
        for k, (name, body) in enumerate(zip(("lower", "upper"), pair.bodies, strict=True), 1)
    ]
    path.with_suffix(".materials.json").write_text(json.dumps({"properties": materials}))
    return {
        "problem_data": {
            **{"problem_name": "pair", "parallel_type": "OpenMP", "echo_level": 0, "start_time": 0.0},
            "end_time": 2.0 if pair.friction else 1.0,
        },
        "solver_settings": {
            **{"solver_type": "Static", "analysis_type": "non_linear", "model_part_name": "Structure", "echo_level": 0},
            **{
                "domain_size": pair.dim,
                "time_stepping": {"time_step": 1 / PRESSES if pair.friction else 1.1},
                "compute_reactions": True,
            },
            "model_import_settings": {"input_type": "mdpa", "input_filename": str(path)},
            "material_import_settings": {"materials_filename": str(path.with_suffix(".materials.json"))},
            "contact_settings": {
                "mortar_type": f"ALMContact{_kind(pair)}",
                "fancy_convergence_criterion": False,
                **{f"contact_{w}_relative_tolerance": TOLERANCE for w in ("displacement", "residual")},
            },
            "convergence_criterion": "contact_residual_criterion",
            **{f"{w}_relative_tolerance": TOLERANCE for w in ("displacement", "residual")},
            **{f"{w}_absolute_tolerance": 1e-12 for w in ("displacement", "residual")},
            "max_iteration": limit(pair),
            "linear_solver_settings": {"solver_type": "LinearSolversApplication.sparse_lu"},
            "rotation_dofs": False,
            "move_mesh_flag": bool(pair.push),  # small strains; but what is far apart is only found as it moves
        },
        "processes": {"conditions": conditions(pair), "contact": [contact(pair)]},
    }


def conditions(pair):
    """Processes that hold, push and load."""
    made = []
    prescribed = [(side, axis, 0.0) for side, axis in pair.held]
    if pair.friction:  # down until the time 1, then aside
        down, aside = f"{pair.push / 2!r}*(t+1-abs(t-1))", f"{pair.aside / 2!r}*(t-1+abs(t-1))"
        prescribed += [("top", 0, aside), ("top", 1, down)]
    elif pair.push:
        prescribed.append(("top", pair.dim - 1, pair.push))
    for side, axis, value in prescribed:
        for part in named(pair, side):
            on, amount = [k == axis for k in range(3)], [value if k == axis else None for k in range(3)]
            where = {"model_part_name": f"Structure.{part}", "variable_name": "DISPLACEMENT"}
            parameters = {**where, "constrained": on, "value": amount}
            made += [_process("assign_vector_variable_process", WHERE, parameters)]
    if pair.pressure:
        made.append(_process("assign_scalar_variable_to_conditions_process", WHERE, {
            "model_part_name": "Structure.upper_top", "variable_name": "POSITIVE_FACE_PRESSURE", "value": pair.pressure,
        }))  # fmt: skip
    return made


def contact(pair):
    """The process that finds pairs and integrates them."""
    (slave,), (master,) = named(pair, "slave"), named(pair, "master")
    return _process("alm_contact_process", f"{WHERE}.ContactStructuralMechanicsApplication", {
        "model_part_name": "Structure", "contact_model_part": {"0": [slave, master]},
        "assume_master_slave": {"0": [slave]}, "contact_type": _kind(pair),
        "friction_coefficients": {"0": pair.friction or 0.0},
        "search_parameters": {"type_search": "in_radius", "search_factor": 3.5},
    })  # fmt: skip


def limit(pair):
    """The most iterations of a step; with friction some steps do not reach the tolerance in any number."""
    return LIMIT_WITH_FRICTION if pair.friction else LIMIT


def _kind(pair):
    return "Frictional" if pair.friction else "Frictionless"


def named(pair, side):
    """The parts of a side."""
    return [f"{n}_{side}" for n, body in zip(("lower", "upper"), pair.bodies, strict=True) if side in body.sides]


def _process(module, where, parameters):
    return {"python_module": module, "kratos_module": where, "Parameters": parameters}


class Analysis(StructuralMechanicsAnalysis):
    """Kratos' own, which counts the iterations of its steps."""

    def FinalizeSolutionStep(self):
        """Keep the iterations of a step."""
        super().FinalizeSolutionStep()
        self.counts = [*getattr(self, "counts", []), self.model["Structure"].ProcessInfo[KM.NL_ITERATION_NUMBER]]


def solve(pair, path):
    """Solve a pair and return its results by name."""
    written(pair, path)
    model = KM.Model()
    run = Analysis(model, KM.Parameters(json.dumps(settings(pair, path))))
    run.Run()
    part = model["Structure"]
    unsolved = sum(count >= limit(pair) for count in run.counts)
    if unsolved and not pair.friction:
        raise RuntimeError(f"no equilibrium found in {LIMIT} iterations")
    count = sum(run.counts)
    out = {"iterations": count, "unsolved": unsolved}
    if pair.dim == 3:
        made = [e.CalculateOnIntegrationPoints(KM.CAUCHY_STRESS_VECTOR, part.ProcessInfo) for e in part.Elements]
        return out | {"stress": max(abs(s[2] + pair.pressure) for points in made for s in points)}
    nodes = model[f"Structure.{named(pair, 'slave')[0]}"].Nodes
    if pair.friction:
        t = [np.linalg.norm(node.GetValue(CSMA.AUGMENTED_TANGENT_CONTACT_PRESSURE)) for node in nodes]
        above = model["Structure.upper_top"].Nodes
        shear, force = (abs(sum(n.GetSolutionStepValue(v) for n in above)) for v in (KM.REACTION_X, KM.REACTION_Y))
        return out | {"force": force, "shear": shear, "nodes": np.array([[node.X0 for node in nodes], t])}
    p = [-node.GetValue(CSMA.AUGMENTED_NORMAL_CONTACT_PRESSURE) for node in nodes]
    top = sum(node.GetSolutionStepValue(KM.REACTION_Y) for node in model["Structure.upper_top"].Nodes)
    return out | {"force": 2 * abs(top), "nodes": np.array([[node.X0 for node in nodes], p])}


if __name__ == "__main__":
    np.savez(sys.argv[2], **solve(load(sys.argv[1]), Path("pair")))
