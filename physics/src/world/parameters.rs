//! Stiffnesses and dampings of a robot's joints and contacts, scaled with its weight.

use crate::contact::Normal;
use crate::friction::Model;
use crate::hold::Grip;
use crate::motion::Scheme;
use crate::system::Settings;
use rollwalk_robot::Robot;

/// Stiffnesses and dampings of everything that is ideal in a robot file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// The stepper.
    pub settings: Settings,
    /// Stiffness of a joint against its two points coming apart, N/m.
    pub joint_n_m: f64,
    /// Length by which that stiffness makes one against the axes tilting, as a multiple of the size of what turns. As
    /// large in its own unit, the latter would be far too stiff for small wheels.
    pub lever: f64,
    /// Along the normal of the ground.
    pub normal: Normal,
    /// Model of friction.
    pub friction: Model,
    /// Friction over sliding velocity of a contact that sticks, N·s/m.
    pub stick_n_s_m: f64,
    /// Coefficient of friction of the shapes of links, which robot files do not have.
    pub shape_friction: f64,
    /// Stiffness and damping of a hoist that holds the root link.
    pub grip: Grip,
}

/// Residual at which a step is solved, as a share of the weight: as a force that pushes the robot all the time it would
/// change its velocity by 1 µm/s in a second.
const TOLERANCE: f64 = 1e-7;
/// Depth to which a quarter of a robot's weight presses a contact, m.
const DEPTH_M: f64 = 3e-4;
/// Time constant of a contact, s: its damping over its stiffness. A leg of a fourteenth of the robot's mass lands critically
/// damped; with a quarter of that, feet bounce where they touch down, and gaits with flight come to nine tenths of their way.
const DAMPING_S: f64 = 6e-3;
/// Creep of a contact that bears a quarter of the weight and is pulled with as much, m/s.
const CREEP_M_S: f64 = 9e-4;
/// Friction of plastic and metal on a floor.
const SHAPE_FRICTION: f64 = 0.4;
/// Depth to which the whole weight sinks in a hoist, m.
const HOIST_M: f64 = 2e-3;
/// Distance from the hoist at which the weight turns the body by as much, m.
const HOIST_LEVER_M: f64 = 0.3;
/// Distance by which a quarter of the weight pulls a joint apart, m.
const JOINT_GAP_M: f64 = 2e-5;

impl Parameters {
    /// Parameters for a robot's weight: the same depth, creep and gaps for all robots.
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
            friction: Model::Linear,
            stick_n_s_m: quarter_n / CREEP_M_S,
            shape_friction: SHAPE_FRICTION,
            grip: Grip {
                shift_n_m,
                velocity_n_s_m,
                turn_nm_rad: shift_n_m * lever,
                spin_nm_s_rad: velocity_n_s_m * lever,
            },
        }
    }

    /// The same with contacts of so many times the stiffness along the normal; their damping ratio stays.
    #[must_use]
    pub fn with_contact_stiffness(mut self, times: f64) -> Self {
        self.normal.stiffness_n_m *= times;
        self.normal.damping_n_s_m *= times.sqrt();
        self.normal.ramp_m /= times;
        self
    }
}
