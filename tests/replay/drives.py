"""Effects on joints and wheels besides the control law: limits of motors, and rolling resistance."""

import math

import numpy as np


class Drives:
    """The motors and passive wheels of a model."""

    def __init__(self, model, rolling_sign_width_m_s):
        self.model, self.width = model, rolling_sign_width_m_s
        actuators = [actuator for _, actuator, _, _ in model.channels]
        # Limits of the torque of each channel.
        self.torque_max = np.array([actuator["torque_max_nm"] for actuator in actuators])
        line = [actuator.get("torque_speed") or {} for actuator in actuators]
        self.stall = np.array([entry.get("stall_torque_nm", np.inf) for entry in line])
        self.no_load = np.array([entry.get("no_load_speed_rad_s", np.inf) for entry in line])
        self.passive = [
            (j, model.wheel_dofs[j], f["radius_m"], f["contact"]["drag"])
            for j, f in enumerate(model.robot["end_effectors"])
            if "drag" in f["contact"]
        ]

    def act(self, d, load):
        """Sets limits and rolling resistance for the next step; `load` is the load of each foot in the previous step,
        N."""
        m = self.model.m
        # A motor that drives is within its torque-speed line; a motor that brakes has its full torque.
        speed = d.qvel[self.model.channel_dofs] / self.model.channel_per_rad
        driving = np.minimum(self.torque_max, np.maximum(self.stall * (1 - np.abs(speed) / self.no_load), 0.0))
        low, high = m.actuator_forcerange[:, 0], m.actuator_forcerange[:, 1]
        high[:] = np.where(speed > 0, driving, self.torque_max)
        low[:] = np.where(speed < 0, -driving, -self.torque_max)
        for j, dof, radius, drag in self.passive:
            v = d.qvel[dof] * radius
            slowing = drag["rolling_resistance"] * math.tanh(v / self.width) + drag["rolling_drag_s_m"] * v
            d.qfrc_applied[dof] = -radius * load[j] * slowing
        return low, high
