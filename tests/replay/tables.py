"""Markdown tables of results."""

import math
import textwrap

HEAD = {
    "motion": "motion of robot",
    "feed_forward": "feed-forward",
    "holds": "passes",
    "ratio": "cycles 2–5",
    "late": "last cycle",
    "side": "sideways mm",
    "yaw": "yaw mrad",
    "path": "path mm",
    "slip": "slip mean / p95 mm/s",
    "swing": "swing on ground",
    "sag": "sag mm",
    "saturated": "saturated",
    "depth": "depth mm",
    "fell": "fell, touched",
}


def nominal(results):
    """Table with a row for each motion and kind of feed-forward."""
    rows = [list(HEAD.values())]
    for result in results:
        rows.append([
            _name(result),
            result["feed_forward"],
            "yes" if result["holds"] else "needs feedback" if result["needs_feedback"] else "**no**",
            _ratios(result["ratio"], result["drift"]),
            _ratios(result["ratio_late"], result["drift_late"]),
            _number(result["drift"] and result["drift"]["left_m"], 1e3),
            _number(result["drift"] and result["drift"]["turn_rad"], 1e3),
            _number(result["path_rms_m"], 1e3),
            f"{_number(result['slip_mean_m_s'], 1e3)} / {_number(result['slip_p95_m_s'], 1e3)}",
            _percent(result["swing_contact"]),
            _number(result["sag_mean_m"], 1e3, 1),
            _percent(result["saturation_worst"]),
            _number(result["depth_m"], 1e3, 2),
            _fell(result),
        ])
    return _markdown(rows)


def both(results):
    """Table with a row for each motion, with feed-forward and without."""
    rows = [[
        "motion of robot", "with feed-forward: cycles 2–5", "last cycle", "sideways mm", "yaw mrad", "slip mm/s",
        "without: cycles 2–5", "last cycle", "slip mm/s", "",
    ]]
    for name, (fed, bare) in _pairs(results).items():
        remark = [_fell(fed)] if fed["fell_at_s"] is not None else []
        remark += ["needs feedback"] if fed["needs_feedback"] else [] if fed["holds"] else ["**fails**"]
        remark += [] if bare["holds"] else ["without: " + ("falls" if bare["fell_at_s"] is not None else "no")]
        ends = lambda result: [
            _ratios(result["ratio"], result["drift"]), _ratios(result["ratio_late"], result["drift_late"])
        ]
        rows.append([
            name, *ends(fed), _number(fed["drift"] and fed["drift"]["left_m"], 1e3),
            _number(fed["drift"] and fed["drift"]["turn_rad"], 1e3), _number(fed["slip_mean_m_s"], 1e3),
            *ends(bare), _number(bare["slip_mean_m_s"], 1e3), ", ".join(remark),
        ])
    return _markdown(rows)


def _by_feedback(results):
    """Shipped motions with feed-forward in three groups: passed, needs feedback, failed."""
    fed = {name: fed for name, (fed, _) in _pairs(results).items()}
    marked = [name for name, result in fed.items() if result["needs_feedback"]]
    failing = [name for name, result in fed.items() if not result["holds"] and name not in marked]
    return [name for name, result in fed.items() if result["holds"]], marked, failing


def verdict(results):
    """Verdict: passed if every motion that does not need feedback passes."""
    failing = _by_feedback(results)[2]
    return f"failed: {', '.join(failing)}" if failing else "passed"


def in_words(results):
    """Summary of the shipped motions."""
    held, marked, failing = _by_feedback(results)
    bare = {name: bare for name, (_, bare) in _pairs(results).items()}
    sagging = [name for name, result in bare.items() if not result["holds"] and name not in marked]
    sagging.sort(key=lambda name: -abs(_worst(bare[name]) - 1))
    text = (
        f"{len(held)} of {len(bare)} motions reach 0.95 to 1.05 of the planned distance and turn over 20 cycles and do not fall. "
    )
    if marked:
        text += f"Their files and `rollwalk report` mark these as motions that need feedback: {', '.join(marked)}. "
    if failing:
        text += f"These fail, and their files do not mark them: {', '.join(failing)}. "
    worst = [
        f"{name} ({'falls' if bare[name]['fell_at_s'] is not None else f'{_worst(bare[name]):.2f}'})" for name in sagging[:4]
    ]
    if sagging:
        text += f"Without feed-forward {len(sagging)} more fail, worst {', '.join(worst)}."
    return textwrap.fill(text.strip(), 116, break_on_hyphens=False)


