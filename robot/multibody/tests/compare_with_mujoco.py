#!/usr/bin/env python3
"""Compares kinematics and dynamics of rollwalk-multibody with MuJoCo.

    python3 robot/multibody/tests/compare_with_mujoco.py ROBOT.json...

The files come from robot/multibody/tests/multibody/mujoco.rs: a MuJoCo model, random states, and the results of Rust.
Every result must agree to 1e-9 of the largest number of its array (dynamics entry by entry, weighted with the mass
matrix). Then the comparison itself is tested: it must find an error planted in each result and in several properties
of the MuJoCo model. Exit status 1: something differs, named on stderr.
"""

import json
import sys

import mujoco
import numpy as np

TOLERANCE = 1e-9
# A planted error, relative to the largest number of its array.
PLANTED = 1e-7


class Model:
    """A MuJoCo model with the names and orders of a robot file."""

    def __init__(self, data):
        self.data = data
        self.m = mujoco.MjModel.from_xml_string(data["mjcf"])
        self.d = mujoco.MjData(self.m)
        body = lambda name: mujoco.mj_name2id(self.m, mujoco.mjtObj.mjOBJ_BODY, name)
        joint = lambda name: mujoco.mj_name2id(self.m, mujoco.mjtObj.mjOBJ_JOINT, name)
        self.links = [body(name) for name in data["links"]]
        self.wheels = [ee for ee in data["end_effectors"] if ee["spins"]]
        self.joints = [joint(name) for name in data["joints"]]
        self.joints += [joint("wheel:" + ee["name"]) for ee in self.wheels]
        self.carriers = [
            body("wheel:" + ee["name"]) if ee["spins"] else self.links[ee["link"]]
            for ee in data["end_effectors"]
        ]
        assert -1 not in self.links + self.joints + self.carriers

    def place(self, state):
        """Sets a state. nu = T qvel: MuJoCo's base turns about its own axes, and its order is the tree's."""
        m, d = self.m, self.d
        d.qpos[0:3] = state["base_position_m"]
        d.qpos[3:7] = state["world_from_body_wxyz"]
        for joint, angle in zip(self.joints, state["joint_rad"] + state["wheel_rad"]):
            d.qpos[m.jnt_qposadr[joint]] = angle
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, np.array(state["world_from_body_wxyz"]))
        self.T = np.zeros((m.nv, m.nv))
        self.T[0:3, 0:3] = np.eye(3)
        self.T[3:6, 3:6] = rotation.reshape(3, 3)
        for index, joint in enumerate(self.joints):
            self.T[6 + index, m.jnt_dofadr[joint]] = 1.0
        nu = np.array(state["velocity"])
        d.qvel[:] = self.T.T @ nu
        d.qfrc_applied[:] = self.T.T @ np.array(state["force"])
        # dT/dt, for Jacobians whose columns turn with the base.
        self.T_dot = np.zeros((m.nv, m.nv))
        self.T_dot[3:6, 3:6] = cross_matrix(nu[3:6]) @ self.T[3:6, 3:6]
        m.opt.gravity[:] = 0.0
        mujoco.mj_forward(m, d)
        self.motion_forces = self.T @ d.qfrc_bias
        m.opt.gravity[:] = state["gravity_m_s2"]
        mujoco.mj_forward(m, d)

    def jacobians(self, point, body):
        """Translation, rotation and their time derivatives of a point of a body, in nu."""
        m, d = self.m, self.d
        jp, jr, djp, djr = (np.zeros((3, m.nv)) for _ in range(4))
        mujoco.mj_jac(m, d, jp, jr, point, body)
        mujoco.mj_jacDot(m, d, djp, djr, point, body)
        jp, jr = jp @ self.T.T, jr @ self.T.T
        return jp, jr, (djp - jp @ self.T_dot) @ self.T.T, (djr - jr @ self.T_dot) @ self.T.T

    def mass_matrix(self):
        full = np.zeros((self.m.nv, self.m.nv))
        mujoco.mj_fullM(self.m, self.d, full)
        return self.T @ full @ self.T.T


