#!/usr/bin/env python3
"""Attacks a live simulated robot over its link, like any node on a bus, and checks the commands to its motors.

    python3 tests/hostile --simulator target/debug/rollwalk-sim --library agilebot.rwl

The client is written from docs/formats/wire-format.md and shares no code with the project. Phases:

1. disarmed: random, forged, replayed and cut frames; no motor may be commanded to move, and the library must stay
2. hostile libraries: damaged copies must be refused; what is resealed and within all limits is played
3. driven: the same frames while an operator arms and plays; setpoints must stay within the limits of the robot file
4. emergency stops among them: no setpoint after one until the operator has cleared it

In every phase, the controller must continue to answer. Exit code 1 if a rule was broken. Uses only Python's standard
library.
"""

import argparse
import pathlib
import random
import subprocess
import sys
import tempfile
import threading
import time

import attacks
import robot
import wire
from client import END_S, HEARTBEAT_S, NODE, Broken, Client, alive, ended, expect, transfer
from libraries import hostile
from rules import Rules

# Lines in one write: a few milliseconds of the bus.
BURST = 20
# Attacks on a driven robot until the operator drives it again.
WAVE = 1000


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--simulator", type=pathlib.Path, required=True, help="the program rollwalk-sim")
    parser.add_argument("--robot", type=pathlib.Path, default="shipped/robots/agilebot.toml")
    parser.add_argument("--library", type=pathlib.Path, required=True, help="a library of the robot (.rwl)")
    parser.add_argument("--frames", type=int, default=100_000, help="attacks in all (%(default)s)")
    parser.add_argument("--libraries", type=int, default=200, help="hostile libraries (%(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=pathlib.Path, help="folder for the log of all buses")
    return parser.parse_args()


class Operator:
    """Sends heartbeats, arms and plays, independent of other nodes on the link."""

    def __init__(self, client, codes, rng):
        self.client, self.codes, self.rng = client, codes, rng
        self.driven = 0
        self.running = True
        self.arms = False
        # True if it streamed since the robot last played.
        self.streamed = False
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def end(self):
        self.running = False
        self.thread.join(END_S)
        expect(not self.thread.is_alive(), f"the operator does not end within {END_S} s")

    def _run(self):
        while self.running:
            self.client.heartbeat()
            if self.arms:
                self._drive()
            time.sleep(HEARTBEAT_S)

    def _drive(self):
        client = self.client
        if client.state == "Disarmed":
            # Any node may set gains, so the operator restores the gains of the robot file. One of 16 sequence
            # numbers is the next.
            for seq in range(16):
                client.frames(wire.parameter(client.node, seq, wire.RESET, 0, 0, bytes(4)))
            self._confirmed(wire.ARM, wire.ARM_CONFIRM)
        elif client.state in ("EStopped", "TorqueOff", "Damped"):
            self._confirmed(wire.CLEAR, wire.CLEAR_CONFIRM)
        elif client.state == "Paused":
            client.command(wire.RESUME)
        elif client.state == "Ready" and not self.streamed and self.rng.random() < 0.5:
            # The robot follows the attackers' set-points, sometimes as answers to samples. Between attacks there are
            # none, and the robot sinks. Afterwards it must play, not stream again.
            self.streamed = True
            client.command(*self.rng.choice([(wire.STREAM,), (wire.TRACK, 10, 20, 120)]))
        elif client.state == "Streaming":
            if self.rng.random() < 0.1:
                client.command(wire.RETURN)
        elif client.state in ("Ready", "Playing"):
            self.driven += 1
            self.streamed &= client.state != "Playing"
            client.command(wire.PLAY, code=self.rng.choice(self.codes), speed=64)

    def _confirmed(self, ask, confirm):
        client = self.client
        client.nonce = None
        client.command(ask)
        if client.until(lambda: client.nonce is not None, 0.1):
            client.command(confirm, arg=client.nonce)


def attack(client, rng, count, stops, between=None):
    """Sends `count` attacks; calls `between` after every wave of them."""
    sent = 0
    while sent < count:
        if between and sent % WAVE == 0:
            between()
        burst = attacks.several(client, rng, min(BURST, count - sent), stops)
        client.send(*burst)
        sent += len(burst)
        time.sleep(0.003)


def phases(options, path):
    rng = random.Random(options.seed)
    library = options.library.read_bytes()
    client, operators = Client(path, NODE), Client(path, NODE)
    share = options.frames // 3
    operator = Operator(operators, [1, 2, 3, 4], random.Random(options.seed + 1))
    try:
        expect(client.until(lambda: client.state == "Disarmed", 10), "the robot does not start")
        refused = transfer(operators, library)
        expect(refused is None, f"the owner's library is refused: {refused}")
        time.sleep(0.2)
        own = client.library

        print(f"1. disarmed: {share} attacks", flush=True)
        attack(client, rng, share, stops=False)
        alive(client, "after the attacks on the disarmed robot")
        expect(client.state == "Disarmed", f"the robot is {client.state}")
        expect(client.library == own, "another library is active")

        print(f"2. {options.libraries} hostile libraries", flush=True)
        refused, played = 0, 0
        for forged, sound in hostile(library, options.libraries, rng):
            if transfer(operators, forged) is not None:
                refused += 1
                continue
            # Without signatures, a library within all limits is as valid as the owner's, so it is played.
            expect(sound, "a library with wrong checksums is active")
            played += 1
            operator.arms = True
            client.until(lambda: client.state == "Playing", 10)
            time.sleep(2)
            operator.arms = False
            for _ in range(3):
                operators.command(wire.DISARM)
            expect(client.until(lambda: client.state == "Disarmed", 10), "DISARM is not obeyed")
        print(f"   {refused} refused, {played} within all limits and played")
        expect(transfer(operators, library) is None, "the owner's library is refused afterwards")
        time.sleep(0.2)
        expect(client.library == own, "another library is active")

        print(f"3. driven: {share} attacks", flush=True)
        operator.arms = True
        playing = lambda: expect(client.until(lambda: client.state == "Playing", 20), f"the robot stays {client.state}")
        attack(client, rng, share, stops=False, between=playing)
        alive(client, "after the attacks on the driven robot")
        plays = operator.driven
        expect(plays > 10, f"the operator could hardly play: {plays} commands")
        expect("Streaming" in client.states, "the robot has followed no setpoints")

        print(f"4. with emergency stops: {options.frames - 2 * share} attacks", flush=True)
        attack(client, rng, options.frames - 2 * share, stops=True, between=playing)
        alive(client, "after the emergency stops")
        operator.arms = False
        for _ in range(5):
            client.frames((wire.ESTOP | NODE << 4, b""))
            time.sleep(0.005)
        expect(client.until(lambda: client.state == "EStopped", 1), "ESTOP is not obeyed")
        print(f"   the operator's commands to play: {operator.driven}")
    finally:
        operator.end()


def main():
    options = arguments()
    with tempfile.TemporaryDirectory() as scratch:
        out = options.out or pathlib.Path(scratch)
        out.mkdir(parents=True, exist_ok=True)
        path, log = pathlib.Path(scratch) / "link.sock", out / "buses.log"
        command = [options.simulator, options.robot, "--bus", f"sim:{path}", "--on", "stand", "--log", log]
        robot_process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        try:
            for _ in range(200):
                if path.exists() or robot_process.poll() is not None:
                    break
                time.sleep(0.05)
            started = time.monotonic()
            phases(options, path)
            expect(robot_process.poll() is None, f"the simulator ended: {robot_process.returncode}")
            took = time.monotonic() - started
        except (Broken, OSError) as broken:
            sys.exit(f"broken: {broken}")
        finally:
            code = ended(robot_process)
        rules = Rules(robot.motors(options.robot), NODE).check(log)
        counts = rules.counts
        print(f"{took:.0f} s, {counts['frames']} frames on all buses, {counts['setpoints']} setpoints looked at, "
              f"{counts['estops']} emergency stops, {len(rules.broken)} broken rules, exit code {code}")
        for broken in rules.broken[:20]:
            print("  ", broken)
        if rules.broken or counts["setpoints"] < 1000 or counts["estops"] < 5:
            sys.exit("a rule was broken, or too little was looked at")


if __name__ == "__main__":
    main()
