"""Markdown tables of results."""

HEAD = {
    "motion": "motion of robot",
    "feed_forward": "feed-forward",
    "holds": "holds",
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
    """One row for each motion and kind of feed-forward."""
    rows = [list(HEAD.values())]
    for result in results:
        rows.append([
            f"{result['motion']} of {result['robot']}",
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


def robustness(results):
    """One row for each motion, one column for each perturbation: ratio of cycles 2–5."""
    cases = list(dict.fromkeys(result["case"] for result in results))
    rows = [["motion of robot", "feed-forward"] + cases]
    by_motion = {}
    for result in results:
        key = (f"{result['motion']} of {result['robot']}", result["feed_forward"])
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
    """Achieved by planned of every goal; of a motion without one how far it strayed, m."""
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
    return "–" if value is None else f"{value * factor:.{digits}f}"


def _percent(value):
    return "–" if value is None else f"{100 * value:.0f} %"


def _markdown(rows):
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0])] + lines[1:])
