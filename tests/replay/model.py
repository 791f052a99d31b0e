"""The robot as a MuJoCo model on level ground.

A wheel that spins is a separate body. Its mass and inertia are subtracted from its link, so that both together equal
the link of the robot file. Wheels are thin ellipsoids: they touch the ground in one point, like the disc of a plan.
Servos are affine actuators, force = control - kp q - kd q', so that MuJoCo integrates their damping implicitly.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

import robots
from robots import steiner

# Half the width of a wheel divided by its radius, so thin that its lowest point is almost that of a disc.
WHEEL_WIDTH = 0.02


@dataclass(frozen=True)
class Ground:
    """Parameters of MuJoCo for contact and time."""

    step_s: float = 0.001
    # Friction constraints that are stiffer than the normal ones creep less. Cones are elliptic: a pyramid has more
    # friction along its edges.
    impratio: float = 20.0
    # Time constant of penetration, s, and damping ratio. With 0.02, the default of MuJoCo, wheels sink in by 0.8 mm,
    # and roll on a radius that is too small by half of that: an error of 0.7 % of every distance, and 12 % of a
    # swizzle. Below 0.003, results change by less than 0.5 % (docs/replay.md).
    solref: tuple = (0.003, 1.0)
    solimp: tuple = (0.9, 0.95, 0.001)
    # Links that reach the ground collide with it.
    solid_links: bool = True


class Model:
    """A compiled model with the names and orders of a robot."""

    def __init__(self, robot, gravity_m_s2, ground=Ground()):
        self.robot, self.ground = robot, ground
        self.m = mujoco.MjModel.from_xml_string(_mjcf(robot, gravity_m_s2, ground))
        m, feet = self.m, robot["end_effectors"]
        find = lambda kind, name: mujoco.mj_name2id(m, kind, name)
        body = lambda name: find(mujoco.mjtObj.mjOBJ_BODY, name)
        joint = lambda name: find(mujoco.mjtObj.mjOBJ_JOINT, name)
        self.links = [body("link:" + link["name"]) for link in robot["links"]]
        self.carriers = np.array(
            [body("wheel:" + f["name"]) if robots.spins(f) else self.links[f["link"]] for f in feet]
        )
        self.foot_geoms = [find(mujoco.mjtObj.mjOBJ_GEOM, "foot:" + f["name"]) for f in feet]
        # Shapes of the root link, and of links without an end effector.
        with_feet = {f["link"] for f in feet if f["contact"]["kind"] != "body_point"} - {0}
        upper = [link for index, link in enumerate(robot["links"]) if index not in with_feet]
        names = [f"shape:{link['name']}:{number}" for link in upper for number in range(len(link["shapes"]))]
        shapes = [find(mujoco.mjtObj.mjOBJ_GEOM, name) for name in names]
        self.trunk_geoms = {geom for geom in shapes if geom >= 0}
        joints = [joint("joint:" + j["name"]) for j in robot["joints"]]
        wheels = [joint("wheel:" + f["name"]) if robots.spins(f) else -1 for f in feet]
        self.joint_qpos, self.joint_dofs = m.jnt_qposadr[joints], m.jnt_dofadr[joints]
        self.per_rad = robots.per_rad(robot)
        self.wheel_qpos = [m.jnt_qposadr[w] if w >= 0 else -1 for w in wheels]
        self.wheel_dofs = [m.jnt_dofadr[w] if w >= 0 else -1 for w in wheels]
        # One row for each channel: joints, then driven wheels. Actuators have the same order.
        self.channels = robots.channels(robot)
        joints = list(self.joint_dofs[robots.driven(robot)])
        wheels = [self.wheel_dofs[c[3]] for c in self.channels if c[3] is not None]
        self.channel_dofs = np.array(joints + wheels, dtype=int)
        # Displacement of each channel's coordinate per radian of its motor.
        self.channel_per_rad = np.array([*self.per_rad[robots.driven(robot)], *[1.0] * len(wheels)])
        self.mass_kg = float(m.body_subtreemass[1])

    def place(self, position, yaw_pitch_roll, joint_rad, wheel_rad):
        """Generalised positions of a pose."""
        q = np.zeros(self.m.nq)
        q[0:3] = position
        yaw, pitch, roll = yaw_pitch_roll
        q[3:7] = robots.quaternion(roll, pitch, yaw)
        q[self.joint_qpos] = np.asarray(joint_rad) * self.per_rad
        for address, angle in zip(self.wheel_qpos, wheel_rad):
            if address >= 0:
                q[address] = angle
        return q

    def place_in_motion(self, motion, time_s):
        """Generalised positions at a time of a plan."""
        return self.place(*motion.base(time_s), motion.joints(time_s)[0], motion.motors(time_s)[0])

    def derivatives(self, motion, time_s, step_s=1e-4):
        """Generalised positions, velocities and accelerations at a time of a plan, by central differences.

        The curves have two continuous derivatives; differences of rotations are taken on the rotation group.
        """
        m = self.m
        q = [self.place_in_motion(motion, time_s + k * step_s) for k in (-1, 0, 1)]
        before, after = np.zeros(m.nv), np.zeros(m.nv)
        mujoco.mj_differentiatePos(m, before, step_s, q[0], q[1])
        mujoco.mj_differentiatePos(m, after, step_s, q[1], q[2])
        return q[1], 0.5 * (before + after), (after - before) / step_s


def _mjcf(robot, gravity, ground):
    solref, solimp = (" ".join(map(repr, values)) for values in (ground.solref, ground.solimp))
    out = [
        f'<mujoco><compiler angle="radian" autolimits="false"/>',
        f'<option timestep="{ground.step_s!r}" gravity="0 0 {-gravity!r}" cone="elliptic" '
        f'impratio="{ground.impratio!r}" integrator="implicitfast" iterations="100" tolerance="1e-10"/>',
        f'<default><geom condim="3" solref="{solref}" solimp="{solimp}" contype="0" conaffinity="0"/></default>',
        '<worldbody><geom name="ground" type="plane" size="0 0 1" contype="1" friction="0.6"/>',
        f'<body name="link:{robot["links"][0]["name"]}"><freejoint name="base"/>',
    ]
    clear = _links_above_ground(robot) if ground.solid_links else set()
    _link(robot, 0, clear, out)
    out += ["</worldbody><actuator>"]
    for name, actuator, joint, foot in robots.channels(robot):
        kind = "joint" if joint is not None else "wheel"
        kp = actuator["kp_nm_rad"] if joint is not None else 0.0
        limit = actuator["torque_max_nm"]
        # Angles, torques and gains of a prismatic joint are those of its motor.
        gear = 1.0 / joint.get("travel_m_per_rad", 1.0) if joint is not None else 1.0
        out.append(
            f'<general joint="{kind}:{name}" gainprm="1" biastype="affine" '
            f'biasprm="0 {-kp!r} {-actuator["kd_nm_s_rad"]!r}" gear="{gear!r}" forcelimited="true" forcerange="{-limit!r} {limit!r}"/>'
        )
    out += ["</actuator></mujoco>"]
    return "\n".join(out)


def _spring(joint):
    """Attributes of the spring and damper beside the motor of a joint."""
    if "spring" not in joint:
        return ""
    spring, per_rad = joint["spring"], joint.get("travel_m_per_rad", 1.0)
    return (
        f' stiffness="{spring["stiffness_nm_rad"] / per_rad**2!r}" springref="{spring["rest_rad"] * per_rad!r}"'
        f' damping="{spring["damping_nm_s_rad"] / per_rad**2!r}"'
    )


def _link(robot, index, clear, out):
    """Inertia, shapes, wheels and children of a link, up to the end of its body."""
    link = robot["links"][index]
    feet = [f for f in robot["end_effectors"] if f["link"] == index]
    mass, com = link["mass_kg"], np.array(link["com_in_link_m"])
    inertia = np.array(link["inertia_in_link_kg_m2"]).reshape(3, 3)
    wheels = [(f, wheel_inertia(robot, f)) for f in feet if robots.spins(f)]
    rest_mass, rest_com, rest_inertia = _without(mass, com, inertia, wheels)
    out.append(_inertial(rest_mass, rest_com, rest_inertia))
    for number, shape in enumerate(link["shapes"]):
        if (index, number) in clear:
            out.append(_shape(f"shape:{link['name']}:{number}", shape))
    for foot in feet:
        center, name = _numbers(foot["center_in_link_m"]), foot["name"]
        geom = f'name="foot:{name}" conaffinity="1" priority="1" friction="{foot["friction_coefficient"]!r}"'
        radius, axis = foot["radius_m"], foot["contact"].get("axis_in_link")
        if axis is None:
            # A point of the body is a small sphere on the same ground.
            size = max(radius, 1e-3)
            center = _numbers(np.array(foot["center_in_link_m"]) + [0.0, 0.0, size - radius])
            out.append(f'<geom {geom} type="sphere" size="{size!r}" pos="{center}"/>')
            continue
        disc = f'{geom} type="ellipsoid" size="{radius!r} {WHEEL_WIDTH * radius!r} {radius!r}" {_turn_y_to(axis)}'
        if not robots.spins(foot):
            out.append(f'<geom {disc} pos="{center}"/>')
            continue
        wheel_mass, wheel = wheel_inertia(robot, foot)
        armature = foot["contact"].get("actuator", {}).get("armature_kg_m2", 0.0)
        out.append(f'<body name="wheel:{name}" pos="{center}">')
        out.append(f'<joint name="wheel:{name}" axis="{_numbers(axis)}" armature="{armature!r}"/>')
        out.append(_inertial(wheel_mass, np.zeros(3), wheel))
        out.append(f"<geom {disc}/></body>")
    for joint in robot["joints"]:
        if joint["parent"] != index:
            continue
        frame = joint["parent_from_joint"]
        name, child = joint["name"], robot["links"][joint["child"]]["name"]
        turn = _numbers(frame["orientation_wxyz"])
        out.append(f'<body name="link:{child}" pos="{_numbers(frame["position_m"])}" quat="{turn}">')
        armature = joint["actuator"]["armature_kg_m2"] if "actuator" in joint else 0.0
        axis = _numbers(joint["axis_in_joint"])
        kind = "slide" if "travel_m_per_rad" in joint else "hinge"
        armature /= joint.get("travel_m_per_rad", 1.0) ** 2
        out.append(f'<joint name="joint:{name}" type="{kind}" axis="{axis}" armature="{armature!r}"{_spring(joint)}/>')
        _link(robot, joint["child"], clear, out)
    out.append("</body>")


def wheel_inertia(robot, foot):
    """Mass and inertia, about its centre, of the rotating part of a wheel.

    If the robot file has a cylinder at the wheel, the values of the cylinder. Otherwise a thin disc with a tenth of
    the link's mass, shared by the link's wheels. A blade does not turn, and gets almost nothing. The remaining link
    must be a physical body.
    """
    link = robot["links"][foot["link"]]
    axis, radius = np.array(foot["contact"]["axis_in_link"]), foot["radius_m"]
    for shape in link["shapes"]:
        if (
            shape["kind"] == "cylinder"
            and abs(axis[shape["axis"]]) > 1 - 1e-9
            and np.allclose(shape["at_m"], foot["center_in_link_m"], atol=1e-9)
            and abs(shape["radius_m"] - radius) < 0.2 * radius
        ):
            return shape["mass_kg"], shape["inertia"]
    sharing = sum(other["link"] == foot["link"] for other in robot["end_effectors"])
    mass = (1e-4 if foot["contact"]["kind"] == "skate" else 0.1) * link["mass_kg"] / sharing
    while True:
        disc = 0.25 * mass * radius**2 * (np.eye(3) + np.outer(axis, axis))
        wheels = [(foot, (sharing * mass, sharing * disc))]
        inertia = np.array(link["inertia_in_link_kg_m2"]).reshape(3, 3)
        moments = np.linalg.eigvalsh(_without(link["mass_kg"], np.array(link["com_in_link_m"]), inertia, wheels)[2])
        if moments[0] > 0 and moments[0] + moments[1] >= moments[2]:
            return mass, disc
        mass *= 0.5


def _without(mass, com, inertia, wheels):
    """Mass, centre, and inertia about the centre, of a link without its wheels."""
    rest = mass - sum(m for _, (m, _) in wheels)
    center = lambda foot: np.array(foot["center_in_link_m"])
    rest_com = (mass * com - sum(m * center(f) for f, (m, _) in wheels)) / rest
    left = inertia + steiner(mass, com - rest_com)
    for foot, (m, disc) in wheels:
        left = left - disc - steiner(m, center(foot) - rest_com)
    return rest, rest_com, left


def _links_above_ground(robot):
    """Shapes, as (link, number), that are above the ground in the nominal pose, and may hit it later.

    Shapes that reach below the feet in that pose are the robot file's rough outlines, not collisions.
    """
    poses = nominal_poses(robot)
    lowest_foot = min(
        (poses[f["link"]][1] + poses[f["link"]][0] @ f["center_in_link_m"])[2] - f["radius_m"]
        for f in robot["end_effectors"]
    )
    found = set()
    for index, link in enumerate(robot["links"]):
        rotation, origin = poses[index]
        for number, shape in enumerate(link["shapes"]):
            if _is_tyre(robot, index, shape):
                continue
            down = rotation.T @ [0.0, 0.0, -1.0]
            bottom = (origin + rotation @ shape["at_m"])[2] - _reach(shape, down)
            if bottom > lowest_foot + 0.001:
                found.add((index, number))
    return found


def _is_tyre(robot, link, shape):
    """True if a shape is a wheel, which touches the ground as an end effector and not as a shape."""
    feet = [f for f in robot["end_effectors"] if f["link"] == link and "axis_in_link" in f["contact"]]
    return shape["kind"] == "cylinder" and any(
        np.allclose(shape["at_m"], f["center_in_link_m"], atol=0.1 * f["radius_m"]) for f in feet
    )


def _reach(shape, direction):
    """Extent of a shape from its centre in a direction of its link, m."""
    if shape["kind"] == "box":
        return float(np.abs(direction) @ shape["size_m"]) / 2
    along = abs(direction[shape["axis"]])
    return along * shape["length_m"] / 2 + np.sqrt(max(1 - along * along, 0.0)) * shape["radius_m"]


def nominal_poses(robot):
    """World-from-link (rotation, origin) of every link, with the body at the origin and the joints in the nominal
    pose."""
    poses = [None] * len(robot["links"])
    poses[0] = (np.eye(3), np.zeros(3))
    turn = np.zeros(9)
    for joint in robot["joints"]:
        rotation, origin = poses[joint["parent"]]
        frame = joint["parent_from_joint"]
        mujoco.mju_quat2Mat(turn, np.array(frame["orientation_wxyz"]))
        if "travel_m_per_rad" in joint:
            child = rotation @ turn.reshape(3, 3)
            slide = np.array(joint["axis_in_joint"]) * joint["travel_m_per_rad"] * joint["nominal_rad"]
            poses[joint["child"]] = (child, origin + rotation @ np.array(frame["position_m"]) + child @ slide)
            continue
        about = np.zeros(4)
        mujoco.mju_axisAngle2Quat(about, np.array(joint["axis_in_joint"]), joint["nominal_rad"])
        child = rotation @ turn.reshape(3, 3)
        origin = origin + rotation @ np.array(frame["position_m"])
        mujoco.mju_quat2Mat(turn, about)
        poses[joint["child"]] = (child @ turn.reshape(3, 3), origin)
    return poses


def _shape(name, shape):
    if shape["kind"] == "box":
        kind = f'type="box" size="{_numbers(shape["size_m"] / 2)}"'
    else:
        axis = np.eye(3)[shape["axis"]]
        turn = np.zeros(4)
        mujoco.mju_quatZ2Vec(turn, axis)
        kind = f'type="cylinder" size="{shape["radius_m"]!r} {shape["length_m"] / 2!r}" quat="{_numbers(turn)}"'
    return f'<geom name="{name}" conaffinity="1" pos="{_numbers(shape["at_m"])}" {kind}/>'


def _turn_y_to(axis):
    """Orientation of a geom with its y axis along `axis`: z along -y, then z along `axis`."""
    turn, tip, both = np.zeros(4), np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]), np.zeros(4)
    mujoco.mju_quatZ2Vec(turn, np.array(axis, dtype=float))
    mujoco.mju_mulQuat(both, turn, tip)
    return f'quat="{_numbers(both)}"'


def _inertial(mass, com, inertia):
    i = inertia
    full = _numbers([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])
    return f'<inertial pos="{_numbers(com)}" mass="{float(mass)!r}" fullinertia="{full}"/>'


def _numbers(values):
    return " ".join(repr(float(value)) for value in values)
