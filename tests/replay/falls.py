"""Detection of falls, with the limits of the project's own simulator (docs/replay.md)."""

import math

# Limits: tilt relative to the plan, rad; share of the planned height of the centre of mass; mean share of the weight on trunk
# and upper limbs, and time constant of this mean, s. A knee that touches down leaves nearly all of the weight to the feet.
TILT_RAD, HEIGHT, ON_TRUNK, ON_TRUNK_S = 1.0, 0.55, 0.25, 0.5


class FallWatch:
    """Falls of a robot. A robot whose motion lies on its body may carry its weight there."""

    def __init__(self, may_lie=False):
        self.may_lie, self.on_trunk = may_lie, 0.0

    def fell(self, tilt_rad, height, on_trunk, step_s):
        """True if the robot has fallen. `height` is a share of the planned height, `on_trunk` of the weight in the present step."""
        # The force of an impact counts as the weight.
        self.on_trunk += step_s / ON_TRUNK_S * (min(max(on_trunk, 0.0), 1.0) - self.on_trunk)
        is_down = self.on_trunk > ON_TRUNK and not self.may_lie
        return tilt_rad > TILT_RAD or height < HEIGHT or is_down or not math.isfinite(height)
