#!/usr/bin/env python3
"""Recompute the physics of a Rollwalk plan from its JSON alone.

    python3 docs/formats/check_plan.py [--json] PLAN.json [PLAN.json ...]

Python's standard library only; no code is shared with the planner. docs/formats/plan-format.md describes the fields,
with frames and units; equation numbers are those of the thesis. For every residual, the table shows the worst value,
the level (the tolerance at the samples), and the place.

Names, units and levels of the residuals, and the constants of the equations, are those of the plan's `formulation`,
and this script trusts them. For a plan of unknown origin, check the levels in the table, or use `rollwalk report`,
which refuses levels other than its own.

Exit code: 0 if all residuals are within their levels, 1 if one is not, 2 if a file is not a plan.
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
    """Rotation vector, axis times angle, of a small rotation."""
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
        if "travel_m_per_rad" in joint:
            slide = apply(r, scale(joint["axis_in_joint"], joint["travel_m_per_rad"]))
            poses[joint["child"]] = (r, add(origin, scale(slide, angle)))
            continue
        poses[joint["child"]] = (matmul(r, from_axis_angle(joint["axis_in_joint"], angle)), origin)
    return poses


def center_of_mass(robot, poses):
    total, moment = 0.0, [0.0] * 3
    for link, (r, p) in zip(robot["links"], poses):
        total += link["mass_kg"]
        moment = add(moment, scale(add(p, apply(r, link["com_in_link_m"])), link["mass_kg"]))
    return scale(moment, 1 / total)


def swept_moment(robot, poses, poses_next):
    """Sum of m r x r' over all mass: mean angular momentum about the centre of mass over an interval, times its
    length. A link has its mass at its centre, and second moments J about its centre."""
    com, com_next = center_of_mass(robot, poses), center_of_mass(robot, poses_next)
    total = [0.0] * 3
    for link, (r, p), (r_next, p_next) in zip(robot["links"], poses, poses_next):
        arm = sub(add(p, apply(r, link["com_in_link_m"])), com)
        arm_next = sub(add(p_next, apply(r_next, link["com_in_link_m"])), com_next)
        total = add(total, scale(cross(arm, arm_next), link["mass_kg"]))
        flat = link["inertia_in_link_kg_m2"]
        half_trace = 0.5 * (flat[0] + flat[4] + flat[8])
        columns, columns_next = transpose(r), transpose(r_next)
        for i in range(3):
            for j in range(3):
                second = (half_trace if i == j else 0.0) - flat[3 * i + j]
                total = add(total, scale(cross(columns[i], columns_next[j]), second))
    return total


def wheel_frame(tilt, yaw, radius):
    """Rolling direction, axis and centre-to-contact vector (Eq. 2.2); a x rolling * radius points down."""
    rolling = [math.cos(yaw), math.sin(yaw), 0.0]
    axis = [-math.sin(yaw) * math.cos(tilt), math.cos(yaw) * math.cos(tilt), math.sin(tilt)]
    return rolling, axis, scale(cross(axis, rolling), radius)


def reach(foot):
    """Clearance radius around the contact point: a wheel's radius, or half a blade."""
    blade = foot["contact"].get("blade_length_m")
    return foot["radius_m"] if blade is None else 0.5 * blade


# --- volume of links ---


def along(ends, s):
    return add(ends[0], scale(sub(ends[1], ends[0]), s))


def least(value):
    """Lowest value of a convex function on 0 to 1, by ternary search."""
    low, high = 0.0, 1.0
    for _ in range(80):
        a, b = low + (high - low) / 3, high - (high - low) / 3
        low, high = (low, b) if value(a) < value(b) else (a, high)
    return min(value(0.0), value(1.0), value(0.5 * (low + high)))


def to_segment(point, ends):
    """Distance of a point from a line segment."""
    axis = sub(ends[1], ends[0])
    s = dot(sub(point, ends[0]), axis) / (dot(axis, axis) or 1)
    return norm(sub(point, along(ends, min(max(s, 0.0), 1.0))))


def to_box(point, size):
    """Distance of a point, in the frame of a box, from its surface; negative inside."""
    beyond = [abs(x) - 0.5 * side for x, side in zip(point, size)]
    if max(beyond) <= 0:
        return max(beyond)
    return norm([max(b, 0.0) for b in beyond])


def capsule(shape, pose):
    r, p = pose
    return [add(p, apply(r, shape[end])) for end in ("from_in_link_m", "to_in_link_m")]


