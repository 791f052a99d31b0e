//! A run as a table: at every step where the robot is, what its drives were commanded, what its motors did, and what the
//! ground did to it. Format: `docs/world-log.md`.
//!
//! The caller that steps a world writes it, with a bus or without.

use rollwalk_physics::World;
use rollwalk_physics::motor::Law;
use rollwalk_robot::{Channel, Robot};
use std::borrow::Cow;
use std::fmt::Write;

/// What is known of a step besides its world.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Simulated time, s.
    pub time_s: f64,
    /// Name of the motion that is played; empty if there is none.
    pub motion: &'a str,
    /// Whether the hoist holds the body.
    pub is_held: bool,
    /// Whether the robot has fallen.
    pub has_fallen: bool,
}

/// Names of the columns, separated by commas. Names of joints and end effectors come from the robot file.
pub fn heading(robot: &Robot) -> String {
    let base = "time_s,motion,held,fell,base_x_m,base_y_m,base_z_m,base_qw,base_qx,base_qy,base_qz,com_x_m,com_y_m,com_z_m,\
                com_vx_m_s,com_vy_m_s,com_vz_m_s";
    let mut text = base.to_owned();
    for channel in robot.channels() {
        let name = match channel {
            Channel::Joint(joint) => joint.name.clone(),
            Channel::Wheel(wheel, _) => format!("{}_motor", wheel.name),
        };
        for what in [
            "rad",
            "rad_s",
            "nm",
            "target_rad",
            "target_rad_s",
            "feedforward_nm",
            "kp_nm_rad",
            "kd_nm_s_rad",
            "limit_nm",
        ] {
            let _ = write!(text, ",{name}_{what}");
        }
    }
    for end_effector in &robot.end_effectors {
        for what in ["normal_n", "fx_n", "fy_n", "fz_n", "slip_m_s"] {
            let _ = write!(text, ",{}_{what}", end_effector.name);
        }
    }
    text
}

/// A line of the table. Numbers have the digits of single precision.
pub fn line(moment: &Moment<'_>, world: &World) -> String {
    let &Moment { time_s, motion, is_held, has_fallen } = moment;
    let flag = u8::from;
    let (motion, held, fell) = (quoted(motion), flag(is_held), flag(has_fallen));
    let mut text = format!("{time_s:.6},{motion},{held},{fell}");
    let mut add = |values: &[f64]| {
        for value in values {
            let _ = write!(text, ",{}", *value as f32);
        }
    };
    let (position, rotation) = world.base();
    let turned = nalgebra::UnitQuaternion::from_matrix(&rotation);
    let (com, velocity) = world.com();
    add(position.as_slice());
    add(&[turned.w, turned.i, turned.j, turned.k]);
    add(com.as_slice());
    add(velocity.as_slice());
    for (channel, shaft) in world.shafts().enumerate() {
        let Law { kp_nm_rad, kd_nm_s_rad, position_rad, speed_rad_s, torque_nm, limit_nm, .. } =
            world.law(channel);
        add(&shaft);
        add(&[position_rad, speed_rad_s, torque_nm, kp_nm_rad, kd_nm_s_rad, limit_nm]);
    }
    for touch in world.touches() {
        add(&[touch.normal_n]);
        add(touch.force.as_slice());
        add(&[if touch.normal_n > 0.0 { touch.sliding.norm() } else { 0.0 }]);
    }
    text
}

/// A name as a cell (RFC 4180).
fn quoted(name: &str) -> Cow<'_, str> {
    match name.contains([',', '"']) {
        true => Cow::Owned(format!("\"{}\"", name.replace('"', "\"\""))),
        false => Cow::Borrowed(name),
    }
}
