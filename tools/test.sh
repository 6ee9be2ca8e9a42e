#!/usr/bin/env bash
# What `make test` runs: both environments are installed side by side, and the one that is there first compiles kernels;
# then linters run beside the tests, which the command that is given runs. Meanwhile the tests of several processes run,
# with the time that the others leave, since a rank that waits for another is busy. What linters and these tests print
# follows at the end. Where PETSc takes another user or system, they are skipped, and this is said.
set -euo pipefail

petsc=petsc
bash tools/system.sh petsc || { [ $? = 1 ] || exit 2; petsc=; }
make --no-print-directory -j 2 .venv/.packages $petsc
trap 'kill $(jobs -p) 2>/dev/null || true' EXIT # what still runs where an installation or the user ends this script
make --no-print-directory lint >.venv/lint.txt 2>&1 &
linters=$!
make --no-print-directory install

if [ "$petsc" ]; then
  LACMESH_ALL=1 OPENBLAS_NUM_THREADS=1 nice -n 15 .venv-petsc/bin/pytest -q -m "petsc and not slow" \
    tests/lacsolver/distributed >.venv-petsc/tests.txt 2>&1 &
  several=$!
fi

collect() { # Python compiles the tests here, once; otherwise each process that runs some would compile them all
  .venv/bin/pytest --collect-only -qq >.venv/tests.txt || { cat .venv/tests.txt && return 1; }
}
status=0
collect && env LACMESH_ALL=1 "$@" || status=$?

wait $linters || status=$?
echo "the linters, which ran meanwhile:"
cat .venv/lint.txt
if [ "$petsc" ]; then
  wait $several || status=$?
  echo "the tests of several processes, which ran meanwhile:"
  cat .venv-petsc/tests.txt
else
  echo "skipped: the tests marked petsc, for want of what the first lines name"
fi
exit $status