def shape_distance(first, second, pose, pose2):
    """Distance of the surfaces of two shapes; the second is a capsule."""
    ends = capsule(second, pose2)
    if first["kind"] == "capsule":
        other = capsule(first, pose)
        axes = least(lambda s: to_segment(along(ends, s), other))
        return axes - first["radius_m"] - second["radius_m"]
    r, p = pose
    center = add(p, apply(r, first["center_in_link_m"]))
    local = [apply(transpose(r), sub(end, center)) for end in ends]
    return least(lambda s: to_box(along(local, s), first["size_m"])) - second["radius_m"]


def are_far(one, two, pose, pose2, keeps):
    """True if the spheres around two shapes prove that the shapes are far enough apart."""
    middles, reaches = [], 0.0
    for shape, (r, p) in ((one, pose), (two, pose2)):
        if shape["kind"] == "capsule":
            ends = shape["from_in_link_m"], shape["to_in_link_m"]
            middle, size = scale(add(*ends), 0.5), sub(*ends)
            reaches += shape["radius_m"]
        else:
            middle, size = shape["center_in_link_m"], shape["size_m"]
        reaches += 0.5 * norm(size)
        middles.append(add(p, apply(r, middle)))
    return norm(sub(*middles)) - reaches >= keeps


class Clearance:
    """Pairs of shapes and points of links with their minimum distances. The nominal pose counts as valid: shapes that
    overlap in it are no pair, and other shapes may come as near as in it. The same holds for the ground, and for the
    pose in which a motion lies."""

    def __init__(self, robot, lying=None):
        upright = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        nominal = [joint["nominal_rad"] for joint in robot["joints"]]
        poses = link_poses(robot, [0.0] * 3, upright, nominal)
        ground = min(lowest_contact(foot, poses[foot["link"]]) for foot in robot["end_effectors"])
        margin = robot.get("clearance_margin_m", 0.01)
        links, carriers = robot["links"], {foot["link"] for foot in robot["end_effectors"]}
        joined = {frozenset((joint["parent"], joint["child"])) for joint in robot["joints"]}
        self.pairs, self.points = [], []
        for b, link2 in enumerate(links):
            for a, link in enumerate(links[:b]):
                for one in link.get("shapes", []) if frozenset((a, b)) not in joined else []:
                    for two in link2.get("shapes", []):
                        apart = shape_distance(one, two, poses[a], poses[b])
                        if apart >= 0:
                            self.pairs.append((a, b, one, two, min(margin, apart)))
        for index, link in enumerate(links):
            floor = 0.0 if index in carriers else margin
            for point, radius, keeps in link_points(link, index, floor):
                height = height_of(point, radius, poses[index]) - ground
                if height >= 0 and not lies_on(robot, index, point, radius):
                    self.points.append((index, point, radius, min(keeps, height)))
        if lying is not None:
            self.allow(robot, link_poses(robot, [0.0] * 3, upright, lying))

    def allow(self, robot, poses):
        """Lets shapes come as near as in a further pose, in which the body lies."""
        ground = min(lowest_contact(foot, poses[0]) for foot in robot["end_effectors"] if is_body_point(foot))
        for k, (a, b, one, two, keeps) in enumerate(self.pairs):
            apart = max(shape_distance(one, two, poses[a], poses[b]), 0.0)
            self.pairs[k] = (a, b, one, two, min(keeps, apart))
        for k, (index, point, radius, keeps) in enumerate(self.points):
            height = max(height_of(point, radius, poses[index]) - ground, 0.0)
            self.points[k] = (index, point, radius, min(keeps, height))


def is_body_point(foot):
    return foot["contact"]["kind"] == "body_point"


def lies_on(robot, link, point, radius):
    """True if a point of a shape is one on which the body lies."""
    return any(
        is_body_point(foot) and foot["link"] == link and (foot["center_in_link_m"], foot["radius_m"]) == (point, radius)
        for foot in robot["end_effectors"]
    )


def lowest_contact(foot, pose):
    """Height of the lowest point of a wheel or foot."""
    r, p = pose
    axis = apply(r, foot["contact"].get("axis_in_link", [0.0] * 3))
    drop = foot["radius_m"] * math.sqrt(max(1 - axis[2] ** 2, 0.0))
    return height_of(foot["center_in_link_m"], drop, pose)


def height_of(point, radius, pose):
    r, p = pose
    return p[2] + dot(r[2], point) - radius


def link_points(link, index, floor):
    """Spheres of a link that stay above the ground: point, radius, minimum height."""
    if not link.get("shapes"):
        return [([0.0] * 3, 0.0, 0.0)] if index > 0 else []
    found = []
    for shape in link["shapes"]:
        if shape["kind"] == "capsule":
            found += [(shape[end], shape["radius_m"], floor) for end in ("from_in_link_m", "to_in_link_m")]
        else:
            half = scale(shape["size_m"], 0.5)
            for x, y, z in ((x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)):
                arm = [x * half[0], y * half[1], z * half[2]]
                found.append((add(shape["center_in_link_m"], arm), 0.0, floor))
    return found