# Maximum difference of achieved / planned for agreement of both worlds.
AGREE = 0.03


def compared(level, ground):
    """Table with a row for each motion: MuJoCo, and the project's own simulator at each of its rates."""
    rates = _rates(ground)
    rows = [["motion of robot", "MuJoCo: cycles 2–5", *(f"ours, 1/{rate} s" for rate in rates), "difference", ""]]
    for name, fed, ours in _beside(level, ground):
        last = ours[rates[-1]]
        off = _difference(fed, last)
        remark = _fates(fed, last)
        if not remark and off is not None and off > AGREE:
            remark = "**differs**"
        rows.append([
            name, _ratios(fed["ratio"], fed["drift"]), *(_ratios(*_middle(fed, ours[rate])) for rate in rates),
            "–" if off is None else f"{off:.3f}", remark,
        ])
    return _markdown(rows)


def compared_in_words(level, ground):
    """Sentences on the number of motions that agree in both worlds."""
    rate = _rates(ground)[-1]
    pairs = [(name, fed, ours[rate]) for name, fed, ours in _beside(level, ground)]
    stands = [(name, _difference(fed, ours)) for name, fed, ours in pairs if not _fates(fed, ours)]
    apart = [f"{name} ({off:.3f})" for name, off in stands if off is not None and off > AGREE]
    fates = [name for name, fed, ours in pairs if (fed["fell_at_s"] is None) != (ours["fell_at_s"] is None)]
    text = (
        f"Of {len(pairs)} motions {len(stands)} stay on their feet in both worlds over 20 cycles, and {len(stands) - len(apart)} "
        f"of these agree within {AGREE:.2f} of the plan at 1/{rate} s. "
    )
    text += f"Apart: {', '.join(apart)}. " if apart else ""
    text += f"A fall in only one world: {', '.join(fates)}." if fates else "Falls agree."
    return textwrap.fill(text, 116, break_on_hyphens=False)


def behind_firmware(results):
    """Table with a row for each motion: achieved / planned with firmware and bus, and in MuJoCo with the same
    commands."""
    rows = [["motion of robot", "firmware, bus, our world", "the same commands in MuJoCo", "difference", ""]]
    for result in results:
        if "refused" in result:
            rows.append([_name(result), "–", "–", "–", result["refused"]])
            continue
        off = _apart(result)
        remark = _where_it_fell(result) or ("**differs**" if off is not None and off > AGREE else "")
        if not result["ours"]:
            remark = ", ".join(filter(None, ["**not played**", remark]))
        ratios = (_way(result, world) for world in ("ours", "mujoco"))
        rows.append([_name(result), *ratios, "–" if off is None else f"{off:.3f}", remark])
    return _markdown(rows)


def behind_firmware_in_words(results):
    """Sentences on the number of motions that agree in both worlds, given the same commands."""
    ran = [result for result in results if "refused" not in result]
    stands = [result for result in ran if result["ours"] and not _where_it_fell(result)]
    going = [(result, _apart(result)) for result in stands if _apart(result) is not None]
    apart = [f"{_name(result)} ({off:.3f})" for result, off in going if off > AGREE]
    fates = [_name(result) for result in ran if len(set(at is None for at in result["fell_at_s"].values())) > 1]
    text = (
        f"{len(ran)} of {len(results)} motions go into a library with a stand before and after them. Of these {len(stands)} stay on "
        f"their feet in both worlds; {len(going)} of them go or turn somewhere, and {len(going) - len(apart)} of those agree within {AGREE:.2f} of "
        "the plan. "
    )
    text += f"Apart: {', '.join(apart)}. " if apart else ""
    text += f"A fall in only one world: {', '.join(fates)}." if fates else "Falls agree."
    return textwrap.fill(text, 116, break_on_hyphens=False)


