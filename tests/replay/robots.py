"""Robots, read from robot files (docs/robot-files.md) without any code of the project.

A robot is a dictionary in the form of plans (docs/formats/plan-format.md, Robot), so that a robot of a file and one
of a plan can be compared number by number. A link also has `shapes` if the robot file has `parts`.
"""

import math
import tomllib

import numpy as np

from errors import Unusable, field_error


def from_file(path):
    """The robot of a robot file."""
    try:
        with open(path, "rb") as file:
            data = tomllib.load(file)
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise Unusable(f"{path}: {error}; expected the robot file of the plan") from error
    try:
        return _resolve(data)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise Unusable(f"{path}: {field_error(error)}") from error


# Protocols whose set-points have no torque field (docs/actuators.md).
WITHOUT_TORQUE = {"dynamixel", "feetech", "maestro"}


def feed_forward(path):
    """Form of torques from the controller: "offset" if drives of the robot file have no torque field, else "torque"."""
    with open(path, "rb") as file:
        buses = tomllib.load(file).get("bus", [])
    loops_in_drives = [bus for bus in buses if bus.get("control", "in_drive") == "in_drive"]
    return "offset" if any(bus["protocol"] in WITHOUT_TORQUE for bus in loops_in_drives) else "torque"


def from_plan(plan):
    """The robot that a plan contains; its links have no shapes."""
    robot = {key: value for key, value in plan["robot"].items()}
    robot["links"] = [dict(link, shapes=[]) for link in robot["links"]]
    return robot


def lies(robot):
    """True for the robot of a plan that lies on points of its body."""
    return any(foot["contact"]["kind"] == "body_point" for foot in robot["end_effectors"])


def with_body_points(robot, planned):
    """The robot of a robot file with the points on which a planned robot lies, which the planner adds as end effectors."""
    points = [foot for foot in planned["end_effectors"] if foot["contact"]["kind"] == "body_point"]
    return robot | {"end_effectors": robot["end_effectors"] + points}


def _resolve(data):
    robot = {"name": data["name"], "links": [], "joints": [], "end_effectors": []}
    index = {}
    groups = [(data, None)]
    groups += [(data["template"][limb["template"]], limb) for limb in data.get("limb", [])]
    for group, limb in groups:
        place = _Place(limb)
        for link in group.get("link", []):
            resolved = _link(link, place)
            index[resolved["name"]] = len(robot["links"])
            robot["links"].append(resolved)
    for group, limb in groups:
        place = _Place(limb)

        def link_index(name):
            name = limb["parent"] if limb and name == "mount" else place.name(name)
            if name not in index:
                raise ValueError(f"link {name!r} does not exist")
            return index[name]

        for joint in group.get("joint", []):
            robot["joints"].append(_joint(joint, place, link_index, data["actuator"], limb))
        for foot in group.get("end_effector", []):
            robot["end_effectors"].append(_end_effector(foot, place, link_index, data["actuator"]))
    return robot


class _Place:
    """Placement of a template's tables: a name for `*`, and the mirror image on the right."""

    def __init__(self, limb):
        self.limb = limb
        self.mirror = np.diag([1.0, -1.0, 1.0]) if limb and limb["side"] == "right" else np.eye(3)
        self.sign = -1.0 if limb and limb["side"] == "right" else 1.0

    def name(self, name):
        return name.replace("*", self.limb["name"]) if self.limb else name

    def point(self, point):
        return self.mirror @ np.array(point, dtype=float)

    def axis(self, axis):
        """Equal angles on both sides give mirrored poses: a becomes -M a."""
        axis = np.array(axis, dtype=float) / np.linalg.norm(axis)
        return axis * [-1.0, 1.0, -1.0] if self.sign < 0 else axis


