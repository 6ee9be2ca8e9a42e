#!/usr/bin/env bash
# What `make test` runs: both environments are installed side by side, and the one that is there first compiles kernels;
# then the tests, by the command that is given. Meanwhile linters run, and after them the tests of several processes, with
# the time that the others leave, since a rank that waits for another is busy; what they print follows at the end. Where
# PETSc takes another user or system, these tests are skipped, and this is said.
set -euo pipefail

petsc=.venv-petsc
bash tools/system.sh petsc || { [ $? = 1 ] || exit 2; petsc=; }
make --no-print-directory -j 2 .venv/.packages $petsc

meanwhile() {
  local status=0
  make --no-print-directory lint || status=$?
  if [ "$petsc" ]; then
    LACMESH_ALL=1 OPENBLAS_NUM_THREADS=1 nice -n 15 .venv-petsc/bin/pytest -q -m "petsc and not slow" \
      tests/lacsolver/distributed || status=$?
  else
    echo "skipped: the tests marked petsc, for want of what the first lines name"
  fi
  return $status
}
meanwhile >.venv/meanwhile.txt 2>&1 &

collect() { # Python compiles the tests here, once; otherwise each process that runs some would compile them all
  .venv/bin/pytest --collect-only -qq >.venv/tests.txt || { cat .venv/tests.txt && return 1; }
}
status=0
make --no-print-directory .venv && collect && env LACMESH_ALL=1 "$@" || status=$?

wait $! || status=$?
echo "the linters, and the tests of several processes, which ran meanwhile:"
cat .venv/meanwhile.txt
exit $status
