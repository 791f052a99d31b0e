"""Motions of robots with legs and wheels: plan, plan again, report, sample, build libraries, simulate, design.

Numbers are in SI units, which their names have: `speed_rad_s`, `force_n`. The world has x forward, y to the left and z up;
quaternions have w first. Arrays are NumPy's, with a letter for each axis in their documentation: T rows of time, J joints,
E end effectors. The tutorial is docs/python.md in Rollwalk's repository.
"""

from ._errors import Infeasible, NotConsistent, RollwalkError
from ._rollwalk import (
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
    simulate,
    write_shipped,
)

__all__ = [
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
    "simulate",
    "write_shipped",
]
