//! Simulated operator, who connects, retries, and brings the robot from any state to a requested one.

use super::shared_rig::SharedRig;
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::wire::{Node, State};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::Core;

/// Maximum time to connect.
const CONNECT_WITHIN: SimTime = SimTime::from_ms(60_000);
/// Maximum time from any state to a requested one.
const RECOVER_WITHIN: SimTime = SimTime::from_ms(90_000);
/// Maximum time until the hoist has lifted a robot.
const SET_UP_WITHIN: SimTime = SimTime::from_ms(10_000);
/// Interval between checks of the status, µs.
const STATUS_CHECK_US: u64 = 50_000;

/// Description of an operator's failure.
pub type OperatorFailure = String;

/// Operator with or without a session.
pub struct Operator<C: Core> {
    rig: SharedRig<C>,
    node: Node,
    session: Option<Session<SharedRig<C>>>,
}

impl<C: Core> Operator<C> {
    /// Creates an operator who is not connected yet.
    pub fn new(rig: &SharedRig<C>) -> Self {
        let node = rig.borrow().node();
        Self { rig: rig.clone(), node, session: None }
    }

    /// Ends the host program.
    pub fn quit(&mut self) {
        self.session = None;
    }

    /// Returns the session, and connects first if necessary.
    pub fn session(&mut self) -> Result<&mut Session<SharedRig<C>>, OperatorFailure> {
        let deadline = self.rig.now() + CONNECT_WITHIN;
        while self.session.is_none() {
            match Session::connect(self.rig.clone(), self.node) {
                Ok(session) => self.session = Some(session),
                Err(error) if self.rig.now() > deadline => return Err(error.to_string()),
                Err(_) => {}
            }
        }
        Ok(self.session.as_mut().expect("just connected"))
    }

    pub fn wait(&mut self, span: SimTime) {
        match &mut self.session {
            Some(session) => drop(session.run_for(span.as_us())),
            None => self.rig.abandon_until(self.rig.now() + span),
        }
    }

    /// Waits until a robot on the ground is in its hoist again. The hoist lifts a fallen robot before it is armed.
    pub fn set_up(&mut self) {
        let deadline = self.rig.now() + SET_UP_WITHIN;
        let lies = |rig: &SharedRig<C>| {
            rig.borrow().body().ground().is_some_and(|ground| !ground.is_held())
        };
        while lies(&self.rig) && self.rig.now() < deadline {
            self.wait(SimTime::from_us(STATUS_CHECK_US));
        }
    }

    /// Most recently reported state.
    fn state(&self) -> Option<State> {
        Some(self.session.as_ref()?.status()?.state)
    }

    /// Brings the robot to a state.
    pub fn reach(&mut self, wanted: State) -> Result<(), OperatorFailure> {
        let deadline = self.rig.now() + RECOVER_WITHIN;
        let mut last = None;
        loop {
            let session = self.session()?;
            let _ = session.run_for(STATUS_CHECK_US);
            let Some(status) = session.status() else { continue };
            if status.state == wanted {
                return Ok(());
            }
            if self.rig.now() > deadline {
                let last: Option<SessionError> = last;
                let last = last.map_or(String::new(), |error| format!("; last answer: {error}"));
                return Err(format!("{wanted:?} is not reached from {status:?}{last}"));
            }
            if status.state == State::Disarmed {
                self.set_up();
            }
            let session = self.session()?;
            let done = match (status.state, wanted) {
                (State::EStopped, _) => session.clear(),
                (State::TorqueOff, _) if !status.faults.is_empty() => session.clear(),
                (State::Disarmed, _) => session.arm(),
                (State::Playing | State::Paused, State::Ready) => session.return_to_safe(),
                (State::Ready | State::Playing | State::Paused, State::Disarmed) => {
                    session.disarm()
                }
                _ => Ok(()),
            };
            last = done.err().or(last);
        }
    }

    /// Plays a motion that starts from SAFE.
    pub fn play(&mut self, code: u8, clip: u8) -> Result<(), OperatorFailure> {
        let deadline = self.rig.now() + RECOVER_WITHIN;
        let mut last = String::new();
        while self.rig.now() <= deadline {
            let session = self.session()?;
            if let Err(error) = session.select(code) {
                last = error.to_string();
                self.reach(State::Ready)?;
                continue;
            }
            let begins = session.wait_until("the motion", 5_000_000, |status| {
                if status.clip == Some(clip) {
                    return Some(true);
                }
                let driven = matches!(status.state, State::Ready | State::Playing);
                (!driven).then_some(false)
            });
            match begins {
                Ok(()) => return Ok(()),
                Err(error) => last = error.to_string(),
            }
            self.reach(State::Ready)?;
        }
        Err(format!("code {code} does not start: {last}, {:?}", self.state()))
    }
}
