//! Driving by velocities, between a call of `~/drive` and a call that stops it. The pilot (`rollwalk_pilot`) plans and streams
//! motion for the commanded velocity.

use crate::commanded::{Commanded, Velocity};
use rollwalk_host::describe::state_name;
use rollwalk_host::operator::{Operator, Weight};
use rollwalk_pilot::{ActionAfterStop, END_US, Phase, Pilot, SteeredRobot};
use rollwalk_protocol::wire::State;
use rollwalk_terminal::link::steering::SteeringInputs;
use std::time::Duration;

/// Pilot of the node.
#[derive(Debug)]
pub struct NodePilot {
    steered: SteeredRobot,
    commanded: Commanded,
    /// Library whose SAFE pose the robot starts in.
    library: u32,
    /// Time at which the robot was ordered to stop because the node ends, µs.
    left_us: Option<u64>,
}

impl NodePilot {
    /// Creates a pilot at rest. `budget` is the time limit of a plan, and `timeout_s` is the lifetime of a velocity.
    pub fn new(prepared: SteeringInputs, budget: Duration, timeout_s: f64) -> Self {
        let SteeringInputs { route, fastest, catalog, .. } = prepared;
        let mut pilot = Pilot::new(false);
        pilot.rest();
        Self {
            steered: SteeredRobot::new(pilot, route, budget),
            commanded: Commanded::new(fastest, timeout_s),
            library: catalog.library,
            left_us: None,
        }
    }

    /// Phase of the pilot.
    pub fn phase(&self) -> Phase {
        self.steered.pilot.phase()
    }

    /// Accepts a velocity, or reports the reason why it cannot be followed.
    pub fn command(&mut self, now_us: u64, velocity: Velocity, operator: &mut Operator) {
        if let Err(why) = self.commanded.command(now_us, velocity) {
            operator.notify(now_us, Weight::Warning, why);
        }
    }

    /// Starts following velocities.
    ///
    /// # Errors
    /// Returns the reason as a message if the robot cannot follow velocities.
    pub fn begin(&mut self, now_us: u64, operator: &Operator) -> Result<(), String> {
        let view = operator.view(now_us);
        let Some(status) = view.status.filter(|_| view.link.contact) else {
            return Err("no contact with the controller".into());
        };
        match self.phase() {
            Phase::Off => {}
            Phase::Beginning | Phase::Steered => return Ok(()),
            Phase::Stopping | Phase::Homeward => return Err("the robot is stopping".into()),
        }
        if status.state != State::Ready {
            let state = state_name(status.state);
            return Err(format!(
                "the robot is {state}: driving begins at SAFE, so call ~/arm or ~/return first"
            ));
        }
        let has = operator.hello().and_then(|hello| hello.library);
        if has != Some(self.library) {
            return Err(
                "the library of the controller differs from --library, so its SAFE pose may differ: \
                 flash the given library, or give the library of the controller"
                    .into(),
            );
        }
        self.steered.pilot.rise();
        Ok(())
    }

    /// Stops the robot and sends it to SAFE.
    pub fn stop(&mut self, now_us: u64, after: ActionAfterStop, operator: &mut Operator) {
        self.steered.pilot.stop(now_us, after, operator);
    }

    /// Stops a driven robot before the node ends. Returns true while the robot is stopping. Returns false if it is not driven,
    /// if there is no contact, or if it does not stop in time.
    pub fn leave(&mut self, now_us: u64, operator: &mut Operator) -> bool {
        if self.phase() == Phase::Off || !operator.view(now_us).link.contact {
            return false;
        }
        if self.left_us.is_none() {
            self.stop(now_us, ActionAfterStop::Leave, operator);
        }
        now_us < *self.left_us.get_or_insert(now_us) + END_US
    }

    /// Sends commands to the robot, receives plans and requests the next plans. Call it often.
    pub fn turn(&mut self, now_us: u64, operator: &mut Operator) {
        self.steered.steer(self.commanded.steering(now_us));
        self.steered.turn(now_us, operator, |_| {});
        if self.phase() == Phase::Off {
            // The pilot begins at a request, not at the next arrival in SAFE.
            self.steered.pilot.rest();
        }
    }
}
