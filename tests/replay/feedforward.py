"""Torques that the motors of a plan need: inverse dynamics with the planned ground forces.

tau = M a + h - J^T f, rows of joints and driven wheels, with rotor inertias. MuJoCo's recursive Newton-Euler
algorithm computes M a + h on the model of the robot file. a is from the plan's splines, f from the plan. The
planner's own torques are not used. The rows of the base have no motor. Their remainder is the force that the plan
lacks, because the plan treats the robot as one body between coarse samples.
"""

import mujoco
import numpy as np


class InverseDynamics:
    """Inverse dynamics of a model, without contacts."""

    def __init__(self, model):
        self.model = model
        self.d = mujoco.MjData(model.m)

    def torques(self, motion, time_s):
        """Torques in channel order, and the missing force and moment about the base."""
        model, m, d = self.model, self.model.m, self.d
        d.qpos[:], d.qvel[:], d.qacc[:] = model.derivatives(motion, time_s)
        flags = m.opt.disableflags
        # mj_inverse would subtract contact forces of the model at this depth, but the plan's forces count.
        m.opt.disableflags = flags | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        d.qfrc_applied[:] = 0
        mujoco.mj_inverse(m, d)
        m.opt.disableflags = flags
        needed = d.qfrc_inverse.copy()
        for j, force in enumerate(self.planned_forces(motion, time_s)):
            if np.any(force):
                needed -= self.contact_jacobian(j).T @ force
        return needed[model.channel_dofs] * model.channel_per_rad, needed[0:6]

    def planned_forces(self, motion, time_s):
        """Forces in the frame of the splines, which continue through later periods."""
        return motion.forces(time_s)

    def contact_jacobian(self, j):
        """Jacobian of an end effector's material point at its lowest point."""
        m, d = self.model.m, self.d
        foot = self.model.robot["end_effectors"][j]
        carrier = self.model.carriers[j]
        jacobian = np.zeros((3, m.nv))
        mujoco.mj_jac(m, d, jacobian, None, self.lowest_point(j, foot), carrier)
        return jacobian

    def lowest_point(self, j, foot):
        """Lowest point of a wheel's rim, or below the centre of a foot's sphere."""
        d = self.d
        link = self.model.links[foot["link"]]
        rotation = d.xmat[link].reshape(3, 3)
        center = d.xpos[link] + rotation @ foot["center_in_link_m"]
        axis = foot["contact"].get("axis_in_link")
        if axis is None:
            return center - [0.0, 0.0, foot["radius_m"]]
        axis = rotation @ np.array(axis)
        up = np.array([0.0, 0.0, 1.0]) - axis[2] * axis
        return center - foot["radius_m"] * up / np.linalg.norm(up)


def frames(model, motion):
    """Torques at every 60 Hz frame, and the root mean square of the missing force, divided by the weight."""
    rate = motion.frame_rate_hz()
    count = round(motion.duration_s * rate) + (0 if motion.periodic else 1)
    inverse, rows, missing = InverseDynamics(model), [], []
    for k in range(count):
        torques, base = inverse.torques(motion, k / rate)
        carried = motion.carried_torques(k / rate)
        rows.append(torques if carried is None else carried)
        missing.append(np.linalg.norm(base[0:3]))
    weight = model.mass_kg * motion.gravity_m_s2
    return np.array(rows), float(np.sqrt(np.mean(np.square(missing)))) / weight


def at_rest(model, motion):
    """Torques that hold the first and the last pose, with the forces that are nearest to the planned forces."""
    inverse, m = InverseDynamics(model), model.m
    found = []
    for time_s in (0.0, motion.duration_s):
        d = inverse.d
        d.qpos[:] = model.place_in_motion(motion, time_s)
        d.qvel[:] = d.qacc[:] = 0
        mujoco.mj_forward(m, d)
        needed = d.qfrc_bias.copy()
        stands = np.flatnonzero(motion.stance(min(time_s, motion.duration_s)))
        jacobians = [inverse.contact_jacobian(j) for j in stands]
        forces = motion.forces(time_s if not motion.periodic else 0.0)[stands]
        if len(stands):
            stacked = np.vstack(jacobians).T
            missing = (needed - stacked @ forces.ravel())[0:6]
            change = np.linalg.lstsq(stacked[0:6], missing, rcond=1e-9)[0]
            needed -= stacked @ (forces.ravel() + change)
        found.append(needed[model.channel_dofs] * model.channel_per_rad)
    return found


def hardest(model, torques):
    """Name of the motor with the largest ratio of torque to limit, and this ratio."""
    used = [
        (np.abs(torques[:, c]).max() / actuator["torque_max_nm"], name)
        for c, (name, actuator, _, _) in enumerate(model.channels)
    ]
    share, name = max(used, default=(0.0, ""))
    return name, float(share)
