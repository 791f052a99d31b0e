#!/usr/bin/env python3
"""Plays the commands to the drives of a simulated robot, from a log of its world, in MuJoCo: the same commands in
both worlds.

    python3 tests/replay/logged.py ROBOT.toml RUN.csv [PLAN.json ...] [--json FILE]

RUN.csv is written by `rollwalk simulate LIB.rwl --world-log RUN.csv` (docs/formats/world-log.md), on level ground and
without pushes, because the log does not contain them. Set-points, gains and limits are decoded from the frames on the
buses. MuJoCo begins with the pose in which the hoist releases the robot, and ends when the hoist picks it up again.

Prints a line for each motion and transition up to the first fall: displacement in the log and in MuJoCo. For motions
with a given plan, the line shows means of periods and the plan's displacement. Exit code: 0, or 2 if a file cannot be
used.
"""

import argparse
import csv
import json
import math
import sys
from pathlib import Path

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from drives import Drives  # noqa: E402
from errors import Unusable  # noqa: E402
import measure  # noqa: E402
from model import Ground, Model  # noqa: E402
import motion as plans  # noqa: E402
import robots  # noqa: E402

# Steps of MuJoCo per step of the log.
PARTS = 4
# Value of the simulator that wrote the log.
GRAVITY_M_S2 = 9.81
# Speed above which rolling resistance is almost complete, m/s, as in the planner.
ROLLING_SIGN_WIDTH_M_S = 0.05
# Limits of a fall, as in the log: tilt of the body, height of the centre of mass.
FALL_TILT_RAD, FALL_HEIGHT = 1.0, 0.4


class Log:
    """Rows of a log after the hoist's release; all rows of a plan's log, which has no hoist."""

    def __init__(self, path, robot, hoisted=True):
        try:
            with open(path, encoding="utf-8", newline="") as file:
                rows = list(csv.DictReader(file))
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise Unusable(f"{path}: {error}") from error
        try:
            if hoisted and rows and rows[0]["held"] != "1":
                raise Unusable(f"{path}: no hoist holds the robot at its beginning; expected the log of a library behind its firmware")
            free = next(index for index, row in enumerate(rows) if row["held"] == "0")
            held = (index for index, row in enumerate(rows) if index > free and row["held"] == "1")
            self.rows = rows[free : next(held, len(rows))]
            _expect_robot(rows[0], robot)
            self.motion = [row["motion"] for row in self.rows]
            column = lambda name: np.array([float(row[name]) for row in self.rows])
            names = [name if foot is None else f"{name}_motor" for name, _, _, foot in robots.channels(robot)]
            channels = lambda what: np.stack([column(f"{name}_{what}") for name in names], axis=1)
            self.time_s = column("time_s")
            self.base = np.stack([column("base_" + key) for key in "x_m y_m z_m qw qx qy qz".split()], axis=1)
            self.com_m = np.stack([column(f"com_{axis}_m") for axis in "xyz"], axis=1)
            self.fell = column("fell")
            self.angle = channels("rad")
            self.kp, self.kd, self.limit = (channels(what) for what in ("kp_nm_rad", "kd_nm_s_rad", "limit_nm"))
            target, speed, torque = (channels(what) for what in ("target_rad", "target_rad_s", "feedforward_nm"))
            self.target, self.speed, self.torque = target, speed, torque
        except StopIteration:
            raise Unusable(f"{path}: the hoist holds the robot all the time (held), or there are no rows") from None
        except (KeyError, TypeError, ValueError) as error:
            raise Unusable(f"{path}: {error}; expected the log of a {robot['name']}, with whole lines") from error
        if len(self.rows) < 2:
            raise Unusable(f"{path}: one row without the hoist; expected at least 2")
        self.step_s = float(np.median(np.diff(self.time_s)))

    @property
    def control(self):
        """Torque that a drive adds to its springs and dampers about 0, N·m."""
        return self.kp * self.target + self.kd * self.speed + self.torque

    def yaw_rad(self):
        w, x, y, z = self.base[:, 3:].T
        return np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))

    def pieces(self, until):
        """Motion, first and last row of each segment with one motion."""
        start = 0
        for index in range(1, until + 1):
            if index == until or self.motion[index] != self.motion[start]:
                if self.motion[start]:
                    yield self.motion[start], start, index - 1
                start = index


def _expect_robot(row, robot):
    """If the robot had more motors or feet, missing columns would not reveal the wrong log."""
    motors = {name if foot is None else f"{name}_motor" for name, _, _, foot in robots.channels(robot)}
    feet = {foot["name"] for foot in robot["end_effectors"]}
    for ending, expected in (("_limit_nm", motors), ("_normal_n", feet)):
        found = {name.removesuffix(ending) for name in row if name.endswith(ending)}
        if found != expected:
            raise ValueError(f"columns *{ending} of {', '.join(sorted(found ^ expected))}")


