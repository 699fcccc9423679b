# make demo   plan a shelf problem and look at it      make test   everything that is tested      make docs   the pages
# The only thing needed beforehand: Python >= 3.11 (PYTHON=python3.12 make demo picks one).
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help

VENV ?= .venv
BIN := $(VENV)/bin
PYTHON ?= $(firstword $(foreach p,python3 python3.13 python3.12 python3.11,$(shell $(p) -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && echo $(p))))
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --quiet --constraint constraints.txt
RUN := $(VENV)/.run-stamp
TEST := $(VENV)/.test-stamp
DEV := $(VENV)/.dev-stamp
DOCS := $(VENV)/.docs-stamp
TOOLS := $(VENV)/.tools-stamp
CORE := $(VENV)/.core-stamp
DEMO_PROBLEM ?= 02_shelf
PORT ?= 7000
# Without CasADi, whose libraries no sanitizer lets in, and without meshes, which a process of little memory reads.
SANITIZED := tests/core/test_convex.py tests/control/behaviour/test_native.py $(addprefix tests/planners/,common/test_continuous_collision.py \
  sampling/test_local_searches.py behaviour/test_moving_obstacles.py $(addprefix trajopt/,program/test_native_sqp.py \
  program/test_native_step.py test_planner.py test_coarse_descents.py))
BUILD_TOOLS := 'cmake>=3.18,<5' 'ninja>=1.11,<2' 'nanobind>=2.4,<4'
CPP = $(shell find optiplan/_core/src tests/core -name '*.[ch]pp')
export OMP_NUM_THREADS ?= 1
unexport PYTHONDONTWRITEBYTECODE  # four workers and all that they start would compile the same files

.PHONY: help demo core environment browser compiler test test-again coverage sanitize bench-smoke docs lint format tidy core-tests clean

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 18

demo: $(RUN) $(CORE) ## plan a shelf problem, print the report, serve the viewer (DEMO_EXIT=1 writes demo/*.html and ends)
	$(BIN)/optiplan plan $(DEMO_PROBLEM) --out demo/run
ifeq ($(DEMO_EXIT),1)
	$(BIN)/optiplan view demo/run --export demo/view.html
	@echo '<!doctype html><meta http-equiv="refresh" content="0; url=view.html#t=0.4&amp;paused">' > demo/screenshot.html
	@echo "demo/view.html plays in any browser; demo/screenshot.html stands still at 0.4 s, ready for a picture"
else
	$(BIN)/optiplan view demo/run --port $(PORT)
endif

core: $(RUN) ## build the native core into the checkout (needs a C++ compiler; planners work without, slower)
	@rm -f $(CORE)
	@$(MAKE) --no-print-directory $(CORE)

# One installation instead of one for each extra, and beside it what needs no library: make -j3 environment
# Of 16,000 modules the tests import a third, by which those are compiled: pip compiles none.
environment: $(VENV)/.environment-stamp $(CORE) browser ## all that test, lint and docs need (-j3: at the same time)

$(VENV)/.environment-stamp: pyproject.toml constraints.txt | $(TOOLS)
	@echo "installing optiplan, its libraries and what tests, linters and pages need"
	$(PIP) --no-compile --editable '.[test,dev,docs]'
	@$(BIN)/python -m compileall -q optiplan
	@touch $(RUN) && touch $(TEST) $(DEV) $(DOCS) $@

# Much of the tests' time is waiting for processes and pages: more workers than two hardware threads fill it.
TESTED = $(BIN)/python -m pytest -n $${TEST_WORKERS:-4} --dist loadfile --no-loadscope-reorder
test: $(TEST) $(CORE) ## every test
	$(TESTED)

test-again: ## what failed in the last `make test`, one after another and with nothing beside it
	$(BIN)/python -m pytest -rA --last-failed --last-failed-no-failures none --maxfail 1 -p no:xdist

coverage: $(TEST) $(CORE) ## every test, a quarter slower, with the gate of 90 % of lines (96 % of them are run)
	$(TESTED) --cov=optiplan --cov-report=term:skip-covered --cov-fail-under=90

docs: $(DOCS) ## the documentation as a site, site/index.html; a warning is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "site/index.html is the front page; $(BIN)/mkdocs serve shows changes at once"

