#!/usr/bin/env python3
"""Records a run in MuJoCo, for `rollwalk identify`: the commands to the drives of a simulated robot, played by a robot with
its own contacts.

    python3 tests/replay/recorded.py ROBOT.toml RUN.csv -o RECORDED.csv [--angle-noise RAD] [--place-noise M] [--seed N]

RUN.csv is that of `rollwalk simulate PLAN.json --world-log RUN.csv` (docs/formats/world-log.md), on level ground; the robot
begins at rest. Commands and limits are those of RUN.csv; gains, masses, friction and feet are those of ROBOT.toml. The table
contains what a real robot could measure: commands, angles and speeds of motors, and the pose of the body from an IMU and a
tracking system. Exit code: 0, or 2 if a file cannot be used.
"""

import argparse
import csv
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from errors import Unusable  # noqa: E402
from logged import Log, played  # noqa: E402
import robots  # noqa: E402


def main(arguments):
    parser = argparse.ArgumentParser(prog="recorded", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robot", metavar="ROBOT.toml")
    parser.add_argument("log", metavar="RUN.csv")
    parser.add_argument("-o", "--output", required=True, metavar="RECORDED.csv")
    parser.add_argument("--angle-noise", type=float, default=2e-3, metavar="RAD", help="standard deviation of angles and of the tilt")
    parser.add_argument("--place-noise", type=float, default=2e-3, metavar="M", help="standard deviation of the place of the body")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    try:
        robot = robots.from_file(options.robot)
        log = Log(options.log, robot, hoisted=False)
        rows = record(log, robot, options)
        with open(options.output, "w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows(rows)
    except (OSError, Unusable) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


# Steps of MuJoCo for each row. With four steps, the error of its first-order integrator would look like a gain.
PARTS = 16


def record(log, robot, options):
    """Heading and rows."""
    gains = [actuator for _, actuator, _, _ in robots.channels(robot)]
    log.kp[:] = [actuator["kp_nm_rad"] for actuator in gains]
    log.kd[:] = [actuator["kd_nm_s_rad"] for actuator in gains]
    seen = []

    def look(d):
        # Positions and speeds belong to this step; quantities that MuJoCo derives, such as actuator lengths, to the last.
        joints = d.model.actuator_trnid[:, 0]
        seen.append((d.qpos[d.model.jnt_qposadr[joints]], d.qvel[d.model.jnt_dofadr[joints]], d.qpos[:7].copy()))

    _, _, fell = played(log, robot, look, PARTS)
    if fell is not None:
        raise Unusable(f"the robot falls in MuJoCo at {log.time_s[fell]:.2f} s")
    random = np.random.default_rng(options.seed)
    names = [name if foot is None else f"{name}_motor" for name, _, _, foot in robots.channels(robot)]
    commands = [f"{name}_{what}" for name in names for what in ("target_rad", "target_rad_s", "feedforward_nm")]
    pose = [f"base_{key}" for key in "x_m y_m z_m qw qx qy qz".split()]
    yield ["time_s", *commands, *(f"{name}_rad" for name in names), *(f"{name}_rad_s" for name in names), *pose]
    for row, (angle, speed, base) in zip(log.rows, seen):
        angle = angle + random.normal(0, options.angle_noise, angle.shape)
        base = base.copy()
        base[:3] += random.normal(0, options.place_noise, 3)
        # A small turn: half of it in the vector part.
        base[4:] += random.normal(0, options.angle_noise / 2, 3)
        base[3:] /= np.linalg.norm(base[3:])
        yield [row["time_s"], *(row[name] for name in commands), *angle, *speed, *base]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
