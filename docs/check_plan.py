#!/usr/bin/env python3
"""Recompute the physics of a Rollwalk plan from its JSON alone.

    python3 docs/check_plan.py [--json] PLAN.json [PLAN.json ...]

Python's standard library only; no code is shared with the planner. What the fields mean, in which
frames and units, is in docs/plan-format.md; the equation numbers are the thesis's. Names, units and levels
of the residuals and the constants of the equations are those of the plan's `formulation`. For every residual
the table shows the worst case, the level up to which a plan is physically credible, and where it is.

Exit code: 0 all residuals are within their levels, 1 one is not, 2 a file is no plan.
"""

import json
import math
import sys

# --- vectors are lists of three, matrices lists of three rows ---


def add(a, b):
    return [x + y for x, y in zip(a, b)]


def sub(a, b):
    return [x - y for x, y in zip(a, b)]


def scale(a, s):
    return [x * s for x in a]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def norm(a):
    return math.sqrt(dot(a, a))


def apply(m, v):
    return [dot(row, v) for row in m]


def transpose(m):
    return [list(column) for column in zip(*m)]


def matmul(a, b):
    return [[dot(row, column) for column in transpose(b)] for row in a]


def from_quaternion(q):
    """Rotation matrix of a unit quaternion [w, x, y, z]."""
    w, x, y, z = q
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def from_axis_angle(axis, angle):
    half = 0.5 * angle
    return from_quaternion([math.cos(half)] + scale(axis, math.sin(half)))


def rotation_vector(r):
    """Axis times angle of a small rotation."""
    v = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]]
    sine, cosine = 0.5 * norm(v), 0.5 * (r[0][0] + r[1][1] + r[2][2] - 1)
    return scale(v, 0.5 * math.atan2(sine, cosine) / sine) if sine > 1e-12 else scale(v, 0.5)


# --- the robot ---


def link_poses(robot, position, rotation, angles):
    """World-from-link (rotation, origin) of every link."""
    poses = [None] * len(robot["links"])
    poses[0] = (rotation, position)
    for joint, angle in zip(robot["joints"], angles):
        r, p = poses[joint["parent"]]
        frame = joint["parent_from_joint"]
        origin = add(p, apply(r, frame["position_m"]))
        r = matmul(r, from_quaternion(frame["orientation_wxyz"]))
        poses[joint["child"]] = (matmul(r, from_axis_angle(joint["axis_in_joint"], angle)), origin)
    return poses


def center_of_mass(robot, poses):
    total, moment = 0.0, [0.0] * 3
    for link, (r, p) in zip(robot["links"], poses):
        total += link["mass_kg"]
        moment = add(moment, scale(add(p, apply(r, link["com_in_link_m"])), link["mass_kg"]))
    return scale(moment, 1 / total)


def centroidal_inertia(robot):
    """Inertia about the centre of mass at the nominal joint angles, in body axes (Eq. 2.4: I)."""
    identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    poses = link_poses(robot, [0.0] * 3, identity, [j["nominal_rad"] for j in robot["joints"]])
    com = center_of_mass(robot, poses)
    inertia = [[0.0] * 3 for _ in range(3)]
    for link, (r, p) in zip(robot["links"], poses):
        flat = link["inertia_in_link_kg_m2"]
        own = matmul(matmul(r, [flat[0:3], flat[3:6], flat[6:9]]), transpose(r))
        arm = sub(add(p, apply(r, link["com_in_link_m"])), com)
        for i in range(3):
            for j in range(3):
                steiner = (dot(arm, arm) if i == j else 0.0) - arm[i] * arm[j]
                inertia[i][j] += own[i][j] + link["mass_kg"] * steiner
    return inertia


def wheel_frame(tilt, yaw, radius):
    """Rolling direction, axis and centre-to-contact vector (Eq. 2.2); a x rolling * radius points down."""
    rolling = [math.cos(yaw), math.sin(yaw), 0.0]
    axis = [-math.sin(yaw) * math.cos(tilt), math.cos(yaw) * math.cos(tilt), math.sin(tilt)]
    return rolling, axis, scale(cross(axis, rolling), radius)


def reach(foot):
    """Radius around the contact point that others keep clear of: a wheel's, or half a blade."""
    blade = foot["contact"].get("blade_length_m")
    return foot["radius_m"] if blade is None else 0.5 * blade


# --- the table ---