# --- the table ---


class Table:
    """Worst residual of each family in SI units."""

    def __init__(self, families):
        self.families = {family["name"]: family for family in families}
        self.rows = {}

    def see(self, name, residual, sample=None, subject="", limit=None):
        family = self.families.get(name)
        if family is None:
            raise ValueError("formulation.families has no %r; expected the level of every residual" % name)
        level = family["level"] * (limit if family["level_of"] == "limit" else 1)
        where = subject if sample is None else "sample %d %s" % (sample, subject)
        known = self.rows.get(name)
        # NaN is worse than any number.
        if known is None or not residual / level <= known[0] / known[1]:
            self.rows[name] = (residual, level, family["unit"], where)

    def good(self):
        """True if all residuals are within their levels. NaN is not."""
        return all(residual <= level for residual, level, _, _ in self.rows.values())

    def show(self):
        for name, (residual, level, unit, where) in self.rows.items():
            mark = " " if residual <= level else "!"
            print("  %-24s %s%10.3g  level %-8.3g %-11s %s" % (name, mark, residual, level, unit, where))

    def as_json(self):
        keys = ("worst", "level", "unit", "where")
        return {name: dict(zip(keys, row)) for name, row in self.rows.items()}


# --- torques of motors ---


def carried_links(robot, joint):
    """Links beyond a joint."""
    found = {joint["child"]}
    for other in robot["joints"]:  # parents come before children
        if other["parent"] in found:
            found.add(other["child"])
    return found


def second_difference(before, here, after):
    return add(sub(before, scale(here, 2)), after)


def joint_torques(line, k):
    """Torque of every joint at state k. It balances ground forces, weight and inertia of all links beyond the joint,
    and of its rotor, and its spring. Accelerations are second differences, as means around the sample."""
    robot, state, torques = line.robot, line.states[k], []
    gravity, per_h2 = line.formulation["gravity_m_s2"], line.mean_of_second_derivative(k)
    around = line.poses[k - 1], line.poses[k], line.poses[k + 1]
    for index_of_joint, joint in enumerate(robot["joints"]):
        frame = joint["parent_from_joint"]
        turn = matmul(around[1][joint["parent"]][0], from_quaternion(frame["orientation_wxyz"]))
        axis, origin = apply(turn, joint["axis_in_joint"]), around[1][joint["child"]][1]
        beyond, moment, force = carried_links(robot, joint), [0.0] * 3, [0.0] * 3
        for index in beyond:
            link = robot["links"][index]
            centers = [add(p, apply(r, link["com_in_link_m"])) for r, p in (poses[index] for poses in around)]
            push = add(scale(second_difference(*centers), per_h2), [0.0, 0.0, gravity])
            moment = add(moment, scale(cross(sub(centers[1], origin), push), link["mass_kg"]))
            force = add(force, scale(push, link["mass_kg"]))
            axes = [transpose(poses[index][0]) for poses in around]
            flat = link["inertia_in_link_kg_m2"]
            half_trace = 0.5 * (flat[0] + flat[4] + flat[8])
            for i in range(3):
                for j in range(3):
                    second = (half_trace if i == j else 0.0) - flat[3 * i + j]
                    bent = scale(second_difference(*(a[j] for a in axes)), per_h2)
                    moment = add(moment, scale(cross(axes[1][i], bent), second))
        for foot, e in zip(robot["end_effectors"], state["end_effectors"]):
            if foot["link"] in beyond:
                moment = sub(moment, cross(sub(e["position_m"], origin), e["force_n"]))
                force = sub(force, e["force_n"])
        angles = [line.states[n]["joint_rad"][index_of_joint] for n in (k - 1, k, k + 1)]
        armature = joint["actuator"]["armature_kg_m2"] if "actuator" in joint else 0.0
        rotor = armature * (angles[0] - 2 * angles[1] + angles[2]) * per_h2
        spring = joint.get("spring", {"stiffness_nm_rad": 0.0, "rest_rad": 0.0, "damping_nm_s_rad": 0.0})
        stretch, speed = angles[1] - spring["rest_rad"], (angles[2] - angles[0]) / (2 * line.h)
        held = spring["stiffness_nm_rad"] * stretch + spring["damping_nm_s_rad"] * speed
        # The motor of a prismatic joint moves it by the travel per radian.
        load = dot(axis, force) * joint["travel_m_per_rad"] if "travel_m_per_rad" in joint else dot(axis, moment)
        torques.append(load + rotor + held)
    return torques


