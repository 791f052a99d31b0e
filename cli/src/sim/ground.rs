//! The ground of `rollwalk-sim`, and what it says of the robot on it.

use crate::output;
use miette::miette;
use rollwalk_physics::ground::{Ground, Plane};
use rollwalk_protocol::library::NodeId;
use rollwalk_sim_host::ground::Travel;
use rollwalk_sim_host::rig::Rig;
use std::sync::Arc;

/// Steepest slope, degrees.
const SLOPE_MAX_DEG: f64 = 30.0;

/// The ground with the slope of the command line, degrees.
pub fn level_or_sloping(slope_deg: Option<f64>) -> miette::Result<Arc<dyn Ground>> {
    let slope_deg = slope_deg.unwrap_or(0.0);
    if !(-SLOPE_MAX_DEG..=SLOPE_MAX_DEG).contains(&slope_deg) {
        return Err(miette!(
            "--slope is {slope_deg}: it must be from -{SLOPE_MAX_DEG} to {SLOPE_MAX_DEG} degrees"
        ));
    }
    Ok(Arc::new(Plane::rising(slope_deg.to_radians())))
}

/// Shortest motion of which something is said, s.
const SHORTEST_S: f64 = 0.2;

/// Prints the way of each motion, and falls, to stderr.
#[derive(Default)]
pub struct Printer {
    falls: usize,
}

impl Printer {
    /// Prints the motions that ended and the falls since the last call.
    pub fn print(&mut self, rig: &mut Rig) {
        for travel in rig.take_travels().iter().filter(|travel| travel.duration_s() >= SHORTEST_S) {
            // Transitions have no names.
            let library = rig.core().controller().library();
            if let Some(name) = library.and_then(|library| library.name(NodeId(travel.clip.0))) {
                say(name, travel);
            }
        }
        let falls = rig.body().ground().map(|ground| ground.falls()).unwrap_or_default();
        for fall in falls.iter().skip(self.falls) {
            output::say(format_args!(
                "{:9.3} s  fell: tilted by {:.0}°, its body {:.2} m above the ground; the hoist holds it until its \
                 torque has been off",
                fall.at.as_s(),
                fall.tilt_rad.to_degrees(),
                fall.height_m
            ));
        }
        self.falls = falls.len();
    }
}

fn say(name: &str, travel: &Travel) {
    let way = travel.way_m();
    output::say(format_args!(
        "{:9.3} s  {name}: {:.3} m ahead, {:.3} m to the left, turned by {:.1}° in {:.2} s; tilt to {:.1}°, slid {:.3} m, \
         at most {:.1} N on a foot or wheel, {:.2} J of work by the motors",
        travel.to.as_s(),
        way.x,
        way.y,
        travel.turn_rad.to_degrees(),
        travel.duration_s(),
        travel.tilt_max_rad.to_degrees(),
        travel.slid_m,
        travel.force_max_n,
        travel.work_j
    ));
}
