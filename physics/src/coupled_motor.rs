//! Motor that turns several hinges, such as the knee motor of a belt drive at the hip, or one hinge by crank and rod.
//!
//! The angle θ of the motor is a function of the angles θ_k of its hinges, with derivatives r_k. A torque τ of the motor acts on
//! each hinge as r_k τ. Ratios of belts are constant; those of a crank depend on the pose.

use crate::force::{Derivative, Force, StateBlock, View, Wrench};
use crate::motion::BodyMotion;
use crate::motor::{Law, Motor, Torque};
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::rotation::skew;
use rollwalk_robot::CrankMap;

/// Motor on several hinges.
#[derive(Clone, Debug)]
pub struct CoupledMotor {
    /// Indices of all bodies of the hinges, without duplicates.
    bodies: Vec<usize>,
    hinges: Vec<CoupledHinge>,
    /// Crank and rod, with the hinges as joints; `None` for constant ratios.
    crank: Option<CrankMap>,
    /// Inertia of rotor and gearbox at the output, kg·m².
    pub armature_kg_m2: f64,
    /// Control law.
    pub law: Law,
}

/// Angle of a motor and its derivatives with respect to the angles of the hinges.
struct Pose {
    angle_rad: f64,
    ratios: Vec<f64>,
    /// Second derivatives, row by row.
    bends: Vec<f64>,
}

impl Pose {
    /// Speed of the motor from those of the hinges, rad/s, and its derivatives with respect to the angles of the hinges.
    fn speed(&self, speeds: &[f64]) -> (f64, Vec<f64>) {
        let speed = self.ratios.iter().zip(speeds).map(|(ratio, speed)| ratio * speed).sum();
        let rows = self.bends.chunks(speeds.len());
        let by_angle = rows.map(|row| row.iter().zip(speeds).map(|(by, speed)| by * speed).sum());
        (speed, by_angle.collect())
    }
}

/// Hinge that a motor turns.
#[derive(Clone, Debug)]
struct CoupledHinge {
    /// Radians of the motor per radian of the hinge, if constant.
    ratio: f64,
    /// Carrying and driven body, as indices into the bodies of the motor.
    ends: [usize; 2],
    /// Hinge without power, for its angle.
    hinge: Motor,
}

impl CoupledHinge {
    fn now(&self, motions: &[BodyMotion]) -> [BodyMotion; 2] {
        self.ends.map(|end| motions[end])
    }
}

impl CoupledMotor {
    /// Creates a motor without power on hinges with ratios.
    pub fn new(hinges: impl IntoIterator<Item = (f64, Motor)>, armature_kg_m2: f64) -> Self {
        let mut bodies = Vec::new();
        let mut local = |body: usize| {
            bodies.iter().position(|known| *known == body).unwrap_or_else(|| {
                bodies.push(body);
                bodies.len() - 1
            })
        };
        let hinges = hinges.into_iter().map(|(ratio, hinge)| CoupledHinge {
            ratio,
            ends: hinge.bodies.map(&mut local),
            hinge,
        });
        let hinges = hinges.collect();
        Self { bodies, hinges, crank: None, armature_kg_m2, law: Law::default() }
    }

    /// Creates a motor without power that turns hinges by crank and rod. Joint k of the crank is hinge k.
    pub fn with_crank(
        crank: CrankMap,
        hinges: impl IntoIterator<Item = Motor>,
        armature_kg_m2: f64,
    ) -> Self {
        let hinges = hinges.into_iter().map(|hinge| (1.0, hinge));
        Self { crank: Some(crank), ..Self::new(hinges, armature_kg_m2) }
    }

    fn pose(&self, now: &[BodyMotion]) -> Pose {
        let angles: Vec<_> = self.hinges.iter().map(|of| of.hinge.angle(&of.now(now))).collect();
        let count = angles.len();
        match &self.crank {
            Some(crank) => {
                let state = crank.state(&angles);
                let mut bends = vec![0.0; count * count];
                state.bends.iter().for_each(|&(j, k, by)| bends[j * count + k] = by);
                let ratios = state.ratios.iter().map(|of| of.ratio).collect();
                Pose { angle_rad: state.angle_rad, ratios, bends }
            }
            None => Pose {
                angle_rad: self
                    .hinges
                    .iter()
                    .zip(&angles)
                    .map(|(of, angle)| of.ratio * angle)
                    .sum(),
                ratios: self.hinges.iter().map(|of| of.ratio).collect(),
                bends: vec![0.0; count * count],
            },
        }
    }

    fn speeds(&self, now: &[BodyMotion]) -> Vec<f64> {
        self.hinges.iter().map(|of| of.hinge.speed(&of.now(now))).collect()
    }

