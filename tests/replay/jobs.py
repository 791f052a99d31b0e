"""Run of a plan from inputs to results in a separate process."""

from dataclasses import dataclass
from pathlib import Path

from errors import Unusable
import library
import measure
import motion as motions
import player
import robots
import world


@dataclass(frozen=True)
class Inputs:
    """Sources of a plan's robot and frames, and number of cycles."""

    robot: str | None
    robots: Path
    library: str | None = None
    cycles: int = 20
    control_hz: int = player.CONTROL_HZ


def load(path, kind, inputs):
    """Motion, robot, frames and torques of a plan; the robot is that of the robot file, which must equal the plan's."""
    motion = motions.load(path)
    file = _robot_file(motion, inputs)
    robot = robots.with_body_points(robots.from_file(file), motion.robot)
    differs = robots.difference(robot, motion.robot)
    if differs:
        raise Unusable(f"{path}: its robot is not that of {file}: {differs}; plan again, or name its robot file")
    if not inputs.library:
        return motion, robot, None, None
    frames, torques = library.frames_of(inputs.library, motion)
    if torques is None and kind != "none":
        raise Unusable(f"{inputs.library}: it has no torques to feed forward; build it without torques = false")
    return motion, robot, frames, torques


def _robot_file(motion, inputs):
    return Path(inputs.robot) if inputs.robot else inputs.robots / f"{motion.robot['name']}.toml"


def replay(job):
    """Results of one plan with one kind of feed-forward in one case."""
    path, kind, case, inputs = job
    motion, robot, frames, torques = load(path, kind, inputs)
    track = world.run(motion, robot, kind, case, inputs.cycles, inputs.control_hz, frames, torques)
    return {
        "motion": motion.name,
        "robot": robot["name"],
        "plan": Path(path).name,
        "feed_forward": kind,
        "drives_take": robots.feed_forward(_robot_file(motion, inputs)),
        "case": case.name,
        **measure.summary(motion, track, inputs.cycles),
    }
