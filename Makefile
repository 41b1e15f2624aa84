# Needs make, Python 3.11 or newer with venv, and (for `make test`) Node.js 20 or newer with npm. Everything else is installed here.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
OUT    := out
DATA   ?= $(HOME)/garmentc-data
MOTION := examples/motions/step_turn_raise.npz

INSTALLED      := $(VENV)/installed.stamp
TEST_INSTALLED := $(VENV)/installed-test.stamp
ENGINES        := tests/engines/node_modules/installed.stamp

.PHONY: install demo pictures test conformance check bench body data ablations clean
.DEFAULT_GOAL := install

install: $(INSTALLED)

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "garmentc needs Python 3.11 or newer; set PYTHON=")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25"

$(INSTALLED): pyproject.toml $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

# torch is pinned to the release that the networks were trained with, and only tests and training need it. The first
# simulation on a machine compiles Newton's kernels, for two or three minutes.
$(TEST_INSTALLED): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --editable ".[test,body,simulate,distributed]" "torch==2.13.0" "tensorboardX>=2.6"
	touch $@

$(ENGINES): tests/engines/package-lock.json
	cd tests/engines && npm ci --no-audit --no-fund
	touch $@

# Compiles the example outfits with the example motion, and draws one: a contact sheet, and a page to open in a browser.
demo: $(INSTALLED)
	mkdir -p $(OUT)
	$(BIN)/garmentc compile examples/tee_and_skirt.obj --motion $(MOTION) -o $(OUT)/tee_and_skirt.glb
	$(BIN)/garmentc compile examples/tee_and_trousers.obj --motion $(MOTION) -o $(OUT)/tee_and_trousers.glb
	$(BIN)/garmentc preview $(OUT)/tee_and_skirt.glb -o $(OUT)/tee_and_skirt.png
	$(BIN)/garmentc preview $(OUT)/tee_and_skirt.glb -o $(OUT)/tee_and_skirt.html

# Draws the README's pictures anew. Needs Chromium (`CHROMIUM=` its command). Make conformance draws docs/engines.png.
CHROMIUM ?= chromium

pictures: demo $(ENGINES)
	$(BIN)/garmentc preview $(OUT)/tee_and_skirt.glb --views front,side --size 380 -o docs/outfits.png
	cd tests/engines && CHROMIUM=$$(command -v $(CHROMIUM)) node open_page.mjs ../../$(OUT)/tee_and_skirt.html \
		viewer_picture.js ../../docs/viewer.png

test: $(TEST_INSTALLED) $(ENGINES)
	$(BIN)/python -m pytest

# Asks every engine where it puts the vertices of some ninety files, and writes docs/engines.md. Needs Chromium
# (`CHROMIUM=` its command); Blender and Filament are installed into an environment of their own. Some five CPU minutes.
ENGINE_PYTHON    := $(VENV)/engines/bin/python
ENGINE_INSTALLED := $(VENV)/engines/installed.stamp

$(ENGINE_INSTALLED): tests/engines/requirements.txt $(BIN)/python
	$(BIN)/python -m venv $(VENV)/engines
	$(ENGINE_PYTHON) -m pip install --quiet -r $<
	touch $@

conformance: $(TEST_INSTALLED) $(ENGINES) $(ENGINE_INSTALLED)
	PYTHONPATH=tests $(BIN)/python -m conformance --python $(ENGINE_PYTHON)

check: $(TEST_INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy garmentc

# Markdown tables of compile time and memory, of the OBJ reader's throughput, and of sizes beside other packers'.
bench: $(TEST_INSTALLED) $(ENGINES)
	$(BIN)/python -m tests.benchmarks.bench_compile
	$(BIN)/python -m tests.benchmarks.bench_obj
	$(BIN)/python -m tests.benchmarks.bench_size

# Builds the default body anew from its CC0 source, byte for byte as it is in the repository.
body: $(TEST_INSTALLED)
	$(BIN)/python -m garmentc.smpl.build_body

# Some 5 CPU hours and 400 MB; may be stopped at any time and goes on where it was.
data: $(INSTALLED)
	$(BIN)/python -m pip install --quiet --editable ".[simulate]"
	$(BIN)/garmentc simulate --preset benchmark-v1 --out $(DATA)/benchmark-v1
	$(BIN)/garmentc simulate --preset wardrobe-v1 --seed 1 --out $(DATA)/wardrobe-v1
	$(BIN)/garmentc simulate --preset wardrobe-v2 --seed 2 --out $(DATA)/wardrobe-v2
	$(BIN)/garmentc simulate --preset tshirt --out $(DATA)/tshirt

# Trains every variant of DeePSD that the paper compares, and writes docs/ablations.md. Some 90 CPU minutes, after `make data`.
ablations: $(TEST_INSTALLED)
	PYTHONPATH=tests $(BIN)/python -m ablations --data $(DATA)/benchmark-v1 --runs $(DATA)/ablations

clean:
	rm -rf $(OUT) $(VENV) tests/engines/node_modules
