"""Requests of motions without tuning: on imported robots, and random ones on the shipped robots.

All lengths and times scale with the height of the robot's body, as they do for real animals (Froude number).
"""

import json
import math
import random
from dataclasses import dataclass
from pathlib import Path

GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True)
class Robot:
    """A robot file, and the scale of its requests."""

    name: str
    file: Path
    height_m: float

    def time_s(self, periods):
        """A time in units of sqrt(height / gravity), a whole number of frames."""
        return max(round(60 * periods * math.sqrt(self.height_m / GRAVITY_M_S2)), 6) / 60


@dataclass(frozen=True)
class Request:
    """A motion of a robot, as the text of its file."""

    robot: Robot
    name: str
    text: str

    def key(self):
        """Unique name of the request."""
        return f"{self.robot.name}/{self.name}"


def _gait(robot, name, gait, duty, periods, forward=0.0, left=0.0, turn=0.0, swing=0.1):
    """A periodic motion; distances are relative to the height of the body."""
    h = robot.height_m
    text = (
        f'name = "{name}"\nrobot = {json.dumps(str(robot.file))}\nends = "periodic"\n'
        f"duration_s = {robot.time_s(periods):.6f}\nswing_height_m = {swing * h:.4f}\n\n"
        f'[footfalls]\ngait = "{gait}"\nduty = {duty}\n\n'
        f"[goal]\nforward_m = {forward * h:.4f}\nleft_m = {left * h:.4f}\nturn_rad = {turn:.4f}\n"
    )
    return Request(robot, name, text)


def of_walking(robot):
    """Eight requests on a robot with four legs."""
    h = robot.height_m
    duck = (
        f'name = "duck"\nrobot = {json.dumps(str(robot.file))}\nends = "at_rest"\nduration_s = {robot.time_s(8):.6f}\n\n'
        f'[footfalls]\nall = "stance"\n\n[goal]\nforward_m = 0.0\nleft_m = 0.0\nturn_rad = 0.0\n\n'
        f'[[target]]\nof = "com"\nat_s = {robot.time_s(4):.6f}\nleft_m = {0.08 * h:.4f}\n'
    )
    return [
        _gait(robot, "walk", "walk", 0.8, 8, forward=0.35),
        _gait(robot, "walk_back", "walk", 0.8, 8, forward=-0.25),
        _gait(robot, "walk_left", "walk", 0.8, 8, left=0.15),
        _gait(robot, "walk_turn", "walk", 0.8, 8, turn=0.15),
        _gait(robot, "trot", "trot", 0.6, 3, forward=0.2),
        _gait(robot, "trot_left", "trot", 0.6, 3, left=0.08),
        _gait(robot, "trot_turn", "trot", 0.6, 3, turn=0.1),
        Request(robot, "lean", duck),
    ]


def drawn(robots, count, seed):
    """Random requests, all drawn from one seed: each of a robot, a kind of footfalls that suits it, and a goal."""
    draw = random.Random(seed)
    found = []
    for number in range(count):
        robot, kinds = draw.choice(robots)
        kind = draw.choice(kinds)
        found.append(_drawn(draw, robot, kind, f"drawn_{number}"))
    return found


def _drawn(draw, robot, kind, name):
    h = robot.height_m
    goal = {"forward_m": 0.0, "left_m": 0.0, "turn_rad": 0.0}
    if kind == "wheels":
        ends = draw.choice(["periodic", "at_rest"])
        goal["forward_m"] = draw.uniform(-1, 1) * 1.5 * h
        goal["turn_rad"] = draw.choice([0.0, draw.uniform(-0.6, 0.6)])
        goal["left_m"] = draw.choice([0.0, draw.uniform(-0.3, 0.3) * h])
        footfalls = 'all = "stance"\n'
        duration_s = robot.time_s(draw.uniform(6, 14))
        swing = ""
    elif kind == "glides":
        ends = "periodic"
        goal["forward_m"] = draw.uniform(0.2, 1.0) * h
        goal["left_m"] = None
        footfalls = 'all = "stance"\n'
        duration_s = robot.time_s(draw.uniform(6, 12))
        swing = ""
    else:
        ends = "periodic"
        of = draw.choice(list(goal))
        goal[of] = draw.choice([-1, 1]) * draw.uniform(0.2, 1) * {"forward_m": 0.5 * h, "left_m": 0.2 * h, "turn_rad": 0.3}[of]
        duty = draw.uniform(0.72, 0.85) if kind == "walk" else draw.uniform(0.52, 0.7)
        footfalls = f'gait = "{kind}"\nduty = {duty:.3f}\n'
        duration_s = robot.time_s(draw.uniform(6, 10) if kind == "walk" else draw.uniform(2.5, 5))
        swing = f"swing_height_m = {draw.uniform(0.06, 0.14) * h:.4f}\n"
    goals = "".join(f"{key} = {value:.4f}\n" for key, value in goal.items() if value is not None)
    text = (
        f'name = "{name}"\nrobot = {json.dumps(str(robot.file))}\nends = "{ends}"\nduration_s = {duration_s:.6f}\n{swing}\n'
        f"[footfalls]\n{footfalls}\n[goal]\n{goals}"
    )
    return Request(robot, name, text)
