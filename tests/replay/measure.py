"""Measures of a run: displacement relative to the plan, slip, tilt and others."""

import math

import numpy as np

from motion import yaw_matrix
import robots

# Range of achieved / planned in which a motion passes.
BAND = (0.95, 1.05)
# Planned distances and turns below these are not goals, m and rad.
SMALLEST = {"forward_m": 0.005, "left_m": 0.005, "turn_rad": 0.01}
# Tolerance of a motion without a goal, m and rad.
STAYS = {"forward_m": 0.005, "left_m": 0.005, "turn_rad": 0.02}
# Periods over which the mean is taken, counted from 1: the effect of the start has decayed, and errors have not
# accumulated yet.
FIRST, LAST = 2, 5


def summary(motion, track, cycles):
    """All values of a run for the tables and the JSON."""
    planned = motion.planned()
    ways = _ways(track)
    found = goals(motion)
    middle = ways[FIRST - 1 : LAST] if motion.periodic else ways
    late = ways[cycles - 1 : cycles] if motion.periodic and cycles > LAST else []
    ratio = lambda some: {key: mean(some, key) / planned[key] for key in found} if some else None
    drift = lambda some: {key: mean(some, key) - planned[key] for key in planned} if some else None
    result = {
        "planned": planned,
        "cycles": ways,
        "ratio": ratio(middle),
        "ratio_late": ratio(late),
        "drift": drift(middle),
        "drift_late": drift(late),
        "height_ratio": _height_ratio(motion, track),
        "fell_at_s": track.fell_at_s,
        "fell_in_cycle": None if track.fell_at_s is None else int(track.fell_at_s / motion.duration_s) + 1,
        **_path(motion, track),
        **_contact(track),
        **_servos(track),
        "links_on_ground": {name: round(steps * track.step_s, 4) for name, steps in sorted(track.touched.items())},
        "missing_force": track.missing_force,
        "hardest_motor": track.hardest_motor[0],
        "needed_torque": track.hardest_motor[1],
    }
    result["holds"] = _holds(motion, result, late)
    result["needs_feedback"] = motion.needs_feedback
    return result


def _height_ratio(motion, track):
    """Final height of the centre of mass / planned, for a motion that lies on its body."""
    if not robots.lies(motion.robot) or not track.com_m:
        return None
    return float(track.com_m[-1][0][2] / motion.plan["after"]["com_m"][2])


def goals(motion):
    """Distances and turns that are goals of the motion."""
    planned, wanted = motion.planned(), motion.plan["motion"]["goal"]
    return [key for key in planned if wanted.get(key) and abs(planned[key]) > SMALLEST[key]]


def mean(ways, key):
    return sum(way[key] for way in ways) / len(ways)


def _ways(track):
    """Displacement of the centre of mass in the initial heading, and turn, of each period."""
    found = []
    for (start, yaw), (end, yaw_after) in zip(track.com_m, track.com_m[1:]):
        moved = yaw_matrix(yaw).T @ (end - start)
        turn = math.remainder(yaw_after - yaw, 2 * math.pi)
        found.append({"forward_m": float(moved[0]), "left_m": float(moved[1]), "turn_rad": turn})
    return found


def _path(motion, track):
    """RMS distance of the base from its planned path, m, and ratio of its lateral range to the planned range."""
    periods = list(zip(track.marks, track.marks[1:]))
    periods = periods[FIRST - 1 : LAST] if motion.periodic else periods
    heading = yaw_matrix(motion.base(0.0)[1][0])[:2, :2]
    planned = track.planned_base_m[:, :2]
    planned = (planned - planned[0]) @ heading
    errors, widths = [], []
    for begin, end in periods:
        seen = np.array(track.base_m[begin:end])[:, :2]
        seen = (seen - seen[0]) @ yaw_matrix(track.yaw_rad[begin])[:2, :2]
        count = min(len(seen), len(planned))
        errors.append(np.sum((seen[:count] - planned[:count]) ** 2, axis=1).mean())
        widths.append(np.ptp(seen[:, 1]))
    wide = np.ptp(planned[:, 1])
    return {
        "path_rms_m": float(np.sqrt(np.mean(errors))) if errors else None,
        "sway_ratio": float(np.mean(widths) / wide) if errors and wide > 0.01 else None,
    }


def _contact(track):
    """Slip in stance, contact in planned swings, and depth in the ground, without the first period."""
    begin = track.marks[1] if len(track.marks) > 2 else 0
    slip = np.array(track.slip_m_s[begin:])
    stance = np.array(track.planned_stance[begin:], dtype=bool)
    if not len(slip):
        return {key: None for key in ("slip_mean_m_s", "slip_p95_m_s", "swing_contact")} | {"depth_m": track.depth_m}
    touches = np.isfinite(slip)
    in_stance, swing = slip[stance & touches], ~stance
    return {
        "slip_mean_m_s": float(in_stance.mean()) if len(in_stance) else None,
        "slip_p95_m_s": float(np.percentile(in_stance, 95)) if len(in_stance) else None,
        # Share of the planned swing in which the end effector carries load.
        "swing_contact": float(touches[swing].mean()) if swing.any() else None,
        "stance_lifted": float((~touches)[stance].mean()) if stance.any() else None,
        "depth_m": float(track.depth_m),
    }


def _servos(track):
    begin = track.marks[1] if len(track.marks) > 2 else 0
    saturated = np.array(track.saturated[begin:])
    if not len(saturated):
        return {key: None for key in ("saturation_worst", "saturation_mean", "sag_mean_m", "sag_worst_m", "joint_error_rad")}
    height = np.array(track.height_error_m[begin:])
    return {
        # Share of time at the torque limit: of the worst motor, and of all motors.
        "saturation_worst": float(saturated.mean(axis=0).max()),
        "saturation_mean": float(saturated.mean()),
        "sag_mean_m": float(-height.mean()),
        "sag_worst_m": float(-height.min()),
        "joint_error_rad": float(np.max(track.joint_error_rad[begin:])),
        "tilt_worst_rad": float(np.max(track.tilt_rad[begin:])),
    }


def _holds(motion, result, late):
    """True if the robot does not fall and reaches its goals within tolerance."""
    if result["fell_at_s"] is not None or result["ratio"] is None:
        return False
    if result["height_ratio"] is not None:
        return BAND[0] <= result["height_ratio"] <= BAND[1]
    if not result["ratio"]:
        return all(abs(result["drift"][key]) <= STAYS[key] for key in STAYS)
    ratios = list(result["ratio"].values()) + (list(result["ratio_late"].values()) if late else [])
    return all(BAND[0] <= ratio <= BAND[1] for ratio in ratios)


def deciding(results):
    """Runs with the feed-forward that the robot's drives support, for each plan; all of its runs if none has that feed-forward."""
    of_plans = {}
    for result in results:
        of_plans.setdefault(result["plan"], []).append(result)
    for runs in of_plans.values():
        taken = [run for run in runs if run["feed_forward"] == run["drives_take"]]
        yield from taken or runs
