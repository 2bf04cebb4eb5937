#!/usr/bin/env bash
# Run a command where no compiler is found: every program of this machine is there but those.
set -euo pipefail
tools=$(mktemp -d)
trap 'rm -rf "$tools"' EXIT
for folder in /usr/local/bin /usr/bin /bin; do
    for program in "$folder"/*; do
        case ${program##*/} in
            cc | c++ | cpp* | c89* | c99* | gcc* | g++* | clang* | tcc | *-gcc* | *-g++* | *-cpp*) ;;
            *) [ -e "$tools/${program##*/}" ] || ln -s "$program" "$tools/" ;;
        esac
    done
done
ln -sf "$(python3 -c 'import sys; print(sys.executable)')" "$tools/python3"
env -u CC -u CXX PATH="$tools" "$@"
