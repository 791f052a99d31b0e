"""Exceptions of `rollwalk`. The compiled module raises them, with the words of the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._rollwalk import Diagnosis, Plan


class RollwalkError(ValueError):
    """An input that is wrong: the message names file, line, field, value and what would be right."""


class NotConsistent(RollwalkError):
    """A request for which no consistent plan was found, in the words of `rollwalk report`.

    `plan` is the best that was found: its `report()`, its samples and a run in the simulation show what is wrong.
    """

    def __init__(self, message: str, plan: Plan) -> None:
        super().__init__(message)
        self.plan: Plan = plan


class Infeasible(NotConsistent):
    """A request that cannot be met. `diagnosis` has the constraints that contradict each other, and what would do."""

    def __init__(self, message: str, plan: Plan, diagnosis: Diagnosis) -> None:
        super().__init__(message, plan)
        self.diagnosis: Diagnosis = diagnosis
