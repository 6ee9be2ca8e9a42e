"""Small models that move in a process that finds nothing compiled: all kernels run as they stand."""

from __future__ import annotations

import pytest

from lacmesh.kernels import Kernel
from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.lacsolver.contact_cases import HEAD, JOINT, MATERIAL, held
from tests.lacsolver.finite_cases import text
from tests.lacsolver.patch_meshes import stack

FRICTION = JOINT + "friction = 0.3\n"
SMOOTHED = JOINT + 'geometry = "current"\nnormals = "smoothed"\n'
PRESSED = held("bottom", ux=0.0, uy=0.0, uz=0.0) + held("top", ux=0.01, uy=0.0, uz=-0.01)


@pytest.mark.parametrize("case", [text(FRICTION + PRESSED), HEAD.format(model="3d") + MATERIAL + SMOOTHED + PRESSED])
def test_nothing_is_compiled_for_a_small_model(monkeypatch, case):
    """To compile the loop of the contact's derivative takes seconds, the whole run as it stands less."""

    def compiled(kernel):
        raise AssertionError(f"{kernel.__name__} is compiled")

    monkeypatch.setattr(Kernel, "_is_kept", property(lambda _: False))
    monkeypatch.setattr(Kernel, "compile", compiled)
    for kernel in Kernel.known:  # by an earlier test
        monkeypatch.setattr(kernel, "compiled", None)
    monkeypatch.setattr("lacmesh.kernels.save", lambda *_: None)
    *_, state = march(Problem.of(parse_case(case), stack("HEXA8", "HEXA8", 3, counts=(3, 2))))
    assert state.iterations < 10 and (state.zones[0].pressure > 0).any()