def _link(link, place):
    shapes = []
    if "parts" in link:
        parts = [_part(part) for part in link["parts"]]
        mass = sum(part["mass_kg"] for part in parts)
        com = sum(part["mass_kg"] * part["at_m"] for part in parts) / mass
        inertia = sum(part["inertia"] + steiner(part["mass_kg"], part["at_m"] - com) for part in parts)
        shapes = [dict(part, at_m=place.point(part["at_m"])) for part in parts]
    else:
        mass, com = link["mass_kg"], np.array(link["com_in_link_m"], dtype=float)
        xx, yy, zz, xy, xz, yz = link["inertia_in_link_kg_m2"]
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return {
        "name": place.name(link["name"]),
        "mass_kg": float(mass),
        "com_in_link_m": list(place.point(com)),
        "inertia_in_link_kg_m2": list((place.mirror @ inertia @ place.mirror).ravel()),
        "shapes": shapes,
    }


def _part(part):
    """A homogeneous box or cylinder: mass, place, inertia about its centre, and its outline."""
    mass = part["mass_kg"]
    if "box_m" in part:
        size = np.array(part["box_m"], dtype=float)
        squares = size * size
        inertia = np.diag(squares.sum() - squares) * mass / 12
        outline = {"kind": "box", "size_m": size}
    else:
        keys = [key for key in ("cylinder_x_m", "cylinder_y_m", "cylinder_z_m") if key in part]
        axis = "xyz".index(keys[0][9]) if keys else None
        if axis is None:
            raise ValueError("a part has neither box_m nor cylinder_x_m, cylinder_y_m, cylinder_z_m")
        radius, length = part[keys[0]]
        diagonal = np.full(3, radius * radius / 4 + length * length / 12)
        diagonal[axis] = radius * radius / 2
        inertia = np.diag(diagonal) * mass
        outline = {"kind": "cylinder", "axis": axis, "radius_m": radius, "length_m": length}
    return {"mass_kg": mass, "at_m": np.array(part["at_m"], dtype=float), "inertia": inertia, **outline}


def steiner(mass, offset):
    """Inertia of a point mass at an offset."""
    offset = np.asarray(offset, dtype=float)
    return mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))


def _joint(joint, place, link_index, actuators, limb):
    origin = place.point(joint["origin_in_parent_m"])
    if limb and joint["parent"] == "mount":
        # The limb's origin places the template, relative to the link that carries the limb.
        origin = origin + np.array(limb["origin_in_parent_m"], dtype=float)
    roll, pitch, yaw = joint.get("origin_rpy_rad", [0.0, 0.0, 0.0])
    slides = joint.get("kind") == "prismatic"
    # Angles of a prismatic joint are those of a pinion; its axis is mirrored as a direction.
    travel = joint.get("travel_m_per_rad", PASSIVE_TRAVEL_M_PER_RAD) if slides else 1.0
    axis = np.array(joint["axis_in_joint"], dtype=float)
    position = lambda name: joint[f"{name}_m"] / travel if slides else joint[f"{name}_rad"]
    return {
        "name": place.name(joint["name"]),
        "parent": link_index(joint["parent"]),
        "child": link_index(joint["child"]),
        "parent_from_joint": {
            "position_m": list(origin),
            "orientation_wxyz": list(quaternion(place.sign * roll, pitch, place.sign * yaw)),
        },
        "axis_in_joint": list(place.point(axis / np.linalg.norm(axis)) if slides else place.axis(axis)),
        **({"travel_m_per_rad": travel} if slides else {}),
        "position_min_rad": position("position_min"),
        "position_max_rad": position("position_max"),
        "nominal_rad": position("nominal"),
        **({"actuator": _actuator(actuators, joint["actuator"])} if "actuator" in joint else {}),
        **_spring(joint, travel if slides else None),
    }


# Travel of a prismatic joint without a motor.
PASSIVE_TRAVEL_M_PER_RAD = 0.1


def per_rad(robot):
    """Displacement of each joint per radian of its coordinate in a plan: 1, or the travel of a prismatic joint, m/rad."""
    return np.array([joint.get("travel_m_per_rad", 1.0) for joint in robot["joints"]])


