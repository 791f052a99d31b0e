#!/usr/bin/env python3
"""Compares torques of motors with crank and rod with inverse dynamics of MuJoCo under equality constraints.

    python3 robot/multibody/tests/compare_linkages.py ROBOT.json

The file comes from robot/multibody/tests/multibody/mujoco.rs. In its model each crank is a body without mass and each rod a
tendon of constant length. The force of a rod follows from the joint that it turns, which has no other motor. Exit status 1:
a rod changes its length, or a torque differs by more than 1e-6 of the largest.
"""

import json
import sys

import mujoco
import numpy as np

# Of the largest torque. Cranks have a mass of 1e-9 kg there.
TOLERANCE = 1e-6
# Change of a rod's length, m, its rate, m/s.
CLOSURE = 1e-12


def main(file):
    with open(file) as text:
        data = json.load(text)
    m = mujoco.MjModel.from_xml_string(data["mjcf"])
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
    d = mujoco.MjData(m)
    index = lambda kind, name: mujoco.mj_name2id(m, kind, name)
    joint = lambda name: index(mujoco.mjtObj.mjOBJ_JOINT, name)
    joints = [joint(name) for name in data["joints"]]
    cranks = {k: joint(name + "_servo") for k, name in enumerate(data["joints"])}
    cranks = {k: servo for k, servo in cranks.items() if servo >= 0}
    wheels = [joint("wheel:" + ee["name"]) for ee in data["end_effectors"] if ee["spins"]]
    tendons = {k: index(mujoco.mjtObj.mjOBJ_TENDON, data["joints"][k] + "_rod") for k in cranks}
    assert cranks and -1 not in joints + wheels + list(tendons.values())
    largest = 0.0
    for state in data["states"]:
        d.qpos[0:3] = state["base_position_m"]
        d.qpos[3:7] = state["world_from_body_wxyz"]
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, np.array(state["world_from_body_wxyz"]))
        rotation = rotation.reshape(3, 3)
        nu, nu_dot = np.array(state["velocity"]), np.array(state["acceleration"])
        # MuJoCo's base turns about its own axes.
        d.qvel[0:6] = np.concatenate([nu[0:3], rotation.T @ nu[3:6]])
        d.qacc[0:6] = np.concatenate([nu_dot[0:3], rotation.T @ nu_dot[3:6]])
        angles = state["joint_rad"] + [0.0] * len(wheels)
        for k, hinge in enumerate(joints + wheels):
            d.qpos[m.jnt_qposadr[hinge]] = angles[k]
            d.qvel[m.jnt_dofadr[hinge]], d.qacc[m.jnt_dofadr[hinge]] = nu[6 + k], nu_dot[6 + k]
        for k, servo in cranks.items():
            d.qpos[m.jnt_qposadr[servo]] = state["motor_rad"][k]
            d.qvel[m.jnt_dofadr[servo]] = state["motor_rad_s"][k]
            d.qacc[m.jnt_dofadr[servo]] = state["motor_rad_s2"][k]
        m.opt.gravity[:] = state["gravity_m_s2"]
        accelerations = d.qacc.copy()
        mujoco.mj_forward(m, d)
        d.qacc[:] = accelerations
        mujoco.mj_inverse(m, d)
        rods = {}
        for k, tendon in tendons.items():
            equality = next(e for e in range(m.neq) if m.eq_obj1id[e] == tendon)
            length = m.tendon_length0[tendon] + m.eq_data[equality, 0]
            assert abs(d.ten_length[tendon] - length) < CLOSURE, d.ten_length[tendon] - length
            assert abs(d.ten_velocity[tendon]) < CLOSURE * 1e3, d.ten_velocity[tendon]
            pin, end = (index(mujoco.mjtObj.mjOBJ_SITE, data["joints"][k] + of) for of in ("_pin", "_end"))
            jacobians = np.zeros((2, 3, m.nv))
            for jacobian, site in zip(jacobians, (pin, end)):
                mujoco.mj_jacSite(m, d, jacobian, None, site)
            rod = d.site_xpos[end] - d.site_xpos[pin]
            row = rod / np.linalg.norm(rod) @ (jacobians[1] - jacobians[0])
            knee = m.jnt_dofadr[joints[k]]
            rods[k] = row * (d.qfrc_inverse[knee] / row[knee])
        forces = d.qfrc_inverse - sum(rods.values())
        torques = [
            forces[m.jnt_dofadr[cranks[k] if k in cranks else hinge]]
            for k, hinge in enumerate(joints)
        ]
        found = np.array(state["results"]["motor_torques"])
        error = np.abs(found - torques).max() / np.abs(torques).max()
        largest = max(largest, error)
    print(f"{data['robot']}: {len(data['states'])} states, largest difference {largest:.1e}")
    return 0 if largest < TOLERANCE else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
