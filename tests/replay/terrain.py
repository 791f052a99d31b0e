#!/usr/bin/env python3
"""Plans motions on terrain, and plays each in Rollwalk's simulator and, exported with its terrain, in MuJoCo: in open loop with
feed-forward, and tracked.

    python3 tests/replay/terrain.py ROLLWALK -o FOLDER --json RESULTS.json [options] ROBOT.toml [ROBOT.toml ...]

Each result is also written to FOLDER. A run continues with the motions that have no result there. Exit code: 0, or 2 if a program
or file cannot be used.
"""

import argparse
import json
import os
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import exported  # noqa: E402
import tables  # noqa: E402
import terrain_cases  # noqa: E402
from errors import Unusable  # noqa: E402

# Longest time of a program, s.
LONGEST_S = 900


def main(arguments):
    parser = argparse.ArgumentParser(prog="terrain", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rollwalk", type=Path, metavar="ROLLWALK")
    parser.add_argument("robots", nargs="+", type=Path, metavar="ROBOT.toml")
    parser.add_argument("-o", dest="folder", type=Path, required=True, help="folder of all files")
    parser.add_argument("--json", type=Path, required=True, help="all results")
    parser.add_argument("--only", default="", metavar="WORD", help="only motions with this word in robot:motion")
    options = parser.parse_args(arguments)
    try:
        robots = [Robot(options.rollwalk.resolve(), robot.resolve(), options.folder) for robot in options.robots]
        runs = [(robot, case) for robot in robots for case in terrain_cases.of_robot(robot.name, robot.size)]
        runs = [(robot, case) for robot, case in runs if options.only in f"{robot.name}:{case.name}"]
        for robot, case in runs:
            robot.result(case, "played", robot.played)
        # Closed loops in MuJoCo take longest, so they come last.
        for robot, case in runs:
            robot.result(case, "tracked", robot.tracked)
        results = [robot.results(case) for robot, case in runs]
    except Unusable as error:
        print(error, file=sys.stderr)
        return 2
    print(tables.terrain(results))
    options.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    return 0


class Robot:
    """A robot file, and the folder of its motions."""

    def __init__(self, rollwalk, file, folder):
        self.rollwalk, self.file = rollwalk, file
        checked = self._json("robot", "check", file, "--json")
        robot, standing = checked["robot"], checked["standing"]
        self.name = robot["name"]
        ahead = [contact["position_m"][0] for contact in standing["contacts"]]
        wheels = [foot["radius_m"] for foot in robot["end_effectors"] if foot["contact"]["kind"] == "actuated_wheel"]
        self.size = terrain_cases.Size(standing["body_height_m"], max(ahead) - min(ahead), max(wheels, default=0.0))
        self.folder = folder.resolve() / self.name
        self.folder.mkdir(parents=True, exist_ok=True)

    def result(self, case, part, compute):
        """Computes a part of the results of a motion unless its file exists."""
        path = self.folder / f"{case.name}.{part}.json"
        if path.exists():
            return
        result = compute(case)
        path.write_text(json.dumps(result, indent=1), encoding="utf-8")
        print(f"{self.name}, {case.name}, {part}", file=sys.stderr, flush=True)

    def results(self, case):
        """All results of a motion."""
        result = {"robot": self.name, "motion": case.name}
        for path in (self.folder / f"{case.name}.{part}.json" for part in ("played", "tracked")):
            result |= json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        return result

    def played(self, case):
        """Outcome of the plan, its runs in Rollwalk's simulator, and its run in open loop in MuJoCo."""
        result = {"level": self._level(case)} if case.terrain else {}
        plan = self._planned(case.name, case.motion, case.terrain)
        if "refused" in plan:
            return result | plan
        file, model = self._files(case)
        result |= plan | {"room": self._json("report", file, "--json")["room"]}
        for control, words in (("open", []), ("tracked", ["--tracking"])):
            run = self._json("simulate", file, "--json", *words)
            result[control] = {key: run.get(key) for key in ("planned", "goals", "cycles", "fell_at_s", "slid_m", "holds", "why")}
        self._run("export", file, "-o", model)
        result["mujoco_open"] = asdict(exported.play(model, lies=_lies(case)))
        return result

    def tracked(self, case):
        """Outcome of the closed loop in MuJoCo."""
        file, model = self._files(case)
        if not model.exists():
            return {}
        return {"mujoco_tracked": asdict(exported.play(model, file, self.rollwalk, _lies(case)))}

    def _files(self, case):
        return (self.folder / f"{case.name}{ending}" for ending in (".json", ".xml"))

    def _level(self, case):
        """The same motion on level ground; one file serves all terrains of the motion."""
        name = "level-" + format(hash_of(case.motion), "08x")
        path = self.folder / f"{name}.level.json"
        if not path.exists():
            path.write_text(json.dumps(self._planned(name, case.motion, "")), encoding="utf-8")
        return json.loads(path.read_text(encoding="utf-8"))

    def _planned(self, name, motion, terrain):
        """Outcome of `rollwalk plan`, or the reason why it refuses the motion."""
        head = f'name = "{name}"\nrobot = "{self.file}"\n'
        if terrain:
            (self.folder / f"{name}.terrain.toml").write_text(terrain, encoding="utf-8")
            head += f'terrain = "{name}.terrain.toml"\n'
        file = self.folder / f"{name}.toml"
        file.write_text(head + motion, encoding="utf-8")
        before_s = os.times().children_user
        run = self._run("plan", file, "-o", self.folder / f"{name}.json", "--json", may_fail=True)
        cpu_s = os.times().children_user - before_s
        try:
            plan = json.loads(run.stdout)
        except ValueError:
            return {"refused": run.stderr.strip() or "no answer in time"}
        keys = ("status", "iterations", "samples", "judgement", "simulation", "diagnosis")
        return {"cpu_s": cpu_s} | {key: plan[key] for key in keys}

    def _json(self, *words):
        run = self._run(*words)
        try:
            return json.loads(run.stdout)
        except ValueError as error:
            raise Unusable(f"rollwalk {words[0]}: {run.stderr.strip()}") from error

    def _run(self, *words, may_fail=False):
        command = [str(word) for word in (self.rollwalk, *words)]
        try:
            run = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, check=False)
        except subprocess.TimeoutExpired:
            return subprocess.CompletedProcess(command, 1, "", "")
        # Exit code 3: a plan fails a check.
        if run.returncode not in (0, 3) and not may_fail:
            raise Unusable(f"rollwalk {words[0]}: {run.stderr.strip()}")
        return run


def _lies(case):
    return "lying" in case.motion


def hash_of(text):
    """A number for a text, equal in every run."""
    number = 0
    for byte in text.encode():
        number = (number * 31 + byte) % 2**32
    return number


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
