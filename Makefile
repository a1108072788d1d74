# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Everything a developer runs. Needs make and a Python 3.13 or 3.11; the rest goes into .venv by itself.

VENV ?= .venv
VERSIONS ?= 3.13 3.11
PY = $(VENV)/bin/python

# The second Blender, 4.5 LTS, has an environment of its own.
LTS_VENV = .venv-4.5
LTS_VERSIONS = 3.11

export PYTHON
# Two cores and a process each: threads of products of matrices would only wait for one another.
export OPENBLAS_NUM_THREADS = 1
# What Python compiles, asserts of tests among it, is kept, wherever that is forbidden beside the sources: collecting took
# 14 s of each process of a run, and takes 4; tests start many others.
unexport PYTHONDONTWRITEBYTECODE
export PYTHONPYCACHEPREFIX = $(CURDIR)/out/pycache

.PHONY: help environment environment-lts demo results collect test quick test-lts lint build bench docs-images clean
.DEFAULT_GOAL := help

help:
	@echo 'make demo         a forest of eighty trees, in some minutes: out/demo/{cycles,eevee,top}.png, demo.blend, stats.json'
	@echo 'make results      the figures and tables of the paper, made anew: docs/results.md, docs/images, out/paper'
	@echo 'make test         all tests that need no full Blender, on bpy'
	@echo 'make quick        the tests that took little time when they were last run, in about a minute'
	@echo 'make test-lts     tests of what depends on the version of Blender, on Blender 4.5 LTS'
	@echo 'make lint         style, the rules of the house and of documents, and near-copies'
	@echo 'make build        the extension for Blender: dist/tetflora-VERSION.zip'
	@echo 'make bench        benchmarks against their targets'
	@echo 'make docs-images  the pictures of the documentation, made anew; goes on where it was stopped'
	@echo 'make clean        removes environments and everything that was made'
	@echo
	@echo 'PYTHON=/path/to/python3.13 chooses the Python; otherwise 3.13 or 3.11 is looked for in PATH and pyenv.'
	@echo 'Set BLENDER=/path/to/blender and run .ci/run for the tests in a full Blender.'

environment: $(VENV)/.ready

environment-lts:
	@$(MAKE) --no-print-directory environment VENV='$(LTS_VENV)' VERSIONS='$(LTS_VERSIONS)'

$(VENV)/.ready: pyproject.toml devtools/environment.py
	@python=$$(sh devtools/find_python.sh $(VERSIONS)) && "$$python" -m devtools.environment $(VENV)

demo: environment
	$(PY) -m examples.demo --out out/demo

results: environment
	$(PY) -m examples.paper

# Two runs: the first never has Blender in its process, as the engine should not need it.
# The second also runs when the first has failed. A file's tests share scenes, so each file is one process's; the files
# that take longest begin.
BY_FILE = --dist loadfile --no-loadscope-reorder
ENGINE_TESTS = tests/attack/engine tests/engine/emission tests/engine
# What arrays have held is kept for the next ones: a tenth of the time went into pages that were given back in between.
# Not of Blender's tests, some of which look at what the process has.
KEEPING = MALLOC_TRIM_THRESHOLD_=268435456 MALLOC_MMAP_THRESHOLD_=33554432

BLENDER_TESTS = tests/examples tests/attack/blender tests/packaging tests/blender

test: environment
	@code=0; \
	$(KEEPING) $(PY) -m pytest -q -n 2 $(BY_FILE) $(ENGINE_TESTS) || code=1; \
	$(PY) -m pytest -q -n 2 $(BY_FILE) $(BLENDER_TESTS) || code=1; \
	exit $$code

# What both processes of each run do first, once for both.
collect: environment
	@$(PY) -m pytest -qq --collect-only $(ENGINE_TESTS) && $(PY) -m pytest -qq --collect-only $(BLENDER_TESTS)

# While editing: what has not taken long in the last run, of the rules, the engine and the add-on. About a minute.
quick: environment
	@code=0; \
	$(PY) -m devtools.house || code=1; \
	$(KEEPING) $(PY) -m pytest -q -n 2 $(BY_FILE) --quick $(ENGINE_TESTS) || code=1; \
	$(PY) -m pytest -q -n 2 $(BY_FILE) --quick $(BLENDER_TESTS) || code=1; \
	exit $$code

