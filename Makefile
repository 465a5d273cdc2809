# What a person types. Needs a Rust toolchain and Python 3.11 or newer; all else is put in .venv.
.DEFAULT_GOAL := help
.PHONY: help demo reproduce benchmark test soak studies fuzz fuzz-guided fuzz-rust fuzz-c fuzz-built fuzz-replay fuzz-corpus lint lint-rust lint-python rust-test no-std python-test rust-checks coverage bench docs links crate-docs architecture pictures notices c-library c-package c-header c-header-test sentences public-names release-check clean

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WHEELS := target/wheels
# Of the fuzzers: seed, calls of the API, files read, cases of each property, where their table goes.
SEED ?= 1
CALLS ?= 20000
FILES ?= 4000
CASES ?= 2048
TABLE ?= target/tries.md
LOOP ?= 10
# Of the guided fuzzers: executions of all targets together, of which each has so many hundredths.
RUNS ?= 300000
CLANG ?= clang
FUZZED := checkpoints=30 texts=45 controllers=10 stages=4 inverses=6
FUZZED_C := library=5
# What `cargo fuzz` gives rustc, without a sanitizer: counters of edges, and comparisons, which a
# fuzzer solves. With a target named, build scripts have none of it.
COUNTERS := -Cpasses=sancov-module $(addprefix -Cllvm-args=-sanitizer-coverage-,level=4 inline-8bit-counters pc-table trace-compares) --cfg fuzzing
# Of `make coverage`: an environment, wheel and crates of its own.
COVERAGE := target/coverage
# A Cortex-M4F.
EMBEDDED := thumbv7em-none-eabihf
SOURCES := $(shell find rust python/piezotrack -name '*.rs' -o -name '*.py' -o -name '*.pyi' -o -name '*.json' -o -name '*.css' -o -name '*.html' -o -name '*.js' -o -name '*.svg' -o -name '*.gz' -o -name '*.c' -o -name '*.h' -o -name '*.ld' -o -name Makefile -o -name README.md -o -name Cargo.toml | grep -v rust/capi) benches/Cargo.toml Cargo.toml Cargo.lock pyproject.toml

help: ## What can be typed
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/  make \1\t\2/'

demo: $(VENV)/installed ## Build, then from a measured log to a model, its test and a tracked reference
	$(BIN)/piezotrack demo --out demo --overwrite

reproduce: $(VENV)/installed ## Every figure and table of the paper, published beside obtained
	$(BIN)/piezotrack reproduce --out report --overwrite

benchmark: $(VENV)/installed ## Every model on every record, and the page of it
	$(BIN)/piezotrack benchmark --out benchmark --overwrite
	$(BIN)/python docs/make_benchmark.py benchmark

# What takes one core goes beside what cargo compiles, which takes one of its folders for itself.
# Not by -j: cargo would ask make for leave to use the cores. What runs in the background does not
# hear Ctrl-C, and is ended.
BESIDE = sh -c '$$1 & first=$$!; trap "kill $$first; exit 130" INT TERM; $$2; second=$$?; wait $$first && exit $$second' beside
SUB = $(MAKE) --no-print-directory

test: $(VENV)/pip ## Everything that must hold before a change lands
	@$(BESIDE) '$(SUB) $(VENV)/tools' '$(SUB) $(WHEELS)/built'
	@$(SUB) $(VENV)/installed
	@$(BESIDE) '$(SUB) lint-python no-std c-header-test' '$(SUB) rust-checks'
	@$(SUB) python-test

rust-checks: lint-rust rust-test c-library

soak: fuzz fuzz-replay ## The tests that take long: fuzzers, properties, examples, searches with full budgets
	PROPTEST_CASES=$(CASES) PROPTEST_RNG_SEED=$(SEED) cargo test --locked --release -p piezotrack-core --test properties
	$(BIN)/pytest -n auto --dist worksteal -m "slow and not study" --ignore=tests/soak

studies: $(VENV)/installed $(VENV)/tools ## Rates over many records: coverage of intervals, choices, false alarms; half an hour
	$(BIN)/pytest -n auto --dist worksteal -m study

