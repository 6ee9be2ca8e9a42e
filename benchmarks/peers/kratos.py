"""The peers' problem for Kratos, run by a Python that has it: python -m benchmarks.peers.kratos N ANSWER.npz.

Dual mortar with an augmented Lagrangian, pairs searched by radius, Newton's method. Writes its input where it runs.
"""

from __future__ import annotations

import json
from pathlib import Path

import KratosMultiphysics as KM  # noqa: N817
import KratosMultiphysics.ContactStructuralMechanicsApplication as CSMA  # noqa: N817
import KratosMultiphysics.LinearSolversApplication
import numpy as np
from KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis import StructuralMechanicsAnalysis

from benchmarks.peers.problems import POISSON, answer

#: relative changes at which the search ends; the most iterations
TOLERANCE, LIMIT = 1e-9, 50
WHERE = "KratosMultiphysics"


def write(pair, path):
    """Write the mesh, a part for each body and for each side, and the materials."""
    nodes, elements, conditions, parts, first, materials = [], [], [], [], 1, []
    for k, (name, body) in enumerate(pair.bodies.items(), 1):
        nodes += [f"{first + i} {x:.17g} {y:.17g} 0" for i, (x, y) in enumerate(body.points)]
        at = len(elements)
        elements += [_row(at + i + 1, k, cell + first) for i, cell in enumerate(body.cells)]
        parts.append((name, range(first, first + len(body.points)), range(at + 1, len(elements) + 1), ()))
        for side, faces in body.sides.items():
            at = len(conditions)
            conditions += [_row(at + i + 1, k, face + first) for i, face in enumerate(faces)]
            parts.append((f"{name}_{side}", np.unique(faces) + first, (), range(at + 1, len(conditions) + 1)))
        first += len(body.points)
        values = {"YOUNG_MODULUS": body.young, "POISSON_RATIO": POISSON, "THICKNESS": 1.0}
        law = {"constitutive_law": {"name": "LinearElasticPlaneStrain2DLaw"}, "Variables": values, "Tables": {}}
        materials.append({"model_part_name": f"Structure.{name}", "properties_id": k, "Material": law})
    blocks = {"Properties 1": (), "Properties 2": (), "Nodes": nodes, "Elements SmallDisplacementElement2D4N": elements}
    text = "".join(_block(*block) for block in (blocks | {"Conditions LineLoadCondition2D2N": conditions}).items())
    for name, *rows in parts:
        three = zip(("Nodes", "Elements", "Conditions"), rows, strict=True)
        inside = (_block(f"SubModelPart{what}", own) for what, own in three)
        text += _block(f"SubModelPart {name}", "".join(inside).splitlines())
    path.with_suffix(".mdpa").write_text(text)
    path.with_suffix(".materials.json").write_text(json.dumps({"properties": materials}))


def _row(number, kind, nodes):
    return f"{number} {kind} {' '.join(map(str, nodes))}"


def _block(name, rows):
    return "\n".join([f"Begin {name}", *map(str, rows), f"End {name.split()[0]}", ""])


def settings(pair, path):
    """The project's parameters."""
    (slave,), (master,) = pair.named("slave"), pair.named("master")
    both = ("displacement", "residual")
    contact = {
        "model_part_name": "Structure",
        "contact_model_part": {"0": [f"{slave}_slave", f"{master}_master"]},
        "assume_master_slave": {"0": [f"{slave}_slave"]},
        "contact_type": "Frictionless",
        "search_parameters": {"type_search": "in_radius", "search_factor": 3.5},
    }
    alm = {"python_module": "alm_contact_process", "kratos_module": f"{WHERE}.ContactStructuralMechanicsApplication"}
    prescribed = []
    for side, axis, value in (*((*one, 0.0) for one in pair.supports), ("top", 1, pair.push)):
        for name in pair.named(side):
            where = {"model_part_name": f"Structure.{name}_{side}", "variable_name": "DISPLACEMENT"}
            where["constrained"] = [k == axis for k in range(3)]
            where["value"] = [value if k == axis else None for k in range(3)]
            module = {"python_module": "assign_vector_variable_process", "kratos_module": WHERE}
            prescribed.append(module | {"Parameters": where})
    solver = {"solver_type": "Static", "analysis_type": "non_linear", "model_part_name": "Structure", "domain_size": 2}
    solver |= {"time_stepping": {"time_step": 1.1}, "compute_reactions": True, "max_iteration": LIMIT, "echo_level": 0}
    solver |= {f"{word}_relative_tolerance": TOLERANCE for word in both}
    solver |= {f"{word}_absolute_tolerance": 1e-12 for word in both}
    solver |= {
        "model_import_settings": {"input_type": "mdpa", "input_filename": str(path)},
        "material_import_settings": {"materials_filename": str(path.with_suffix(".materials.json"))},
        "contact_settings": {"mortar_type": "ALMContactFrictionless", "fancy_convergence_criterion": False}
        | {f"contact_{word}_relative_tolerance": TOLERANCE for word in both},
        "convergence_criterion": "contact_residual_criterion",
        "linear_solver_settings": {"solver_type": "LinearSolversApplication.sparse_lu"},
        "rotation_dofs": False,
        "move_mesh_flag": True,  # small strains; but distant pairs are only found as the mesh moves
    }
    data = {"problem_name": "pair", "parallel_type": "OpenMP", "echo_level": 0, "start_time": 0.0, "end_time": 1.0}
    processes = {"conditions": prescribed, "contact": [alm | {"Parameters": contact}]}
    return {"problem_data": data, "solver_settings": solver, "processes": processes}


def solve(pair):
    """Solve a pair and return its results by name."""
    path, model = Path("pair"), KM.Model()
    write(pair, path)
    StructuralMechanicsAnalysis(model, KM.Parameters(json.dumps(settings(pair, path)))).Run()
    count = model["Structure"].ProcessInfo[KM.NL_ITERATION_NUMBER]
    if count >= LIMIT:
        raise RuntimeError(f"no equilibrium found in {LIMIT} iterations")
    nodes = model[f"Structure.{pair.named('slave')[0]}_slave"].Nodes
    p = [-node.GetValue(CSMA.AUGMENTED_NORMAL_CONTACT_PRESSURE) for node in nodes]
    top = sum(node.GetSolutionStepValue(KM.REACTION_Y) for node in model["Structure.upper_top"].Nodes)
    return {"iterations": count, "force": 2 * abs(top), "nodes": np.array([[node.X0 for node in nodes], p])}


if __name__ == "__main__":
    answer(solve)
