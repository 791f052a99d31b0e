//! Stiffness and damping of a robot's joints and contacts, scaled with its weight.

use crate::contact::Normal;
use crate::friction::FrictionModel;
use crate::hold::HoldGains;
use crate::motion::Scheme;
use crate::system::Settings;
use rollwalk_robot::Robot;

/// Stiffness and damping of joints and contacts, which robot files treat as rigid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Parameters of the stepper.
    pub settings: Settings,
    /// Stiffness of a joint against separation of its two points, N/m.
    pub joint_n_m: f64,
    /// Lever arm of a joint's rotational stiffness, as a multiple of the size of the turning part. The rotational stiffness is
    /// `joint_n_m` times the squared lever arm. A constant rotational stiffness would be far too large for small wheels.
    pub lever: f64,
    /// Law of the normal force.
    pub normal: Normal,
    /// Friction law.
    pub friction: FrictionModel,
    /// Ratio of friction to sliding velocity of a sticking contact, N·s/m.
    pub stick_n_s_m: f64,
    /// Friction coefficient of link shapes, which robot files do not contain.
    pub shape_friction: f64,
    /// Stiffness and damping of the hoist that can hold the root link.
    pub grip: HoldGains,
}

/// Residual of a solved step, as a fraction of the weight. As a constant force, this residual would accelerate the robot by 1
/// µm/s².
const TOLERANCE: f64 = 1e-7;
/// Depth of a contact under a quarter of the robot's weight, m.
const DEPTH_M: f64 = 3e-4;
/// Ratio of damping to stiffness of a contact, s. A leg with 1/14 of the robot's mass then lands critically damped. With a
/// quarter of this damping, feet bounce at touch-down, and gaits with flight cover only 90 % of their distance.
const DAMPING_S: f64 = 6e-3;
/// Creep speed of a contact under a quarter of the weight and an equal tangential force, m/s.
const CREEP_M_S: f64 = 9e-4;
/// Friction coefficient of plastic and metal on a floor.
const SHAPE_FRICTION: f64 = 0.4;
/// Deflection of the hoist under the whole weight, m.
const HOIST_M: f64 = 2e-3;
/// Lever arm of the hoist's rotational stiffness, m. The rotational stiffness is the translational one times the squared lever
/// arm.
const HOIST_LEVER_M: f64 = 0.3;
/// Separation of a joint under a quarter of the weight, m.
const JOINT_GAP_M: f64 = 2e-5;

impl Parameters {
    /// Scales the parameters to a robot's weight, so that depth, creep and separation are equal for all robots.
    pub fn new(robot: &Robot) -> Self {
        let mut settings = Settings::default();
        let mass_kg: f64 = robot.links.iter().map(|link| link.mass_kg).sum();
        let quarter_n = 0.25 * mass_kg * settings.gravity_m_s2.norm();
        settings.scheme = Scheme::Bdf2;
        settings.tolerance = TOLERANCE * 4.0 * quarter_n;
        let stiffness_n_m = quarter_n / DEPTH_M;
        let joint_n_m = quarter_n / JOINT_GAP_M;
        // Critically damped: 2 sqrt(k m).
        let shift_n_m = 4.0 * quarter_n / HOIST_M;
        let velocity_n_s_m = 2.0 * (shift_n_m * mass_kg).sqrt();
        let lever = HOIST_LEVER_M * HOIST_LEVER_M;
        Self {
            settings,
            joint_n_m,
            lever: 2.0,
            normal: Normal {
                stiffness_n_m,
                damping_n_s_m: DAMPING_S * stiffness_n_m,
                ramp_m: 0.6 * DEPTH_M,
                pulls: true,
            },
            friction: FrictionModel::Linear,
            stick_n_s_m: quarter_n / CREEP_M_S,
            shape_friction: SHAPE_FRICTION,
            grip: HoldGains {
                shift_n_m,
                velocity_n_s_m,
                turn_nm_rad: shift_n_m * lever,
                spin_nm_s_rad: velocity_n_s_m * lever,
            },
        }
    }

    /// Multiplies the normal stiffness of contacts by `times`, with constant damping ratio.
    #[must_use]
    pub fn with_contact_stiffness(mut self, times: f64) -> Self {
        self.normal.stiffness_n_m *= times;
        self.normal.damping_n_s_m *= times.sqrt();
        self.normal.ramp_m /= times;
        self
    }
}
