"""Motions of robots with legs and wheels: plan, plan again, report, sample, build libraries, simulate, design.

Names of numbers end with their SI unit: `speed_rad_s`, `force_n`. In the world, x is forward, y left and z up;
quaternions have w first. Arrays are NumPy arrays. The documentation names their axes by letters: T samples, J
joints, E end effectors. The tutorial is docs/python.md in Rollwalk's repository.
"""

from ._errors import Infeasible, NotConsistent, RollwalkError
from ._rollwalk import (
    BatchProgress,
    Culprit,
    Design,
    Diagnosis,
    Gradients,
    Motion,
    Parameter,
    Plan,
    Progress,
    Report,
    Residual,
    Robot,
    Samples,
    Simulation,
    build_library,
    plan,
    plan_many,
    simulate,
    write_shipped,
)

__all__ = [
    "BatchProgress",
    "Culprit",
    "Design",
    "Diagnosis",
    "Gradients",
    "Infeasible",
    "Motion",
    "NotConsistent",
    "Parameter",
    "Plan",
    "Progress",
    "Report",
    "Residual",
    "Robot",
    "RollwalkError",
    "Samples",
    "Simulation",
    "build_library",
    "plan",
    "plan_many",
    "simulate",
    "write_shipped",
]
