"""`rollwalk control` in lockstep: one line of measurements in, one line of set-points out (docs/tracking.md, "In your
simulator")."""

import json
import os
import select
import subprocess

import numpy as np

from errors import Unusable
import robots


# Longest wait for an answer, on a busy computer.
ANSWER_S = 60.0


class Control:
    """The controller of a plan in a separate process, which ends with the `with` block. `robot` is the robot of the harness,
    if it has one."""

    def __init__(self, rollwalk, plan, robot, feedback, control_hz, latency_s=0.0):
        words = [str(rollwalk), "control", str(plan), "--feedback", feedback, "--rate", str(control_hz)]
        words += ["--latency-ms", str(1e3 * latency_s)]
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.unread = b""
        self.hello = self._read()
        if robot is not None:
            self._check(plan, robot)

    def _check(self, plan, robot):
        feet = robot["end_effectors"]
        # Orders are those of the harness, which shares no code with the program.
        for key, names in (
            ("joints", [joint["name"] for joint in robot["joints"]]),
            ("wheels", [foot["name"] for foot in feet if robots.is_wheel(foot)]),
            ("end_effectors", [foot["name"] for foot in feet]),
            ("channels", [name for name, _, _, _ in robots.channels(robot)]),
        ):
            if self.hello[key] != names:
                raise Unusable(f"{plan}: rollwalk control has {key} {self.hello[key]}; expected {names}")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        for pipe in (self.process.stdin, self.process.stdout, self.process.stderr):
            pipe.close()
        self.process.wait()

    def tick(self, record):
        """Set-points for a record as arrays in channel order, and the reason if they are open-loop set-points of the
        plan."""
        try:
            self.process.stdin.write(json.dumps(record).encode() + b"\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            # The reason is on its standard error.
            pass
        answer = self._read()
        return {key: np.array(answer[key]) for key in KEYS}, answer["untracked"]

    def _read(self):
        out = self.process.stdout.fileno()
        while b"\n" not in self.unread:
            if not select.select([out], [], [], ANSWER_S)[0]:
                raise Unusable(f"rollwalk control: no answer within {ANSWER_S} s")
            data = os.read(out, 65536)
            if not data:
                raise Unusable(f"rollwalk control: {self.process.stderr.read().decode().strip()}")
            self.unread += data
        line, self.unread = self.unread.split(b"\n", 1)
        return json.loads(line)


KEYS = ("position_rad", "speed_rad_s", "torque_nm", "kp_nm_rad", "kd_nm_s_rad")
