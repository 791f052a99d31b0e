#!/usr/bin/env python3
"""Ends commands at random moments, and fills the disk while they run. An output must be the complete old or the
complete new file.

    python3 tests/hostile/files.py --rollwalk target/debug/rollwalk

A limit on the size of files replaces a full disk, because writes fail in the same way. Exit code 1 if an output was
broken. Uses only Python's standard library.
"""

import argparse
import pathlib
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time


# Longest run of a command, on a busy computer.
COMMAND_S = 120


def commands(rollwalk, folder):
    """Name of the output and the command that writes it."""
    plan = folder / "plan.json"
    subprocess.run([rollwalk, "plan", "motions/stand.toml", "-o", plan], check=True, capture_output=True, timeout=COMMAND_S)
    return [
        ("out.json", [rollwalk, "plan", "motions/stand.toml", "-o"]),
        ("out.rwl", [rollwalk, "library", "build", "motions/test_leg_library.toml", "-o"]),
        ("out.svg", [rollwalk, "plot", plan, "-o"]),
        ("out.csv", [rollwalk, "export", plan, "-o"]),
    ]


def run(command, out, limit=None, kill_after_s=None):
    """Exit code and output."""

    def limited():
        if limit is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    process = subprocess.Popen([*command, out], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, preexec_fn=limited)
    if kill_after_s is not None:
        time.sleep(kill_after_s)
        process.kill()
    try:
        said, _ = process.communicate(timeout=COMMAND_S)
    finally:
        process.kill()
    return process.returncode, said.decode(errors="replace")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rollwalk", type=pathlib.Path, required=True, help="the program rollwalk")
    parser.add_argument("--rounds", type=int, default=30, help="of each command (%(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng, broken, killed, full = random.Random(options.seed), [], 0, 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        for name, command in commands(options.rollwalk, folder):
            out = folder / name
            started = time.monotonic()
            # A command may refuse to replace a file of another kind, so the first file is written without one.
            code, said = run(command, out)
            took = time.monotonic() - started
            if code != 0:
                sys.exit(f"{name}: {said}")
            new = out.read_bytes()
            old = new + b"\n" if name != "out.rwl" else new
            for _ in range(options.rounds):
                out.write_bytes(old)
                code, _ = run(command, out, kill_after_s=rng.uniform(0, 1.1 * took))
                killed += code == -signal.SIGKILL
                if out.read_bytes() not in (old, new):
                    broken.append(f"{name}: half written after kill -9")
            for limit in [0, 1, len(new) // 2, len(new) - 1]:
                out.write_bytes(old)
                code, said = run(command, out, limit=limit)
                full += code != 0
                if out.read_bytes() != old:
                    broken.append(f"{name}: lost or half written on a full disk of {limit} B")
                if code == 0 or name not in said:
                    broken.append(f"{name}: exit code {code} on a full disk of {limit} B, without the name of the file: {said}")
    print(f"{killed} killed, {full} on a full disk, {len(broken)} broken")
    for what in broken:
        print("  ", what)
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()
