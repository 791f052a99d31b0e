//! Planar placements as maps of points and vectors: how a periodic motion goes on.

use super::Placement;

impl Placement {
    /// A point of the motion one period later: turned about the vertical, then moved.
    pub fn point(&self, point_m: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.vector(point_m);
        [x + self.offset_m[0], y + self.offset_m[1], z]
    }

    /// A free vector (force, velocity, axis) one period later.
    pub fn vector(&self, vector: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let [x, y, z] = vector;
        [cos * x - sin * y, sin * x + cos * y, z]
    }

    /// The placement that undoes this one: p → R_z(−ψ)·(p − D).
    pub fn inverse(&self) -> Self {
        let back = Self { offset_m: [0.0; 2], yaw_rad: -self.yaw_rad };
        let [x, y, _] = back.vector([self.offset_m[0], self.offset_m[1], 0.0]);
        Self { offset_m: [-x, -y], yaw_rad: -self.yaw_rad }
    }

    /// Applies this placement `times` over, by squaring. Negative counts apply the inverse.
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

    /// Applies this placement, then another.
    fn then(&self, next: &Self) -> Self {
        let [x, y, _] = next.point([self.offset_m[0], self.offset_m[1], 0.0]);
        Self { offset_m: [x, y], yaw_rad: self.yaw_rad + next.yaw_rad }
    }
}