class Table:
    """The worst residual of each family, SI."""

    def __init__(self, families):
        self.families = {family["name"]: family for family in families}
        self.rows = {}

    def see(self, name, residual, sample=None, subject="", limit=None):
        family = self.families[name]
        level = family["level"] * (limit if family["level_of"] == "limit" else 1)
        where = "" if sample is None else "sample %d %s" % (sample, subject)
        known = self.rows.get(name)
        # A residual that is not a number is worse than any.
        if known is None or not residual / level <= known[0] / known[1]:
            self.rows[name] = (residual, level, family["unit"], where)

    def good(self):
        """Whether all residuals are within their levels; one that is not a number is not."""
        return all(residual <= level for residual, level, _, _ in self.rows.values())

    def show(self):
        for name, (residual, level, unit, where) in self.rows.items():
            mark = " " if residual <= level else "!"
            print("  %-24s %s%10.3g  level %-8.3g %-11s %s" % (name, mark, residual, level, unit, where))

    def as_json(self):
        keys = ("worst", "level", "unit", "where")
        return {name: dict(zip(keys, row)) for name, row in self.rows.items()}


# --- what motors hold ---


def carried_links(robot, joint):
    """Links beyond a joint."""
    found = {joint["child"]}
    for other in robot["joints"]:  # parents come before children
        if other["parent"] in found:
            found.add(other["child"])
    return found


def joint_torques(robot, sample, poses, gravity):
    """Torque that holds ground forces and weight of all that is beyond each joint, limb at rest."""
    torques = []
    for joint in robot["joints"]:
        frame = joint["parent_from_joint"]
        turn = matmul(poses[joint["parent"]][0], from_quaternion(frame["orientation_wxyz"]))
        axis, origin = apply(turn, joint["axis_in_joint"]), poses[joint["child"]][1]
        beyond, moment = carried_links(robot, joint), [0.0] * 3
        for index in beyond:
            link, (r, p) = robot["links"][index], poses[index]
            arm = sub(add(p, apply(r, link["com_in_link_m"])), origin)
            moment = add(moment, cross(arm, [0.0, 0.0, -gravity * link["mass_kg"]]))
        for foot, e in zip(robot["end_effectors"], sample["end_effectors"]):
            if foot["link"] in beyond:
                moment = add(moment, cross(sub(e["position_m"], origin), e["force_n"]))
        torques.append(-dot(axis, moment))
    return torques


def wheel_torque(foot, e):
    """Torque about its axis that holds the ground force on a wheel: r f.t."""
    rolling, _, _ = wheel_frame(e["tilt_rad"], e["yaw_rad"], foot["radius_m"])
    return foot["radius_m"] * dot(e["force_n"], rolling)


def beyond_line(motor, torque, speed):
    """How far a torque at a speed is beyond a motor's torque-speed line; None without a line."""
    line = motor["torque_speed"]
    if line is None:
        return None
    used = torque / line["stall_torque_nm"] + speed / line["no_load_speed_rad_s"]
    return max(abs(used) - 1, 0)


# --- choreography ---


def place(subject, state):
    """Position of what a target or a height is about."""
    if subject == "com":
        return state["com_m"]
    if subject == "body":
        return state["base_position_m"]
    return state["end_effectors"][subject["end_effector"]]["position_m"]


