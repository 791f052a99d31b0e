#!/usr/bin/env python3
"""Identifies a robot from a run in MuJoCo, and predicts other runs: a test of `rollwalk identify` with contacts that
differ from its model.

    python3 tests/replay/identified.py ROLLWALK -o FOLDER --json RESULTS.json [--seeds 1 2]

ROLLWALK is the program. AgileBot, with other friction and gains than in its file, plays motions in MuJoCo, measured
with noise (recorded.py). The robot is identified from some of them, each alone and all together. The result of the
first predicts the others. For comparison, the values of the file and the true values predict them too, the latter
also with fitted contacts and delay. Exit code: 0, or 2 if a program fails.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import recorded  # noqa: E402
import robots  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
ROBOT = ROOT / "shipped/robots/agilebot.toml"
FITTED, PREDICTED = ("slalom", "walk", "step_and_drive"), ("step_and_drive", "walk", "trot")
# Longest run of a command: identification takes minutes.
COMMAND_S = 1800
# At first, the servos deflect under the robot's weight. Several pairs of gains and landing times of the wheels fit this
# part equally well, so it is left out.
BEGINS = ("--from", "0.3")
# Values of the robot in MuJoCo that replace those of its file: table, key, values. One line of a template is for all
# wheels.
HIDDEN = (
    ("[[template.leg.end_effector]]", "friction_coefficient", "0.8", "0.3"),
    ("[actuator.xm430]", "kp_nm_rad", "80.0", "50.0"),
    ("[actuator.xm540]", "kd_nm_s_rad", "2.5", "1.8"),
)
# Parameters that no robot file has.
ALONG = ("--fit", "stiffness,stick,delay")


def main(arguments):
    parser = argparse.ArgumentParser(prog="identified", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rollwalk", metavar="ROLLWALK")
    parser.add_argument("-o", "--output", required=True, type=Path, metavar="FOLDER")
    parser.add_argument("--json", required=True, type=Path, metavar="RESULTS.json")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    try:
        hidden = options.output / "hidden.toml"
        hidden.write_text(hide(ROBOT.read_text(encoding="utf-8")), encoding="utf-8")
        logs = {motion: log(options, motion) for motion in dict.fromkeys((*FITTED, *PREDICTED))}
        results = [identify(options, hidden, logs, seed) for seed in options.seeds]
    except (OSError, subprocess.SubprocessError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    results = {"true": truth(robots.from_file(hidden)), "seeds": results}
    options.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    return 0


def hide(text):
    """Text of a robot file with the true values in place of the values that `rollwalk identify` starts from."""
    for table, key, before, after in HIDDEN:
        head, mark, rest = text.partition(f"{table}\n")
        line = f"{key} = {before}"
        if not mark or rest.count(line) == 0:
            raise ValueError(f"{ROBOT}: expected `{line}` in {table}")
        text = head + mark + rest.replace(line, f"{key} = {after}", 1)
    return text


def truth(robot):
    """Parameters of a robot, by their names in `rollwalk identify`."""
    found = {"friction": robot["end_effectors"][0]["friction_coefficient"]}
    names = {"steer": "xm430", "knee": "xm540"}
    for name, actuator, joint, _ in robots.channels(robot):
        of = "xm430_drive" if joint is None else names.get(name.rsplit("_", 1)[-1])
        if of is not None:
            found[f"kd.{of}"] = actuator["kd_nm_s_rad"]
            if joint is not None:
                found[f"kp.{of}"] = actuator["kp_nm_rad"]
    return found


def run(options, *arguments):
    words = [str(word) for word in (options.rollwalk, *arguments)]
    return subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True, timeout=COMMAND_S).stdout


def log(options, motion):
    """Simulates a motion and logs the commands to the drives."""
    plan, path = options.output / f"{motion}.json", options.output / f"{motion}.csv"
    run(options, "plan", ROOT / f"shipped/motions/{motion}.toml", "-o", plan)
    run(options, "simulate", plan, "--cycles", 3, "--rate", 120, "--no-feed-forward", "--world-log", path)
    return path


def identify(options, hidden, logs, seed):
    """Identifies the robot from recordings with the noise of a seed, and predicts other motions."""
    runs = {}
    for motion, path in logs.items():
        runs[motion] = options.output / f"{motion}-{seed}.csv"
        # Each run has separate noise.
        number = 100 * seed + len(runs)
        if recorded.main([str(hidden), str(path), "-o", str(runs[motion]), "--seed", str(number)]) != 0:
            raise ValueError(f"{motion} cannot be recorded")
    predict = [word for motion in PREDICTED for word in ("--predict", runs[motion])]

    def fit(motions, robot, *more):
        words = ("--robot", robot, "-o", options.output / "fitted.toml", "--json", *BEGINS)
        text = run(options, "identify", *(runs[motion] for motion in motions), *words, *more)
        # Each run takes minutes, so results are stored even if a later run fails.
        (options.output / f"{Path(robot).stem}-{'-'.join(motions)}-{seed}.json").write_text(text, encoding="utf-8")
        return json.loads(text)

    first = FITTED[:1]
    found, true, together = fit(first, ROBOT, *predict), fit(first, hidden, *predict, *ALONG), fit(FITTED, ROBOT)
    return {
        "seed": seed,
        "alone": {motion: of["parameters"] for motion, of in zip(FITTED, together["runs"])},
        "together": together["parameters"],
        "predicted": {
            motion: {
                "file": _column(ours, "before"), "fitted": _column(ours, "after"),
                "true": _column(theirs, "before"), "true with contacts": _column(theirs, "after"),
            }
            for motion, ours, theirs in zip(PREDICTED, found["others"], true["others"])
        },
    }


def _column(run, when):
    return {fit["signal"]: fit[when] for fit in run["predicted"]}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
