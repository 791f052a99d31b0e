//! Messages of `rollwalk-sim` about the robot on the ground.

use crate::excursion::Excursions;
use rollwalk_physics::world::NetDisplacement;
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
    excursions: Excursions,
}

impl Default for Printer {
    fn default() -> Self {
        let excursions = Excursions::default();
        Self { falls: 0, obstacle_contacts: 0, is_held: true, excursions }
    }
}

/// Time, s, and description of an event.
type Event = (f64, String);

impl Printer {
    /// Prints the motions that ended and the falls since the previous call, in the order of time.
    pub fn print(&mut self, rig: &mut Rig) {
        let travels = rig.take_travels();
        let library = rig.core().controller().library();
        let safe = library.as_ref().map(|library| library.safe_node().0);
        let mut events = Vec::new();
        for travel in &travels {
            let name = match travel.motion {
                // Transitions have no names.
                Moving::Clip(clip) => {
                    library.as_ref().and_then(|library| library.name(NodeId(clip.0)))
                }
                Moving::Setpoints => Some("setpoints of the host"),
            };
            if travel.clip().map(|clip| clip.0) != safe {
                self.excursions.add(name, &travel.displacement());
            }
            if let Some(name) = name.filter(|_| travel.duration_s() >= SHORTEST_S) {
                events.push(describe_travel(name, travel));
            }
        }
        if let Some(ground) = rig.body().ground() {
            let of_ground = self.ground_events(ground).into_iter();
            if safe.is_some()
                && ground.playing().map(|clip| clip.0) == safe
                && let Some(done) = self.excursions.return_to_safe()
            {
                let name = done.name();
                let way = describe_way(&done.way);
                events.push((rig.now().as_s(), format!("from SAFE to SAFE with {name}: {way}")));
            }
            // The world is up to one step ahead of the controller, whose states are printed with the present time.
            let now_s = rig.now().as_s();
            events.extend(of_ground.map(|(at_s, what)| (at_s.min(now_s), what)));
        }
        print_events(events);
    }

    /// Prints falls, contacts with obstacles and hoist actions since the previous call.
    pub fn print_ground(&mut self, ground: &Grounded) {
        print_events(self.ground_events(ground));
    }

    fn ground_events(&mut self, ground: &Grounded) -> Vec<Event> {
        let mut events = Vec::new();
        let falls = ground.falls();
        for fall in falls.iter().skip(self.falls) {
            let what = format!(
                "the robot fell: tilted by {:.0}°, its centre of mass {:.2} m above the ground; the \
                 hoist lifts the robot after 3 s without torque",
                fall.how.tilt_rad.to_degrees(),
                fall.how.height_m
            );
            events.push((fall.at.as_s(), what));
        }
        let contacts = ground.obstacle_contacts().unwrap_or_default();
        for contact in contacts.iter().skip(self.obstacle_contacts) {
            let what = format!("`{}` touches obstacle `{}`", contact.link, contact.obstacle);
            events.push((contact.at_s, what));
        }
        self.obstacle_contacts = contacts.len();
        if ground.is_held() != self.is_held {
            let what = if ground.is_held() { "lifts the robot" } else { "releases the robot" };
            events.push((ground.world().system().time_s(), format!("the hoist {what}")));
        }
        self.update(falls.len(), ground.is_held());
        events
    }

    /// Records falls and hoist. A fall or the hoist ends an excursion, because the robot does not come back by its motions.
    fn update(&mut self, falls: usize, is_held: bool) {
        if falls > self.falls || is_held && !self.is_held {
            self.excursions = Excursions::default();
        }
        (self.falls, self.is_held) = (falls, is_held);
    }
}

fn print_events(mut events: Vec<Event>) {
    events.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    for (at_s, what) in events {
        output::print_line(format_args!("{at_s:9.3} s  {what}"));
    }
}

fn describe_travel(name: &str, travel: &Travel) -> Event {
    let totals = travel.totals();
    let what = format!(
        "{name}: {} in {:.2} s; tilt up to {:.1}°, slid {:.3} m, at most {:.1} N on a foot or \
         wheel, {} J of work by the motors",
        describe_way(&travel.displacement()),
        travel.duration_s(),
        totals.tilt_max_rad.to_degrees(),
        totals.slid_m,
        totals.force_max_n,
        fixed::<2>(totals.work_j)
    );
    (travel.to.as_s(), what)
}

fn describe_way(way: &NetDisplacement) -> String {
    format!(
        "{} m ahead, {} m to the left, turned by {}°",
        fixed::<3>(way.forward_m),
        fixed::<3>(way.left_m),
        fixed::<1>(way.turn_rad.to_degrees())
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The robot is elsewhere afterwards, and in SAFE without having returned there.
    #[test]
    fn a_fall_and_the_hoist_end_an_excursion() {
        let is_reported = |falls, is_held| {
            let mut printer = Printer::default();
            printer.update(0, false);
            assert_eq!(printer.excursions.return_to_safe(), None);
            printer.excursions.add(Some("walk"), &NetDisplacement::default());
            printer.update(falls, is_held);
            printer.excursions.return_to_safe().is_some()
        };
        assert_eq!(
            [(0, false), (1, false), (0, true)].map(|(a, b)| is_reported(a, b)),
            [true, false, false]
        );
    }
}