def wheel_torque(foot, e):
    """Torque about its axis that holds the ground force on a wheel: r f.t."""
    rolling, _, _ = wheel_frame(e["tilt_rad"], e["yaw_rad"], foot["radius_m"])
    return foot["radius_m"] * dot(e["force_n"], rolling)


def beyond_line(motor, torque, speed):
    """Excess of a torque at a speed over a motor's torque-speed line; None without a line."""
    line = motor["torque_speed"]
    if line is None:
        return None
    used = torque / line["stall_torque_nm"] + speed / line["no_load_speed_rad_s"]
    return max(abs(used) - 1, 0)


# --- choreography ---


def place(subject, state):
    """Position of the subject of a target or a height limit."""
    if subject == "com":
        return state["com_m"]
    if subject == "body":
        return state["base_position_m"]
    return state["end_effectors"][subject["end_effector"]]["position_m"]


def check_choreography(table, plan, timeline):
    """Targets and height limits relative to the first sample."""
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
        # The samples of the span and the two samples that enclose it. The end of a period is its start.
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


def state_difference(a, b, offset, turn, feet, periodic):
    """Largest difference between state a, rotated about the vertical and moved, and state b. Periodic motions repeat
    wheel speeds; at rest, speeds outside the motion have no meaning."""
    r = from_axis_angle([0, 0, 1], turn)
    points = [(a["base_position_m"], b["base_position_m"]), (a["com_m"], b["com_m"])]
    pairs = list(zip(a["joint_rad"], b["joint_rad"]))
    heading, pitch, roll = a["base_yaw_pitch_roll_rad"]
    pairs += zip([heading + turn, pitch, roll], b["base_yaw_pitch_roll_rad"])
    for foot, e, e2 in zip(feet, a["end_effectors"], b["end_effectors"]):
        points.append((e["position_m"], e2["position_m"]))
        pairs += zip(apply(r, e["force_n"]), e2["force_n"])
        wheel_turn = turn if "axis_in_link" in foot["contact"] else 0.0
        pairs += [(e["tilt_rad"], e2["tilt_rad"]), (e["yaw_rad"] + wheel_turn, e2["yaw_rad"])]
        if periodic:
            pairs.append((e["wheel_speed_rad_s"], e2["wheel_speed_rad_s"]))
    for p, q in points:
        pairs += zip(add(apply(r, p), offset), q)
    return max(abs(x - y) for x, y in pairs)


def torques(state):
    """Torques of all motors."""
    wheels = [e["motor_torque_nm"] for e in state["end_effectors"]]
    return state["joint_torque_nm"] + [torque for torque in wheels if torque is not None] + [0.0]


def contact_point(foot, e, poses):
    """Contact point by forward kinematics."""
    r, p = poses[foot["link"]]
    return add(add(p, apply(r, foot["center_in_link_m"])), contact_from_center(foot, e))


def wheel_axis_error(foot, e, poses):
    """Length of the difference between a wheel's axis and the axis of its link."""
    _, axis, _ = wheel_frame(e["tilt_rad"], e["yaw_rad"], foot["radius_m"])
    return norm(sub(apply(poses[foot["link"]][0], foot["contact"]["axis_in_link"]), axis))


def inconsistency(robot, state, poses, contacts):
    """Largest difference between the values of a state and the values that follow from its base and joints."""
    off = [abs(x - y) for x, y in zip(center_of_mass(robot, poses), state["com_m"])]
    for x, y in zip(euler_matrix(state["base_yaw_pitch_roll_rad"]), poses[0][0]):
        off += [abs(a - b) for a, b in zip(x, y)]
    if contacts:
        for foot, e in zip(robot["end_effectors"], state["end_effectors"]):
            off.append(norm(sub(contact_point(foot, e, poses), e["position_m"])))
            if "axis_in_link" in foot["contact"]:
                off.append(wheel_axis_error(foot, e, poses))
    return max(off)


# --- the equations ---


