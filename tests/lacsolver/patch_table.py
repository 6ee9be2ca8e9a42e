"""The worst figures of every family of patch tests, as a table: python -m tests.lacsolver.patch_table [FAMILY]."""

from __future__ import annotations

import sys

from tests import skips
from tests.lacsolver.patch_cases import TWINS, Figures, cases, figures, shared_case, shared_rows, twin


def rows(chosen=""):
    """(family, label, figures) of every test of the families that have `chosen` in their names."""
    for case in cases():
        if chosen in case.family:
            yield case.family, case.label, figures(case.make())
    for name in TWINS:
        if chosen in "twins of code_aster's":
            yield "twins of code_aster's", name, figures(twin(name))
    folder = skips.shared_folder() / "reference"
    for name, row in shared_rows(folder).items() if not skips.absence("shared") else ():
        if chosen in "code_aster's meshes":
            yield "code_aster's meshes", name, figures(shared_case(row, folder))


def main(chosen=""):
    """Print the worst of each family."""
    worst, count = {}, {}
    for family, _, found in rows(chosen):
        worst[family] = worst.get(family, found).worst(found)
        count[family] = count.get(family, 0) + 1
    print(f"{'family':44s} {'tests':>5s} " + " ".join(f"{name:>12s}" for name in Figures._fields))
    for family, found in worst.items():
        print(f"{family:44s} {count[family]:5d} " + " ".join(f"{value:12.1e}" for value in found))


if __name__ == "__main__":
    main(*sys.argv[1:])