def tracked(results):
    """Tables with a row for each motion and controller and a column for each world; then drifts, then pushes, if any."""
    pushes = [result for result in results if "push" in result]
    runs = [result for result in results if "push" not in result]
    cases = list(dict.fromkeys(result["case"] for result in runs))
    ratios, drifts = [["motion of robot", "control", *cases]], [["motion of robot", "control", *(f"{case}: path, side, yaw" for case in DRIFTS)]]
    for (motion, control), of in _by_control(runs).items():
        found = {result["case"]: result for result in of}
        ratios.append([motion, control, *(_played(found[case]) for case in cases)])
        drifts.append([motion, control, *(_drift(found[case]) for case in DRIFTS)])
    worst = [["motion of robot", "control", "mean", "least", "from the sides"]]
    for (motion, control), of in _by_control(pushes).items():
        parts = [result["push"] for result in of]
        sides = [result["push"] for result in of if result["direction"][1]]
        means = [f"{sum(values) / len(values):.2f}" for values in (parts, sides)]
        worst.append([motion, control, means[0], f"{min(parts):.1f}", means[1]])
    return "\n\n".join(map(_markdown, (ratios, drifts, worst) if pushes else (ratios, drifts)))


def _by_control(results):
    """Results by motion and controller."""
    found = {}
    for result in results:
        found.setdefault((_name(result), result["control"]), []).append(result)
    return found


# Worlds whose drift the table lists.
DRIFTS = ("as planned", "noise, estimator", "together")


def _played(result):
    if result["fell_at_s"] is not None:
        return f"falls {result['fell_at_s']:.1f} s"
    return _ratios(result["ratio"], result["drift"]) + (" *" if result["untracked"] else "")


def _drift(result):
    if result["fell_at_s"] is not None or not result["drift"]:
        return "–"
    return ", ".join(_number(value, 1e3, 0) for value in (result["path_rms_m"], result["drift"]["left_m"], result["drift"]["turn_rad"]))


def retargeted(results):
    """Table with a row for each motion: achieved / planned before and after, with firmware and bus, and in MuJoCo
    with the same commands."""
    rows = [["motion of robot", "stiffness", "before", "after", "MuJoCo before", "MuJoCo after", ""]]
    for result in results:
        share = "as it is" if result["stiffness"] == 1 else f"{result['stiffness']:g} of it"
        if "refused" in result:
            rows.append([_name(result), share, "–", "–", "–", "–", result["refused"]])
            continue
        runs = [result["before"], result["after"]]
        falls = [f"{when}: {_where_it_fell(run)}" for when, run in zip(("before", "after"), runs) if _where_it_fell(run)]
        ways = [_way(run, world) for world in ("ours", "mujoco") for run in runs]
        rows.append([_name(result), share, *ways, "; ".join(falls)])
    return _markdown(rows)


def identified(results):
    """Table with a row for each parameter: true value, value of the file, result of each recording, and result of all recordings of one noise."""
    seeds = results["seeds"]
    motions = list(seeds[0]["alone"])
    rows = [["", "true", "file", *(f"{name} {seed['seed']}" for seed in seeds for name in (*(f"`{motion}`" for motion in motions), "together"))]]
    for number, first in enumerate(seeds[0]["together"]):
        true = results["true"].get(first["name"])
        cells = [
            _found(parameters[number], true)
            for seed in seeds for parameters in (*(seed["alone"][motion] for motion in motions), seed["together"])
        ]
        rows.append([f"`{first['name']}`", "–" if true is None else f"{true:g}", f"{first['before']:.4g}", *cells])
    return _markdown(rows)


def _found(parameter, true):
    """Value, deviation, and error in deviations."""
    value, deviation = parameter["fitted"], parameter["deviation"]
    if deviation is None:
        return "not told"
    off = "" if true is None else f" ({(value - true) / deviation:+.1f})"
    return f"{value:.4g} ± {deviation:.2g}{off}"


def predicted(results):
    """Table with a row for each motion and signal: root mean square errors of each recording, simulated with the parameters of the robot file and with those identified from other runs."""
    kinds = ["file", "fitted", "true", "true with contacts"]
    rows = [["motion", "", "file", "fitted", "true", "true, contacts and delay fitted"]]
    seeds = results["seeds"]
    for motion in seeds[0]["predicted"]:
        for signal, unit in (("position of the body", "mm"), ("orientation", "mrad"), ("angles of joints", "mrad"), ("angles of wheels", "mrad")):
            cell = lambda kind: " · ".join(_thousandths(seed["predicted"][motion][kind][signal]) for seed in seeds)
            rows.append([f"`{motion}`", f"{signal}, {unit}", *map(cell, kinds)])
    return _markdown(rows)


