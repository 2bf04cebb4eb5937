#!/usr/bin/env bash
# Run the commands with the lowest versions that pyproject.toml declares: .ci/lowest_versions.sh [PYTHON] [RESOLUTION]
# RESOLUTION is lowest-direct, or highest for the versions in constraints.txt. The lists of packages are those of
# pyproject.toml: all extras but those of developers. The tests of commands, reports, sweeps, sources of readings, studio
# and robots run in an environment of their own, with pytest of today.
set -euo pipefail
cd "$(dirname "$0")/.."
python=${1:-python3} resolution=${2:-lowest-direct}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$python" -m venv "$folder"
own=$folder/bin/python
"$own" -m pip install --quiet --only-binary :all: uv
extras=$("$own" -c '
import tomllib
extras = tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]
print(*[f"--extra {name}" for name in extras if name not in {"benchmarks", "dev", "docs", "fmu"}])')  # fmu brings CMake
# shellcheck disable=SC2086 # each extra is two words
wanted=(--resolution "$resolution" -r pyproject.toml $extras)
[ "$resolution" != highest ] || wanted+=(-c constraints.txt)
"$own" -m uv pip install --quiet --python "$own" --only-binary :all: "${wanted[@]}"
"$own" -m uv pip install --quiet --python "$own" --only-binary :all: pytest pytest-xdist hypothesis mpmath PyYAML
# quick, since the objects of the library are cached, if CC and CXX are those of the first build
"$own" -m uv pip install --quiet --python "$own" --no-deps -e .
"$own" -m pretouch doctor
# Warnings are no errors here: they are about these old versions. The messages of scenario files depend on no library.
env -u CC -u CXX "$own" -m pytest -n "${JOBS:-2}" --dist worksteal -q -p no:cacheprovider --durations=20 -o filterwarnings= -m "not thorough" \
    --deselect "tests/contract/test_snapshots.py::test_a_command_prints_what_its_snapshot_shows[scenario-file]" \
    tests/contract/test_snapshots.py tests/contract/test_every_report.py tests/contract/test_cli_sweep.py \
    tests/contract/test_cli_record.py tests/contract/test_studio.py tests/contract/test_robot_examples.py
