"""One run from its inputs to its results: what a process of its own does."""

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
    """Where a plan's robot and frames come from, and how long it is played."""

    robot: str | None
    robots: Path
    library: str | None = None
    cycles: int = 20
    control_hz: int = player.CONTROL_HZ


def load(path, inputs):
    """Motion, robot and frames of a plan; the robot is that of the robot file, which must be the plan's."""
    motion = motions.load(path)
    name = motion.robot["name"]
    file = Path(inputs.robot) if inputs.robot else inputs.robots / f"{name}.toml"
    robot = robots.from_file(file)
    differs = robots.difference(robot, motion.robot)
    if differs:
        raise Unusable(f"{path}: its robot is not that of {file}: {differs}; plan again, or name its robot file")
    frames = library.frames_of(inputs.library, motion) if inputs.library else None
    return motion, robot, frames


def replay(job):
    """Results of one plan with one kind of feed-forward in one case."""
    path, kind, case, inputs = job
    motion, robot, frames = load(path, inputs)
    track = world.run(motion, robot, kind, case, inputs.cycles, inputs.control_hz, frames)
    return {
        "motion": motion.name,
        "robot": robot["name"],
        "plan": Path(path).name,
        "feed_forward": kind,
        "case": case.name,
        **measure.summary(motion, track, inputs.cycles),
    }
