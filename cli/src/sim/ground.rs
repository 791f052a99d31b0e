//! Messages of `rollwalk-sim` about the robot on the ground.

use rollwalk_protocol::library::NodeId;
use rollwalk_sim_host::ground::{Grounded, Moving, Travel};
use rollwalk_sim_host::rig::Rig;
use rollwalk_terminal::output::{self, fixed};

/// Minimum duration of a reported motion, s.
const SHORTEST_S: f64 = 0.2;

/// Prints the displacement of each motion, falls and hoist actions to stderr.
pub struct Printer {
    falls: usize,
    obstacle_contacts: usize,
    is_held: bool,
}

impl Default for Printer {
    fn default() -> Self {
        Self { falls: 0, obstacle_contacts: 0, is_held: true }
    }
}

impl Printer {
    /// Prints the motions that ended and the falls since the previous call.
    pub fn print(&mut self, rig: &mut Rig) {
        for travel in rig.take_travels().iter().filter(|travel| travel.duration_s() >= SHORTEST_S) {
            let library = rig.core().controller().library();
            let name = match travel.motion {
                // Transitions have no names.
                Moving::Clip(clip) => library.and_then(|library| library.name(NodeId(clip.0))),
                Moving::Setpoints => Some("setpoints of the host"),
            };
            if let Some(name) = name {
                print_travel(name, travel);
            }
        }
        if let Some(ground) = rig.body().ground() {
            self.print_ground(ground);
        }
    }

    /// Prints falls, contacts with obstacles and hoist actions since the previous call.
    pub fn print_ground(&mut self, ground: &Grounded) {
        let falls = ground.falls();
        for fall in falls.iter().skip(self.falls) {
            output::print_line(format_args!(
                "{:9.3} s  the robot fell: tilted by {:.0}°, its centre of mass {:.2} m above the ground; \
                 the hoist lifts the robot after 3 s without torque",
                fall.at.as_s(),
                fall.how.tilt_rad.to_degrees(),
                fall.how.height_m
            ));
        }
        self.falls = falls.len();
        let contacts = ground.obstacle_contacts().unwrap_or_default();
        for contact in contacts.iter().skip(self.obstacle_contacts) {
            output::print_line(format_args!(
                "{:9.3} s  `{}` touches obstacle `{}`",
                contact.at_s, contact.link, contact.obstacle
            ));
        }
        self.obstacle_contacts = contacts.len();
        if ground.is_held() != self.is_held {
            self.is_held = ground.is_held();
            let what = if self.is_held { "lifts the robot" } else { "releases the robot" };
            let at_s = ground.world().system().time_s();
            output::print_line(format_args!("{at_s:9.3} s  the hoist {what}"));
        }
    }
}

fn print_travel(name: &str, travel: &Travel) {
    let (way, totals) = (travel.displacement(), travel.totals());
    output::print_line(format_args!(
        "{:9.3} s  {name}: {} m ahead, {} m to the left, turned by {}° in {:.2} s; tilt up to \
         {:.1}°, slid {:.3} m, at most {:.1} N on a foot or wheel, {} J of work by the motors",
        travel.to.as_s(),
        fixed::<3>(way.forward_m),
        fixed::<3>(way.left_m),
        fixed::<1>(way.turn_rad.to_degrees()),
        travel.duration_s(),
        totals.tilt_max_rad.to_degrees(),
        totals.slid_m,
        totals.force_max_n,
        fixed::<2>(totals.work_j)
    ));
}
