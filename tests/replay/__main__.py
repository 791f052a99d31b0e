#!/usr/bin/env python3
"""Replays plans in MuJoCo, open loop, with the servos of the robot file.

    python3 tests/replay [options] PLAN.json [PLAN.json ...]

docs/replay.md describes the simulation. Needs Python 3.11, mujoco and numpy.

Columns of the table:
  cycles 2-5, last cycle  achieved / planned: forward and left distance of the centre of mass, turn of the body
  sideways, yaw           achieved - planned, mean of a cycle
  path                    distance of the base from its planned path within a cycle, root mean square
  slip                    speed over the ground of the material at a planned stance contact with a load of at least
                          1 % of the weight; mean and 95th percentile
  swing on ground         share of the planned swing, lift-off and touch-down included, in which an end effector carries
                          at least 1 % of the weight
  sag                     planned - actual height of the body, mean
  saturated               share of time at the torque limit, for the worst motor
  depth                   deepest penetration of an end effector
  fell, touched           time of a fall (tilt above 1 rad relative to the plan, centre of mass below 55 % of its planned
                          height, or a quarter of the weight on body and upper limbs for half a second); link with the
                          longest ground contact

Exit code: 0 if every motion passes (stays on its feet and within 0.95 to 1.05 of its plan) with the feed-forward that
its robot's drives accept, or, without such a run, with every requested feed-forward; 1 if one does not, 2 if a file
or an option cannot be used.
"""

import argparse
import json
import multiprocessing
import os
import sys
from pathlib import Path

# One process for each run; more threads would only wait for each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

from errors import Unusable  # noqa: E402
import jobs  # noqa: E402
import measure  # noqa: E402
import player  # noqa: E402
import tables  # noqa: E402
import world  # noqa: E402

FEED_FORWARD = {"none": ["none"], "torque": ["torque"], "offset": ["offset"], "both": ["none", "torque"],
                "all": ["none", "torque", "offset"]}
ROBOTS = Path(__file__).resolve().parents[2] / "shipped/robots"


def main(arguments):
    options = _options(arguments)
    kinds = FEED_FORWARD[options.feed_forward]
    cases = (world.Case(),) + (world.PERTURBATIONS if options.robustness else ())
    inputs = jobs.Inputs(options.robot, options.robots, options.library, options.cycles, options.control_hz)
    todo = [(path, kind, case, inputs) for path in options.plans for kind in kinds for case in cases]
    try:
        # Faults of all files are reported before the first run.
        for path in options.plans:
            jobs.load(path, kinds[-1], inputs)
        if options.jobs > 1:
            with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
                results = _watched(pool.imap(jobs.replay, todo), len(todo))
        else:
            results = _watched(map(jobs.replay, todo), len(todo))
    except Unusable as error:
        print(error, file=sys.stderr)
        return 2
    nominal = [result for result in results if result["case"] == "nominal"]
    text = tables.nominal(nominal)
    if options.robustness:
        text += "\n\n" + tables.robustness(results)
    print(text)
    if options.json:
        Path(options.json).write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    return 0 if all(result["holds"] or result["needs_feedback"] for result in measure.deciding(nominal)) else 1


def _watched(results, count):
    """Collects all results. Prints a line to stderr for each run, because many runs take minutes."""
    found = []
    for result in results:
        found.append(result)
        words = (f"{result['motion']} of {result['robot']}", result["feed_forward"], result["case"])
        print(f"{len(found)} of {count}:", ", ".join(words), file=sys.stderr, flush=True)
    return found


def _options(arguments):
    parser = argparse.ArgumentParser(
        prog="replay", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("plans", nargs="+", metavar="PLAN.json")
    parser.add_argument("--feed-forward", choices=FEED_FORWARD, default="none",
                        help="torque or offset: as a torque, or on top of targets; both: none and torque")
    parser.add_argument("--robot", help="robot file of all plans; left out, NAME.toml in --robots")
    parser.add_argument("--robots", type=Path, default=ROBOTS, help="folder of robot files")
    parser.add_argument("--library", help="motion library (.rwl) whose frames and torques are played, by name")
    parser.add_argument("--cycles", type=_positive, default=20, help="periods of a motion that repeats (20)")
    parser.add_argument("--control-hz", type=_control_hz, default=player.CONTROL_HZ, help="control rate (120)")
    parser.add_argument("--robustness", action="store_true", help="perturbed runs as well")
    parser.add_argument("--jobs", type=_positive, default=os.cpu_count(), help="runs at a time (as many as cores)")
    parser.add_argument("--json", help="write all results here")
    return parser.parse_args(arguments)


def _positive(text):
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is below 1")
    return value


def _control_hz(text):
    value = int(text)
    if value % 60 or not 60 <= value <= 960:
        raise argparse.ArgumentTypeError(f"{value} is no multiple of 60 from 60 to 960")
    return value


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
