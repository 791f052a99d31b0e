#!/usr/bin/env python3
"""Agreement of verdicts on requests without tuning: verdict of `rollwalk plan`, and result in MuJoCo.

    python3 tests/agreement ROLLWALK -o FOLDER [--robots FOLDER] [--drawn COUNT] [--seed SEED] [--shipped]

Requests are eight motions of each imported robot, random ones of robots that ship with Rollwalk, and the motions that ship. Every
request is planned, with its verdict; a plan that the planner does not call infeasible is replayed in MuJoCo on contacts of six
stiffnesses, eight periods each, and by `rollwalk simulate` at other rates and stiffnesses. Each request is a line of FOLDER/results.jsonl; what has a line there is not run again.

Exit code: 0 if at most one in forty of the good plans fails in MuJoCo on one of the hard contacts, by the rules of our simulator, and at most
one in forty of all that are judged was refused and holds on all contacts, the soft ones too; 1 if not, 2 if nothing was run.
"""

import argparse
import json
import multiprocessing
import os
from pathlib import Path
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import drawing  # noqa: E402
from judging import CONTACTS_S, HARD_S, ROOT, SIMULATED, judge, run  # noqa: E402

# Robots that ship with Rollwalk, with what their end effectors can do.
SHIPPED = {
    "agilebot": ["wheels", "walk", "trot"],
    "anymal_wheels": ["wheels", "walk", "trot"],
    "car": ["wheels"],
    "creature3": ["walk", "trot"],
    "dinobot": ["wheels"],
    "legbot": ["walk", "trot"],
    "pup": ["wheels", "walk", "trot"],
    "skaterbot": ["walk"],
    "swizzlebot": ["glides"],
    "swizzlebot4": ["glides"],
}


# Robots with four legs of the package example-robot-data, below its folder of robots.
IMPORTED = {
    "a1": "a1_description/urdf/a1.urdf",
    "anymal_b": "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c": "anymal_c_simple_description/urdf/anymal.urdf",
    "b1": "b1_description/urdf/b1.urdf",
    "go1": "go1_description/urdf/go1.urdf",
    "go2": "go2_description/urdf/go2.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "laikago": "laikago_description/urdf/laikago.urdf",
    "solo": "solo_description/robots/solo.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
}
# One verdict in this number may be wrong.
ONE_IN = 40


def main(arguments):
    options = _options(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    results = options.output / "results.jsonl"
    lines = [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    done = {line["key"] for line in lines}
    todo = [(options, request) for request in _requests(options) if request.key() not in done]
    with multiprocessing.get_context("spawn").Pool() as pool, results.open("a") as file:
        for number, line in enumerate(pool.imap_unordered(judge, todo), 1):
            file.write(json.dumps(line) + "\n")
            file.flush()
            lines.append(line)
            print(f"{number} of {len(todo)}: {line['key']}", file=sys.stderr, flush=True)
    return summary(lines)


def summary(lines):
    """Prints the number of verdicts that agree, and every verdict that does not."""
    replayed = [line for line in lines if "mujoco" in line]
    if not replayed:
        print("nothing was replayed")
        return 2
    held = lambda line, contacts: all(line["mujoco"][contact].get("holds") for contact in contacts)
    needs = [line for line in replayed if line["judgement"] == "needs_feedback" or line["needs_feedback"]]
    # MuJoCo plays one motion, and does not show displacements that transitions reverse.
    taken_back = [line for line in replayed if line["judgement"] == "taken_back"]
    judged = [line for line in replayed if line not in needs and line not in taken_back]
    good, refused = ([line for line in judged if line["holds"] is wanted] for wanted in (True, False))
    missed = [line for line in good if not held(line, HARD_S)]
    lost = [line for line in refused if held(line, CONTACTS_S)]
    ratios = lambda line: [run.get("ratio") or run.get("fell") or run.get("error") for run in line["mujoco"].values()]
    for title, wrong in (("good, and fails in MuJoCo", missed), ("refused, and passes in MuJoCo", lost)):
        for line in wrong:
            why = line["simulation"] if line["consistent"] else line["judgement"]
            print(f"{title}: {line['key']}, {ratios(line)}, {why}")
    # Agreement of the verdict of `plan` with our simulations, and with contacts of MuJoCo.
    others = {name: {line["key"]: line["verdicts"][name] for line in judged} for name in ("report", *SIMULATED)}
    for name in CONTACTS_S:
        others[name] = {line["key"]: bool(line["mujoco"][name].get("holds")) for line in judged}
    print(f"{'of':30}{'both pass':>12}{'plan only':>12}{'it only':>12}{'neither':>12}")
    for name, verdicts in others.items():
        counts = [sum((line["holds"], verdicts[line["key"]]) == of for line in judged) for of in ((True, True), (True, False), (False, True), (False, False))]
        print(f"{name:30}" + "".join(f"{count:12}" for count in counts))
    infeasible = sum(bool(line.get("diagnosis")) for line in lines)
    errors = [line["key"] for line in lines if "error" in line]
    print(
        f"of {len(lines)} requests {infeasible} are infeasible, {len(needs)} say that they need feedback, {len(taken_back)} are taken back, {len(errors)} are refused as files; "
        f"{len(good)} are good, of which {len(missed)} fail in MuJoCo; {len(refused)} are refused, of which {len(lost)} pass in MuJoCo"
    )
    return int(max(len(missed) / max(len(good), 1), len(lost) / len(judged)) > 1 / ONE_IN)


def _requests(options):
    found = []
    for name, path in IMPORTED.items() if options.robots else ():
        robot = imported(options, name, options.robots / path)
        found += drawing.of_walking(robot)
    if options.drawn:
        shipped = [(_scaled(options, name, ROOT / f"shipped/robots/{name}.toml"), kinds) for name, kinds in SHIPPED.items()]
        found += drawing.drawn(shipped, options.drawn, options.seed)
    if options.shipped:
        for path in sorted((ROOT / "shipped/motions").rglob("*.toml")):
            text = path.read_text()
            if "duration_s" in text and "[[motion]]" not in text:
                name = path.stem
                file = next(line.split('"')[1] for line in text.splitlines() if line.startswith("robot"))
                robot = drawing.Robot("shipped", (path.parent / file).resolve(), 1.0)
                found.append(drawing.Request(robot, name, str(path)))
    return found


def imported(options, name, urdf):
    """Robot of a URDF, with the template of settings that the import writes."""
    folder = options.output / name
    folder.mkdir(exist_ok=True)
    settings, robot = folder / "settings.toml", folder / "robot.toml"
    run(options, "robot", "import", urdf, "--template", settings)
    made = run(options, "robot", "import", urdf, "--with", settings, "-o", robot)
    if made.returncode != 0:
        sys.exit(f"{name}: {made.stderr}")
    return _scaled(options, name, robot)


def _scaled(options, name, file):
    check = json.loads(run(options, "robot", "check", file, "--json").stdout)
    return drawing.Robot(name, file.resolve(), check["standing"]["body_height_m"])


def _options(arguments):
    parser = argparse.ArgumentParser(prog="agreement", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rollwalk", type=Path, metavar="ROLLWALK")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--robots", type=Path, metavar="FOLDER", help="robots of the package example-robot-data")
    parser.add_argument("--drawn", type=int, default=0, metavar="COUNT")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--shipped", action="store_true")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