def check_lengths(plan):
    """Lists parallel to the robot's joints, its feet or the samples have one element for each."""
    robot, motion, samples = plan["robot"], plan["motion"], plan["samples"]
    joints, feet = len(robot["joints"]), len(robot["end_effectors"])
    lists = [("motion.stance", motion["stance"], len(samples)), ("motion.held_wheels", motion["held_wheels"], feet)]
    lists += [("motion.stance[%d]" % i, flags, feet) for i, flags in enumerate(motion["stance"])]
    states = [("before", plan["before"]), ("after", plan["after"])]
    for path, state in states + [("samples[%d]" % i, s) for i, s in enumerate(samples)]:
        lists.append((path + ".joint_rad", state["joint_rad"], joints))
        lists.append((path + ".joint_torque_nm", state["joint_torque_nm"], joints))
        lists.append((path + ".end_effectors", state["end_effectors"], feet))
    for path, found, expected in lists:
        if len(found) != expected:
            raise ValueError("%s has %d elements; expected %d" % (path, len(found), expected))
    for path, state in states + [("samples[%d]" % i, s) for i, s in enumerate(samples)]:
        for j, (foot, e) in enumerate(zip(robot["end_effectors"], state["end_effectors"])):
            torque, driven = e["motor_torque_nm"], "actuator" in foot["contact"]
            if isinstance(torque, (int, float)) != driven:
                expected = "the torque of its motor" if driven else "null: it has no motor"
                shown = (path, j, json.dumps(torque), expected)
                raise ValueError("%s.end_effectors[%d].motor_torque_nm is %s; expected %s" % shown)


class Timeline:
    """A plan with the states outside its motion, and the kinematics of every state from base and joints."""

    def __init__(self, plan):
        check_lengths(plan)
        self.plan, self.robot, self.motion = plan, plan["robot"], plan["motion"]
        self.samples, self.h = plan["samples"], plan["sample_interval_s"]
        self.feet, self.formulation = self.robot["end_effectors"], plan["formulation"]
        self.periodic = self.motion["ends"] == "periodic"
        # T intervals of a periodic motion, T - 1 of any other.
        self.intervals = len(self.samples) if self.periodic else len(self.samples) - 1
        self.states = [plan["before"]] + self.samples + [plan["after"]]
        self.rotations = [from_quaternion(s["base_orientation_wxyz"]) for s in self.states]
        self.poses = [
            link_poses(self.robot, s["base_position_m"], r, s["joint_rad"])
            for s, r in zip(self.states, self.rotations)
        ]
        self.torques = [joint_torques(self, k) for k in range(1, len(self.samples) + 1)]

    def neighbours(self, k):
        """Indices of the states beside state k within the motion. An end has one interval."""
        inside = [(k - 1, k > 1), (k + 1, k < len(self.samples))]
        return [n for n, there in inside if there or self.periodic]

    def mean_of_second_derivative(self, k):
        """Factor by which the second difference at state k becomes the mean of the second derivative, 1/s^2."""
        return 2 / (len(self.neighbours(k)) * self.h ** 2)


def check_times(table, line):
    table.see("duration", abs(line.intervals * line.h - line.motion["duration_s"]))
    for i, s in enumerate(line.states, -1):
        table.see("time", abs(s["time_s"] - i * line.h), i)


def check_ends(table, line):
    """States before and after match the kind of the motion's ends, and agree with forward kinematics."""
    before, first, last, after = line.states[0], line.samples[0], line.samples[-1], line.states[-1]
    placed = line.plan["end_placement"]["offset_m"] + [0.0], line.plan["end_placement"]["yaw_rad"]
    prescribed = line.motion["ends"] == "prescribed"
    if line.periodic:
        pairs = [(before, last, placed), (first, after, placed)]
        for e, e2 in zip(before["end_effectors"], last["end_effectors"]):
            table.see("ends", abs(e["motor_speed_rad_s"] - e2["motor_speed_rad_s"]))
    else:
        still = [0.0] * 3, 0.0
        pairs = [(before, first, still), (last, after, still)]
    for a, b, (offset, turn) in pairs:
        for foot, e, e2 in zip(line.feet, a["end_effectors"], b["end_effectors"]):
            if e["contact"] != e2["contact"]:
                table.see("contact flag", 1, subject=foot["name"])
        table.see("ends", max(abs(x - y) for x, y in zip(torques(a), torques(b))))
        if not prescribed:
            table.see("ends", state_difference(a, b, offset, turn, line.feet, line.periodic))
    if prescribed:
        # The base of the last sample equals the moved base of the first sample.
        offset, turn = placed
        start, end = first["base_position_m"][:2] + [0.0], last["base_position_m"][:2] + [0.0]
        moved = add(apply(from_axis_angle([0, 0, 1], turn), start), offset)
        turned = last["base_yaw_pitch_roll_rad"][0] - first["base_yaw_pitch_roll_rad"][0]
        table.see("ends", max(norm(sub(moved, end)), abs(turned - turn)))
    # Prescribed states are exact to their contact points; others repeat samples, whose contact points are residuals.
    for k in (0, -1):
        table.see("ends", inconsistency(line.robot, line.states[k], line.poses[k], contacts=prescribed))