def check_choreography(table, plan, timeline):
    """Targets and heights, seen from where the first sample stands."""
    motion, samples, h = plan["motion"], plan["samples"], plan["sample_interval_s"]
    periodic = motion["ends"] == "periodic"
    x, y = samples[0]["base_position_m"][:2]
    yaw = samples[0]["base_yaw_pitch_roll_rad"][0]
    to_start = from_axis_angle([0, 0, 1], -yaw)
    names = [foot["name"] for foot in plan["robot"]["end_effectors"]]

    def name_of(subject):
        return subject if isinstance(subject, str) else names[subject["end_effector"]]

    for target in motion["targets"]:
        # Lagrange's parabola through the nearest sample and its neighbours in the motion.
        first, last = (0, len(samples) - 1) if periodic else (1, len(samples) - 2)
        i = min(max(math.floor(target["at_s"] / h + 0.5), first), last)
        u = target["at_s"] / h - i
        at = [u * (u - 1) / 2, (1 - u) * (1 + u), u * (u + 1) / 2]
        rate = [(2 * u - 1) / (2 * h), -2 * u / h, (2 * u + 1) / (2 * h)]
        three = timeline[i : i + 3]
        seen = [apply(to_start, sub(place(target["of"], s), [x, y, 0.0])) for s in three]
        for c, direction in enumerate(["forward", "left", "up"]):
            who = "%s %s at %.3f s" % (name_of(target["of"]), direction, target["at_s"])
            wanted = target["position_m"][c]
            if wanted is not None:
                off = sum(w * p[c] for w, p in zip(at, seen)) - wanted
                table.see("target position", abs(off), i, who)
            wanted = target["velocity_m_s"][c]
            if wanted is not None:
                off = sum(w * p[c] for w, p in zip(rate, seen)) - wanted
                table.see("target velocity", abs(off), i, who)
        if target["heading_rad"] is not None:
            turned = sum(w * (s["base_yaw_pitch_roll_rad"][0] - yaw) for w, s in zip(at, three))
            who = "%s at %.3f s" % (name_of(target["of"]), target["at_s"])
            table.see("target heading", abs(turned - target["heading_rad"]), i, who)

    for limit in motion["heights"]:
        # The samples of the span and the two that enclose it; the end of a period is its start.
        span = range(math.floor(limit["from_s"] / h + 1e-6), math.ceil(limit["to_s"] / h - 1e-6) + 1)
        for i, s in enumerate(samples):
            if i in span or periodic and i + len(samples) in span:
                z = place(limit["of"], s)[2]
                over = z - limit["below_m"] if limit["below_m"] is not None else 0
                under = limit["above_m"] - z if limit["above_m"] is not None else 0
                table.see("height limit", max(over, under, 0), i, name_of(limit["of"]))


# --- states outside the motion ---


def euler_matrix(yaw_pitch_roll):
    yaw, pitch, roll = yaw_pitch_roll
    turn = matmul(from_axis_angle([0, 0, 1], yaw), from_axis_angle([0, 1, 0], pitch))
    return matmul(turn, from_axis_angle([1, 0, 0], roll))


def contact_from_center(foot, e):
    """From the centre of a wheel or foot to the contact point."""
    if "axis_in_link" not in foot["contact"]:
        return [0.0, 0.0, -foot["radius_m"]]
    return wheel_frame(e["tilt_rad"], e["yaw_rad"], foot["radius_m"])[2]


def pose_difference(a, b, offset, turn, feet):
    """Largest difference between state a, turned about the vertical and moved, and state b."""
    r = from_axis_angle([0, 0, 1], turn)
    points = [(a["base_position_m"], b["base_position_m"]), (a["com_m"], b["com_m"])]
    pairs = list(zip(a["joint_rad"], b["joint_rad"]))
    heading, pitch, roll = a["base_yaw_pitch_roll_rad"]
    pairs += zip([heading + turn, pitch, roll], b["base_yaw_pitch_roll_rad"])
    for foot, e, e2 in zip(feet, a["end_effectors"], b["end_effectors"]):
        points.append((e["position_m"], e2["position_m"]))
        wheel_turn = turn if "axis_in_link" in foot["contact"] else 0.0
        pairs += [(e["tilt_rad"], e2["tilt_rad"]), (e["yaw_rad"] + wheel_turn, e2["yaw_rad"])]
    for p, q in points:
        pairs += zip(add(apply(r, p), offset), q)
    return max(abs(x - y) for x, y in pairs)


def contact_point(foot, e, poses):
    """Contact point by forward kinematics."""
    r, p = poses[foot["link"]]
    return add(add(p, apply(r, foot["center_in_link_m"])), contact_from_center(foot, e))


def inconsistency(robot, state, poses, contacts):
    """Largest difference between what one state says and what follows from its base and joints."""
    pairs = list(zip(center_of_mass(robot, poses), state["com_m"]))
    for x, y in zip(euler_matrix(state["base_yaw_pitch_roll_rad"]), poses[0][0]):
        pairs += zip(x, y)
    if contacts:
        for foot, e in zip(robot["end_effectors"], state["end_effectors"]):
            pairs += zip(contact_point(foot, e, poses), e["position_m"])
    return max(abs(x - y) for x, y in pairs)


# --- the equations ---