def _spring(joint, travel=None):
    """Spring and damper beside the motor; nothing for a joint without them. `travel` is that of a prismatic joint."""
    if "spring" not in joint:
        return {}
    if travel is not None:
        stiffness, rest, damping = (joint["spring"].get(key, 0.0) for key in ("stiffness_n_m", "rest_m", "damping_n_s_m"))
        square = travel * travel
        values = stiffness * square, rest / travel, damping * square
        return {"spring": dict(zip(("stiffness_nm_rad", "rest_rad", "damping_nm_s_rad"), values))}
    keys = "stiffness_nm_rad", "rest_rad", "damping_nm_s_rad"
    return {"spring": {key: joint["spring"].get(key, 0.0) for key in keys}}


def _end_effector(foot, place, link_index, actuators):
    contact = {"kind": foot["contact"]}
    if "axis_in_link" in foot:
        contact["axis_in_link"] = list(place.axis(foot["axis_in_link"]))
    if "actuator" in foot:
        contact["actuator"] = _actuator(actuators, foot["actuator"])
    if "rolling_resistance" in foot:
        contact["drag"] = {
            "rolling_resistance": foot["rolling_resistance"],
            "rolling_drag_s_m": foot.get("rolling_drag_s_m", 0.0),
        }
    if "blade_length_m" in foot:
        contact["blade_length_m"] = foot["blade_length_m"]
    return {
        "name": place.name(foot["name"]),
        "link": link_index(foot["link"]),
        "center_in_link_m": list(place.point(foot["center_in_link_m"])),
        "radius_m": foot["radius_m"],
        "friction_coefficient": foot["friction_coefficient"],
        "contact": contact,
    }


def _actuator(actuators, name):
    if name not in actuators:
        raise ValueError(f"actuator {name!r} does not exist")
    data = dict(actuators[name])
    stall, no_load = data.pop("stall_torque_nm", None), data.pop("no_load_speed_rad_s", None)
    line = None if stall is None else {"stall_torque_nm": stall, "no_load_speed_rad_s": no_load}
    return dict(data, torque_speed=line)


def quaternion(roll, pitch, yaw):
    """[w, x, y, z] of R_z(yaw) R_y(pitch) R_x(roll)."""
    cr, sr, cp, sp = math.cos(roll / 2), math.sin(roll / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return [
        cy * cp * cr + sy * sp * sr,
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
    ]


def difference(a, b, path="robot"):
    """Path and values of the first difference of two robots, or None. Addresses on buses and clearance are not
    compared."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in sorted(set(a) | set(b)):
            if key in ("shapes", "clearance_margin_m", "bus", "id", "buses"):
                continue
            if key not in a or key not in b:
                return f"{path}.{key} is on one side only"
            found = difference(a[key], b[key], f"{path}.{key}")
            if found:
                return found
        return None
    if isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            return f"{path} has {len(a)} entries and {len(b)}"
        for index, (x, y) in enumerate(zip(a, b)):
            found = difference(x, y, f"{path}[{index}]")
            if found:
                return found
        return None
    number = (int, float, np.floating)
    if isinstance(a, number) and isinstance(b, number):
        # Both are equal except for the rounding of a few sums.
        return None if abs(a - b) <= 1e-12 + 1e-9 * abs(a) else f"{path} is {a} and {b}"
    return None if a == b else f"{path} is {a!r} and {b!r}"


def driven(robot):
    """Indices of the joints with a motor."""
    return [k for k, joint in enumerate(robot["joints"]) if "actuator" in joint]


def channels(robot):
    """(name, actuator, joint or None, end effector index or None) in channel order: joints with a motor, then driven
    wheels."""
    found = [(robot["joints"][k]["name"], robot["joints"][k]["actuator"], robot["joints"][k], None) for k in driven(robot)]
    for index, foot in enumerate(robot["end_effectors"]):
        if "actuator" in foot["contact"]:
            found.append((foot["name"], foot["contact"]["actuator"], None, index))
    return found


def spins(foot):
    """True if an end effector turns against its link: a driven or free wheel, and a blade, which glides like a free wheel."""
    return foot["contact"]["kind"] in ("actuated_wheel", "passive_wheel", "skate")


def is_wheel(foot):
    """True if an end effector is a wheel that spins. A blade is not, although MuJoCo replaces it by a wheel."""
    return spins(foot) and foot["contact"]["kind"] != "skate"
