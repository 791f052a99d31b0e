//! Planar placements as maps of points and vectors: continuation of a periodic motion.

use super::Placement;

impl Placement {
    /// Moves a point by one period: turn about the vertical, then translation.
    pub fn point(&self, point_m: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.vector(point_m);
        [x + self.offset_m[0], y + self.offset_m[1], z]
    }

    /// Turns a free vector (force, velocity, axis) by one period.
    pub fn vector(&self, vector: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let [x, y, z] = vector;
        [cos * x - sin * y, sin * x + cos * y, z]
    }

    /// Returns the inverse placement: p → R_z(−ψ)·(p − D).
    pub fn inverse(&self) -> Self {
        let back = Self { offset_m: [0.0; 2], yaw_rad: -self.yaw_rad };
        let [x, y, _] = back.vector([self.offset_m[0], self.offset_m[1], 0.0]);
        Self { offset_m: [-x, -y], yaw_rad: -self.yaw_rad }
    }

    /// Returns this placement applied `times` times, by squaring. Negative counts apply the inverse.
    pub fn repeated(&self, times: i64) -> Self {
        let mut step = if times < 0 { self.inverse() } else { *self };
        let (mut total, mut left) = (Self::default(), times.unsigned_abs());
        while left > 0 {
            if left & 1 == 1 {
                total = total.then(&step);
            }
            step = step.then(&step);
            left >>= 1;
        }
        total
    }

    /// Returns the placement that applies this one, then `next`.
    fn then(&self, next: &Self) -> Self {
        let [x, y, _] = next.point([self.offset_m[0], self.offset_m[1], 0.0]);
        Self { offset_m: [x, y], yaw_rad: self.yaw_rad + next.yaw_rad }
    }
}
