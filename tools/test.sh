#!/usr/bin/env bash
# The first half of `make test`: install both environments side by side, then run the linters and meanwhile the tests of
# several processes. Where PETSc takes another user or system, its tests are skipped, and this is said.
set -euo pipefail

petsc=petsc
bash tools/system.sh petsc || { [ $? = 1 ] || exit 2; petsc=; }
make --no-print-directory -j 2 install $petsc

lint() {
  make --no-print-directory lint
  # Python compiles the tests here, once; otherwise each process that runs some would compile them all
  .venv/bin/pytest --collect-only -qq >.venv/tests.txt || { cat .venv/tests.txt && return 1; }
}
lint &
linting=$!
status=0
if [ "$petsc" ]; then
  LACMESH_ALL=1 OPENBLAS_NUM_THREADS=1 .venv-petsc/bin/pytest -q -m "petsc and not slow" tests/lacsolver/distributed || status=$?
else
  echo "skipped: the tests marked petsc, for want of what the lines above name"
fi
wait $linting && exit $status