def played(log, robot, look=lambda d: None, parts=PARTS):
    """Centre of mass and heading at the end of each row, and the row at which the robot fell; `look` gets MuJoCo's
    data at each."""
    model = Model(robot, GRAVITY_M_S2, Ground(step_s=log.step_s / parts))
    m, d = model.m, mujoco.MjData(model.m)
    drives = Drives(model, ROLLING_SIGN_WIDTH_M_S)
    feet = np.full(m.ngeom, -1)
    feet[model.foot_geoms] = np.arange(len(model.foot_geoms))
    which = robots.driven(robot)
    driven = model.joint_qpos[which]
    d.qpos[:7] = log.base[0]
    d.qpos[model.joint_qpos] = model.per_rad * [joint["nominal_rad"] for joint in robot["joints"]]
    d.qpos[driven] = log.angle[0, : len(driven)] * model.per_rad[which]
    mujoco.mj_forward(m, d)
    up, height = d.xmat[1][6:9].copy(), d.subtree_com[1][2]
    load = np.zeros(len(model.foot_geoms))
    controls = log.control
    com, yaw, fell = [d.subtree_com[1].copy()], [_yaw(d)], None
    look(d)
    for row in range(1, len(log.rows)):
        # Commands during the step that ends at the row.
        m.actuator_biasprm[:, 1], m.actuator_biasprm[:, 2] = -log.kp[row], -log.kd[row]
        d.ctrl[:] = controls[row]
        drives.torque_max = log.limit[row]
        for _ in range(parts):
            drives.act(d, load)
            mujoco.mj_step(m, d)
            load[:] = 0
            for geom, address in zip(d.contact.geom[:, 1], d.contact.efc_address):
                if feet[geom] >= 0 and address >= 0:
                    load[feet[geom]] += d.efc_force[address]
        com.append(d.subtree_com[1].copy())
        yaw.append(_yaw(d))
        look(d)
        tilt = math.acos(min(max(float(d.xmat[1][6:9] @ up), -1.0), 1.0))
        # A robot that sinks after torque-off has not fallen.
        sunk = log.motion[row] and d.subtree_com[1][2] < FALL_HEIGHT * height
        if fell is None and (tilt > FALL_TILT_RAD or sunk):
            fell = row
    return np.array(com), np.unwrap(yaw), fell


def _yaw(d):
    return math.atan2(d.xmat[1][3], d.xmat[1][0])


def way(com_m, yaw_rad, start, end):
    """Displacement forward and left in the initial heading, m, and turn, rad."""
    moved = plans.yaw_matrix(yaw_rad[start]).T @ (com_m[end] - com_m[start])
    return {"forward_m": float(moved[0]), "left_m": float(moved[1]), "turn_rad": float(yaw_rad[end] - yaw_rad[start])}


def mean_way(com_m, yaw_rad, marks):
    """Mean of the periods between marks."""
    ways = [way(com_m, yaw_rad, start, end) for start, end in zip(marks, marks[1:])]
    return {key: sum(found[key] for found in ways) / len(ways) for key in ways[0]}


def compare(robot, log, motions):
    """A row for each played motion up to the first fall. `motions` contains the motions with plans by name."""
    com_m, yaw_rad, fell = played(log, robot)
    logged_yaw = log.yaw_rad()
    ours_fell = int(np.argmax(log.fell > 0)) if log.fell.any() else None
    until = min(row for row in (fell, ours_fell, len(log.rows)) if row is not None)
    at = lambda row: None if row is None else float(log.time_s[row])
    pieces = []
    for name, start, end in log.pieces(until):
        motion = motions.get(name)
        periods = 1
        if motion is not None and motion.periodic:
            periods = max(round((log.time_s[end] - log.time_s[start]) / motion.duration_s), 1)
        marks = np.linspace(start, end, periods + 1).round().astype(int)
        pieces.append({
            "motion": name,
            "from_s": at(start),
            "periods": periods,
            **({} if motion is None else {"planned": motion.planned(), "goals": measure.goals(motion)}),
            "ours": mean_way(log.com_m, logged_yaw, marks),
            "mujoco": mean_way(com_m, yaw_rad, marks),
        })
    return {"robot": robot["name"], "fell_at_s": {"ours": at(ours_fell), "mujoco": at(fell)}, "pieces": pieces}


def main(arguments):
    parser = argparse.ArgumentParser(prog="logged", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robot", metavar="ROBOT.toml")
    parser.add_argument("log", metavar="RUN.csv")
    parser.add_argument("plans", metavar="PLAN.json", nargs="*")
    parser.add_argument("--json", help="write the result here")
    options = parser.parse_args(arguments)
    try:
        robot = robots.from_file(options.robot)
        motions = {motion.name: motion for motion in map(plans.load, options.plans)}
        result = compare(robot, Log(options.log, robot), motions)
        if options.json:
            Path(options.json).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        print(error, file=sys.stderr)
        return 2
    except Unusable as error:
        print(error, file=sys.stderr)
        return 2
    for piece in result["pieces"]:
        ours, theirs = piece["ours"], piece["mujoco"]
        plan = piece.get("planned")
        of_plan = lambda key: f" (planned {plan[key]:.4f})" if plan else ""
        words = ", ".join(f"{key} {ours[key]:.4f}, in MuJoCo {theirs[key]:.4f}{of_plan(key)}" for key in ours)
        print(f"{piece['from_s']:8.3f} s  {piece['motion']}: {words}")
    for world, at_s in result["fell_at_s"].items():
        print(f"fell after {at_s:.3f} s: {world}" if at_s is not None else f"no fall: {world}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
