# The README's commands. `make demo` and `make test` set up what they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
APT := apt-get install -y -qq --no-install-recommends
AS_ROOT := $(shell if [ "$$(id -u)" = 0 ]; then echo run; elif command -v sudo >/dev/null; then echo sudo; else echo none; fi)
DEMO := demo

.PHONY: setup browser demo test bench schemas pictures lint clean

setup: $(VENV)/.installed
	@$(call ensure,$(BIN)/framepairs doctor --json >/dev/null 2>&1,libllvm19 libatomic1)
	@$(BIN)/framepairs doctor --json >/dev/null

$(VENV)/.installed: pyproject.toml
	@$(call ensure,$(PYTHON) -c 'import ensurepip$(,)venv',python3-venv)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[test]'
	@touch $@

# $(call ensure,CHECK,DEBIAN PACKAGES): installs the packages where the check fails and apt can, else says the line to type.
define ensure
$(1) || { \
  case "$(AS_ROOT)-$$(command -v apt-get)" in \
    none-*|*-) echo "Please install: $(2)   (Debian, Ubuntu: apt-get install $(2))" >&2; exit 1;; \
    run-*) apt-get update -qq && DEBIAN_FRONTEND=noninteractive $(APT) $(2);; \
    *) sudo apt-get update -qq && sudo DEBIAN_FRONTEND=noninteractive $(APT) $(2);; \
  esac; } >/dev/null
endef
, := ,

browser: setup
	@$(call ensure,command -v chromium || command -v chromium-browser || command -v google-chrome,chromium)

demo: setup
	$(BIN)/framepairs render market --display 960x540 --scale 2 --scale 3 --channels all --out $(DEMO)
	$(BIN)/framepairs validate $(DEMO)
	$(BIN)/framepairs preview $(DEMO)
	$(BIN)/framepairs upscale $(DEMO) --method bicubic --method accumulate --method temporal --method guided_temporal --out $(DEMO)-upscaled

test: setup
	$(BIN)/ruff check generator tests scenes
	$(BIN)/python -m pytest

# What some benchmarks take here: their defaults would make an hour of it.
SHORT_camera_sampler := --count 1
SHORT_split_sum := $(VENV)/split_sum.svg 128
SHORT_steady := 100
SHORT_textures := 240 135

bench: setup
	@set -e; $(foreach file,$(sort $(wildcard tests/benchmarks/bench_*.py)),$(BIN)/python $(file) $(SHORT_$(patsubst bench_%.py,%,$(notdir $(file))));)

schemas: setup
	$(BIN)/python -m framepairs.schemas

pictures: setup
	$(BIN)/python -m framepairs.pictures

lint: setup
	$(BIN)/ruff check --fix generator tests scenes

clean:
	rm -rf $(VENV) $(DEMO) $(DEMO)-preview $(DEMO)-upscaled
