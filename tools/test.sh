#!/usr/bin/env bash
# What `make test` runs: install both environments side by side, then compile kernels beside the linters, then run the
# tests by the command that is given. Meanwhile the tests of several processes run, with the time that the others leave,
# since a rank that waits for another is busy; what they print follows at the end. Where PETSc takes another user or
# system, they are skipped, and this is said.
set -euo pipefail

petsc=petsc
bash tools/system.sh petsc || { [ $? = 1 ] || exit 2; petsc=; }
make --no-print-directory -j 2 install lint $petsc

if [ "$petsc" ]; then
  several=.venv-petsc/tests.txt
  LACMESH_ALL=1 OPENBLAS_NUM_THREADS=1 nice -n 15 .venv-petsc/bin/pytest -q -m "petsc and not slow" \
    tests/lacsolver/distributed >$several 2>&1 &
fi

collect() { # Python compiles the tests here, once; otherwise each process that runs some would compile them all
  .venv/bin/pytest --collect-only -qq >.venv/tests.txt || { cat .venv/tests.txt && return 1; }
}
status=0
collect && env LACMESH_ALL=1 "$@" || status=$?

if [ "$petsc" ]; then
  wait $! || status=$?
  echo "the tests of several processes, which ran meanwhile:"
  cat $several
else
  echo "skipped: the tests marked petsc, for want of what the first lines name"
fi
exit $status
