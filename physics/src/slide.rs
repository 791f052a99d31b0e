//! Prismatic joints: a point of the second body slides along an axis of the first, and the bodies do not turn against each other.
//!
//! With the centre x and spin ω of the first body, the point P on its axis u, and the point Q of the second body, all in world
//! axes, the displacement and its rate are
//!
//! ```text
//! σ = u · (Q − P)          σ̇ = u · y,  y = v_Q − v − ω × (Q − x)
//! ```
//!
//! Forces act at Q on both bodies, so that they keep the angular momentum.

use crate::force::{Derivative, Force, StateBlock, View, Wrench};
use crate::motion::BodyMotion;
use crate::points::Points;
use nalgebra::{Matrix3, RowVector3, Vector3};
use rollwalk_multibody::rotation::skew;

/// Constraint that keeps a point of the second body on an axis of the first. Two [`crate::joint::ParallelAxes`] keep the bodies
/// from turning.
#[derive(Clone, Debug)]
pub struct Track {
    /// Point P of the axis on the first body, and the point Q of the second body.
    pub ends: Points,
    /// Unit axis, in axes of the first body.
    pub axis: Vector3<f64>,
    /// Stiffness across the axis, N/m.
    pub stiffness_n_m: f64,
}

/// Drive of a prismatic joint by a pinion, for a [`crate::motor::Motor`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slide {
    /// Point P on the first body and point Q of the second, from their centres of mass in body axes, m.
    pub points: [Vector3<f64>; 2],
    /// Displacement per radian of the motor, m/rad.
    pub travel_m_per_rad: f64,
}

/// Axis, arms and relative velocity of the two bodies, in world axes.
struct Placed {
    axis: Vector3<f64>,
    /// Vectors from the centres of mass to Q, m.
    levers: [Vector3<f64>; 2],
    /// Vector from P to Q, m.
    offset: Vector3<f64>,
    /// Velocity y of Q in the first body, m/s.
    velocity: Vector3<f64>,
}

/// Derivatives of an angle and its speed with respect to the motions of both bodies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    /// Derivative of the angle with respect to the position of each body. That of the speed with respect to its velocity is
    /// equal.
    pub shift: [Vector3<f64>; 2],
    /// Derivative of the angle with respect to a turn of each body. That of the speed with respect to its spin is equal.
    pub turn: [Vector3<f64>; 2],
    /// Derivative of the speed with respect to the position of each body.
    pub speed_by_shift: [Vector3<f64>; 2],
    /// Derivative of the speed with respect to a turn of each body.
    pub speed_by_turn: [Vector3<f64>; 2],
}

impl Placed {
    fn new(points: &[Vector3<f64>; 2], axis: &Vector3<f64>, now: &[BodyMotion]) -> Self {
        let (start, _) = now[0].point(&points[0]);
        let (place, velocity) = now[1].point(&points[1]);
        let levers = [0, 1].map(|k| place - now[k].position);
        Self {
            axis: now[0].rotation * axis,
            levers,
            offset: place - start,
            velocity: velocity - now[0].velocity - now[0].spin.cross(&levers[0]),
        }
    }

    /// Adds the force on the second body and its reaction on the first, both at Q.
    fn add_wrenches(&self, force: &Vector3<f64>, wrenches: &mut [Wrench]) {
        for (k, sign) in [(0, -1.0), (1, 1.0)] {
            wrenches[k].force += force * sign;
            wrenches[k].moment += self.levers[k].cross(force) * sign;
        }
    }

