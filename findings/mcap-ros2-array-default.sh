#!/usr/bin/env bash
# mcap-ros2-support: a ROS 2 message type with a default value for an array cannot be written, not even if all values are given.
#
# Expected: ROS 2 definitions may give a field a default, also an array: the page "About ROS 2 interfaces" has the example
#   "int32[] samples [-200, -100, 0, 100, 200]". The writer of mcap-ros2-support applies scalar defaults to fields that are left out, so it
#   should apply array defaults as well, and ignore them where the message has values.
# What happens: mcap-ros2-support 0.6.0 applies the default of a scalar. If an array with a default has values, the writer raises
#   "Default value for primitive types cannot be an array". If a sequence with a default is left out, it writes an empty sequence without a
#   message; a fixed-size array that is left out raises the same error. Without the default in the definition, the same messages are
#   written. The reader of the same package has no problem with the definition.
# Why it matters: sensor messages carry calibration polynomials and warning distances, for which neutral defaults are usual. A recording
#   written on the robot by rosbag2 reads well, and cannot be rewritten. Somebody who relies on the defaults records "no warning distances".
# Remedy: remove the defaults of arrays from the definition before register_msgdef. The bytes of a message do not depend on them.
# Source: ROS 2 documentation, "About ROS 2 interfaces", section on default values.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "this script needs Python 3.11 or later as python3")'
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -qq --disable-pip-version-check mcap-ros2-support==0.6.0 mcap==1.6.0
"$work/venv/bin/python" - <<'PY'
import importlib.metadata
import io
import struct
import sys

import mcap.writer
from mcap_ros2.reader import read_ros2_messages
from mcap_ros2.writer import Writer


def read(stream):
    stream.seek(0)
    (message,) = list(read_ros2_messages(stream))
    return message.ros_msg.value


def write(definition, message):
    """Write one message, read it again: the value, or the text of the error."""
    stream = io.BytesIO()
    try:
        writer = Writer(stream)
        schema = writer.register_msgdef("example_msgs/msg/Example", definition)
        writer.write_message("/example", schema, message, 1, 1)
        writer.finish()
        return read(stream)
    except ValueError as error:
        return str(error)


def write_bytes(definition, content):
    """Write one message that is serialized already, read it with mcap-ros2-support."""
    stream = io.BytesIO()
    writer = mcap.writer.Writer(stream)
    writer.start(profile="ros2", library="example")
    schema = writer.register_schema("example_msgs/msg/Example", "ros2msg", definition.encode())
    writer.add_message(writer.register_channel("/example", "cdr", schema), 1, content, 1)
    writer.finish()
    return read(stream)


polynomial = "float32[3] value [0.0, 1.0, 0.0]"
warnings = "float32[] value [0.25, 0.5]"
results = {
    ("float32 value 2.0", "left out"): write("float32 value 2.0", {}),
    (polynomial, "given [0.5, 2, 0.25]"): write(polynomial, {"value": [0.5, 2.0, 0.25]}),
    (polynomial, "left out"): write(polynomial, {}),
    (warnings, "given [1]"): write(warnings, {"value": [1.0]}),
    (warnings, "left out"): write(warnings, {}),
    ("float32[3] value", "given [0.5, 2, 0.25]"): write("float32[3] value", {"value": [0.5, 2.0, 0.25]}),
    (polynomial, "serialized elsewhere"): write_bytes(polynomial, struct.pack("<I3f", 0x100, 0.5, 2.0, 0.25)),
}
print("mcap-ros2-support", importlib.metadata.version("mcap-ros2-support"))
for (definition, message), result in results.items():
    print(f"  {definition:33s} {message:21s}-> {result}")

scalar, given, absent, sequence_given, sequence_absent, plain, elsewhere = results.values()
refusal = "Default value for primitive types cannot be an array"
checks = {
    "a scalar default is applied": scalar == 2.0,
    "arrays with a default are refused, with and without values": given == absent == sequence_given == refusal,
    "a sequence that is left out becomes empty": not isinstance(sequence_absent, str) and list(sequence_absent) == [],
    "without the default the values are written": list(plain) == [0.5, 2.0, 0.25],
    "the reader accepts the definition": list(elsewhere) == [0.5, 2.0, 0.25],
}
for text, holds in checks.items():
    print("as found:" if holds else "CHANGED: ", text)
sys.exit(not all(checks.values()))
PY
