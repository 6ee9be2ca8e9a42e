#!/usr/bin/env bash
# Install what pip cannot bring, where it is missing: Python's venv, the libraries that gmsh loads, an off-screen
# renderer for pictures; with the argument `tests`, the browser and the solver that tests run; with the argument `petsc`
# PETSc and MPI instead, for which only Python 3.12 and later has a wheel. On Debian and Ubuntu, as root; anyone else is
# told the one command to run, and the status is 1.
set -euo pipefail

if [ "$(uname)" != Linux ]; then
  [ "${1:-}" = petsc ] || exit 0
  echo "PETSc is installed by these tools on Linux only; docs/install_petsc.md has other ways." >&2
  exit 1
fi
known=$(PATH=$PATH:/sbin:/usr/sbin ldconfig -p)
missing=()
need() { # a package, and the library or libraries, any of which will do
  local package=$1 library
  shift
  for library in "$@"; do
    [[ $known == *"$library "* ]] && return
  done
  missing+=("$package")
}

python=$(bash tools/python.sh || true)
[ -n "$python" ] || missing+=(python3 python3-venv)
if [ -n "$python" ] && ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
  missing+=("$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')")
fi
libraries() {
  need libglu1-mesa libGLU.so.1
  need libgl1 libGL.so.1
  need libxrender1 libXrender.so.1
  need libxcursor1 libXcursor.so.1
  need libxft2 libXft.so.2
  need libxinerama1 libXinerama.so.1
  need libgomp1 libgomp.so.1
  need libegl1 libEGL.so.1 libOSMesa.so.8
}
programs() {
  command -v chromium >/dev/null || missing+=(chromium)
  command -v ccx >/dev/null || missing+=(calculix-ccx)
}
petsc() {
  local wheel='import platform, sys; sys.exit(sys.version_info < (3, 12) or platform.machine() != "x86_64")'
  if [ -n "$python" ] && "$python" -c "$wheel"; then return; fi
  compgen -G '/usr/lib/petscdir/petsc3*/*-real/lib/python3/dist-packages/petsc4py' >/dev/null || missing+=(python3-petsc4py)
  command -v mpiexec >/dev/null || missing+=(openmpi-bin)
}
case "${1:-}" in
  petsc) petsc ;;
  tests) libraries && programs ;;
  *) libraries ;;
esac

[ ${#missing[@]} -gt 0 ] || exit 0
if ! command -v apt-get >/dev/null; then
  echo "Missing, under the names that Debian gives them: ${missing[*]}. Install them and run make again." >&2
  exit 1
fi
if [ "$(id -u)" != 0 ]; then
  echo "Some packages of the system are missing. Run this once, then make again:" >&2
  echo "  sudo sh -c 'apt-get update && apt-get install -y --no-install-recommends ${missing[*]}'" >&2
  exit 1
fi
export DEBIAN_FRONTEND=noninteractive
apt-get -q update
apt-get -q install -y --no-install-recommends "${missing[@]}"
