"""Compares exported robots, read by MuJoCo, Pinocchio and urdf_parser_py, with poses of the project's own kinematics.

Usage: consumers.py FOLDER, with NAME.urdf, NAME.xml and NAME.poses.json of each exported robot, and NAME.xml and
NAME.imported.json of each robot that was imported from a model. Exit code 1 at the first difference.
"""

import json
import pathlib
import sys

import mujoco
import numpy as np

# Error of double precision after a dozen joints: m, rad and kg m2.
TOLERANCE = 1e-9


class Different(Exception):
    """A number of another tool differs from ours."""


def main(folder):
    """Compares every robot of a folder."""
    files = sorted(pathlib.Path(folder).glob("*.poses.json"))
    models = sorted(pathlib.Path(folder).glob("*.imported.json"))
    if not files and not models:
        raise Different(f"{folder} has no *.poses.json and no *.imported.json")
    for file in models:
        expected = json.loads(file.read_text(encoding="utf-8"))
        stem = file.name.removesuffix(".imported.json")
        worst = imported(file.with_name(f"{stem}.xml"), expected)
        print(f"{stem}, imported: {len(expected['poses'])} poses, largest difference {worst:.1e}")
    for file in files:
        expected = json.loads(file.read_text(encoding="utf-8"))
        stem = file.name.removesuffix(".poses.json")
        urdf, mjcf = (file.with_name(f"{stem}.{ending}") for ending in ("urdf", "xml"))
        worst = max(in_mujoco(mjcf, expected), in_pinocchio(urdf, expected))
        urdf_fields(urdf, expected)
        # MuJoCo reads URDF as well.
        mujoco.MjModel.from_xml_path(str(urdf))
        print(f"{stem}: {len(expected['poses'])} poses, largest difference {worst:.1e}")


def compare(where, theirs, ours):
    """Largest difference of two arrays."""
    theirs, ours = np.asarray(theirs, dtype=float), np.asarray(ours, dtype=float)
    difference = float(np.max(np.abs(theirs - ours.reshape(theirs.shape)), initial=0.0))
    if not difference <= TOLERANCE:
        raise Different(f"{where}: {theirs} there, {ours} here, difference {difference}")
    return difference


def in_mujoco(path, expected):
    """The MJCF model in MuJoCo: poses, mass, limits."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    joint = lambda name: model.joint(name)
    worst = compare(f"{path}: mass", model.body_subtreemass[1], expected["mass_kg"])
    for name, limit in zip(expected["joints"], expected["limits"]):
        compare(f"{path}: range of {name}", joint(name).range, limit["position_rad"])
        compare(f"{path}: armature of {name}", joint(name).armature, [limit["armature_kg_m2"]])
        force = model.actuator(name).forcerange
        compare(f"{path}: torque of {name}", force, [-limit["torque_nm"], limit["torque_nm"]])
    for number, pose in enumerate(expected["poses"]):
        mujoco.mj_resetData(model, data)
        data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
        for name, angle in zip(expected["joints"], pose["joint_rad"]):
            data.joint(name).qpos[:] = angle
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for name, link in zip(expected["links"], pose["links"]):
            body = data.body(name)
            where = f"{path}: pose {number}, link {name}"
            worst = max(worst, compare(where, body.xpos, link["position_m"]))
            worst = max(worst, compare(where, body.xmat, link["rotation"]))
        for foot, center in zip(expected["end_effectors"], pose["centers_m"]):
            where = f"{path}: pose {number}, end effector {foot['name']}"
            worst = max(worst, compare(where, data.geom(foot["name"]).xpos, center))
        worst = max(worst, compare(f"{path}: pose {number}, com", data.subtree_com[1], pose["com_m"]))
        inertia = about_com(model, data)
        worst = max(worst, compare(f"{path}: pose {number}, inertia", inertia, pose["inertia_kg_m2"]))
    return worst


def imported(path, expected):
    """Compares with the model from which a robot was imported: mass, limits relative to the initial joint positions,
    poses of feet, centre of mass, inertia."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    worst = compare(f"{path}: mass", model.body_subtreemass[1], expected["mass_kg"])
    begins = {name: model.qpos0[model.joint(name).qposadr[0]] for name in expected["joints"]}
    for name, limit in zip(expected["joints"], expected["limits"]):
        compare(f"{path}: range of {name}", model.joint(name).range - begins[name], limit["position_rad"])
    for number, pose in enumerate(expected["poses"]):
        mujoco.mj_resetData(model, data)
        data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
        for name, angle in zip(expected["joints"], pose["joint_rad"]):
            data.joint(name).qpos[:] = begins[name] + angle
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        where = f"{path}: pose {number}"
        for foot, center in zip(expected["end_effectors"], pose["centers_m"]):
            worst = max(worst, compare(f"{where}, {foot['name']}", data.geom(foot["name"]).xpos, center))
        worst = max(worst, compare(f"{where}, com", data.subtree_com[1], pose["com_m"]))
        worst = max(worst, compare(f"{where}, inertia", about_com(model, data), pose["inertia_kg_m2"]))
    return worst