sanitize: $(TEST) $(CORE) ## the native core under the sanitizers for memory and undefined behaviour (needs g++; some minutes)
	@rm -rf build/sanitize && mkdir -p build/sanitize
	$${CXX:-c++} -std=c++17 -O1 -g -Wall -Wextra -ffp-contract=off -fsanitize=address,undefined -fno-sanitize-recover=all \
	  -Ioptiplan/_core/src tests/core/convex_check.cpp optiplan/_core/src/convex/*.cpp -o build/sanitize/convex_check
	build/sanitize/convex_check $${ROUNDS:-20}
	PATH="$(abspath $(BIN)):$$PATH" cmake -S . -B build/sanitize/core-tests -G Ninja --log-level=NOTICE -DOPTIPLAN_CORE_TESTS=ON \
	  -DCMAKE_CXX_FLAGS="-g -fsanitize=address,undefined -fno-sanitize-recover=all"
	PATH="$(abspath $(BIN)):$$PATH" cmake --build build/sanitize/core-tests -- --quiet
	build/sanitize/core-tests/core_tests
	cp -r CMakeLists.txt pyproject.toml optiplan tests benchmarks robots problems control build/sanitize/
	rm -rf build/sanitize/optiplan/_core/in_place
	PATH="$(abspath $(BIN)):$$PATH" cmake -S build/sanitize -B build/sanitize/core -G Ninja --log-level=NOTICE -DOPTIPLAN_IN_PLACE=ON \
	  -DOPTIPLAN_VARIANTS=base -DCMAKE_CXX_FLAGS="-g -fsanitize=address,undefined -fno-sanitize-recover=all" \
	  -DPython_EXECUTABLE="$(abspath $(BIN))/python"
	PATH="$(abspath $(BIN)):$$PATH" cmake --build build/sanitize/core -- --quiet
	cd build/sanitize && ASAN_OPTIONS=detect_leaks=0 OPTIPLAN_CORE=base \
	  LD_PRELOAD="$$($${CXX:-c++} -print-file-name=libasan.so) $$($${CXX:-c++} -print-file-name=libstdc++.so)" \
	  "$(abspath $(BIN))/python" -m pytest -q -p no:xdist -p no:cacheprovider $(SANITIZED)

bench-smoke: $(RUN) $(CORE) ## how quick this machine is, as multiples of 10,000 distances of coal (a minute)
	$(BIN)/python benchmarks/smoke.py

lint: $(DEV) ## ruff, mypy --strict, clang-format, and the prose of pages and docstrings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/clang-format --dry-run --Werror $(CPP)
	$(BIN)/proselint check --config docs/proselint.json README.md CONTRIBUTING.md docs benchmarks
	$(BIN)/python docs/prose.py

format: $(DEV) ## let ruff and clang-format lay out the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/clang-format -i $(CPP)

core-tests: $(TEST) $(CORE) ## the unit tests of the core's C++, tests/core/cpp, one file for each of its files
	$(BIN)/python -m pytest -q -p no:xdist tests/core/test_cpp.py

tidy: $(DEV) $(CORE) ## clang-tidy over the native core (two minutes of a core)
	find optiplan/_core/src -name '*.cpp' -print0 | xargs -0 -n 1 -P "$$(nproc)" $(BIN)/clang-tidy -p build/core --quiet

clean: ## remove what make has made
	rm -rf $(VENV) build dist demo site *.egg-info .coverage* optiplan/_core/in_place
	find optiplan -name __pycache__ -prune -exec rm -rf {} +

$(BIN)/python:
	@if [ -z "$(PYTHON)" ]; then echo "Python >= 3.11 is needed; name one with PYTHON=/path/to/python" >&2; exit 1; fi
	@echo "making $(VENV) with $$($(PYTHON) --version)"
	@if ! $(PYTHON) -m venv $(VENV); then \
	  rm -rf $(VENV); \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    apt-get update -qq && apt-get install -y -qq python3-venv && $(PYTHON) -m venv $(VENV); \
	  else echo "$(PYTHON) has no working venv module (on Debian: apt-get install python3-venv)" >&2; exit 1; fi; fi

$(RUN): pyproject.toml constraints.txt | $(BIN)/python $(TOOLS)  # one pip at a time, also with -j
	@echo "installing optiplan and its libraries (about 300 MB the first time)"
	$(PIP) --editable .
	@$(BIN)/python -m compileall -q optiplan  # as pip does for a wheel: else the first start, or each, compiles 300 files
	@touch $@

compiler: | $(BIN)/python
	@if ! command -v $${CXX:-c++} >/dev/null && [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	   echo "installing a C++ compiler"; \
	   apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends g++ || true; fi

$(TOOLS): | $(BIN)/python
	$(PIP) $(BUILD_TOOLS)
	@touch $@

# With a compiler, or with root rights to install one; without, a line says so and planners run in Python.
$(CORE): $(shell find optiplan/_core/src -type f) CMakeLists.txt | compiler $(TOOLS)
	@if ! command -v $${CXX:-c++} >/dev/null; then \
	   echo "no C++ compiler: planners run on their reference path in Python, which is slower" >&2; \
	 else \
	   echo "building the native core (less than a minute)"; \
	   export PATH="$(abspath $(BIN)):$$PATH"; \
	   cmake -S . -B build/core -G Ninja -DOPTIPLAN_IN_PLACE=ON -DPython_EXECUTABLE="$(abspath $(BIN))/python" \
	     --log-level=NOTICE && env -u MAKEFLAGS cmake --build build/core -- --quiet || \
	   echo "the native core could not be built: planners run on their reference path in Python" >&2; fi
	@touch $@

browser: | compiler
	@if command -v chromium-headless-shell chromium chromium-browser google-chrome >/dev/null; then :; \
	 elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	   apt-get update -qq && for browser in chromium-headless-shell chromium; do \
	     DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $$browser && break; done; \
	 else echo "no chromium found: the browser tests will be skipped (on Debian: apt-get install chromium)" >&2; fi

$(TEST): $(RUN) | browser
	$(PIP) --editable '.[test]'
	@touch $@

$(DEV): $(RUN)
	$(PIP) --editable '.[dev]'
	@touch $@

$(DOCS): $(RUN)
	$(PIP) --editable '.[docs]'
	@touch $@
