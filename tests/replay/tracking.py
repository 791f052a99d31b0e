#!/usr/bin/env python3
"""Compares controllers in MuJoCo, as `rollwalk bench tracking` does in the project's own simulator: docs/tracking.md,
"In MuJoCo".

    python3 tests/replay/tracking.py ROLLWALK --json RESULTS.json [options] PLAN.json [PLAN.json ...]

ROLLWALK is the program, whose `control` tracks the plans. Open loop plays as in tests/replay. Exit code: 0, or 2 if a
file or program cannot be used.
"""

import argparse
import json
import math
import multiprocessing
import os
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path

# One process for each run; more threads would only wait for each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import jobs  # noqa: E402
import measure  # noqa: E402
import tables  # noqa: E402
import tracked  # noqa: E402
import world  # noqa: E402
from errors import Unusable  # noqa: E402
from sensed import Noise  # noqa: E402

ROBOTS = Path(__file__).resolve().parents[2] / "shipped/robots"
CYCLES = 5
# Feed-forward of open loop, or feedback of closed loop.
OPEN = {"servos": "none", "feed-forward": "torque"}
CLOSED = {"tracking, tasks": "tasks", "tracking, gains": "gains"}
# Maximum push of the search as a share of the weight, and its resolution.
PUSH_MOST, PUSH_STEP = 1.6, 0.1
PHASES, DIRECTIONS = 8, ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
# Controllers of pushed runs, and number of their periods.
PUSHED, PUSH_CYCLES = ("feed-forward", "tracking, gains"), 4


@dataclass(frozen=True)
class World:
    case: world.Case
    noise: Noise | None = None


WORLDS = (
    World(world.Case("as planned")),
    World(world.Case("mass + 10 %", mass_factor=1.1)),
    World(world.Case("mass − 10 %", mass_factor=0.9)),
    World(world.Case("friction 0.5", friction=0.5)),
    World(world.Case("6 ms", delay_s=0.006)),
    World(world.Case("10 ms", delay_s=0.010)),
    World(world.Case("noise, estimator"), Noise()),
    World(world.Case("slope 5°", slope_rad=math.radians(5))),
    World(world.Case("together", friction=0.5, mass_factor=1.1, delay_s=0.006), Noise()),
)


@dataclass(frozen=True)
class Job:
    rollwalk: str
    plan: str
    control: str
    # None stands for pushes of one phase and direction.
    world: World | None = None
    phase: int = 0
    direction: tuple = field(default=())


def main(arguments):
    options = _options(arguments)
    # Pushes take longest, so they come first.
    todo = [
        Job(options.rollwalk, plan, control, None, phase, direction)
        for plan in options.plans if Path(plan).name in (options.push or ())
        for control in PUSHED for phase in range(PHASES) for direction in DIRECTIONS
    ] + [Job(options.rollwalk, plan, control, of) for plan in options.plans for control in (*OPEN, *CLOSED) for of in WORLDS]
    results = []
    try:
        with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
            for result in pool.imap(run, todo):
                results.append(result)
                print(f"{len(results)} of {len(todo)}:", *result["words"], file=sys.stderr, flush=True)
    except Unusable as error:
        print(error, file=sys.stderr)
        return 2
    print(tables.tracked(results))
    Path(options.json).write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    return 0


def run(job):
    """Results of a job."""
    result = {"plan": Path(job.plan).name, "control": job.control}
    if job.world is None:
        of, part = _largest(job)
        words = [of["motion"], job.control, f"phase {job.phase}", str(job.direction), f"{part:.1f}"]
        return result | of | {"phase": job.phase, "direction": job.direction, "push": part, "words": words}
    summary = _play(job, job.world.case, job.world.noise, CYCLES)
    ratio = ", ".join(f"{value:.3f}" for value in (summary["ratio"] or {}).values())
    fate = ratio if summary["fell_at_s"] is None else f"fell at {summary['fell_at_s']:.2f} s"
    return result | summary | {"words": [result["plan"], job.control, job.world.case.name, fate]}


def _largest(job):
    """Motion, robot, and the largest push that the robot survives, found by bisection."""
    low, high = 0.0, PUSH_MOST
    while high - low > 1.01 * PUSH_STEP:
        middle = 0.5 * (low + high)
        moment = job.phase / PHASES
        push = world.Push(middle, job.direction, 1.0 + moment, moment)
        case = replace(WORLDS[0].case, push=push)
        summary = _play(job, case, None, PUSH_CYCLES)
        low, high = (middle, high) if summary["fell_at_s"] is None else (low, middle)
    return {"motion": summary["motion"], "robot": summary["robot"]}, low


def _play(job, case, noise, cycles):
    motion, robot, _, _ = jobs.load(job.plan, "torque", jobs.Inputs(_beside(job.plan), ROBOTS))
    untracked = 0
    if job.control in OPEN:
        track = world.run(motion, robot, OPEN[job.control], case, cycles)
    else:
        track, untracked = tracked.run(job.rollwalk, job.plan, motion, robot, CLOSED[job.control], case, cycles, noise)
    summary = measure.summary(motion, track, cycles)
    return {"motion": motion.name, "robot": robot["name"], "case": case.name, "untracked": untracked, **summary}


def _beside(plan):
    """Robot file of an imported robot, which is beside its plans; None for a shipped robot."""
    file = Path(plan).with_name("robot.toml")
    return str(file) if file.exists() else None


def _options(arguments):
    parser = argparse.ArgumentParser(prog="tracking", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rollwalk", metavar="ROLLWALK")
    parser.add_argument("plans", nargs="+", metavar="PLAN.json")
    parser.add_argument("--json", required=True, metavar="RESULTS.json")
    parser.add_argument("--push", nargs="*", metavar="PLAN.json", help="names of the plans that are pushed as well")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="runs at a time (as many as cores)")
    options = parser.parse_args(arguments)
    unknown = set(options.push or ()) - {Path(plan).name for plan in options.plans}
    if unknown:
        parser.error(f"--push {' '.join(sorted(unknown))}: not among the plans")
    return options


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
