//! A robot that is driven: the velocity that is commanded goes to the pilot, which plans and streams (`rollwalk_pilot`),
//! between a call of `~/drive` and one that stops it.

use crate::commanded::{Commanded, Velocity};
use rollwalk_host::describe::state_name;
use rollwalk_host::operator::{Operator, Weight};
use rollwalk_pilot::{After, END_US, Phase, Pilot, Steered};
use rollwalk_protocol::wire::State;
use rollwalk_terminal::link::steering::Prepared;
use std::time::Duration;

/// The pilot of a node.
#[derive(Debug)]
pub struct Driving {
    steered: Steered,
    commanded: Commanded,
    /// The library in whose SAFE pose the robot begins.
    library: u32,
    /// Time at which the robot was ordered to stop because the node ends, µs.
    left_us: Option<u64>,
}

impl Driving {
    /// A pilot of a robot that does not follow it yet. A plan takes `budget` at most, and a velocity counts for `timeout_s`.
    pub fn new(prepared: Prepared, budget: Duration, timeout_s: f64) -> Self {
        let Prepared { route, fastest, catalog } = prepared;
        let mut pilot = Pilot::new(false);
        pilot.rest();
        Self {
            steered: Steered::new(pilot, route, budget),
            commanded: Commanded::new(fastest, timeout_s),
            library: catalog.library,
            left_us: None,
        }
    }

    /// Phase of the pilot.
    pub fn phase(&self) -> Phase {
        self.steered.pilot.phase()
    }

    /// Takes a velocity; one that cannot be followed is said.
    pub fn command(&mut self, now_us: u64, velocity: Velocity, operator: &mut Operator) {
        if let Err(why) = self.commanded.command(now_us, velocity) {
            operator.say(now_us, Weight::Warning, why);
        }
    }

    /// Follows the velocities from now on.
    ///
    /// # Errors
    /// Why the robot cannot, in words.
    pub fn begin(&mut self, now_us: u64, operator: &Operator) -> Result<(), String> {
        let view = operator.view(now_us);
        let Some(status) = view.status.filter(|_| view.link.contact) else {
            return Err("no contact with the controller".into());
        };
        match self.phase() {
            Phase::Off => {}
            Phase::Beginning | Phase::Steered => return Ok(()),
            Phase::Stopping | Phase::Homeward => return Err("it is stopping".into()),
        }
        if status.state != State::Ready {
            let state = state_name(status.state);
            return Err(format!(
                "the robot is {state}: it is driven from SAFE, which ~/arm and ~/return take it to"
            ));
        }
        let has = operator.hello().and_then(|hello| hello.library);
        if has != Some(self.library) {
            return Err("the controller has another library than that of --library, whose SAFE pose may differ".into());
        }
        self.steered.pilot.rise();
        Ok(())
    }

    /// Stops the robot and sends it to SAFE.
    pub fn stop(&mut self, now_us: u64, after: After, operator: &mut Operator) {
        self.steered.pilot.stop(now_us, after, operator);
    }

    /// Stops a driven robot before the node ends. Returns whether it is about to; otherwise it is not driven, not heard, or
    /// does not stop.
    pub fn leave(&mut self, now_us: u64, operator: &mut Operator) -> bool {
        if self.phase() == Phase::Off || !operator.view(now_us).link.contact {
            return false;
        }
        if self.left_us.is_none() {
            self.stop(now_us, After::Leave, operator);
        }
        now_us < *self.left_us.get_or_insert(now_us) + END_US
    }

    /// Gives commands, takes plans and asks for plans; call often.
    pub fn turn(&mut self, now_us: u64, operator: &mut Operator) {
        self.steered.steer(self.commanded.steering(now_us));
        self.steered.turn(now_us, operator, |_| {});
        if self.phase() == Phase::Off {
            // It begins when it is asked to, not when it is next in SAFE.
            self.steered.pilot.rest();
        }
    }
}