def check_dynamics(table, line):
    """Newton and Euler equations of the whole robot, as means around every sample."""
    gravity = line.formulation["gravity_m_s2"]
    mass = sum(link["mass_kg"] for link in line.robot["links"])
    for i, s in enumerate(line.samples):
        k = i + 1  # index in the timeline
        before, after = line.states[k - 1], line.states[k + 1]

        # Means around the sample with the weight 1 - |t| / h: 2/3 and 1/3 on the interval to a neighbour, since forces
        # are linear there. The mean of an acceleration is the second difference.
        inside, per_h2 = [line.states[n] for n in line.neighbours(k)], line.mean_of_second_derivative(k)
        force, moment = [0.0] * 3, [0.0] * 3
        for state, weight in [(s, 2 / 3)] * len(inside) + [(n, 1 / 3) for n in inside]:
            for e in state["end_effectors"]:
                f = scale(e["force_n"], weight / len(inside))
                force = add(force, f)
                moment = add(moment, cross(sub(e["position_m"], state["com_m"]), f))

        # Linear dynamics, Eq. 2.3: sum f + M g - M x'' = 0.
        acceleration = scale(second_difference(before["com_m"], s["com_m"], after["com_m"]), per_h2)
        wrong = sub(force, scale(add(acceleration, [0, 0, gravity]), mass))
        table.see("linear dynamics", norm(wrong), i)

        # Angular dynamics, Eq. 2.4, with the mean angular momentum of all links over the intervals.
        swept_in = swept_moment(line.robot, line.poses[k - 1], line.poses[k])
        swept_out = swept_moment(line.robot, line.poses[k], line.poses[k + 1])
        rate = scale(sub(swept_out, swept_in), per_h2)
        table.see("angular dynamics", norm(sub(moment, rate)), i)


def check_body(table, line):
    """Centre of mass, orientation and joints of every sample."""
    robot = line.robot
    for i, s in enumerate(line.samples):
        k = i + 1
        # Centre of mass and orientation agree with the pose, Eq. 2.11 and 2.12.
        off = norm(sub(center_of_mass(robot, line.poses[k]), s["com_m"]))
        table.see("centre of mass", off, i)
        euler = euler_matrix(s["base_yaw_pitch_roll_rad"])
        off = max(abs(a - b) for x, y in zip(euler, line.rotations[k]) for a, b in zip(x, y))
        table.see("base orientation", off, i)
        for joint, q, torque in zip(robot["joints"], s["joint_rad"], line.torques[i]):
            beyond = max(q - joint["position_max_rad"], joint["position_min_rad"] - q, 0)
            table.see("joint limit", beyond, i, joint["name"])
            if "actuator" not in joint:  # a passive joint, which its spring alone balances
                table.see("passive joint", abs(torque), i, joint["name"])
                continue
            limit = joint["actuator"]["torque_max_nm"]
            beyond = max(abs(torque) - limit, 0)
            table.see("joint torque", beyond, i, joint["name"], limit)


def check_contacts(table, line):
    """Every end effector at every sample."""
    for i, s in enumerate(line.samples):
        for j, (foot, e) in enumerate(zip(line.feet, s["end_effectors"])):
            if e["contact"] != line.motion["stance"][i][j]:
                table.see("contact flag", 1, i, foot["name"])
            check_ground_force(table, line, i, foot, e)
            check_contact_place(table, line, i, foot, e)
            for other, e2 in list(zip(line.feet, s["end_effectors"]))[j + 1:]:
                check_clearance(table, line, i, (foot, e), (other, e2))


def check_ground_force(table, line, i, foot, e):
    """Friction cone, Eq. 2.5; free wheels, Eq. 2.6; no force in swing, Eq. 2.7; torque of a wheel's motor."""
    name, f, radius, contact = foot["name"], e["force_n"], foot["radius_m"], foot["contact"]
    if not e["contact"]:
        table.see("swing force", norm(f), i, name)
    else:
        beyond = math.hypot(f[0], f[1]) - foot["friction_coefficient"] * max(f[2], 0)
        table.see("friction", max(beyond, -f[2], 0), i, name)
        drag = contact.get("drag")
        if drag is not None:
            rolling, _, _ = wheel_frame(e["tilt_rad"], e["yaw_rad"], radius)
            speed = e["wheel_speed_rad_s"] * radius
            sign = math.tanh(speed / line.formulation["rolling_sign_width_m_s"])
            slowing = drag["rolling_resistance"] * sign + drag["rolling_drag_s_m"] * speed
            table.see("free-wheel traction", abs(dot(f, rolling) + f[2] * slowing), i, name)
    if "actuator" in contact:
        limit = contact["actuator"]["torque_max_nm"]
        beyond = max(abs(wheel_torque(foot, e)) - limit, 0)
        table.see("wheel torque", beyond, i, name, limit)