# On 4.5 again: what depends on Blender's version. That is rendering, materials, nodes, files, undo, handlers,
# properties, packaging, and each button once (operators/test_undo.py). It is not where plants stand, nor what a
# refinement makes of them: both are numpy on numbers that Blender gives. Of the engine, what plants are, branch by
# branch and polygon by polygon, which has to come out the same on every Python and numpy.
LTS_ENGINE_TESTS = $(addprefix tests/engine/,growth/test_growth.py growth/test_hashing.py subplants/test_copies.py \
	subplants/test_pieces.py emission/test_emission.py)
LTS_LEFT_OUT = placing biomes geodata stands species test_asset_trees.py test_full_disk.py test_manual.py \
	$(addprefix job/test_,cycles.py far.py first_look.py forecast.py frame_cache.py long_animation.py view_cells.py) \
	$(addprefix scene/test_,field_sizes.py plant_ages.py year.py)
# What pictures of results come to is a question of these, not of Blender: that Cycles takes velocities, and that both
# engines show what was baked, are tests of their own.
LTS_DESELECTED = scene/test_wind.py::test_a_picture_with_motion_blur_is_the_mean_of_pictures_while_the_shutter_is_open \
	job/test_refine.py::test_the_refined_picture_is_that_of_the_plants \
	materials/test_snow.py::test_a_crown_of_facets_is_as_white_as_its_leaves \
	$(addprefix results/test_baked_light.py::,test_baked_proxies_are_as_bright_as_lit_ones \
	test_baked_pictures_have_next_to_no_noise)
# Baked light leaves nothing of proxies; that of real leaves is the same attributes on other meshes.
LTS_DESELECTED += results/test_baked_light.py::test_clear_and_esc_leave_nothing_of_baked_light[ALL-
# EEVEE of 4.5 compiles each material for longer than all the rest takes. It draws one of each kind of proxy, baked
# light, and instances; nodes of bark and blades give there what they give in Cycles.
LTS_DESELECTED += materials/test_blade.py::test_the_mean_is_the_same_in_eevee \
	materials/test_materials.py::test_bark_keeps_the_mean_color[ridged-EEVEE] \
	results/test_cluster_meshes.py::test_clusters_of_a_mesh_look_like_it[BLENDER_EEVEE_NEXT]
# USD of 4.5 is written and read, and its checker finds no fault; what is left of a file is a question of Python.
LTS_DESELECTED += $(addprefix export/test_export_usd.py::,test_a_full_disk_leaves_no_half_file \
	test_closing_the_steps_leaves_no_half_file test_recorded_sizes_come_back_bit_by_bit \
	test_single_plants_and_instances_keep_their_seeds)
# That data has gone is told alike whatever it was; here it goes by undo, with the file, the scene, all else, the results.
LTS_DESELECTED += $(addprefix job/test_gone.py::test_a_job_whose_data_goes_says_so_and_leaves_nothing[,\
	clear keep camera plant mesh leaf view)
LTS_BLENDER_TESTS = tests/blender $(addprefix tests/packaging/test_,installed.py session.py) $(addprefix --ignore=tests/blender/,$(LTS_LEFT_OUT)) \
	$(addprefix --deselect=tests/blender/,$(LTS_DESELECTED))

test-lts:
	@$(MAKE) --no-print-directory test VENV='$(LTS_VENV)' VERSIONS='$(LTS_VERSIONS)' ENGINE_TESTS='$(LTS_ENGINE_TESTS)' \
		BLENDER_TESTS='$(LTS_BLENDER_TESTS)'

lint: environment
	@code=0; \
	$(PY) -m ruff check . || code=1; \
	$(PY) -m ruff format --check . || code=1; \
	$(PY) -m devtools.house || code=1; \
	$(PY) -m devtools.readability || code=1; \
	$(PY) -m devtools.duplicates tests benchmarks examples devtools farm || code=1; \
	exit $$code

build: environment
	$(PY) -m devtools.build

bench: environment
	$(PY) -m benchmarks all

docs-images: environment
	$(PY) -m examples.docs_images
	$(PY) -m devtools.window_pictures
	$(PY) -m devtools.tutorials

clean:
	rm -rf $(VENV) $(LTS_VENV) out dist .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