    /// Angle of the motor, rad. `now` are the motions of its bodies.
    pub fn angle(&self, now: &[BodyMotion]) -> f64 {
        self.pose(now).angle_rad
    }

    /// Speed of the motor, rad/s.
    pub fn speed(&self, now: &[BodyMotion]) -> f64 {
        self.pose(now).speed(&self.speeds(now)).0
    }

    /// Torque of the control law, without rotor inertia.
    pub fn torque(&self, now: &[BodyMotion]) -> Torque {
        self.law.torque(self.angle(now), self.speed(now))
    }

    /// Torque of the motor including rotor inertia.
    fn moment(&self, view: &View<'_>) -> Torque {
        let speed = |motions: &[BodyMotion]| self.speed(motions);
        let acceleration = view.weights.rate(speed(view.now), speed(view.last), speed(view.before));
        let gain = view.weights.gain();
        self.torque(view.now).with_rotor(self.armature_kg_m2, acceleration, gain)
    }
}

impl Force for CoupledMotor {
    fn bodies(&self) -> &[usize] {
        &self.bodies
    }

    fn end_step(&mut self, motions: &[BodyMotion]) {
        self.hinges.iter_mut().for_each(|of| of.hinge.end_step(motions));
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        let torque_nm = self.moment(view).value_nm;
        for (of, ratio) in self.hinges.iter().zip(self.pose(view.now).ratios) {
            let axis = of.hinge.axis_in_world(&view.now[of.ends[0]]);
            let moment = axis * (ratio * torque_nm);
            wrenches[of.ends[0]].moment -= moment;
            wrenches[of.ends[1]].moment += moment;
        }
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        self.wrenches(view, wrenches);
        let torque = self.moment(view);
        let count = self.bodies.len();
        let pose = self.pose(view.now);
        let (_, speed_by_angle) = pose.speed(&self.speeds(view.now));
        for (i, on) in self.hinges.iter().enumerate() {
            let axis = on.hinge.axis_in_world(&view.now[on.ends[0]]);
            for (end, sign) in on.ends.into_iter().zip([-1.0, 1.0]) {
                let on_end = sign * pose.ratios[i];
                // The axis turns with the carrier.
                let by_axis = skew(&axis) * (-on_end * torque.value_nm);
                derivatives[end * count + on.ends[0]].add_moment(StateBlock::Rotation, &by_axis);
                for (j, by) in self.hinges.iter().enumerate() {
                    let now = by.now(view.now);
                    let [first, second] = by.ends.map(|body| end * count + body);
                    let moment = axis * (on_end * pose.ratios[j]);
                    let gradient = by.hinge.angle_by_turn(&now);
                    // Ratios turn with the angles, and with them the speed.
                    let turns = on_end * torque.by_speed * speed_by_angle[j]
                        + sign * pose.bends[i * self.hinges.len() + j] * torque.value_nm;
                    let by_angle = (moment * torque.by_angle + axis * turns) * gradient.transpose();
                    let (by_turn, by_spin) = by_speed(&by.hinge, &now, &(moment * torque.by_speed));
                    derivatives[first].add_moment(StateBlock::Rotation, &(by_turn - by_angle));
                    derivatives[second].add_moment(StateBlock::Rotation, &by_angle);
                    derivatives[first].add_moment(StateBlock::Spin, &-by_spin);
                    derivatives[second].add_moment(StateBlock::Spin, &by_spin);
                }
            }
        }
    }

    /// Adds the derivatives of the rotor inertia, which depends on earlier speeds.
    fn history(&self, view: &View<'_>, last: &mut [Derivative], before: &mut [Derivative]) -> bool {
        let count = self.bodies.len();
        let now = self.pose(view.now);
        let times = [(view.last, last), (view.before, before)];
        for ((then, derivatives), gain) in times.into_iter().zip(view.weights.earlier_gains()) {
            let pose = self.pose(then);
            let (_, speed_by_angle) = pose.speed(&self.speeds(then));
            for (i, on) in self.hinges.iter().enumerate() {
                let axis = on.hinge.axis_in_world(&view.now[on.ends[0]]);
                for (end, sign) in on.ends.into_iter().zip([-1.0, 1.0]) {
                    let on_end = axis * (-sign * now.ratios[i] * self.armature_kg_m2 * gain);
                    for (j, by) in self.hinges.iter().enumerate() {
                        let [first, second] = by.ends.map(|body| end * count + body);
                        let (by_turn, by_spin) =
                            by_speed(&by.hinge, &by.now(then), &(on_end * pose.ratios[j]));
                        let gradient = by.hinge.angle_by_turn(&by.now(then));
                        let by_angle = on_end * gradient.transpose() * speed_by_angle[j];
                        derivatives[first].add_moment(StateBlock::Rotation, &(by_turn - by_angle));
                        derivatives[second].add_moment(StateBlock::Rotation, &by_angle);
                        derivatives[first].add_moment(StateBlock::Spin, &-by_spin);
                        derivatives[second].add_moment(StateBlock::Spin, &by_spin);
                    }
                }
            }
        }
        true
    }
}

