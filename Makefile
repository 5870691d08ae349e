# Every target makes its own environment in .venv first; nothing but python3 and make is needed beforehand.
#   make demo                      the main job, start to finish
#   make test PYTHON=python3.12    with another Python
#   make test VENV=.venv-other     in another environment
PYTHON ?= python3
VENV ?= .venv
WORKERS ?= 2

bootstrap = @$(PYTHON) tools/bootstrap.py --venv $(VENV)
python = $(VENV)/bin/python

.DEFAULT_GOAL := help
.PHONY: help setup setup-dev demo test test-computed test-slow test-learn test-viewer test-rl test-lerobot test-doors test-ray test-openpi test-gltf lint types format bench docs site clean clean-env

help: ## show this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 20

setup: ## install ArtiSkill and what the demo needs
	$(bootstrap)

setup-dev: ## install everything for working on ArtiSkill
	$(bootstrap) dev test

demo: ## open drawers and doors of unseen cabinets; reports, films and pages in results/demo
	$(bootstrap)
	$(VENV)/bin/artiskill demo

test: ## run the tests that take seconds
	$(bootstrap) test
	$(python) -m pytest -n $(WORKERS)

# what must be the same on every Python, and the command line above it
computed = $(addprefix tests/,contract assets geometry robots scene sim sensors tasks envs experts learning cli)
test-computed: ## run the part of the tests that is about what is computed, in half of the time
	$(bootstrap) test
	$(python) -m pytest $(computed) $(wildcard tests/test_*.py) -n $(WORKERS)

test-slow: ## run the tests that take minutes
	$(bootstrap) test
	$(python) -m pytest -n $(WORKERS) -m slow

test-learn: VENV = .venv-learn
test-learn: ## run the tests of learning, which need torch, in .venv-learn
	$(bootstrap) test-learn
	$(python) -m pytest tests/learning -n $(WORKERS)

test-viewer: VENV = .venv-viewer
test-viewer: ## drive the viewer in a headless Chromium, in .venv-viewer
	@command -v chromium chromium-browser google-chrome >/dev/null || { echo "test-viewer needs chromium on the path" >&2; exit 1; }
	$(bootstrap) test-viewer
	$(python) -m pytest tests/viewer tests/cli/test_view.py -m "slow or not slow"

test-rl: VENV = .venv-rl
test-rl: ## run the tests that need torch, TorchRL, Stable-Baselines3 or SBX, in .venv-rl
	$(bootstrap) test-rl
	$(python) -m pytest tests/envs tests/tasks tests/evaluation -n $(WORKERS) -m "slow or not slow" \
		-k "sb3 or torch or stable_baselines or example or record_video"
	$(python) -m pytest tests/learning/test_reinforcement.py tests/learning/test_expert_takeover.py -n $(WORKERS)

test-lerobot: VENV = .venv-lerobot
test-lerobot: ## let LeRobot read what is exported for it, and play our tasks, in .venv-lerobot
	$(bootstrap) test
	$(python) -m pip install torch==2.13.0
	$(python) -m pip install --no-deps lerobot==0.4.4 torchvision==0.23.0
	$(python) -m pip install "datasets<5" "huggingface-hub<0.36" "av<16" "packaging<26" draccus==0.10.0 jsonlines \
		deepdiff einops pandas opencv-python-headless termcolor accelerate pyserial "diffusers<0.36"
	$(python) -m pip install --no-deps plugins/lerobot_env_artiskill
	$(python) -m pytest tests/demos/test_lerobot_library.py tests/compat/test_lerobot_library.py -m slow

test-doors: VENV = .venv-doors
test-doors: ## let vla-eval play our tasks, in .venv-doors
	$(bootstrap) test vla
	$(python) -m pytest tests/compat/test_vla_eval.py

test-ray: VENV = .venv-ray
test-ray: ## run the tests that need a Ray cluster, of two nodes here, in .venv-ray
	$(bootstrap) distributed test
	$(python) -m pytest tests/jobs tests/demos/test_collect_ray.py tests/evaluation/test_cluster_ray.py -m "slow or not slow" -k ray

test-openpi: ## evaluate with openpi's own client and server, in .venv-openpi, without ArtiSkill
	$(bootstrap) test
	$(PYTHON) -m venv --without-pip .venv-openpi
	$(python) -m pip --python .venv-openpi/bin/python install openpi-client==0.1.2 openpi-server==0.1.0 typing_extensions
	OPENPI_PYTHON=.venv-openpi/bin/python $(python) -m pytest tests/evaluation/test_openpi.py

test-gltf: ## let Khronos' validator read every exported glTF; needs Node.js
	$(bootstrap) test
	npm install --no-audit --no-fund --no-save --prefix $(VENV) gltf-validator@2.0.0-dev.3.10
	$(python) -m pytest tests/exports -m "slow or not slow" -k "gltf or glb"

docs: ## build the documentation in build/docs; warnings are errors
	$(bootstrap) docs
	$(python) -m sphinx -W --keep-going -q -b html -d build/doctrees docs build/docs
	@echo "open build/docs/index.html"

site: ## build the documentation with the gallery of all objects and a film of each task in build/site
	$(bootstrap) docs
	$(python) tools/make_site.py build/site

lint: ## check style and layout
	$(bootstrap) dev
	$(python) -m ruff check .
	$(python) -m ruff format --check .

types: ## check types
	$(bootstrap) dev
	$(python) -m mypy

format: ## lay out the code and mend what can be mended
	$(bootstrap) dev
	$(python) -m ruff check --fix .
	$(python) -m ruff format .

bench: ## measure speed: every script in benchmarks/
	$(bootstrap) test
	@set -e; for script in benchmarks/*.py; do echo "== $$script"; $(python) "$$script"; done

clean: ## remove results and caches
	rm -rf results build dist .pytest_cache .mypy_cache .ruff_cache
	find src tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

clean-env: ## remove the environments too
	rm -rf $(VENV) .venv-learn .venv-viewer .venv-rl .venv-lerobot .venv-doors .venv-openpi .venv-ray