def check(plan):
    robot, motion, h = plan["robot"], plan["motion"], plan["sample_interval_s"]
    samples, feet = plan["samples"], robot["end_effectors"]
    periodic = motion["ends"] == "periodic"
    mass = sum(link["mass_kg"] for link in robot["links"])
    inertia_in_body = centroidal_inertia(robot)
    formulation = plan["formulation"]
    gravity = formulation["gravity_m_s2"]
    table = Table(formulation["families"])

    # Times on the grid: T intervals of a periodic motion, T - 1 of any other.
    intervals = len(samples) if periodic else len(samples) - 1
    table.see("duration", abs(intervals * h - motion["duration_s"]))
    for i, s in enumerate(samples):
        table.see("time", abs(s["time_s"] - i * h), i)

    # The states outside belong to the motion as its ends say.
    d, psi = plan["end_placement"]["offset_m"] + [0.0], plan["end_placement"]["yaw_rad"]
    if periodic:
        pairs = [(plan["before"], samples[-1], d, psi), (samples[0], plan["after"], d, psi)]
    elif motion["ends"] == "at_rest":
        pairs = [(plan["before"], samples[0], [0.0] * 3, 0.0), (samples[-1], plan["after"], [0.0] * 3, 0.0)]
    else:
        pairs = []
    for a, b, offset, turn in pairs:
        table.see("ends", pose_difference(a, b, offset, turn, feet))

    timeline = [plan["before"]] + samples + [plan["after"]]
    rotations = [from_quaternion(s["base_orientation_wxyz"]) for s in timeline]
    poses = [
        link_poses(robot, s["base_position_m"], r, s["joint_rad"]) for s, r in zip(timeline, rotations)
    ]

    # Their numbers agree with each other. Prescribed states are exact to their contact points; others repeat
    # samples, whose contact points are residuals.
    for state, pose in ((plan["before"], poses[0]), (plan["after"], poses[-1])):
        table.see("ends", inconsistency(robot, state, pose, contacts=not pairs))

    torques = [joint_torques(robot, s, p, gravity) for s, p in zip(timeline, poses)]

    for i, s in enumerate(samples):
        k = i + 1  # place in the timeline
        before, after, r = timeline[k - 1], timeline[k + 1], rotations[k]

        # Linear dynamics, Eq. 2.3: sum f + M g - M x'' = 0.
        acceleration = scale(
            add(sub(before["com_m"], scale(s["com_m"], 2)), after["com_m"]), 1 / (h * h)
        )
        force, moment = [0.0] * 3, [0.0] * 3
        for e in s["end_effectors"]:
            force = add(force, e["force_n"])
            moment = add(moment, cross(sub(e["position_m"], s["com_m"]), e["force_n"]))
        wrong = sub(force, scale(add(acceleration, [0, 0, gravity]), mass))
        table.see("linear dynamics", norm(wrong), i)

        # Angular dynamics, Eq. 2.4, with world inertia R I R^T and angular velocities on intervals.
        inertia = matmul(matmul(r, inertia_in_body), transpose(r))
        v_in = scale(rotation_vector(matmul(r, transpose(rotations[k - 1]))), 1 / h)
        v_out = scale(rotation_vector(matmul(rotations[k + 1], transpose(r))), 1 / h)
        mean = scale(add(v_in, v_out), 0.5)
        rate = add(apply(inertia, scale(sub(v_out, v_in), 1 / h)), cross(mean, apply(inertia, mean)))
        table.see("angular dynamics", norm(sub(moment, rate)), i)

        # Centre of mass and orientation agree with the pose, Eq. 2.11 and 2.12.
        off = norm(sub(center_of_mass(robot, poses[k]), s["com_m"]))
        table.see("centre of mass", off, i)
        euler = euler_matrix(s["base_yaw_pitch_roll_rad"])
        off = max(abs(a - b) for x, y in zip(euler, r) for a, b in zip(x, y))
        table.see("base orientation", off, i)

        for joint, q in zip(robot["joints"], s["joint_rad"]):
            beyond = max(q - joint["position_max_rad"], joint["position_min_rad"] - q, 0)
            table.see("joint limit", beyond, i, joint["name"])

        for joint, torque in zip(robot["joints"], torques[k]):
            limit = joint["actuator"]["torque_max_nm"]
            beyond = max(abs(torque) - limit, 0)
            table.see("joint torque", beyond, i, joint["name"], limit)

        for j, (foot, e) in enumerate(zip(feet, s["end_effectors"])):
            name, f, radius = foot["name"], e["force_n"], foot["radius_m"]
            stands, wheel = e["contact"], "axis_in_link" in foot["contact"]
            rolling, axis, _ = wheel_frame(e["tilt_rad"], e["yaw_rad"], radius)
            if stands != motion["stance"][i][j]:
                table.see("contact flag", 1, i, name)

            # Forces: friction cone, Eq. 2.5; free wheels, Eq. 2.6; none in swing, Eq. 2.7.
            if stands:
                beyond = math.hypot(f[0], f[1]) - foot["friction_coefficient"] * max(f[2], 0)
                table.see("friction", max(beyond, -f[2], 0), i, name)
                drag = foot["contact"].get("drag")
                if drag is not None:
                    speed = e["wheel_speed_rad_s"] * radius
                    sign = math.tanh(speed / formulation["rolling_sign_width_m_s"])
                    slowing = drag["rolling_resistance"] * sign + drag["rolling_drag_s_m"] * speed
                    pushed = dot(f, rolling) + f[2] * slowing
                    table.see("free-wheel traction", abs(pushed), i, name)
            else:
                table.see("swing force", norm(f), i, name)

            if "actuator" in foot["contact"]:
                limit = foot["contact"]["actuator"]["torque_max_nm"]
                beyond = max(abs(wheel_torque(foot, e)) - limit, 0)
                table.see("wheel torque", beyond, i, name, limit)

            # Height, Eq. 2.9: on the ground in stance, not below it in swing.
            z = e["position_m"][2]
            if stands:
                table.see("contact height", abs(z), i, name)
            else:
                table.see("depth in swing", max(-z, 0), i, name)

            # Clearance, Eq. 2.10.
            for other, e2 in list(zip(feet, s["end_effectors"]))[j + 1:]:
                if other["link"] != foot["link"]:
                    apart = norm(sub(e["position_m"], e2["position_m"]))
                    missing = max(reach(foot) + reach(other) + formulation["clearance_m"] - apart, 0)
                    table.see("end-effector clearance", missing, i, name)

            # Wheel axis and contact point agree with the pose, Eq. 2.13 and 2.14.
            link_r, _ = poses[k][foot["link"]]
            if wheel:
                mounted = apply(link_r, foot["contact"]["axis_in_link"])
                table.see("wheel axis", norm(sub(mounted, axis)), i, name)
            blade = foot["contact"].get("blade_length_m")
            if blade is not None and stands:
                # The middle of the blade is opposite to the link's z, square to the axis across it.
                across = foot["contact"]["axis_in_link"]
                down = sub(scale(across, across[2]), [0.0, 0.0, 1.0])
                middle = apply(link_r, scale(down, radius / norm(down)))
                most = radius * math.sin(min(0.5 * blade / radius, 0.5 * math.pi))
                beyond = max(abs(dot(middle, rolling)) - most, 0)
                table.see("contact on the blade", beyond, i, name)
            off = norm(sub(contact_point(foot, e, poses[k]), e["position_m"]))
            table.see("contact point", off, i, name)

    # Intervals: speeds and slip.
    for i in range(intervals):
        k = i + 1
        s, after = timeline[k], timeline[k + 1]
        held = [0.5 * (a + b) for a, b in zip(torques[k], torques[k + 1])]
        for joint, q, q_next, torque in zip(robot["joints"], s["joint_rad"], after["joint_rad"], held):
            beyond = beyond_line(joint["actuator"], torque, (q_next - q) / h)
            if beyond is not None:
                table.see("torque-speed line", beyond, i, joint["name"])
            limit = joint["actuator"]["speed_max_rad_s"]
            beyond = max(abs(q_next - q) / h - limit, 0)
            table.see("joint speed", beyond, i, joint["name"], limit)
        for foot, e, e2, j in zip(feet, s["end_effectors"], after["end_effectors"], range(len(feet))):
            name, radius, contact = foot["name"], foot["radius_m"], foot["contact"]
            wheel, driven, free = (key in contact for key in ("axis_in_link", "actuator", "drag"))
            tilt, yaw = 0.5 * (e["tilt_rad"] + e2["tilt_rad"]), 0.5 * (e["yaw_rad"] + e2["yaw_rad"])
            rolling, axis, _ = wheel_frame(tilt, yaw, radius)
            speed = e["wheel_speed_rad_s"]

            # No slip, Eq. 2.8 at the interval's middle: (e' - e) / h = omega r t, and 0 for a foot.
            # Free wheels and blades leave the ground and come down along their direction, too.
            landing = free and e["contact"] != e2["contact"]
            if e["contact"] and e2["contact"] or landing:
                slip = scale(sub(e2["position_m"], e["position_m"]), 1 / h)
                if wheel:
                    slip = sub(slip, scale(rolling, speed * radius))
                kind_of_slip = "landing slip" if landing else "slip"
                table.see(kind_of_slip, math.hypot(slip[0], slip[1]), i, name)

            # The wheel turns against its link by omega + yaw' (v.a) - Omega.a. A motor turns it so; a
            # welded or held wheel does not turn.
            link_in, link_out = poses[k][foot["link"]][0], poses[k + 1][foot["link"]][0]
            turn = scale(rotation_vector(matmul(link_out, transpose(link_in))), 1 / h)
            needed = speed + (e2["yaw_rad"] - e["yaw_rad"]) / h * axis[2] - dot(turn, axis)
            if wheel and not driven and not free or motion["held_wheels"][j]:
                table.see("held wheel", abs(needed) * radius, i, name)
            if driven:
                motor = e["motor_speed_rad_s"]
                table.see("motor against wheel", abs(motor - needed) * radius, i, name)
                limit = foot["contact"]["actuator"]["speed_max_rad_s"]
                beyond = max(abs(motor) - limit, 0)
                table.see("wheel motor speed", beyond, i, name, limit)
                torque = 0.5 * (wheel_torque(foot, e) + wheel_torque(foot, e2))
                beyond = beyond_line(foot["contact"]["actuator"], torque, motor)
                if beyond is not None and not motion["held_wheels"][j]:
                    table.see("torque-speed line", beyond, i, name)

    # Goals: displacement of the centre of mass along and across the starting heading, and turn.
    first, last = timeline[1], timeline[1 + intervals]
    yaw = first["base_yaw_pitch_roll_rad"][0]
    moved = sub(last["com_m"], first["com_m"])
    reached = {
        "forward_m": moved[0] * math.cos(yaw) + moved[1] * math.sin(yaw),
        "left_m": moved[1] * math.cos(yaw) - moved[0] * math.sin(yaw),
        "turn_rad": last["base_yaw_pitch_roll_rad"][0] - yaw,
    }
    for name, value in reached.items():
        goal = motion["goal"].get(name)
        if goal is not None:
            kind = "turning goal" if name == "turn_rad" else "displacement goal"
            table.see(kind, abs(value - goal), intervals, name.rsplit("_", 1)[0])
    check_choreography(table, plan, timeline)
    return table


