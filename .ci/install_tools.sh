#!/usr/bin/env bash
# Install the programs with which tests compile, run and prove exported laws. If this fails, those tests are skipped.
# Downloads on a machine with gcc: cmake 21 MB, clang 59 MB, Arm toolchain 97 MB, QEMU 25 MB, AVR toolchain with
# simavr 22 MB. Left out are octave (210 MB with 250 packages; one test needs it) and downloads from elsewhere; Debian 12
# itself has no cbmc, other releases have.
set -u
missing() { ! command -v "$1" > /dev/null; }
packages=()
missing cmake && packages+=("cmake")
missing clang && packages+=("clang")
missing cbmc && packages+=("cbmc")
missing arm-none-eabi-gcc && packages+=("gcc-arm-none-eabi libnewlib-arm-none-eabi")
missing qemu-system-arm && packages+=("qemu-system-arm")
missing avr-gcc && packages+=("gcc-avr avr-libc")
missing simavr && packages+=("simavr")
[ -d /usr/share/arduino/hardware/arduino/avr ] || packages+=("arduino-core-avr")
[ ${#packages[@]} -eq 0 ] && exit 0
if [ "$(id -u)" != 0 ] || ! command -v apt-get > /dev/null; then
    echo "Not installed, because this needs root and apt-get: ${packages[*]}. The tests that need them are skipped."
    exit 0
fi
export DEBIAN_FRONTEND=noninteractive
quick=(-qq -o Acquire::Retries=1 -o Acquire::http::Timeout=20 -o Acquire::https::Timeout=20 -o DPkg::Lock::Timeout=60)
timeout 120 apt-get "${quick[@]}" update > /dev/null 2>&1 || echo "apt-get update failed; trying the known lists."
for names in "${packages[@]}"; do
    # each by itself: a release that lacks one of them still installs the others
    # shellcheck disable=SC2086 # several packages in one word
    install=(apt-get "${quick[@]}" install -y --no-install-recommends $names)
    { timeout 240 "${install[@]}" --download-only && "${install[@]}"; } > /dev/null 2>&1 ||
        echo "Not installed: $names. The tests that need it are skipped."
done
exit 0
