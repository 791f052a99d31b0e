//! Contact of a foot, wheel or blade with the ground: a spring along the normal, and friction in the tangent plane.
//!
//! The contact point of a wheel is the deepest point of its rim, along the ground normal at its centre. The contact point of a
//! foot is the deepest point of a sphere. Both points move on the body when it turns, and all derivatives include this motion.

mod by_number;
mod contact_point;
mod normal;

use crate::force::{Derivative, Force, Kink, StateBlock, StickingFriction, View, Wrench};
use crate::friction::Friction;
use crate::motion::BodyMotion;
use crate::touch::Touch;
use contact_point::{ContactPoint, across};
use nalgebra::{Matrix3, Matrix6x3, RowVector3, Vector3};
pub(crate) use normal::NormalForce;
use rollwalk_multibody::ground::{Ground, Surface};
use rollwalk_multibody::rotation::skew;
use std::sync::Arc;

pub use by_number::ContactQuantity;
pub use contact_point::Tip;
pub use normal::Normal;

/// Speed at which the rolling resistance reaches three quarters of its constant part, m/s.
const RESISTANCE_SPEED_M_S: f64 = 0.01;

/// Gap above which an iteration ignores a possible contact, m. The radius of the contact applies instead if it is larger.
const REACH_M: f64 = 0.02;
/// Gap above which a step ignores a possible contact, m. The solver adds the distance that the body can move.
const FAR_M: f64 = 0.005;

/// Rolling resistance as a fraction of the normal force: c_rr s(v) + c_v v, with a smooth sign s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Resistance {
    /// Coefficient c_rr.
    pub constant: f64,
    /// Coefficient c_v, s/m.
    pub per_speed_s_m: f64,
}

/// Contact of one body with the ground.
#[derive(Clone, Debug)]
pub struct GroundContact {
    /// Index of the body.
    pub body: [usize; 1],
    /// Centre of the sphere or wheel, from the centre of mass in body axes, m.
    pub center: Vector3<f64>,
    /// Radius, m.
    pub radius_m: f64,
    /// Shape of the contacting part.
    pub tip: Tip,
    /// Law of the normal force.
    pub normal: Normal,
    /// Friction law in the tangent plane.
    pub friction: Friction,
    /// Rolling resistance of a rim about its axis, or gliding resistance of a blade along itself.
    pub resistance: Resistance,
    /// Ground under the contact.
    pub ground: Arc<dyn Ground>,
}

/// Contact geometry for a given motion of the body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactGeometry {
    /// Vector from the centre of mass to the contact point, m.
    pub arm: Vector3<f64>,
    pub gap_m: f64,
    pub normal: Vector3<f64>,
    /// Velocity of the body at the contact point, m/s.
    pub velocity: Vector3<f64>,
    /// Unit vector across a blade.
    blade: Option<Vector3<f64>>,
}

/// Vector with its derivatives with respect to position, rotation, velocity and spin of the body.
#[derive(Clone, Copy)]
struct VectorWithDerivatives {
    value: Vector3<f64>,
    by: [Matrix3<f64>; 4],
}

impl GroundContact {
    /// State of the contact for a given motion of the body.
    pub fn touch_at(&self, body: &BodyMotion) -> Touch {
        let place = self.contact_point(body);
        let Surface { gap_m, normal, .. } = place.surface;
        let velocity = body.velocity + body.spin.cross(&place.arm);
        let mut touch = Touch {
            gap_m,
            point: body.position + place.arm,
            normal,
            force: Vector3::zeros(),
            normal_n: 0.0,
            approach_m_s: -normal.dot(&velocity),
            sliding: velocity - normal * normal.dot(&velocity),
            slips: false,
            friction: self.friction,
        };
        if gap_m < 0.0 {
            let (force, normal_n, slips) = self.force(&place, &velocity, None);
            touch = Touch { force, normal_n, slips, ..touch };
        }
        touch
    }

    fn contact_point(&self, body: &BodyMotion) -> ContactPoint {
        ContactPoint::new(&self.center, self.radius_m, self.tip, self.ground.as_ref(), body)
    }

