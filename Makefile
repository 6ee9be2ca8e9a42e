# Everything starts here, and installs what it needs: `make demo`, `make test`, in any order (CONTRIBUTING.md).
# `make .venv` and `make .venv-petsc` install alone: the packages with their tools, and PETSc with MPI.

SHELL := /bin/bash
# what Python compiled of a module is kept for the hundreds of processes that the tests start
unexport PYTHONDONTWRITEBYTECODE
# where a virtual environment has its programs: elsewhere on Windows
BIN := .venv/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
# the packages alone, which linters need, and with them the compiled kernels
PACKAGES := .venv/.packages
INSTALLED := .venv/.installed
# PETSc and MPI, with the older numpy that Debian's PETSc needs
PETSC := .venv-petsc
# pip compiles nothing: it would take all modules, most of a minute; Python compiles those that are imported, a third
# three processes on two cores, since tests wait for programs that they start; each has one thread of OpenBLAS
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 3 --dist worksteal
# what `make test QUICK=1` runs: of every package what notices most in the least time, a minute of one core in all
QUICK_TESTS := \
  $(addprefix tests/test_,cells.py cut.py recognition.py orientation.py mesh.py targets.py topology.py cli.py) \
  $(addprefix tests/partition/test_,store.py) \
  $(addprefix tests/checks/test_,check.py) \
  $(addprefix tests/formats/test_,exodus.py) \
  $(addprefix tests/surface/test_,kernels.py) \
  $(addprefix tests/smooth/test_,shapes.py) \
  $(addprefix tests/lacsolver/test_,case_values.py case_read.py constraints.py assemble.py schur.py equilibrium.py \
    contact_held.py friction_laws.py) \
  $(addprefix tests/lacsolver/distributed/test_,launch.py) \
  $(addprefix tests/verification/test_,measures.py)

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test verify bench docs lint wheel clean

help:
	@awk -F ':.*## ' '/^[a-z]+:.*## /{printf "make %-7s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

demo: $(INSTALLED) ## cut data/two_blocks.msh as a user would, press the blocks together, and draw both
	@mkdir -p build
	$(BIN)/lacmesh cut data/two_blocks.msh --slave slave -o build/two_blocks.lac.msh --force
	$(BIN)/lacmesh info build/two_blocks.lac.msh
	$(BIN)/python data/draw_two_blocks.py build/two_blocks.lac.msh build/two_blocks.lac.png
	$(BIN)/lacsolver run data/two_blocks.toml -o build/two_blocks --force --plot build/two_blocks_pressure.png
	@echo
	@echo "The cut mesh is build/two_blocks.lac.msh (gmsh opens it), its picture build/two_blocks.lac.png."
	@echo "The results are in build/two_blocks (ParaView opens the .pvd), their picture is build/two_blocks_pressure.png."

# a skip for want of a package is an error
test: $(if $(QUICK)$(NOISE),$(INSTALLED),.venv/.system-tests) ## linters, and every test but the slow ones; QUICK=1: a choice in a minute; NOISE=1: with last bits of other processors
ifdef QUICK
	$(PYTEST) -q -m "not slow" $(QUICK_TESTS)
else ifdef NOISE
	for seed in 1 2 3; do NOISE_SEED=$$seed $(PYTEST) -q -m "not petsc and not slow" || exit 1; done
else
	@bash tools/test.sh $(PYTEST) -m "not petsc and not slow"
endif

# two hours on two free cores; it goes on if stopped
verify: $(INSTALLED) .venv/.system-tests ## the slow tests, then cases with known solutions and a report of them; FUZZ=1: 10,000 damaged files of each format instead
ifdef FUZZ
	LACMESH_FUZZ=1 $(PYTEST) -q -m fuzz
else
	LACMESH_ALL=1 $(PYTEST) -q -m "slow and not petsc"
	[ ! -x $(PETSC)/bin/pytest ] || $(PETSC)/bin/pytest -q -m "slow and petsc" tests/lacsolver/distributed
	$(BIN)/python -m verification run --suite full --resume -o build/verification-full
endif

bench: $(INSTALLED) ## measure speed and memory
	for name in start cut quality surface contact moving large peers.compare; do OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.$$name || exit 1; done

docs: $(INSTALLED) ## the pages as a site for a browser, in build/site, with figures, pictures and films made again; SITE=1: the site alone
	@$(BIN)/python -c 'import furo, myst_parser' 2>/dev/null || $(BIN)/pip install --quiet --disable-pip-version-check -e '.[docs]'
	$(BIN)/python docs/make.py $(if $(SITE),site,figures pictures films tutorials site)

lint: $(PACKAGES) ## style, types, import layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	@$(BIN)/lint-imports --no-cache > .venv/imports.txt || { cat .venv/imports.txt; exit 1; }; tail -n 2 .venv/imports.txt

wheel: $(INSTALLED) ## the wheel and the source distribution, in dist/; IMAGE=1: a container image `lacmesh` with the wheel as well
	rm -f dist/lacmesh-*
	$(BIN)/python -m build --no-isolation --outdir dist
	$(if $(IMAGE),$$(command -v docker || command -v podman || echo docker) build --tag lacmesh --file packaging/Dockerfile .)

clean: ## remove .venv, build and every cache
	rm -rf .venv $(PETSC) build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +

# ---- installed once, and again after a change of what they name

.venv: $(INSTALLED)
$(PETSC): $(PETSC)/.installed

.venv/.system: tools/system.sh tools/python.sh
	@bash tools/system.sh
	@mkdir -p .venv && touch $@

.venv/.system-tests: tools/system.sh
	@bash tools/system.sh tests
	@mkdir -p .venv && touch $@

$(PACKAGES): pyproject.toml .venv/.system
	@python=$$(bash tools/python.sh) && $$python -m venv .venv
	@echo "installing lacmesh and its tools into .venv (some 300 MB to fetch the first time)"
	@$(BIN)/pip install --quiet --no-compile --disable-pip-version-check -e '.[dev]'
	@touch $@

$(INSTALLED): $(PACKAGES)
	@$(BIN)/lacmesh compile
	@touch $@

# runs on several processes (docs/install_petsc.md); Debian's PETSc needs an older numpy, so an environment of its own
$(PETSC)/.installed: pyproject.toml tools/system.sh tools/python.sh
	@bash tools/system.sh petsc
	@python=$$(bash tools/python.sh) && $$python -m venv $(PETSC)
	@echo "installing lacsolver with PETSc into $(PETSC) (some 100 MB to fetch the first time)"
	@$(PETSC)/bin/pip install --quiet --no-compile --disable-pip-version-check -e '.[petsc,multigrid]' pytest hypothesis
	@$(PETSC)/bin/lacmesh compile
	@touch $@