# What may be absent: options of a robot file, goals that a motion does not have, the level of a cost.
NULLABLE = {
    "torque_speed", "diagnosis", "subject", "field", "given", "would_do", "forward_m", "left_m", "turn_rad",
    "heading_rad", "below_m", "above_m", "level",
}  # fmt: skip
# Components of a target that leave an axis free.
NULLABLE_ITEMS = {"position_m", "velocity_m_s"}


def refuse_strange_numbers(value, path="", key="", in_targets=False):
    """Python reads NaN and Infinity, and 1e999 as infinity; other writers put null for them. None is a measure."""
    if isinstance(value, dict):
        for key, item in value.items():
            here = "%s.%s" % (path, key) if path else key
            refuse_strange_numbers(item, here, key, in_targets or key == "targets")
    elif isinstance(value, list):
        for index, item in enumerate(value):
            refuse_strange_numbers(item, "%s[%d]" % (path, index), key, in_targets)
    elif value is None and key not in NULLABLE and not (in_targets and key in NULLABLE_ITEMS):
        raise ValueError("%s is null; expected a value" % path)
    elif isinstance(value, float) and not math.isfinite(value):
        raise ValueError("%s is %s; expected a finite number" % (path, value))


def main(arguments):
    paths = [a for a in arguments if a != "--json"]
    if not paths or paths[0] in ("-h", "--help"):
        print(__doc__.strip())
        return 0 if paths else 2
    code = 0
    for path in paths:
        try:
            with open(path, encoding="utf-8") as file:
                plan = json.load(file)
            if plan.get("format") != "rollwalk-plan" or plan.get("version") != 3:
                raise ValueError("format and version are not rollwalk-plan 3")
            refuse_strange_numbers(plan)
            table = check(plan)
        except (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
            print("%s: not a usable plan: %s: %s" % (path, type(error).__name__, error), file=sys.stderr)
            code = 2
            continue
        if "--json" in arguments:
            print(json.dumps(table.as_json()))
        else:
            print("%s: %s of %s" % (path, plan["motion"]["name"], plan["robot"]["name"]))
            table.show()
        if not table.good():
            code = max(code, 1)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