def _thousandths(value):
    return "falls" if value is None else f"{1000 * value:.2f}"


def _where_it_fell(result):
    fell = [{"ours": "our world", "mujoco": "MuJoCo"}[world] for world, at in result["fell_at_s"].items() if at is not None]
    return f"falls in {' and in '.join(fell)}" if fell else ""


def _goals(result):
    """Planned distances and turns that are goals of the motion."""
    return {key: result["planned"][key] for key in result["goals"]}


def _way(result, world):
    found = result[world]
    if not found:
        return "–"
    return _ratios({key: found[key] / planned for key, planned in _goals(result).items()}, found)


def _apart(result):
    """The largest difference of the ratios."""
    if not result["ours"]:
        return None
    goals = _goals(result).items()
    return max((abs(result["ours"][key] - result["mujoco"][key]) / abs(planned) for key, planned in goals), default=None)


def _rates(ground):
    """Steps per second of the runs, fewest first."""
    return sorted(ground[0]["rates"], key=int)


def _beside(level, ground):
    """Level results with feed-forward, and those of the project's simulator by rate."""
    rates = {result["plan"]: result["rates"] for result in ground}
    for result in level:
        if result["case"] == "nominal" and result["feed_forward"] == "torque":
            yield _name(result), result, rates[result["plan"]]


def _middle(fed, ours):
    """Ratios of the goals in MuJoCo's result, and drift, over the same cycles."""
    cycles = ours["cycles"][1:5] if len(ours["cycles"]) > 1 else ours["cycles"]
    if not cycles:
        return None, None
    mean = lambda key: sum(cycle[key] for cycle in cycles) / len(cycles)
    ratio = {key: mean(key) / fed["planned"][key] for key in fed["ratio"] or {}}
    return ratio, {key: mean(key) - planned for key, planned in fed["planned"].items()}


def _difference(fed, ours):
    """The largest difference of the ratios; without a goal or a cycle none."""
    ratio, _ = _middle(fed, ours)
    return max((abs(value - fed["ratio"][key]) for key, value in (ratio or {}).items()), default=None)


def _fates(fed, ours):
    fell = [world for world, result in (("MuJoCo", fed), ("ours", ours)) if result["fell_at_s"] is not None]
    return {0: "", 1: f"falls in {fell[0]} only" if fell else "", 2: "falls in both"}[len(fell)]


def _pairs(results):
    """Level results of each motion with feed-forward as torque, and without."""
    found = {}
    for result in results:
        if result["case"] == "nominal":
            found.setdefault(_name(result), {})[result["feed_forward"]] = result
    return {name: (kinds["torque"], kinds["none"]) for name, kinds in found.items()}


def _name(result):
    """Name of a motion and its robot. Names of motions of Table 2.1 are marked, because some are also names of others."""
    table = " (Table 2.1)" if result.get("plan", "").startswith("table_2_1-") else ""
    return f"`{result['motion']}` of {result['robot']}{table}"


def _worst(result):
    """Ratio of achieved to planned that is farthest from 1; infinite for a motion that falls."""
    if result["fell_at_s"] is not None:
        return math.inf
    ratios = list((result["ratio"] or {}).values()) + list((result["ratio_late"] or {}).values())
    return max(ratios, key=lambda ratio: abs(ratio - 1), default=0.0)


def robustness(results):
    """Table with a row for each motion and a column for each perturbation: ratio of cycles 2–5."""
    cases = list(dict.fromkeys(result["case"] for result in results))
    rows = [["motion of robot", "feed-forward"] + cases]
    by_motion = {}
    for result in results:
        key = (_name(result), result["feed_forward"])
        by_motion.setdefault(key, {})[result["case"]] = result
    for (motion, feed_forward), found in by_motion.items():
        cells = []
        for case in cases:
            result = found.get(case)
            if result is None:
                cells.append("")
            elif result["fell_at_s"] is not None:
                cells.append(f"fell {result['fell_at_s']:.1f} s")
            else:
                cells.append(_ratios(result["ratio"], result["drift"]))
        rows.append([motion, feed_forward] + cells)
    return _markdown(rows)


def _ratios(ratio, drift):
    """Achieved / planned of every goal; for a motion without a goal its drift, m."""
    if ratio:
        names = {"forward_m": "", "left_m": "left ", "turn_rad": "turn "}
        return ", ".join(f"{names[key]}{value:.3f}" for key, value in ratio.items())
    if drift:
        return f"{1e3 * (drift['forward_m'] ** 2 + drift['left_m'] ** 2) ** 0.5:.1f} mm off"
    return "–"


