"""The fields of a plan that replay reads (docs/formats/plan-format.md): present, finite, and as many as the robot has."""

import math


def check(plan):
    """Raises ValueError with the path of the first wrong field."""
    robot = _get(plan, "robot", dict)
    links, joints, feet = (_get(robot, key, list, "robot") for key in ("links", "joints", "end_effectors"))
    _get(robot, "name", str, "robot")
    motion = _get(plan, "motion", dict)
    _get(motion, "name", str, "motion")
    _get(motion, "goal", dict, "motion")
    _positive(motion, "duration_s", "motion")
    ends = _get(motion, "ends", str, "motion")
    if ends not in ("periodic", "at_rest", "prescribed"):
        raise ValueError(f"field motion.ends is {ends!r}; expected periodic, at_rest or prescribed")
    _positive(plan, "sample_interval_s")
    placement = _get(plan, "end_placement", dict)
    _numbers(placement, "offset_m", 2, "end_placement")
    _number(placement, "yaw_rad", "end_placement")
    formulation = _get(plan, "formulation", dict)
    for key in ("gravity_m_s2", "rolling_sign_width_m_s"):
        _positive(formulation, key, "formulation")
    samples = _get(plan, "samples", list)
    if len(samples) < 3:
        raise ValueError(f"field samples has {len(samples)} entries; expected 3 or more")
    intervals = len(samples) if ends == "periodic" else len(samples) - 1
    if abs(intervals * plan["sample_interval_s"] - motion["duration_s"]) > 1e-6:
        raise ValueError(f"field sample_interval_s times {intervals} is not motion.duration_s")
    for index, link in enumerate(links):
        at = f"robot.links[{index}]"
        _get(link, "name", str, at)
        _positive(link, "mass_kg", at)
        _numbers(link, "com_in_link_m", 3, at)
        _numbers(link, "inertia_in_link_kg_m2", 9, at)
    for at, sample in [(f"samples[{i}]", s) for i, s in enumerate(samples)] + [
        (key, _get(plan, key, dict)) for key in ("before", "after")
    ]:
        for key in ("base_position_m", "base_yaw_pitch_roll_rad", "com_m"):
            _numbers(sample, key, 3, at)
        _numbers(sample, "joint_rad", len(joints), at)
        if "joint_torque_nm" in sample:
            _numbers(sample, "joint_torque_nm", len(joints), at)
        _entries(sample, "end_effectors", len(feet), at)
        for index, foot in enumerate(sample["end_effectors"]):
            here = f"{at}.end_effectors[{index}]"
            _numbers(foot, "force_n", 3, here)
            _number(foot, "motor_speed_rad_s", here)
            _get(foot, "contact", bool, here)


def _get(table, key, kind, at=""):
    path = f"{at}.{key}" if at else key
    if not isinstance(table, dict):
        raise ValueError(f"field {at} is no object")
    if key not in table:
        raise ValueError(f"field {path} is missing")
    if not isinstance(table[key], kind):
        raise ValueError(f"field {path} is {table[key]!r:.40}; expected {_KINDS[kind]}")
    return table[key]


_KINDS = {dict: "an object", list: "an array", str: "a string", bool: "true or false"}


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _number(table, key, at=""):
    value = _get(table, key, object, at)
    if not _is_number(value):
        raise ValueError(f"field {at + '.' if at else ''}{key} is {value!r:.40}; expected a finite number")
    return value


def _positive(table, key, at=""):
    value = _number(table, key, at)
    if value <= 0:
        raise ValueError(f"field {at + '.' if at else ''}{key} is {value}; expected a number above 0")


def _entries(table, key, count, at):
    values = _get(table, key, list, at)
    if len(values) != count:
        raise ValueError(f"field {at}.{key} has {len(values)} entries; expected {count}")
    return values


def _numbers(table, key, count, at):
    for index, value in enumerate(_entries(table, key, count, at)):
        if not _is_number(value):
            raise ValueError(f"field {at}.{key}[{index}] is {value!r:.40}; expected a finite number")
