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
# Each command with its report, and the sources that need a library of an extra. Warnings are no errors here: they are about
# these old versions. The messages about scenario files depend on no library.
contract=tests/contract
env -u CC -u CXX "$own" -m pytest -n "${JOBS:-2}" --dist worksteal -q -p no:cacheprovider --durations=10 -o filterwarnings= \
    --deselect "$contract/test_snapshots.py::test_a_command_prints_what_its_snapshot_shows[scenario-file]" \
    $contract/test_snapshots.py \
    $contract/test_every_report.py::test_an_answer_and_its_report_are_complete \
    $contract/test_cli_sweep.py::test_the_dataset_goes_where_it_is_asked_for_and_stays \
    $contract/test_cli_record.py::test_an_unplugged_sensor_is_one_sentence_and_the_readings_are_kept \
    $contract/test_cli_record.py::test_a_live_topic_is_recorded_through_dds \
    $contract/test_robot_film.py::test_robot_writes_a_report_without_scripts_and_addresses \
    $contract/test_sweep_cluster.py::test_a_cluster_goes_on_with_what_one_process_has_begun \
    $contract/test_studio.py::test_a_scenario_is_described_with_its_own_texts \
    $contract/test_studio.py::test_the_distribution_of_a_value_moves_with_it \
    $contract/test_studio.py::test_what_the_page_never_sends_is_a_message \
    $contract/test_studio.py::test_a_file_is_saved_where_it_was_opened \
    $contract/test_studio.py::test_an_export_brings_the_law_in_c \
    tests/faults/test_table_documents.py