    /// Rolling resistance as a fraction of the normal force, at a rolling speed, and its derivative.
    fn resistance(&self, speed_m_s: f64) -> (f64, f64) {
        let Resistance { constant, per_speed_s_m } = self.resistance;
        let sign = (speed_m_s / RESISTANCE_SPEED_M_S).tanh();
        let slope = constant * (1.0 - sign * sign) / RESISTANCE_SPEED_M_S;
        (constant * sign + per_speed_s_m * speed_m_s, slope + per_speed_s_m)
    }

    /// Returns the force of the ground, N, the normal force of the spring, N, and true if the contact slips.
    fn force(
        &self,
        place: &ContactPoint,
        velocity: &Vector3<f64>,
        held: Option<&StickingFriction>,
    ) -> (Vector3<f64>, f64, bool) {
        let Surface { gap_m, normal, .. } = place.surface;
        let opening = normal.dot(velocity);
        let NormalForce { spring_n: spring, force_n, .. } = self.normal.press(gap_m, opening);
        let mut sliding = velocity - normal * opening;
        let mut along = Vector3::zeros();
        if let (Tip::Blade { .. }, Some(axis)) = (self.tip, place.axis) {
            let (across, _, _) = across(&axis, &normal);
            sliding = across * across.dot(velocity);
            let ahead = across.cross(&normal);
            along = ahead * -(spring * self.resistance(ahead.dot(velocity)).0);
        }
        let friction = self.friction.held_force(held, &sliding, spring);
        (normal * force_n + friction.force + along, spring, friction.slips)
    }

    /// Contact geometry for a given motion of the body.
    pub(crate) fn geometry(&self, body: &BodyMotion) -> ContactGeometry {
        let place = self.contact_point(body);
        let Surface { gap_m, normal, .. } = place.surface;
        let velocity = body.velocity + body.spin.cross(&place.arm);
        let blade = match (self.tip, place.axis) {
            (Tip::Blade { .. }, Some(axis)) => Some(across(&axis, &normal).0),
            _ => None,
        };
        ContactGeometry { arm: place.arm, gap_m, normal, velocity, blade }
    }

    /// Force after a small displacement `shift` of the contact point, m, and its derivative with respect to `shift`. The
    /// velocity of the point changes by `gain * shift`.
    pub(crate) fn law(
        &self,
        spot: &ContactGeometry,
        held: Option<&StickingFriction>,
        gain: f64,
        shift: &Vector3<f64>,
    ) -> (Vector3<f64>, Matrix3<f64>) {
        let ContactGeometry { normal, blade, .. } = *spot;
        let gap_m = spot.gap_m + normal.dot(shift);
        if gap_m >= 0.0 {
            return (Vector3::zeros(), Matrix3::zeros());
        }
        let velocity = spot.velocity + shift * gain;
        let stiffness = self.normal.stiffness_n_m;
        let press = self.normal.press(gap_m, normal.dot(&velocity));
        let spring = press.spring_n;
        let mut force = normal * press.force_n;
        let mut by_shift = normal * normal.transpose() * (press.by_gap + press.by_opening * gain);
        let across = match blade {
            Some(across) => across * across.transpose(),
            None => Matrix3::identity() - normal * normal.transpose(),
        };
        let friction = self.friction.held_force(held, &(across * velocity), spring);
        force += friction.force;
        by_shift += friction.by_sliding * across * gain
            - friction.by_normal * normal.transpose() * stiffness;
        if let Some(across) = blade {
            let ahead = across.cross(&normal);
            let (share, slope) = self.resistance(ahead.dot(&velocity));
            force -= ahead * (spring * share);
            by_shift += ahead * normal.transpose() * (stiffness * share)
                - ahead * ahead.transpose() * (spring * slope * gain);
        }
        (force, by_shift)
    }

