#!/usr/bin/env python3
"""Attacks a live simulated robot that obeys only hosts with its link key, while such a host drives it.

    python3 tests/hostile/authenticated.py --simulator target/debug/rollwalk-sim --library agilebot.rwl

Host and attacker are written from docs/formats/wire-format.md; authentication codes are those of Python's HMAC. The
attacker receives everything, but has no key. It sends the attacks of `attacks.py` except emergency stops, and replays
received messages with authenticators: repeated, mixed, with a flipped bit, cut, or followed by its own messages. The
controller must obey none: only commands, parameters and transfers of the host are answered with ok, the library
stays, and the rules of `rules.py` hold. Exit code 1 if a rule was broken.
"""

import argparse
import collections
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
from rules import Rules

PAUSE_S = 0.003
# Attacks between two pauses. A flood of authenticators displaces the host's, which is a denial of service and no
# finding. On a driven robot, the attacks are few enough for it to play.
FLOOD, FEW = 20, 1
OK, REQUIRED = 0, {"command": 14, "parameter": 9, "transfer": 11}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--simulator", type=pathlib.Path, required=True, help="the program rollwalk-sim")
    parser.add_argument("--robot", type=pathlib.Path, default="shipped/robots/agilebot.toml")
    parser.add_argument("--library", type=pathlib.Path, required=True, help="a library of the robot (.rwl)")
    parser.add_argument("--frames", type=int, default=20_000, help="attacks in all (%(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=pathlib.Path, help="folder for the log of all buses")
    return parser.parse_args()


class Host(Client):
    """A host with the key. An authenticator precedes each of its messages."""

    def __init__(self, path, node, key, nonce):
        super().__init__(path, node)
        self.key, self.session_nonce = key, nonce
        self.lock = threading.Lock()
        self.number = None
        self.counters = [0, 0]

    def begin(self):
        """Requests a session, and checks that the answer is the controller's."""
        self.session_nonce += 1
        answer = self.request(bytes([wire.SESSION_REQUEST]) + self.session_nonce.to_bytes(8, "little"), answered=wire.SESSION)
        expect(answer is not None and len(answer) == 17, f"no session: {answer}")
        number = int.from_bytes(answer[1:9], "little")
        tag = wire.session_code(self.key, number, self.session_nonce, wire.TO_HOST | self.node << 4)[:8]
        expect(answer[9:] == tag, "the controller's proof is not that of docs/formats/wire-format.md")
        self.number, self.counters = number, [0, 0]

    def proof(self, identifier, message):
        which = identifier >> 8 == 5
        self.counters[which] += 1
        counter = self.counters[which]
        return wire.authenticator(self.node, self.key, self.number, self.session_nonce, counter, identifier, message)

    def frames(self, *frames):
        with self.lock:
            for identifier, data in frames:
                is_proven = self.number is not None and identifier >> 8 in (1, 2, 6)
                ahead = [self.proof(identifier, data)] if is_proven else []
                super().frames(*ahead, (identifier, data))

    def _send_message(self, message):
        if self.number is not None and 0x10 <= message[0] <= 0x13:
            with self.lock:
                ahead = self.proof(wire.TO_CONTROLLER | self.node << 4, message)
                super().frames(ahead)
        super()._send_message(message)


class Driver:
    """Arms, plays, and counts its commands."""

    def __init__(self, host, codes, rng):
        self.host, self.codes, self.rng = host, codes, rng
        self.commanded = collections.Counter()
        self.running, self.arms = True, False
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def end(self):
        self.running = False
        self.thread.join(END_S)
        expect(not self.thread.is_alive(), f"the operator does not end within {END_S} s")

    def command(self, kind, **fields):
        self.commanded[kind] += 1
        self.host.command(kind, **fields)

    def _run(self):
        while self.running:
            self.host.heartbeat()
            if self.arms and self.host.state == "Disarmed":
                self._confirmed(wire.ARM, wire.ARM_CONFIRM)
            elif self.arms and self.host.state in ("TorqueOff", "Damped"):
                self._confirmed(wire.CLEAR, wire.CLEAR_CONFIRM)
            elif self.arms and self.host.state in ("Ready", "Playing") and self.rng.random() < 0.2:
                self.command(wire.PLAY, code=self.rng.choice(self.codes), speed=64)
            time.sleep(HEARTBEAT_S)

    def _confirmed(self, ask, confirm):
        host = self.host
        heard = host.acknowledgements[ask, OK]
        self.command(ask)
        if host.until(lambda: host.acknowledgements[ask, OK] > heard, 0.1):
            self.command(confirm, arg=host.nonce)


class Attacker:
    """Received pairs of authenticators and messages, and forgeries of them."""

    def __init__(self, client, rng):
        self.client, self.rng = client, rng
        self.sent = collections.Counter()

    def pairs(self):
        heard = list(self.client.recent)
        first = wire.AUTHENTICATOR | self.client.node << 4
        pairs = zip(heard, heard[1:])
        return [(a, b) for a, b in pairs if a[0] == first and b[0] >> 8 in (1, 2, 5, 6) and b[0] != first]

    def flipped(self, frame):
        identifier, data = frame
        data = bytearray(data)
        data[self.rng.randrange(len(data))] ^= 1 << self.rng.randrange(8)
        return identifier, bytes(data)

    def cut(self, frame):
        return frame[0], frame[1][: self.rng.randrange(len(frame[1]))]

    def lines(self):
        """An attack and its name."""
        rng, pairs = self.rng, self.pairs()
        kind = rng.choice(["any", "replayed", "mixed", "forged", "forged", "cut", "guessed", "alone"])
        if kind == "any" or not pairs:
            return attacks.several(self.client, rng, 1, stops=False), "any"
        authenticator, message = rng.choice(pairs)
        if kind == "mixed":
            authenticator, _ = rng.choice(pairs)
        elif kind == "forged":
            if rng.random() < 0.5:
                authenticator = self.flipped(authenticator)
            else:
                message = self.flipped(message)
        elif kind == "cut":
            if rng.random() < 0.5:
                authenticator = self.cut(authenticator)
            else:
                message = self.cut(message)
        elif kind == "guessed":
            authenticator = authenticator[0], bytes(authenticator[1][:2]) + rng.randbytes(6)
            found = wire.received(attacks.command(self.client, rng)[:-1])
            message = found or message
        frames = [message] if kind == "alone" else [authenticator, message]
        return [wire.of_frame(frame) for frame in frames], kind

    def attack(self, count, at_once):
        for at in range(0, count, at_once):
            burst = []
            for _ in range(min(at_once, count - at)):
                lines, kind = self.lines()
                self.sent[kind] += 1
                burst += lines
            self.client.send(*burst)
            time.sleep(PAUSE_S)


def answers(client):
    """Counts of commands, parameters and transfers answered with ok so far."""
    commands = collections.Counter({kind: n for (kind, result), n in client.acknowledgements.items() if result == OK})
    return commands, client.parameters[OK], sum(n for answer, n in client.answers.items() if answer[1:] == b"\0")


def phases(options, path, key):
    rng = random.Random(options.seed)
    library = options.library.read_bytes()
    host, client = Host(path, NODE, key, rng.getrandbits(63)), Client(path, NODE)
    expect(client.until(lambda: client.state == "Disarmed", 10), "the robot does not start")
    plain = transfer(client, library)
    expect(plain is not None and plain[1][2] == REQUIRED["transfer"], f"a library without proof: {plain}")
    host.begin()
    expect(transfer(host, library) is None, "the host's library is refused")
    time.sleep(0.2)
    own = client.library
    driver, attacker = Driver(host, [1, 2, 3, 4], random.Random(options.seed + 1)), Attacker(client, rng)
    try:
        before = answers(client)
        print(f"1. disarmed: {options.frames // 2} attacks", flush=True)
        client.states.clear()
        attacker.attack(options.frames // 2, FLOOD)
        alive(client, "after the attacks on the disarmed robot")
        expect(client.states <= {"Disarmed"}, f"the robot was {client.states}")
        expect(answers(client) == before, f"answered ok: {answers(client)}, before {before}")

        print(f"2. driven: {options.frames - options.frames // 2} attacks", flush=True)
        driver.arms = True
        expect(client.until(lambda: client.state == "Playing", 20), f"the robot stays {client.state}")
        client.states.clear()
        attacker.attack(options.frames - options.frames // 2, FEW)
        driver.arms = False
        alive(client, "after the attacks on the driven robot")
    finally:
        driver.end()
    commands, parameters, transfers = answers(client)
    obeyed = {kind: n for kind, n in commands.items() if n > driver.commanded[kind]}
    expect(not obeyed, f"commands that were obeyed more often than the host gave them: {obeyed} of {driver.commanded}")
    expect((parameters, transfers) == before[1:], f"{parameters} parameter requests and {transfers} transfers were answered ok")
    expect(client.library == own, "another library is active")
    refused = client.acknowledgements
    refused = sum(n for (_, result), n in refused.items() if result == REQUIRED["command"])
    expect(commands[wire.PLAY] > 20, f"the host could hardly play: {commands}")
    print(f"   attacks: {dict(attacker.sent)}")
    print(f"   the host gave {dict(driver.commanded)}, answered ok {dict(commands)}; {refused} commands and "
          f"{client.parameters[REQUIRED['parameter']]} parameter requests refused; states {sorted(client.states)}")


def main():
    options = arguments()
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        out = options.out or scratch
        out.mkdir(parents=True, exist_ok=True)
        key = random.Random(options.seed + 2).randbytes(32)
        (scratch / "robot.key").write_text(f"rollwalk-link-key-1 {key.hex()}\n")
        (scratch / "robot.key").chmod(0o600)
        path, log = scratch / "link.sock", out / "authenticated.log"
        command = [options.simulator, options.robot, "--bus", f"sim:{path}", "--on", "stand", "--log", log]
        command += ["--link-key", scratch / "robot.key"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        try:
            for _ in range(200):
                if path.exists() or process.poll() is not None:
                    break
                time.sleep(0.05)
            phases(options, path, key)
            expect(process.poll() is None, f"the simulator ended: {process.returncode}")
        except (Broken, OSError) as broken:
            sys.exit(f"broken: {broken}")
        finally:
            ended(process)
        rules = Rules(robot.motors(options.robot), NODE).check(log)
        print(f"{rules.counts['frames']} frames on all buses, {rules.counts['setpoints']} setpoints looked at, "
              f"{len(rules.broken)} broken rules")
        for broken in rules.broken[:20]:
            print("  ", broken)
        if rules.broken or rules.counts["setpoints"] < 1000:
            sys.exit("a rule was broken, or too little was looked at")


if __name__ == "__main__":
    main()
