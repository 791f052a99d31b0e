"""Limits of a robot's motors by bus and address, from its robot file (docs/robot-files.md) alone."""

import tomllib
from dataclasses import dataclass


@dataclass
class Motor:
    name: str
    wheel: bool
    least: float
    most: float
    kp_most: float
    kd_most: float
    torque_most: float


# Gains that can be set at run time, as a multiple of the robot file's (docs/parameters.md).
GAIN_RATIO = 2.0


def motors(path):
    """Motors by (bus, address)."""
    with open(path, "rb") as file:
        data = tomllib.load(file)
    found = {}
    for limb in data["limb"]:
        template = data["template"][limb["template"]]
        joints = [joint for joint in template.get("joint", []) if "actuator" in joint]
        wheels = [foot for foot in template.get("end_effector", []) if "actuator" in foot]
        for address, part in enumerate(joints + wheels, limb["first_id"]):
            actuator = data["actuator"][part["actuator"]]
            wheel = "position_min_rad" not in part
            speed = actuator["speed_max_rad_s"]
            found[limb["bus"], address] = Motor(
                name=part["name"].replace("*", limb["name"]),
                wheel=wheel,
                least=-speed if wheel else part["position_min_rad"],
                most=speed if wheel else part["position_max_rad"],
                kp_most=GAIN_RATIO * actuator["kp_nm_rad"],
                kd_most=GAIN_RATIO * actuator["kd_nm_s_rad"],
                torque_most=actuator["torque_max_nm"],
            )
    return found