def _fell(result):
    words = []
    if result["fell_at_s"] is not None:
        words.append(f"fell at {result['fell_at_s']:.2f} s")
    if result["links_on_ground"]:
        longest = max(result["links_on_ground"].items(), key=lambda item: item[1])
        words.append(f"{longest[0]} on the ground for {longest[1]:.2f} s")
    return ", ".join(words)


def _number(value, factor, digits=1):
    # Negative zero prints as 0.
    return "–" if value is None else f"{round(value * factor, digits) + 0.0:.{digits}f}"


def _percent(value):
    return "–" if value is None else f"{100 * value:.0f} %"


def _markdown(rows):
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0])] + lines[1:])


def terrain(results):
    """Table with a row for each motion on terrain."""
    rows = [[
        "motion of robot", "plan", "iterations (level)", "CPU / level", "open loop", "tracked", "MuJoCo, open loop",
        "MuJoCo, tracked", "least clearance mm", "slid m, open loop",
    ]]
    for result in results:
        name = f"`{result['motion']}` of {result['robot']}"
        if "refused" in result:
            rows.append([name, f"refused: {result['refused'].splitlines()[0]}", *["–"] * 8])
            continue
        level = result.get("level") or {}
        rows.append([
            name,
            _verdict(result),
            f"{result['iterations']} ({level['iterations']})" if "iterations" in level else str(result["iterations"]),
            f"{result['cpu_s'] / level['cpu_s']:.1f}" if level.get("cpu_s") else "–",
            *(_on_terrain(result[control]) for control in ("open", "tracked")),
            *(_in_mujoco(result.get(control)) for control in ("mujoco_open", "mujoco_tracked")),
            _number(min((of["distance_m"] for of in result["room"].values() if of), default=None), 1e3),
            _number(result["open"]["slid_m"], 1.0, 2),
        ])
    return _markdown(rows)


def terrain_in_words(results):
    """Explanation of the table's columns, and the numbers of motions that pass."""
    played = [result for result in results if "refused" not in result]
    kept = [result for result in played if _verdict(result) == "passes"]
    held = lambda control: sum(result[control]["holds"] for result in played)
    lines = [
        f"{len(results)} motions: {len(kept)} plans pass. In Rollwalk's simulator {held('open')} motions hold in open loop, "
        f"{held('tracked')} tracked.",
        "Distances and turns are achieved / planned; bold ones miss the plan. `level`: the same motion on level ground. CPU is the "
        "time of `rollwalk plan` with its simulation. Risers are in percent of the body's height, kerbs in wheel radii. MuJoCo plays the exported model on the true ground. Clearances are those "
        "of the plan: of links to each other and to the ground, and of feet in swing. `slid` is the sum of all feet and wheels.",
    ]
    return "\n\n".join(textwrap.fill(line, 130) for line in lines)


def _verdict(result):
    """Outcome of `rollwalk plan` in a few words."""
    if result["judgement"] != "consistent":
        return result["status"].replace("_", " ")
    verdict = (result["simulation"] or {}).get("verdict")
    return {"holds": "passes", "fails": "fails in simulation"}.get(verdict, "not simulated")


def _on_terrain(run):
    """Outcome of a run in Rollwalk's simulator."""
    if run["fell_at_s"] is not None:
        return f"falls {run['fell_at_s']:.1f} s"
    way = run["cycles"][0]
    ratios = [way[key] / run["planned"][key] for key, goal in zip(way, run["goals"]) if goal]
    words = ", ".join(f"{ratio:.3f}" for ratio in ratios) or "stays"
    return words if run["holds"] else f"**{words}**"


def _in_mujoco(run):
    """Outcome of a run of an exported motion."""
    if run is None:
        return "–"
    if run["fell_at_s"] is not None:
        return f"falls {run['fell_at_s']:.1f} s"
    if run["height_ratio"] is not None:
        return f"height {run['height_ratio']:.3f}"
    pairs = zip(run["played"], run["planned"], (0.02, 0.02, 0.05))
    return ", ".join(f"{played / planned:.3f}" for played, planned, least in pairs if abs(planned) > least) or "stays"