/// Derivatives of `moment` times the speed of a hinge with respect to a turn of its first body and to the spin of its second
/// body. The derivative with respect to the spin of the first body has the opposite sign.
fn by_speed(
    hinge: &Motor,
    now: &[BodyMotion; 2],
    moment: &Vector3<f64>,
) -> (Matrix3<f64>, Matrix3<f64>) {
    let axis = hinge.axis_in_world(&now[0]);
    let relative = now[1].spin - now[0].spin;
    (moment * axis.cross(&relative).transpose(), moment * axis.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{LAW, agrees_with_finite_differences};
    use rollwalk_robot::{Linkage, Robot};

    fn motor(law: Law) -> CoupledMotor {
        let hinge = |bodies, axis: Vector3<f64>, across| Motor {
            bodies,
            axis,
            across: [across, across],
            slide: None,
            armature_kg_m2: 0.0,
            stops: None,
            spring: None,
            angle_rad: 0.0,
            law: Law::default(),
        };
        let hinges = [
            (0.7, hinge([0, 1], Vector3::y(), Vector3::x())),
            (-1.4, hinge([1, 2], Vector3::z(), Vector3::x())),
        ];
        CoupledMotor { law, ..CoupledMotor::new(hinges, 0.02) }
    }

    #[test]
    fn a_coupled_motor_has_its_derivatives_free_and_at_its_limit() {
        agrees_with_finite_differences(&motor(LAW));
        agrees_with_finite_differences(&motor(Law { limit_nm: 0.1, ..LAW }));
    }

    /// Second servo of a five-bar leg, with a crank so long that the linkage closes in every pose.
    fn crank(law: Law) -> CoupledMotor {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots/pup_five_bar.toml");
        let text = std::fs::read_to_string(path).unwrap();
        let robot = Robot::from_toml("pup_five_bar.toml", &text).unwrap();
        let joint = &robot.joints[1];
        let hip = robot.joints[0].parent_from_joint.translation.vector;
        let linkage = Linkage {
            pivot_in_link_m: hip,
            pin_in_link_m: hip + Vector3::new(-0.1968, 0.0, -0.0357),
            ..joint.linkage.clone().unwrap()
        };
        let crank = CrankMap::new(&robot, joint, &linkage).unwrap().renumbered();
        let hinge = |bodies, angle: f64| {
            let turn = crate::rotation::Increment::new(Vector3::y() * angle).rotation();
            Motor {
                bodies,
                axis: Vector3::y(),
                across: [Vector3::x(), turn * Vector3::x()],
                slide: None,
                armature_kg_m2: 0.0,
                stops: None,
                spring: None,
                angle_rad: 0.0,
                law: Law::default(),
            }
        };
        let hinges = [hinge([0, 1], 0.6), hinge([1, 2], -1.2)];
        CoupledMotor { law, ..CoupledMotor::with_crank(crank, hinges, 0.002) }
    }

    #[test]
    fn a_crank_has_its_derivatives_free_and_at_its_limit() {
        let free = Law {
            kp_nm_rad: 5.0,
            kd_nm_s_rad: 0.3,
            position_rad: 0.2,
            limit_nm: 1e3,
            ..Law::default()
        };
        agrees_with_finite_differences(&crank(free));
        agrees_with_finite_differences(&crank(Law { limit_nm: 0.1, ..free }));
    }

    #[test]
    fn a_motor_on_one_hinge_is_that_of_the_hinge() {
        let law = Law { kp_nm_rad: 5.0, kd_nm_s_rad: 0.3, limit_nm: 1e3, ..Law::default() };
        let turned = BodyMotion {
            rotation: crate::rotation::Increment::new(Vector3::y() * 0.4).rotation(),
            spin: Vector3::new(0.1, 1.5, -0.2),
            ..BodyMotion::at(Vector3::zeros())
        };
        let now = [BodyMotion::at(Vector3::zeros()), turned];
        let hinge = motor(law).hinges[0].hinge.clone();
        let coupled = CoupledMotor { law, ..CoupledMotor::new([(1.0, hinge.clone())], 0.02) };
        let alone = Motor { law, ..hinge };
        assert_eq!(coupled.torque(&now).value_nm, alone.torque(&now).value_nm);
    }
}