def check_contact_place(table, line, i, foot, e):
    """Height over the ground, Eq. 2.9; wheel axis and contact point agree with the pose, Eq. 2.13 and 2.14."""
    name, radius, contact, poses = foot["name"], foot["radius_m"], foot["contact"], line.poses[i + 1]
    z = e["position_m"][2]
    if e["contact"]:
        table.see("contact height", abs(z), i, name)
    else:
        table.see("depth in swing", max(-z, 0), i, name)
    if "axis_in_link" in contact:
        table.see("wheel axis", wheel_axis_error(foot, e, poses), i, name)
    blade = contact.get("blade_length_m")
    if blade is not None and e["contact"]:
        # The middle of the blade is opposite to the link's z, square to the axis across it.
        across = contact["axis_in_link"]
        down = sub(scale(across, across[2]), [0.0, 0.0, 1.0])
        middle = apply(poses[foot["link"]][0], scale(down, radius / norm(down)))
        rolling, _, _ = wheel_frame(e["tilt_rad"], e["yaw_rad"], radius)
        most = radius * math.sin(min(0.5 * blade / radius, 0.5 * math.pi))
        beyond = max(abs(dot(middle, rolling)) - most, 0)
        table.see("contact on the blade", beyond, i, name)
    off = norm(sub(contact_point(foot, e, poses), e["position_m"]))
    table.see("contact point", off, i, name)


def check_clearance(table, line, i, one, another):
    """End effectors of different links keep apart, Eq. 2.10."""
    (foot, e), (other, e2) = one, another
    if other["link"] != foot["link"] and not is_body_point(other):
        apart = norm(sub(e["position_m"], e2["position_m"]))
        missing = max(reach(foot) + reach(other) + line.formulation["clearance_m"] - apart, 0)
        table.see("end-effector clearance", missing, i, foot["name"])


def check_link_clearance(table, line):
    """Links keep apart, and above the ground."""
    names = [link["name"] for link in line.robot["links"]]
    clearance = Clearance(line.robot, line.motion.get("lying_rad"))
    for i, poses in enumerate(line.poses[1:-1]):
        for a, b, one, two, keeps in clearance.pairs:
            far = are_far(one, two, poses[a], poses[b], keeps)
            missing = 0 if far else max(keeps - shape_distance(one, two, poses[a], poses[b]), 0)
            table.see("link clearance", missing, i, names[a] + " and " + names[b])
        for link, point, radius, keeps in clearance.points:
            missing = max(keeps - height_of(point, radius, poses[link]), 0)
            table.see("ground clearance", missing, i, names[link])


def check_intervals(table, line):
    """Speeds, and torques at speeds, from every sample to the next."""
    for i in range(line.intervals):
        k = i + 1
        s, after = line.states[k], line.states[k + 1]
        before = line.states[k - 1]
        angles = zip(before["joint_rad"], s["joint_rad"], after["joint_rad"])
        for joint, (q_last, q, q_next), torque in zip(line.robot["joints"], angles, line.torques[i]):
            if "actuator" not in joint:
                continue
            beyond = beyond_line(joint["actuator"], torque, (q_next - q_last) / (2 * line.h))
            if beyond is not None:
                table.see("torque-speed line", beyond, i, joint["name"])
            limit = joint["actuator"]["speed_max_rad_s"]
            beyond = max(abs(q_next - q) / line.h - limit, 0)
            table.see("joint speed", beyond, i, joint["name"], limit)
        for j, (foot, e, e2) in enumerate(zip(line.feet, s["end_effectors"], after["end_effectors"])):
            check_slip(table, line, i, foot, e, e2)
            if "axis_in_link" in foot["contact"]:
                check_wheel_speed(table, line, i, j, e, e2)


def mean_wheel_frame(foot, e, e2):
    """Rolling direction and axis in the middle of an interval."""
    tilt, yaw = 0.5 * (e["tilt_rad"] + e2["tilt_rad"]), 0.5 * (e["yaw_rad"] + e2["yaw_rad"])
    return wheel_frame(tilt, yaw, foot["radius_m"])[:2]


def link_turn(line, i, foot):
    """Angular velocity in world of the link that carries an end effector, on the interval after sample i."""
    link_in, link_out = (line.poses[k][foot["link"]][0] for k in (i + 1, i + 2))
    return scale(rotation_vector(matmul(link_out, transpose(link_in))), 1 / line.h)