    /// Moment of the rolling resistance of a rim about its axis.
    fn rolling_moment(&self, body: &BodyMotion, place: &ContactPoint) -> Vector3<f64> {
        match (self.tip, place.axis) {
            (Tip::Rim { .. }, Some(axis)) => {
                let spring = -self.normal.stiffness_n_m * place.surface.gap_m;
                let (share, _) = self.resistance(self.radius_m * axis.dot(&body.spin));
                axis * -(self.radius_m * spring * share)
            }
            _ => Vector3::zeros(),
        }
    }
}

impl VectorWithDerivatives {
    /// Dot product and its derivatives.
    fn dot(&self, other: &Self) -> (f64, [RowVector3<f64>; 4]) {
        let by = [0, 1, 2, 3]
            .map(|k| self.value.transpose() * other.by[k] + other.value.transpose() * self.by[k]);
        (self.value.dot(&other.value), by)
    }
}

impl Force for GroundContact {
    fn bodies(&self) -> &[usize] {
        &self.body
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        let body = &view.now[0];
        let place = self.contact_point(body);
        if place.surface.gap_m >= 0.0 {
            return;
        }
        let velocity = body.velocity + body.spin.cross(&place.arm);
        let (force, _, _) = self.force(&place, &velocity, view.held.as_ref());
        wrenches[0].force += force;
        wrenches[0].moment += place.arm.cross(&force) + self.rolling_moment(body, &place);
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        const PARTS: [StateBlock; 4] =
            [StateBlock::Position, StateBlock::Rotation, StateBlock::Velocity, StateBlock::Spin];
        let body = &view.now[0];
        let place = self.contact_point(body);
        let Surface { gap_m, normal, .. } = place.surface;
        if gap_m >= 0.0 {
            return;
        }
        self.wrenches(view, wrenches);
        let none = Matrix3::zeros();
        let by_pose = place.by_pose();
        let (by_position, by_rotation) = (by_pose.point_by_position, by_pose.point_by_rotation);
        let arm = VectorWithDerivatives {
            value: place.arm,
            by: [by_position - Matrix3::identity(), by_rotation, none, none],
        };
        let spin = skew(&body.spin);
        let velocity = VectorWithDerivatives {
            value: body.velocity + body.spin.cross(&place.arm),
            by: [spin * arm.by[0], spin * arm.by[1], Matrix3::identity(), -skew(&place.arm)],
        };
        let normal = VectorWithDerivatives {
            value: normal,
            by: [by_pose.normal_by_position, by_pose.normal_by_rotation, none, none],
        };
        let still = RowVector3::zeros();
        let gap_by = [by_pose.gap_by_position, by_pose.gap_by_rotation, still, still];
        let (opening, opening_by) = normal.dot(&velocity);
        let stiffness = self.normal.stiffness_n_m;
        let press = self.normal.press(gap_m, opening);
        let spring = press.spring_n;

        // Sliding direction, and for a blade the resistance along it.
        let mut sliding = VectorWithDerivatives {
            value: velocity.value - normal.value * opening,
            by: [0, 1, 2, 3]
                .map(|k| velocity.by[k] - normal.by[k] * opening - normal.value * opening_by[k]),
        };
        let mut along = VectorWithDerivatives { value: Vector3::zeros(), by: [none; 4] };
        let axis = place.axis.map(|axis| VectorWithDerivatives {
            value: axis,
            by: [none, -skew(&axis), none, none],
        });
        if let (Tip::Blade { .. }, Some(axis)) = (self.tip, axis) {
            let (unit, by_axis, by_normal) = across(&axis.value, &normal.value);
            let by = [0, 1, 2, 3].map(|k| by_axis * axis.by[k] + by_normal * normal.by[k]);
            let unit = VectorWithDerivatives { value: unit, by };
            let (rate, rate_by) = unit.dot(&velocity);
            sliding = VectorWithDerivatives {
                value: unit.value * rate,
                by: [0, 1, 2, 3].map(|k| unit.by[k] * rate + unit.value * rate_by[k]),
            };
            let (of_unit, of_normal) = (-skew(&normal.value), skew(&unit.value));
            let ahead = VectorWithDerivatives {
                value: unit.value.cross(&normal.value),
                by: [0, 1, 2, 3].map(|k| of_unit * unit.by[k] + of_normal * normal.by[k]),
            };
            let (pace, pace_by) = ahead.dot(&velocity);
            let (share, slope) = self.resistance(pace);
            along.value = ahead.value * -(spring * share);
            along.by = [0, 1, 2, 3].map(|k| {
                let size_by = gap_by[k] * (stiffness * share) - pace_by[k] * (spring * slope);
                ahead.by[k] * -(spring * share) + ahead.value * size_by
            });
        }
        let mut friction = self.friction.held_force(view.held.as_ref(), &sliding.value, spring);
        if view.tame && view.held.is_none() {
            friction = friction.secant(&sliding.value);
        }

        let force = normal.value * press.force_n + friction.force + along.value;
        let lever = skew(&place.arm);
        for (k, part) in PARTS.into_iter().enumerate() {
            let press_by = gap_by[k] * press.by_gap + opening_by[k] * press.by_opening;
            let force_by = normal.value * press_by
                + normal.by[k] * press.force_n
                + friction.by_sliding * sliding.by[k]
                + friction.by_normal * (gap_by[k] * -stiffness)
                + along.by[k];
            derivatives[0].add_force(part, &force_by);
            let moment_by = lever * force_by - skew(&force) * arm.by[k];
            derivatives[0].add_moment(part, &moment_by);
        }
        if let (Tip::Rim { .. }, Some(axis)) = (self.tip, axis) {
            let spin = VectorWithDerivatives {
                value: body.spin,
                by: [none, none, none, Matrix3::identity()],
            };
            let (rate, rate_by) = axis.dot(&spin);
            let radius = self.radius_m;
            let (share, slope) = self.resistance(radius * rate);
            for (k, part) in PARTS.into_iter().enumerate() {
                let size_by = gap_by[k] * (radius * stiffness * share)
                    - rate_by[k] * (radius * radius * spring * slope);
                let moment_by = axis.by[k] * -(radius * spring * share) + axis.value * size_by;
                derivatives[0].add_moment(part, &moment_by);
            }
        }
    }

