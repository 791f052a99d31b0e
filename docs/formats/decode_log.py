#!/usr/bin/env python3
"""Decodes a log of candump with DBC files: one JSON object for each frame, on standard output.

    python3 docs/formats/decode_log.py bus.log 'link*=docs/rollwalk.dbc' 'act*=docs/rollwalk-actuators.dbc'

An argument INTERFACE=FILE gives the DBC file of the interfaces that match the pattern, which may contain `*`. FILE
alone is for all interfaces. Each object has `time_s`, `interface`, `id` and `data` of the frame. If the DBC file of
the interface contains the identifier, the object also has `message` and `signals` by name: numbers in the units of
the file, or their names in the file; with --numbers always numbers. A frame that does not match its message has
`error`.

Exit code 1 after such an error, or with --all after a frame that no file contains.

Needs python-can 4 and cantools 38 or later. On Debian 12:

    apt-get install python3-can python3-pip && pip install --break-system-packages cantools
"""

import argparse
import fnmatch
import json
import math
import sys

import can
import cantools


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("log", help="log in the format of `candump -l`")
    parser.add_argument("dbc", nargs="+", help="DBC file, or INTERFACE=FILE")
    parser.add_argument("--numbers", action="store_true", help="numbers instead of their names")
    parser.add_argument("--all", action="store_true", help="unknown frames are errors, too")
    return parser.parse_args()


def databases(arguments_of_dbc):
    """Pairs of a pattern of interfaces and the messages by identifier."""
    pairs = []
    for argument in arguments_of_dbc:
        pattern, _, path = argument.rpartition("=")
        pairs.append((pattern or "*", cantools.database.load_file(path)))
    return pairs


def plain(value):
    """A value for JSON: names and non-finite numbers as text."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if isinstance(value, (int, float)) else str(value)


def decode(frame, pairs, numbers):
    """JSON object of a frame."""
    told = {
        "time_s": frame.timestamp,
        "interface": frame.channel,
        "id": frame.arbitration_id,
        "data": frame.data.hex(),
    }
    if frame.is_extended_id or frame.is_error_frame or frame.is_remote_frame:
        return told
    for pattern, database in pairs:
        if not fnmatch.fnmatchcase(str(frame.channel), pattern):
            continue
        try:
            message = database.get_message_by_frame_id(frame.arbitration_id)
        except KeyError:
            continue
        told["message"] = message.name
        try:
            # Frames of ISO-TP are as long as their content.
            signals = message.decode(
                bytes(frame.data), decode_choices=not numbers, allow_truncated=True
            )
            told["signals"] = {name: plain(value) for name, value in signals.items()}
        except (ValueError, cantools.Error) as error:
            told["error"] = str(error) or type(error).__name__
        return told
    return told


def main():
    options = arguments()
    pairs = databases(options.dbc)
    failed = False
    try:
        for frame in can.CanutilsLogReader(options.log):
            told = decode(frame, pairs, options.numbers)
            failed |= "error" in told or options.all and "message" not in told
            print(json.dumps(told))
    except BrokenPipeError:
        sys.stderr.close()
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