def cross_matrix(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def rim_point(axis, normal, radius):
    """Angle of the lowest point of a circle in a basis of the circle's plane, and the terms of the angle's rate."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    x, y = -normal @ first, -normal @ second
    angle = np.arctan2(y, x)
    lever = radius * (np.cos(angle) * first + np.sin(angle) * second)

    def lever_rate(omega):
        d_first, d_second = np.cross(omega, first), np.cross(omega, second)
        d_x, d_y = -normal @ d_first, -normal @ d_second
        d_angle = (x * d_y - y * d_x) / (x * x + y * y)
        along = -np.sin(angle) * first + np.cos(angle) * second
        turned = np.cos(angle) * d_first + np.sin(angle) * d_second
        return radius * (d_angle * along + turned)

    return lever, lever_rate


def reference(model, state):
    """Values of MuJoCo in the form of the results."""
    m, d, data = model.m, model.d, model.data
    model.place(state)
    nu = np.array(state["velocity"])
    links, contacts = [], []
    for link, point_in_link in zip(model.links, state["points_in_link_m"]):
        rotation = d.xmat[link].reshape(3, 3)
        point = d.xpos[link] + rotation @ np.array(point_in_link)
        jp, jr, djp, djr = model.jacobians(point, link)
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(m, d, mujoco.mjtObj.mjOBJ_XBODY, link, velocity, 0)
        links.append({
            "position": d.xpos[link], "rotation": rotation,
            "angular_velocity": velocity[0:3], "linear_velocity": velocity[3:6],
            "point": point, "point_jacobian": jp, "angular_jacobian": jr,
            "point_jacobian_derivative": djp, "angular_jacobian_derivative": djr,
            "point_bias": djp @ nu, "angular_bias": djr @ nu,
        })
    for ee, carrier in zip(data["end_effectors"], model.carriers):
        link = model.links[ee["link"]]
        rotation = d.xmat[link].reshape(3, 3)
        center = d.xpos[link] + rotation @ np.array(ee["center_in_link_m"])
        if ee["axis_in_link"] is None:
            lever, lever_rate = -ee["radius_m"] * np.array(state["normal"]), lambda omega: np.zeros(3)
        else:
            axis = rotation @ np.array(ee["axis_in_link"])
            lever, lever_rate = rim_point(axis, np.array(state["normal"]), ee["radius_m"])
        position = center + lever
        jp, jr, djp, _ = model.jacobians(position, carrier)
        center_jacobian, link_rotation, _, _ = model.jacobians(center, link)
        geometric = center_jacobian @ nu + lever_rate(link_rotation @ nu)
        contacts.append({
            "position": position, "material_jacobian": jp, "material_jacobian_derivative": djp,
            "material_velocity": jp @ nu, "material_bias": djp @ nu,
            "geometric_velocity": geometric,
            # Jacobian times nu at a point that moves over the tyre.
            "rolling_bias": djp @ nu + np.cross(jr @ nu, geometric - jp @ nu),
        })

    bodies = range(1, m.nbody)
    mass = sum(m.body_mass[b] for b in bodies)
    com = d.subtree_com[1].copy()
    com_jacobian = np.zeros((3, m.nv))
    mujoco.mj_jacSubtreeCom(m, d, com_jacobian, 1)
    com_jacobian = com_jacobian @ model.T.T
    angular = np.zeros((3, m.nv))
    mujoco.mj_angmomMat(m, d, angular, 1)
    com_bias, inertia = np.zeros(3), np.zeros((3, 3))
    for b in bodies:
        com_bias += m.body_mass[b] / mass * (model.jacobians(d.xipos[b], b)[2] @ nu)
        axes, arm = d.ximat[b].reshape(3, 3), cross_matrix(d.xipos[b] - com)
        inertia += axes @ np.diag(m.body_inertia[b]) @ axes.T - m.body_mass[b] * arm @ arm
    force, moment = model.motion_forces[0:3], model.motion_forces[3:6]
    moment = moment - np.cross(com - np.array(state["base_position_m"]), force)
    result = {
        "links": links, "contacts": contacts, "com": com, "com_jacobian": com_jacobian,
        "com_bias": com_bias, "centroidal_inertia": inertia, "mass_matrix": model.mass_matrix(),
        "centroidal_momentum_matrix": np.vstack([mass * com_jacobian, angular @ model.T.T]),
        "centroidal_bias": np.concatenate([force, moment]),
        "bias_forces": model.T @ (d.qfrc_bias - d.qfrc_passive), "forward_dynamics": model.T @ d.qacc,
    }
    d.qacc[:] = model.T.T @ np.array(state["acceleration"])
    mujoco.mj_inverse(m, d)
    result["inverse_dynamics"] = model.T @ d.qfrc_inverse
    return result


def leaves(value, path=()):
    """Every array of a result, with its path."""
    if isinstance(value, dict):
        for key in sorted(value):
            yield from leaves(value[key], path + (key,))
    elif path[-1] in ("links", "contacts"):
        for index, item in enumerate(value):
            yield from leaves(item, path + (index,))
    else:
        yield path, np.array(value, dtype=float)


def scale(path, expected, root):
    """Scale of the errors of a result, from `root`, the square roots of the mass matrix's diagonal.

    Errors of forces and accelerations are weighted by energy, so that light joints and the heavy base count alike. A vector that may vanish has the scale of a thousandth of the SI unit.
    """
    if path[-1] == "mass_matrix":
        return np.outer(root, root)
    if path[-1] in ("bias_forces", "inverse_dynamics"):
        return root * (np.abs(expected) / root).max()
    if path[-1] == "forward_dynamics":
        return (np.abs(expected) * root).max() / root
    if path[-1] == "centroidal_inertia":
        return np.abs(expected).max()
    return max(np.abs(expected).max(), 1e-3)


def named(path):
    return " ".join(map(str, path))


def difference(path, found, expected, root):
    """Largest error of an array relative to its scale; infinite for NaN."""
    assert found.shape == expected.shape, (path, found.shape, expected.shape)
    error = (np.abs(found - expected) / scale(path, expected, root)).max()
    return error if np.isfinite(error) else np.inf


def differences(results, expected):
    """Paths and relative errors of results on which Rust and MuJoCo disagree, and the largest error."""
    found, wanted = list(leaves(results)), list(leaves(expected))
    assert [path for path, _ in found] == [path for path, _ in wanted]
    root = np.sqrt(np.diag(expected["mass_matrix"]))
    pairs = zip(found, wanted)
    errors = [(named(path), difference(path, a, b, root)) for (path, a), (_, b) in pairs]
    return [(name, error) for name, error in errors if error > TOLERANCE], max(e for _, e in errors)


def undetected(data, state, expected):
    """Planted errors that the comparison does not find."""
    missed, root = [], np.sqrt(np.diag(expected["mass_matrix"]))
    for (path, found), (_, wanted) in zip(leaves(state["results"]), leaves(expected)):
        for planted in [PLANTED * np.max(scale(path, wanted, root)), np.nan]:
            wrong = found.copy()
            wrong.flat[-1] += planted
            if difference(path, wrong, wanted, root) <= TOLERANCE:
                missed.append("a wrong " + named(path))
    for name in ["body_mass", "body_inertia", "body_ipos", "body_pos", "dof_armature"]:
        model = Model(data)
        values = getattr(model.m, name)
        # The last body or joint; what has no joints has no armature, and its body is where the state says.
        if not np.any(values[-1]):
            print(f"{data['robot']}: {name} is 0, so no error of it is planted")
            continue
        values[-1] *= 1.0 + 1e-3
        mujoco.mj_setConst(model.m, model.d)
        if not differences(state["results"], reference(model, state))[0]:
            missed.append("a model with another " + name)
    return missed


def main(files):
    failed = False
    for file in files:
        with open(file) as text:
            data = json.load(text)
        model, largest, first = Model(data), 0.0, None
        for number, state in enumerate(data["states"]):
            expected = reference(model, state)
            first = first or (state, expected)
            wrong, error = differences(state["results"], expected)
            largest = max(largest, error)
            for path, error in wrong:
                print(f"{data['robot']} state {number}: {path} differs by {error:.1e}", file=sys.stderr)
                failed = True
        if not failed:
            for what in undetected(data, *first):
                print(f"{data['robot']}: {what} is not found", file=sys.stderr)
                failed = True
        print(f"{data['robot']}: {len(data['states'])} states, largest difference {largest:.1e}")
    return 1 if failed or not files else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