    fn has_kink(&self) -> bool {
        true
    }

    fn kink(&self, now: &[BodyMotion], held: Option<StickingFriction>) -> Option<Kink<'_>> {
        let spot = self.geometry(&now[0]);
        if spot.gap_m > self.radius_m.max(REACH_M) {
            return None;
        }
        let mut lever = Matrix6x3::zeros();
        lever.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        lever.fixed_view_mut::<3, 3>(3, 0).copy_from(&skew(&spot.arm));
        Some(Kink {
            levers: [lever, Matrix6x3::zeros()],
            directions: 3,
            always: spot.gap_m < 0.0,
            law: Box::new(move |gain, shift| self.law(&spot, held.as_ref(), gain, shift)),
        })
    }

    fn is_far(&self, now: &[BodyMotion], step_s: f64) -> bool {
        let (center, velocity) = now[0].point(&self.center);
        let speed_m_s = velocity.norm() + self.radius_m * now[0].spin.norm();
        let clear_m = self.ground.at(&center).gap_m - self.radius_m;
        clear_m > FAR_M + 2.0 * step_s * speed_m_s
    }

    fn friction(&self) -> Option<&Friction> {
        Some(&self.friction)
    }

    fn touch(&self, now: &[BodyMotion]) -> Option<Touch> {
        Some(self.touch_at(&now[0]))
    }

    fn energy(&self, now: &[BodyMotion]) -> f64 {
        let gap = self.contact_point(&now[0]).surface.gap_m.min(0.0);
        0.5 * self.normal.stiffness_n_m * gap * gap
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::agrees_at;
    use crate::friction::FrictionModel;
    use crate::{Assembly, Settings, System};
    use rollwalk_multibody::ground::{Capsule, Grid, HeightField, Plane, Profile, Sphere, Union};

    fn contact(tip: Tip, ground: Arc<dyn Ground>, model: FrictionModel) -> GroundContact {
        GroundContact {
            body: [0],
            center: Vector3::new(0.02, -0.01, -0.1),
            radius_m: 0.05,
            tip,
            normal: Normal { stiffness_n_m: 200.0, damping_n_s_m: 3.0, ramp_m: 0.02, pulls: true },
            friction: Friction { model, coefficient: 0.7, stick_n_s_m: 5.0 },
            resistance: Resistance { constant: 0.02, per_speed_s_m: 0.05 },
            ground,
        }
    }

    #[test]
    fn feet_wheels_and_blades_have_their_derivatives_on_planes_and_curved_ground() {
        let axis = Vector3::new(0.1, 1.0, 0.05).normalize();
        let ball = Sphere { center: Vector3::new(0.0, 0.1, -1.0), radius_m: 0.9 };
        let grid = Grid::of(&ball, Vector3::new(-1.2, -1.1, -2.2), 0.1, [25; 3]).unwrap();
        let wave = |k: i32| 0.02 * (f64::from(k % 30) * 0.3).sin() + 0.01 * f64::from(k / 30);
        let heights = (0..900).map(wave).collect();
        let field = HeightField::new([-1.5, -1.5], 0.1, [30, 30], heights).unwrap();
        let ends = [Vector3::new(-2.0, 0.3, -0.2), Vector3::new(2.0, -0.4, 0.1)];
        let grounds: [Arc<dyn Ground>; 7] = [
            Arc::new(Capsule { ends, radius_m: 0.3 }),
            Arc::new(Plane::level()),
            Arc::new(Plane::rising(0.3)),
            Arc::new(ball),
            Arc::new(grid),
            Arc::new(field),
            Arc::new(Profile::ramp(-2.0, 4.0, 0.8).unwrap()),
        ];
        for ground in grounds {
            for tip in [Tip::Sphere, Tip::Rim { axis }, Tip::Blade { axis }] {
                for model in [FrictionModel::Linear, FrictionModel::Tanh] {
                    let mut contact = contact(tip, Arc::clone(&ground), model);
                    // The point is deep enough for contact, and not near a kink.
                    for (depth, pulls) in [(0.005, true), (0.05, true), (0.005, false)] {
                        contact.normal.pulls = pulls;
                        agrees_at(&contact, 8, |now| {
                            let gap = contact.touch_at(&now[0]).gap_m;
                            let normal = contact.touch_at(&now[0]).normal;
                            now[0].position -= normal * (gap + depth);
                        });
                    }
                }
            }
        }
    }

    /// Tests that the law of a shift equals the force after that shift, and that its derivative is exact.
    #[test]
    fn the_law_of_a_shift_is_the_force_after_it() {
        let (axis, gain) = (Vector3::new(0.1, 1.0, 0.05).normalize(), 60.0);
        for (tip, model) in [
            (Tip::Sphere, FrictionModel::Linear),
            (Tip::Rim { axis }, FrictionModel::Tanh),
            (Tip::Blade { axis }, FrictionModel::Linear),
        ] {
            let contact = contact(tip, Arc::new(Plane::rising(0.3)), model);
            let mut body = BodyMotion::at(Vector3::new(0.0, 0.0, 0.1));
            body.velocity = Vector3::new(0.3, -0.2, 0.1);
            let spot = contact.geometry(&body);
            // Deep, shallow, open.
            for shift in [[0.01, 0.02, -0.04], [-0.01, 0.003, 0.003], [0.0, 0.0, 0.2]] {
                let shift = Vector3::from(shift);
                let mut moved = body;
                moved.position += shift;
                moved.velocity += shift * gain;
                let (force, by_shift) = contact.law(&spot, None, gain, &shift);
                let expected = contact.touch_at(&moved).force;
                assert!((force - expected).norm() < 1e-9 * (1.0 + force.norm()), "{tip:?}");
                for axis in 0..3 {
                    let step = Vector3::ith(axis, 1e-7);
                    let at = |shift| contact.law(&spot, None, gain, &shift).0;
                    let rate = (at(shift + step) - at(shift - step)) / 2e-7;
                    let error = (rate - by_shift.column(axis)).norm();
                    assert!(error < 1e-5 * (1.0 + by_shift.norm()), "{tip:?}: {rate} {by_shift}");
                }
            }
        }
    }

    /// Tests a ball of 2 cm on level ground, with its centre 5 mm outside the lattice of another part of the ground.
    #[test]
    fn beside_the_lattice_a_foot_stands_on_the_ground_of_the_union() {
        let (half_m, center) = (0.15, Vector3::new(0.013, -0.007, 0.02));
        let ball = Sphere { center, radius_m: 0.1 };
        let ball = Grid::of(&ball, Vector3::repeat(-half_m), half_m / 12.0, [25; 3]).unwrap();
        let ground = Union { parts: vec![Arc::new(Plane::level()), Arc::new(ball)] };
        let stiffness_n_m = 1e4;
        let mut assembly = Assembly::default();
        assembly.add_particle(1.0, Vector3::new(half_m + 0.005, 0.0, 0.021));
        assembly.add(GroundContact {
            body: [0],
            center: Vector3::zeros(),
            radius_m: 0.02,
            tip: Tip::Sphere,
            normal: Normal { stiffness_n_m, damping_n_s_m: 100.0, ramp_m: 0.0, pulls: true },
            friction: Friction {
                model: FrictionModel::Linear,
                coefficient: 0.4,
                stick_n_s_m: 200.0,
            },
            resistance: Resistance::default(),
            ground: Arc::new(ground),
        });
        let mut system = System::new(Settings::default(), assembly);
        for _ in 0..240 {
            system.step(1.0 / 240.0).unwrap();
        }
        let touch = system.touch(0).unwrap();
        assert_eq!(touch.normal, Vector3::z());
        assert!((touch.gap_m + 9.81 / stiffness_n_m).abs() < 1e-6, "{touch:?}");
        assert!((system.motions()[0].position.x - half_m - 0.005).abs() < 1e-6);
    }

    #[test]
    fn what_leaves_fast_is_pulled_or_let_go() {
        let mut contact = contact(Tip::Sphere, Arc::new(Plane::level()), FrictionModel::Linear);
        let mut body = BodyMotion::at(Vector3::new(0.0, 0.0, 0.14));
        body.velocity = Vector3::new(0.0, 0.0, 2.0);
        // 200 N/m and half of 3 N·s/m at a depth of 1 cm are 2 N and 3 N.
        assert!((contact.touch_at(&body).force.z + 1.0).abs() < 1e-12);
        contact.normal.pulls = false;
        assert_eq!(contact.touch_at(&body).force, Vector3::zeros());
    }

    #[test]
    fn what_is_above_the_ground_is_left_alone() {
        let contact = contact(Tip::Sphere, Arc::new(Plane::level()), FrictionModel::Linear);
        let touch = contact.touch_at(&BodyMotion::at(Vector3::new(0.0, 0.0, 0.3)));
        assert!((touch.gap_m - 0.15).abs() < 1e-15);
        assert_eq!(touch.force, Vector3::zeros());
    }

    /// Tests that a rolling wheel does not slide and a dragged one does.
    #[test]
    fn the_contact_point_of_a_wheel_is_that_of_its_rim() {
        let contact = contact(
            Tip::Rim { axis: Vector3::y() },
            Arc::new(Plane::level()),
            FrictionModel::Linear,
        );
        let mut body = BodyMotion::at(Vector3::new(-0.02, 0.01, 0.149));
        body.spin = Vector3::y() * 4.0;
        body.velocity = Vector3::x() * 4.0 * 0.15;
        // The centre of the wheel is 0.1 m below the centre of the body, about which the wheel rotates.
        let touch = contact.touch_at(&body);
        assert!((touch.point - Vector3::new(0.0, 0.0, -0.001)).norm() < 1e-12, "{touch:?}");
        assert!((touch.sliding.x).abs() < 1e-12, "{touch:?}");
    }
}
