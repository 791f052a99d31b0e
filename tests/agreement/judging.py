"""Judgement of one request: the plan with its verdict, and the result of the plan in MuJoCo."""

from dataclasses import replace
import json
import os
from pathlib import Path
import subprocess
import sys

sys.path.append(str(Path(__file__).resolve().parents[1] / "replay"))

from errors import Unusable  # noqa: E402
import jobs  # noqa: E402
import measure  # noqa: E402
import robots as robot_files  # noqa: E402
import world  # noqa: E402
from model import Ground  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
CYCLES = 8
# Longest run of a command, s.
COMMAND_S = 1800
# Time constants of MuJoCo's contacts, s; stiffness is proportional to the inverse square. On hard contacts, results
# do not depend on it (docs/replay.md). On soft contacts, feet sink in by 0.2 to 0.8 mm, as in our
# simulator; wheels then roll on a radius that is too small.
HARD_S = {"MuJoCo, hard, 1/2": 0.00424, "MuJoCo, hard": 0.003, "MuJoCo, hard, 2 x": 0.00212}
SOFT_S = {"MuJoCo, soft, 1/2": 0.0141, "MuJoCo, soft": 0.01, "MuJoCo, soft, 2 x": 0.0071}
CONTACTS_S = HARD_S | SOFT_S
# Runs of `rollwalk simulate`: at the usual rate, at two and four times this rate, and on softer and harder contacts.
SIMULATED = {
    "simulate": [],
    "simulate at 2 x the rate": ["--rate", "960"],
    "simulate at 4 x the rate": ["--rate", "1920"],
    "simulate at 1/2 the stiffness": ["--contact-stiffness", "0.5"],
    "simulate at 2 x the stiffness": ["--contact-stiffness", "2"],
}


def run(options, *words):
    return subprocess.run([str(word) for word in (options.rollwalk, *words)], capture_output=True, text=True, timeout=COMMAND_S)


def judge(job):
    """A line of the results."""
    options, request = job
    return {"key": request.key(), **_judge(options, request)}


def _judge(options, request):
    folder = options.output / request.robot.name
    folder.mkdir(exist_ok=True)
    if request.robot.name == "shipped":
        file = Path(request.text)
    else:
        file = folder / f"{request.name}.toml"
        file.write_text(request.text)
    plan = folder / f"{request.name}.plan.json"
    began = os.times()
    planned = run(options, "plan", file, "-o", plan, "--json")
    ended = os.times()
    line = {"plan_cpu_s": round(ended.children_user - began.children_user, 2), "plan_exit": planned.returncode}
    if planned.returncode not in (0, 3) or not plan.exists():
        return line | {"error": planned.stderr[-400:]}
    outcome = json.loads(planned.stdout)
    for key in ("judgement", "consistent", "simulation"):
        line[key] = outcome.get(key)
    line["holds"] = planned.returncode == 0
    line["samples"] = outcome["samples"]
    line["diagnosis"] = bool(outcome.get("diagnosis"))
    reported = run(options, "report", plan, "--json")
    report = json.loads(reported.stdout)
    line["growth"], line["needs_feedback"] = report.get("growth_per_cycle"), "needs_feedback" in report
    if line["diagnosis"]:
        return line
    line["verdicts"] = {"report": reported.returncode == 0}
    for name, words in SIMULATED.items():
        line["verdicts"][name] = run(options, "simulate", plan, "--cycles", CYCLES, *words).returncode == 0
    line["mujoco"] = {name: replayed(plan, request.robot.file, time_constant_s) for name, time_constant_s in CONTACTS_S.items()}
    return line


def replayed(plan, robot, time_constant_s):
    try:
        motion, robot_data, frames, torques = jobs.load(str(plan), "none", jobs.Inputs(str(robot), ROOT))
        ground = replace(Ground(), solref=(time_constant_s, 1.0))
        track = world.run(motion, robot_data, robot_files.feed_forward(robot), cycles=CYCLES, ground=ground)
    except Unusable as error:
        return {"error": str(error)}
    found = measure.summary(motion, track, CYCLES)
    goals = measure.goals(motion)
    cycles = [[round(cycle[key] / found["planned"][key], 4) for key in goals] for cycle in found["cycles"]]
    # The effect of the start has decayed after a period.
    mean = _mean(cycles[1:] or cycles)
    holds = found["holds"] if not goals else found["fell_at_s"] is None and _comes_there(cycles)
    return {"holds": holds, "ratio": mean, "fell": found["fell_at_s"], "drift": found["drift"], "cycles": cycles}


def _comes_there(cycles):
    """True if the motion passes by the rules of the simulator (docs/solver.md, Simulated). `cycles` contains the
    achieved goals of each period, as fractions of the planned goals."""
    rest = cycles[1:] or cycles
    if any(abs(of - 1) > 0.05 for of in _mean(rest) + _mean(rest[-3:])):
        return False
    changes = [abs(a - b) for one, other in zip(cycles[-4:], cycles[-3:]) for a, b in zip(one, other)]
    return bool(len(cycles) < CYCLES or max(changes) <= 0.02)


def _mean(cycles):
    return [round(float(sum(values)) / len(cycles), 4) for values in zip(*cycles)]