def about_com(model, data):
    """Inertia of the whole robot about its centre of mass, in world axes."""
    total = np.zeros((3, 3))
    for body in range(1, model.nbody):
        turn = data.ximat[body].reshape(3, 3)
        arm = data.xipos[body] - data.subtree_com[1]
        total += turn @ np.diag(model.body_inertia[body]) @ turn.T
        total += model.body_mass[body] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return total


def in_pinocchio(path, expected):
    """The URDF in Pinocchio: poses, mass, limits, frames of end effectors."""
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(path), pinocchio.JointModelFreeFlyer())
    data = model.createData()
    worst = compare(f"{path}: mass", pinocchio.computeTotalMass(model), expected["mass_kg"])
    for number, pose in enumerate(expected["poses"]):
        q = pinocchio.neutral(model)
        for name, angle in zip(expected["joints"], pose["joint_rad"]):
            q[model.joints[model.getJointId(name)].idx_q] = angle
        # Continuous joints are given by cosine and sine; the inertia of wheels does not depend on their angle.
        wheels = zip(expected["end_effectors"], pose["wheel_rad"])
        for name, angle in ((foot["name"], angle) for foot, angle in wheels if foot["spins"]):
            at = model.joints[model.getJointId(name)].idx_q
            q[at : at + 2] = np.cos(angle), np.sin(angle)
        pinocchio.framesForwardKinematics(model, data, q)
        for name, link in zip(expected["links"], pose["links"]):
            place = data.oMf[model.getFrameId(name, pinocchio.FrameType.BODY)]
            where = f"{path}: pose {number}, link {name}"
            worst = max(worst, compare(where, place.translation, link["position_m"]))
            worst = max(worst, compare(where, place.rotation.flatten(), link["rotation"]))
        for foot, center in zip(expected["end_effectors"], pose["centers_m"]):
            place = data.oMf[model.getFrameId(foot["name"], pinocchio.FrameType.BODY)]
            where = f"{path}: pose {number}, end effector {foot['name']}"
            worst = max(worst, compare(where, place.translation, center))
        pinocchio.ccrba(model, data, q, np.zeros(model.nv))
        com = pinocchio.centerOfMass(model, data, q)
        worst = max(worst, compare(f"{path}: pose {number}, com", com, pose["com_m"]))
        worst = max(worst, compare(f"{path}: pose {number}, inertia", data.Ig.inertia, pose["inertia_kg_m2"]))
    return worst


def urdf_fields(path, expected):
    """Compares limits and tree in a reader without kinematics."""
    from urdf_parser_py.urdf import URDF

    robot = URDF.from_xml_string(path.read_bytes())
    if robot.get_root() != expected["links"][0]:
        raise Different(f"{path}: root {robot.get_root()}, expected {expected['links'][0]}")
    for name, limit in zip(expected["joints"], expected["limits"]):
        read = robot.joint_map[name].limit
        compare(f"{path}: limits of {name}", [read.lower, read.upper], limit["position_rad"])
        of_joint = [limit["joint_speed_rad_s"], limit["joint_torque_nm"]]
        compare(f"{path}: limits of {name}", [read.velocity, read.effort], of_joint)


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except Different as difference:
        sys.exit(str(difference))