    /// Adds the derivatives of a force at Q. `by` has those of the force on the second body with respect to shift, turn, velocity
    /// and spin of each body.
    fn add_derivatives(
        &self,
        force: &Vector3<f64>,
        by: &[[Matrix3<f64>; 4]; 2],
        tame: bool,
        derivatives: &mut [Derivative],
    ) {
        use StateBlock::{Position, Rotation, Spin, Velocity};
        let arms = self.levers.map(|lever| skew(&lever));
        for (i, on_i) in [(0, -1.0), (1, 1.0)] {
            for (j, of_j) in by.iter().enumerate() {
                let derivative = &mut derivatives[2 * i + j];
                for (block, of) in [Position, Rotation, Velocity, Spin].into_iter().zip(of_j) {
                    derivative.add_force(block, &(of * on_i));
                    derivative.add_moment(block, &(arms[i] * of * on_i));
                }
            }
            if tame {
                continue;
            }
            // The arms change: δ(ρ × f) = −[f] δρ with δρ = δx_Q − δx.
            let turning = skew(force) * on_i;
            let place = -turning;
            derivatives[2 * i + 1].add_moment(Position, &place);
            derivatives[2 * i + 1].add_moment(Rotation, &(turning * arms[1]));
            derivatives[2 * i + i].add_moment(Position, &turning);
        }
    }
}

impl Track {
    /// Force on the second body, N.
    fn force(&self, placed: &Placed) -> Vector3<f64> {
        let along = placed.axis * placed.axis.dot(&placed.offset);
        (along - placed.offset) * self.stiffness_n_m
    }
}

impl Force for Track {
    fn bodies(&self) -> &[usize] {
        &self.ends.bodies
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        let placed = Placed::new(&self.ends.points, &self.axis, view.now);
        placed.add_wrenches(&self.force(&placed), wrenches);
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        let placed = Placed::new(&self.ends.points, &self.axis, view.now);
        let Placed { axis, offset, levers, .. } = &placed;
        let force = self.force(&placed);
        placed.add_wrenches(&force, wrenches);
        let across = (axis * axis.transpose() - Matrix3::identity()) * self.stiffness_n_m;
        let start = view.now[0].rotation * self.ends.points[0];
        let mut by_first_turn = across * skew(&start);
        if !view.tame {
            // δu = −[u] δθ in the force k (u (u·d) − d).
            let along = skew(axis) * -axis.dot(offset) + axis * axis.cross(offset).transpose();
            by_first_turn += along * self.stiffness_n_m;
        }
        let none = Matrix3::zeros();
        let by = [
            [-across, by_first_turn, none, none],
            [across, across * -skew(&levers[1]), none, none],
        ];
        placed.add_derivatives(&force, &by, view.tame, derivatives);
    }

    fn energy(&self, now: &[BodyMotion]) -> f64 {
        let placed = Placed::new(&self.ends.points, &self.axis, now);
        let along = placed.axis.dot(&placed.offset);
        0.5 * self.stiffness_n_m * (placed.offset.norm_squared() - along * along)
    }
}

impl Slide {
    /// Angle of the motor, rad, and its speed, rad/s.
    pub(crate) fn angle_and_speed(&self, axis: &Vector3<f64>, now: &[BodyMotion]) -> [f64; 2] {
        let placed = Placed::new(&self.points, axis, now);
        [placed.offset, placed.velocity].map(|of| placed.axis.dot(&of) / self.travel_m_per_rad)
    }

    /// Wrenches on both bodies for a torque of 1 N·m.
    pub(crate) fn unit_wrenches(&self, axis: &Vector3<f64>, now: &[BodyMotion]) -> [Wrench; 2] {
        let placed = Placed::new(&self.points, axis, now);
        let mut wrenches = [Wrench::default(); 2];
        placed.add_wrenches(&(placed.axis / self.travel_m_per_rad), &mut wrenches);
        wrenches
    }

    /// Derivatives of angle and speed.
    pub(crate) fn rows(&self, axis: &Vector3<f64>, now: &[BodyMotion]) -> Rows {
        let Placed { axis, levers: [first, second], offset: _, velocity } =
            Placed::new(&self.points, axis, now);
        let of_place = -axis.cross(&now[0].spin);
        let rows = Rows {
            shift: [-axis, axis],
            turn: [-first.cross(&axis), second.cross(&axis)],
            speed_by_shift: [-of_place, of_place],
            speed_by_turn: [
                axis.cross(&velocity),
                second.cross(&(axis.cross(&now[1].spin) + of_place)),
            ],
        };
        let per_m = 1.0 / self.travel_m_per_rad;
        Rows {
            shift: rows.shift.map(|row| row * per_m),
            turn: rows.turn.map(|row| row * per_m),
            speed_by_shift: rows.speed_by_shift.map(|row| row * per_m),
            speed_by_turn: rows.speed_by_turn.map(|row| row * per_m),
        }
    }

