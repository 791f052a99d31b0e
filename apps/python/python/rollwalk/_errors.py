"""Exceptions of `rollwalk`. The compiled module raises them with the messages of the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._rollwalk import Diagnosis, Plan


class RollwalkError(ValueError):
    """Wrong input. The message names file, line, field, value and the right value."""


class NotConsistent(RollwalkError):
    """Request without a consistent plan. The message is that of `rollwalk report`.

    `plan` is the best plan. Its `report()`, its samples and a simulation show the problem.
    """

    def __init__(self, message: str, plan: Plan) -> None:
        super().__init__(message)
        self.plan: Plan = plan


class Infeasible(NotConsistent):
    """Request that cannot be met. `diagnosis` contains the conflicting constraints and feasible values."""

    def __init__(self, message: str, plan: Plan, diagnosis: Diagnosis) -> None:
        super().__init__(message, plan)
        self.diagnosis: Diagnosis = diagnosis