def check_slip(table, line, i, foot, e, e2):
    """No slip, Eq. 2.8 at the interval's middle: (e' - e) / h = omega r t, and r Omega x z for the sphere of a foot."""
    # Free wheels and blades also leave the ground and land along their direction.
    landing = "drag" in foot["contact"] and e["contact"] != e2["contact"]
    if e["contact"] and e2["contact"] or landing:
        slip = scale(sub(e2["position_m"], e["position_m"]), 1 / line.h)
        if "axis_in_link" in foot["contact"]:
            rolling, _ = mean_wheel_frame(foot, e, e2)
            slip = sub(slip, scale(rolling, e["wheel_speed_rad_s"] * foot["radius_m"]))
        else:
            turn = link_turn(line, i, foot)
            slip = sub(slip, scale(cross(turn, [0.0, 0.0, 1.0]), foot["radius_m"]))
        kind_of_slip = "landing slip" if landing else "slip"
        table.see(kind_of_slip, math.hypot(slip[0], slip[1]), i, foot["name"])


def check_wheel_speed(table, line, i, j, e, e2):
    """Checks the speed of a wheel relative to its link, omega + yaw' (v.a) - Omega.a: the motor speed, or 0 for a welded or held wheel."""
    foot = line.feet[j]
    name, radius, contact, held = foot["name"], foot["radius_m"], foot["contact"], line.motion["held_wheels"][j]
    _, axis = mean_wheel_frame(foot, e, e2)
    turn = link_turn(line, i, foot)
    needed = e["wheel_speed_rad_s"] + (e2["yaw_rad"] - e["yaw_rad"]) / line.h * axis[2] - dot(turn, axis)
    if held or not ("actuator" in contact or "drag" in contact):
        table.see("held wheel", abs(needed) * radius, i, name)
    if "actuator" in contact:
        motor = e["motor_speed_rad_s"]
        table.see("motor against wheel", abs(motor - needed) * radius, i, name)
        limit = contact["actuator"]["speed_max_rad_s"]
        beyond = max(abs(motor) - limit, 0)
        table.see("wheel motor speed", beyond, i, name, limit)
        torque = 0.5 * (wheel_torque(foot, e) + wheel_torque(foot, e2))
        beyond = beyond_line(contact["actuator"], torque, motor)
        if beyond is not None and not held:
            table.see("torque-speed line", beyond, i, name)


def check_goals(table, line):
    """Displacement of the centre of mass along and across the starting heading, and turn."""
    first, last = line.states[1], line.states[1 + line.intervals]
    yaw = first["base_yaw_pitch_roll_rad"][0]
    moved = sub(last["com_m"], first["com_m"])
    reached = {
        "forward_m": moved[0] * math.cos(yaw) + moved[1] * math.sin(yaw),
        "left_m": moved[1] * math.cos(yaw) - moved[0] * math.sin(yaw),
        "turn_rad": last["base_yaw_pitch_roll_rad"][0] - yaw,
    }
    for name, value in reached.items():
        goal = line.motion["goal"].get(name)
        if goal is not None:
            kind = "turning goal" if name == "turn_rad" else "displacement goal"
            table.see(kind, abs(value - goal), line.intervals, name.rsplit("_", 1)[0])


def check(plan):
    line = Timeline(plan)
    table = Table(line.formulation["families"])
    check_times(table, line)
    check_ends(table, line)
    check_dynamics(table, line)
    check_body(table, line)
    check_contacts(table, line)
    check_link_clearance(table, line)
    check_intervals(table, line)
    check_goals(table, line)
    check_choreography(table, plan, line.states)
    return table


# Optional fields: options of a robot file, goals that a motion does not have, the level of a cost.
NULLABLE = {
    "torque_speed", "diagnosis", "subject", "field", "given", "would_do", "forward_m", "left_m", "turn_rad",
    "heading_rad", "below_m", "above_m", "level", "motor_torque_nm",
}  # fmt: skip
# Components of a target that leave an axis free.
NULLABLE_ITEMS = {"position_m", "velocity_m_s"}


def refuse_strange_numbers(value, path="", key="", in_targets=False):
    """Refuses NaN, Infinity and numbers such as 1e999, which Python reads as infinity, and null, which other writers put in their place."""
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


def plain(text):
    """Text without control characters, because names in plans are not trusted."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


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
            if "terrain" in plan["motion"]:
                raise ValueError("motion.terrain is given; this script checks plans for level ground")
            table = check(plan)
        except (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
            print(plain("%s: not a usable plan: %s: %s" % (path, type(error).__name__, error)), file=sys.stderr)
            code = 2
            continue
        if "--json" in arguments:
            print(json.dumps(table.as_json()))
        else:
            print(plain("%s: %s of %s" % (path, plan["motion"]["name"], plan["robot"]["name"])))
            table.show()
        if not table.good():
            code = max(code, 1)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
