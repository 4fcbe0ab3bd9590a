# make demo: simulate a drive, extract its features, make a page.   make demo LOG=path: of your log.
# make test: what is checked before each commit.                    make bench: the README's figures.
# make test-all: what takes longer, besides.                        make lines: what there is to read.
# make docs: the site of the documents, in build/site.
PYTHON ?= python3
BIN := .venv/$(if $(filter Windows_NT,$(OS)),Scripts,bin)

PYTEST = pytest -n auto --dist worksteal

.PHONY: demo test test-all slow boundscheck kernels library docs lint house types tests coverage wheel bench pictures mutants results lines browser ros1 clean

# Where no library fits, numba compiles the two largest kernels side by side.
demo: .venv/base
	@$(BIN)/lineament warmup --quiet -m liu:paper & $(BIN)/lineament demo $(if $(LOG),"$(LOG)") -o demo

test: lint types tests

test-all: bench-check wheel slow coverage boundscheck kernels docs

# What a demo needs; and what the checks need besides.
.venv/base: requirements-base.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "lineament needs Python 3.11 or newer, this is " + sys.version.split()[0] + "; name one by make PYTHON=...")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --no-compile --require-hashes -r requirements-base.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

.venv/ready: requirements.lock lab/pyproject.toml .venv/base
	$(BIN)/python -m pip install --quiet --no-compile --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable lab
	@touch $@

lint: .venv/ready
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/lint-imports --no-cache
	$(BIN)/python benchmarks/house.py --check

# The picture of the house in CONTRIBUTING, from the real imports.
house: .venv/ready
	$(BIN)/python benchmarks/house.py

types: .venv/ready
	$(BIN)/mypy

# The tests of the page of `lineament view` drive a browser; without one they skip, and say so.
browser:
	@(command -v chromium && command -v chromedriver) >/dev/null || if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; \
	then apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium chromium-driver >/dev/null; \
	else echo "no chromium: the tests of the page will be skipped"; fi

# The tests of ROS 1 run against Debian's own; without it they skip, and say so.
ROS1 := rospy rosmaster sensor-msgs nav-msgs std-srvs visualization-msgs diagnostic-msgs tf2-msgs
ros1:
	@dpkg -s $(ROS1:%=python3-%) >/dev/null 2>&1 || { [ "$$(id -u)" = 0 ] && apt-get update -qq && \
	apt-get install -y -qq --no-install-recommends $(ROS1:%=python3-%) >/dev/null; } || echo "no ROS 1: its tests will be skipped"

# The kernels as a library for this machine; where they change, numba compiles them until this is made.
library: .venv/ready
	@command -v cc >/dev/null || $(BIN)/python -m pip install --quiet ziglang
	$(BIN)/python building/compile.py

tests: library browser ros1
	$(BIN)/python -m $(PYTEST) -m 'not slow' --durations=5

slow: library browser ros1
	$(BIN)/python -m $(PYTEST) -m slow --durations=5

# Of all lines by the quick tests; of the kernels', as plain Python, by these.
OF_KERNELS := $(addprefix tests/test_,$(addsuffix .py,twins budget line_rules liu pdbs polylines \
	optimal_partition optimal_scenes methods tracking tracking_motion mapping_parts locating_parts \
	scan_consistency))
coverage: library
	rm -f .coverage .coverage.*
	$(BIN)/coverage run -m $(PYTEST) -m 'not slow'
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run -m $(PYTEST) -m 'not slow' $(OF_KERNELS)
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report --fail-under=95 --skip-covered

# No kernel reads or writes outside of its arrays: with checked indices.
boundscheck: .venv/ready
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=build/boundscheck $(BIN)/python -m $(PYTEST) \
	tests/test_kernel_range.py tests/test_optimal_properties.py tests/test_twins.py tests/test_polylines.py tests/test_budget.py

# The library, numba and Python find the same: the first two in every byte.
kernels: library
	NUMBA_CACHE_DIR=build/kernels $(BIN)/python tests/same_kernels.py

# The site of the documents, with its tutorials run; what it needs is installed when it is first made.
.venv/docs: requirements-docs.lock .venv/ready
	$(BIN)/python -m pip install --quiet --no-compile --require-hashes -r requirements-docs.lock
	@touch $@

docs: .venv/docs library
	$(BIN)/python benchmarks/site.py
	@echo "the site is in build/site: open build/site/index.html"

# The wheel has the compiled kernels, and runs in an environment that has nothing else. It is for this machine's
# level of the CPU; that for all is made by `make wheel LEVELS=`.
LEVELS ?= native
wheel: library
	rm -rf dist build/empty
	LINEAMENT_LEVELS=$(LEVELS) $(BIN)/python -m build --no-isolation --quiet --sdist --wheel
	$(PYTHON) -m venv build/empty
	sed -n 's/ *\\$$//; /^[a-z].*==/p' requirements.lock > build/constraints.txt
	build/empty/$(notdir $(BIN))/python -m pip install --quiet --constraint build/constraints.txt dist/lineament-*-py3-none-*.whl
	build/empty/$(notdir $(BIN))/python benchmarks/installed.py
	cd build/empty && $(notdir $(BIN))/lineament demo --quiet -o demo && ls demo
	LINEAMENT_LEVELS=$(LEVELS) $(BIN)/python -m build --no-isolation --quiet --wheel -o dist lab
	build/empty/$(notdir $(BIN))/python -m pip install --quiet --constraint build/constraints.txt dist/lineament_lab-*.whl
	cd build/empty && $(notdir $(BIN))/lineament compare demo/drive.npz -o rivals.html --quiet && ls rivals.html

# The first minutes of a new user, from the built wheel in an empty environment: each step, and its time.
.PHONY: new-user
new-user: library
	rm -rf dist
	$(BIN)/python -m build --no-isolation --quiet --wheel
	$(BIN)/python benchmarks/new_user.py dist/lineament-*-py3-none-*.whl

# Do the tests fail when the code is wrong? A quarter of an hour for each area on two cores.
mutants: .venv/ready
	$(BIN)/python benchmarks/mutants.py $(AREA:%=--area %) --seed 1

bench: .venv/ready
	$(BIN)/python benchmarks/speed.py

# Counts the work of the kernels over fixed scans: is it that of the counts stored?
.PHONY: bench-check
bench-check: .venv/ready
	$(BIN)/python benchmarks/work.py

# Draws recorded scans (LINEAMENT_DATA) and the stages of each, to be looked at.
pictures: .venv/ready
	$(BIN)/python benchmarks/contact_sheet.py -o build/pictures

# Measures the tables of docs/results.md and of the README again, in a quarter of an hour.
results: .venv/ready
	$(BIN)/python benchmarks/results.py

# Lines of source and of tests, by folder.
lines:
	@for top in src/lineament lab/src/lineament_lab tests; do git ls-files "$$top/*.py" "$$top/*.js" "$$top/*.css" "$$top/*.html" | xargs wc -l | \
	awk -v top="$$top" '$$2 != "total" { sub(top "/", "", $$2); n = split($$2, at, "/"); folder = n > 1 ? at[1] "/" : "."; of[folder] += $$1; all += $$1 } \
	END { for (folder in of) printf "%7d  %s/%s\n", of[folder], top, folder | "sort -rn"; close("sort -rn"); printf "%7d  %s in all\n\n", all, top }'; done

clean:
	rm -rf .venv dist build demo .coverage .coverage.*
	find src \( -name '*.nb[ic]' -o -name '*.so' -o -name '*.sha256' \) -delete