fuzz: $(VENV)/installed $(VENV)/tools ## The fuzzers, with their table of tries and failures: SEED=7 CALLS=1000000 FILES=100000
	$(BIN)/pytest -n auto --dist worksteal -m slow tests/soak --soak-seed=$(SEED) --soak-calls=$(CALLS) --soak-files=$(FILES) --soak-table=$(TABLE) --soak-loop=$(LOOP)

fuzz-guided: fuzz-rust fuzz-c ## Fuzzers that coverage guides, of the crates and of the C library: RUNS=10000000

# New inputs are kept in target/fuzz/corpus, finds in tests/fuzz/finds.
FUZZ = for one in $(1); do \
		target=$${one%=*}; share=$${one\#*=}; \
		new=target/fuzz/corpus/$$target; kept=tests/fuzz/corpus/$$target; finds=tests/fuzz/finds/$$target; \
		mkdir -p $$new $$kept $$finds; \
		echo "$$target, $$(($(RUNS) * share / 100)) runs"; \
		$$built/$$target -runs=$$(($(RUNS) * share / 100)) -max_len=400 -len_control=20 -timeout=60 -verbosity=0 -print_final_stats=1 \
			-artifact_prefix=$$finds/ $$new $$kept 2> target/fuzz/$$target.log \
			|| { tail -n 40 target/fuzz/$$target.log; exit 1; }; \
		grep -E '^stat::(number_of_executed|average_exec)' target/fuzz/$$target.log; \
	done
FUZZ_BUILT = target/fuzz/$$(rustc -vV | sed -n 's/^host: //p')/release

fuzz-built:
	RUSTFLAGS="$(COUNTERS)" cargo build --locked --release --workspace --manifest-path tests/fuzz/Cargo.toml \
		--target-dir target/fuzz --target "$$(rustc -vV | sed -n 's/^host: //p')" --features libfuzzer

fuzz-rust: fuzz-built ## The guided fuzzers of the crates
	@built=$(FUZZ_BUILT); $(call FUZZ,$(FUZZED))

# The library is compiled from its sources with counters of edges, the harness with the sanitizers
# too: they watch all memory that the library takes and frees, and what crosses the border.
fuzz-c: fuzz-built ## The guided fuzzer of the C library, under AddressSanitizer and UndefinedBehaviorSanitizer
	@command -v $(CLANG) >/dev/null || { echo "clang with libFuzzer is needed; on Debian install it by: apt install clang libclang-rt-14-dev" >&2; exit 1; }
	@mkdir -p target/fuzz/c
	$(CLANG) -g -O1 -std=c11 -Wall -Wextra -Werror -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined \
		-Irust/capi/include tests/fuzz/c/library.c $(FUZZ_BUILT)/libpiezotrack.a -lm -lpthread -ldl -lgcc_s -o target/fuzz/c/library
	@built=target/fuzz/c; $(call FUZZ,$(FUZZED_C))

fuzz-replay: ## Replay what the guided fuzzers kept, without libFuzzer
	cargo test --quiet --locked --release --manifest-path tests/fuzz/Cargo.toml --target-dir target/fuzz --test replay

fuzz-corpus: ## Keep of all inputs the fewest that reach the same code: tests/fuzz/corpus
	@for one in $(FUZZED) $(FUZZED_C); do \
		target=$${one%=*}; built=$(FUZZ_BUILT); kept=tests/fuzz/corpus/$$target; all=target/fuzz/merged/$$target; \
		[ -x $$built/$$target ] || built=target/fuzz/c; \
		rm -rf $$all; mkdir -p $$all; \
		$$built/$$target -set_cover_merge=1 -use_counters=0 $$all $$kept target/fuzz/corpus/$$target 2> target/fuzz/$$target.merge.log || exit 1; \
		rm -rf $$kept; cp -r $$all $$kept; \
		echo "$$target: $$(ls $$kept | wc -l) files, $$(du -bs $$kept | cut -f1) bytes"; \
	done

lint: lint-rust lint-python ## Formatting, clippy, ruff, types, layers, stubs

lint-rust:
	cargo fmt --all --check
	cargo clippy --release --workspace --all-targets --locked -- -D warnings

lint-python: $(VENV)/installed $(VENV)/tools
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m mypy.stubtest piezotrack._core

# The Python module is named so that features, and with them the compiled crates, are those of the
# wheel; it has no tests of its own.
rust-test: $(VENV)/pip ## Tests of the crates, the control crate also without std
	PYO3_PYTHON="$(CURDIR)/$(BIN)/python" cargo test --locked --release -p piezotrack-control -p piezotrack-core -p piezotrack-py
	cargo test --locked --release -p piezotrack-control

no-std: ## The control crate where there is no std and no allocator
	cargo build --locked --manifest-path tests/no_std/Cargo.toml --target-dir target/no-std
	@if [ -d "$$(rustc --print target-libdir --target $(EMBEDDED))" ]; then \
		set -x; \
		cargo build --locked --release -p piezotrack-control --target $(EMBEDDED); \
	else \
		echo "not built for $(EMBEDDED), which is not installed; to have it: rustup target add $(EMBEDDED)"; \
	fi

python-test: $(VENV)/installed $(VENV)/tools c-library ## Tests of the package, its docstrings and pages
	$(BIN)/pytest -n auto --dist worksteal -m "not slow and not study"

# Beside the Python module, so that the compiled crates are those of the wheel.
c-library: $(VENV)/pip ## The C library: target/release/libpiezotrack.a and .so; header in rust/capi/include
	PYO3_PYTHON="$(CURDIR)/$(BIN)/python" cargo build --locked --release -p piezotrack-capi -p piezotrack-py

# With the licences of what is in it.
c-package: c-library ## The C library to hand on, header and licences beside it: target/piezotrack-c.tar.gz
	rm -rf target/piezotrack-c && mkdir -p target/piezotrack-c
	cp rust/capi/include/piezotrack.h target/release/libpiezotrack.* LICENSE-* THIRD-PARTY.txt target/piezotrack-c
	rm -f target/piezotrack-c/*.d
	tar -czf target/piezotrack-c.tar.gz -C target piezotrack-c

c-header: ## Write rust/capi/include/piezotrack.h from the functions of the C library
	WRITE=1 $(MAKE) --no-print-directory c-header-test

c-header-test:
	cargo test --quiet --locked --manifest-path tests/c_header/Cargo.toml --target-dir target/c-header

# All that is reached by the crates' tests and by those of the package, which run once: in an
# environment whose wheel counts, with coverage.py counting on the Python side. That a test fails,
# which can be as all of it is slower, is for `make test` to judge.
INSTRUMENTED = PYO3_PYTHON="$(CURDIR)/$(COVERAGE)/venv/bin/python" CARGO_TARGET_DIR="$(CURDIR)/$(COVERAGE)/cargo" \
	RUSTC_WORKSPACE_WRAPPER="$(CURDIR)/.ci/instrumented"
PROFILES = LLVM_PROFILE_FILE="$(CURDIR)/$(COVERAGE)/profiles/%4m.profraw"
CRATE_TESTS = cargo test --locked --release -p piezotrack-control -p piezotrack-core -p piezotrack-py --lib --bins --tests

coverage: ## What the tests reach of Python and Rust, lines and branches: docs/coverage.md, target/coverage
	@mkdir -p $(COVERAGE)
	@$(INSTRUMENTED) $(SUB) VENV=$(COVERAGE)/venv WHEELS=$(COVERAGE)/wheels $(COVERAGE)/venv/installed $(COVERAGE)/venv/tools
	$(COVERAGE)/venv/bin/python -m pip install --quiet --group coverage
	rm -rf $(COVERAGE)/profiles $(COVERAGE)/python $(COVERAGE)/html
	mkdir -p $(COVERAGE)/python
	$(INSTRUMENTED) $(PROFILES) $(CRATE_TESTS)
	$(INSTRUMENTED) $(CRATE_TESTS) --no-run --quiet --message-format=json > $(COVERAGE)/built.json
	$(INSTRUMENTED) cargo build --locked --release -p piezotrack-capi -p piezotrack-py
	-$(PROFILES) CARGO_TARGET_DIR="$(CURDIR)/$(COVERAGE)/cargo" $(COVERAGE)/venv/bin/coverage run -m pytest -n auto --dist worksteal -m "not slow and not study"
	$(COVERAGE)/venv/bin/coverage combine --quiet
	$(COVERAGE)/venv/bin/coverage html --quiet
	$(COVERAGE)/venv/bin/coverage json --quiet -o $(COVERAGE)/python.json
	$(COVERAGE)/venv/bin/python .ci/profiles.py $(COVERAGE) > $(COVERAGE)/rust.lcov
	$(COVERAGE)/venv/bin/python docs/make_coverage.py $(COVERAGE)

bench: ## Criterion benches: throughput of the swarm, latency of a step
	cargo bench --locked

# Warnings end the build: dead links, pages without a place, public names without an entry.
docs: $(VENV)/installed $(VENV)/site-tools ## The site: target/site/index.html; pages, reference, gallery
	$(BIN)/sphinx-build -q -W --keep-going -j auto -d target/site-cache docs target/site

links: $(VENV)/installed $(VENV)/site-tools ## Look for links of the site that lead nowhere: needs a network
	$(BIN)/sphinx-build -q -b linkcheck -j auto -d target/site-cache docs target/links

crate-docs: ## The crates' pages: target/doc
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps

architecture: $(VENV)/installed ## Draw docs/architecture.svg from the code
	$(BIN)/python docs/make_architecture.py

pictures: $(VENV)/installed $(VENV)/tools ## Draw the pictures of the pages that no example draws
	$(BIN)/python docs/make_pictures.py
	$(BIN)/python docs/make_page_pictures.py

sentences: $(VENV)/pip ## All sentences that the program prints, to be read: target/sentences.txt
	@mkdir -p target
	$(BIN)/python .ci/sentences.py > target/sentences.txt

notices: ## Write THIRD-PARTY.txt: the licences of the crates that are linked in
	$(PYTHON) docs/make_notices.py

public-names: $(VENV)/installed $(VENV)/tools ## Write tests/public_names.txt: what is public, with its arguments
	PYTHONPATH=tests/helpers:docs/extensions $(BIN)/python tests/helpers/public_names.py

release-check: $(VENV)/installed $(VENV)/tools $(VENV)/release-tools ## All of a release but the uploads, with a table: done, not possible here, why
	$(BIN)/python .ci/release_check.py $(ONLY)

clean: ## Remove what was built, not your results
	rm -rf $(VENV) target demo report docs/gallery docs/reference

$(VENV)/pip:
	@command -v cargo >/dev/null || { echo "A Rust toolchain is needed, there is no cargo: install it from https://rustup.rs" >&2; exit 1; }
	$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(None if v >= (3, 11) else f"Python 3.11 or newer is needed, this is {v.major}.{v.minor}")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1' 'maturin>=1.9,<2'
	@touch $@

# A release wheel, as a user would install it; the package in python/ is never imported.
$(WHEELS)/built: $(VENV)/pip $(SOURCES)
	@echo "Compiling: two to three minutes, with one line of output for most of it; less after a change."
	@rm -rf $(WHEELS)
	$(BIN)/maturin build --release --locked --out $(WHEELS) --interpreter $(BIN)/python
	@touch $@

$(VENV)/installed: $(WHEELS)/built
	$(BIN)/python -m pip install --quiet --force-reinstall --no-deps $(WHEELS)/*.whl
	$(BIN)/python -m pip install --quiet "$$(ls $(WHEELS)/*.whl)[app]"
	@touch $@

$(VENV)/tools: $(VENV)/pip pyproject.toml
	$(BIN)/python -m pip install --quiet --group test
	@touch $@

$(VENV)/release-tools: $(VENV)/pip pyproject.toml
	$(BIN)/python -m pip install --quiet --group release
	@touch $@

$(VENV)/site-tools: $(VENV)/pip pyproject.toml
	$(BIN)/python -m pip install --quiet --group docs
	@touch $@