    /// Adds the derivatives of a torque, N·m, with the given derivatives by angle and speed.
    pub(crate) fn add_derivatives(
        &self,
        axis: &Vector3<f64>,
        view: &View<'_>,
        [torque_nm, by_angle, by_speed]: [f64; 3],
        derivatives: &mut [Derivative],
    ) {
        let placed = Placed::new(&self.points, axis, view.now);
        let rows = self.rows(axis, view.now);
        let unit = placed.axis / self.travel_m_per_rad;
        let times =
            |row: Vector3<f64>| -> Matrix3<f64> { unit * RowVector3::from(row.transpose()) };
        let mut by = [0, 1].map(|k| {
            [
                times(rows.shift[k] * by_angle + rows.speed_by_shift[k] * by_speed),
                times(rows.turn[k] * by_angle + rows.speed_by_turn[k] * by_speed),
                times(rows.shift[k] * by_speed),
                times(rows.turn[k] * by_speed),
            ]
        });
        // The force turns with the axis.
        by[0][1] -= skew(&unit) * torque_nm;
        placed.add_derivatives(&(unit * torque_nm), &by, false, derivatives);
    }

    /// Adds the derivatives of the torque `gain` × speed `then` with respect to the motions `then`.
    pub(crate) fn add_history(
        &self,
        axis: &Vector3<f64>,
        view: &View<'_>,
        then: &[BodyMotion],
        gain: f64,
        derivatives: &mut [Derivative],
    ) {
        let wrenches = self.unit_wrenches(axis, view.now);
        let rows = self.rows(axis, then);
        for (i, wrench) in wrenches.iter().enumerate() {
            for j in 0..2 {
                let derivative = &mut derivatives[2 * i + j];
                for (block, row) in [
                    (StateBlock::Position, rows.speed_by_shift[j]),
                    (StateBlock::Rotation, rows.speed_by_turn[j]),
                    (StateBlock::Velocity, rows.shift[j]),
                    (StateBlock::Spin, rows.turn[j]),
                ] {
                    let row = row.transpose() * gain;
                    derivative.add_force(block, &(wrench.force * row));
                    derivative.add_moment(block, &(wrench.moment * row));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{LAW, agrees_with_finite_differences};
    use crate::motor::{Law, Motor, Stops};

    const POINTS: [Vector3<f64>; 2] =
        [Vector3::new(0.1, -0.2, 0.05), Vector3::new(-0.03, 0.1, 0.2)];

    #[test]
    fn a_track_has_its_derivatives() {
        agrees_with_finite_differences(&Track {
            ends: Points { bodies: [0, 1], points: POINTS },
            axis: Vector3::new(0.6, 0.0, 0.8),
            stiffness_n_m: 50.0,
        });
    }

    #[test]
    fn a_motor_that_slides_has_its_derivatives() {
        for (law, stops) in [
            (LAW, None),
            (Law { limit_nm: 0.1, ..LAW }, None),
            (LAW, Some(Stops { range_rad: [-0.1, 0.1], stiffness_nm_rad: 30.0 })),
        ] {
            agrees_with_finite_differences(&Motor {
                bodies: [0, 1],
                axis: Vector3::new(0.6, 0.0, 0.8),
                across: [Vector3::y(); 2],
                slide: Some(Slide { points: POINTS, travel_m_per_rad: 0.3 }),
                armature_kg_m2: 0.02,
                stops,
                spring: None,
                angle_rad: 0.0,
                law,
            });
        }
    }
}
