//! A person at the host's end: asks again, connects again, and knows what to do in which state.

use super::bench::Bench;
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::wire::{Node, State};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::Core;

/// So long it is tried to get an answer at all.
const CONNECT_WITHIN: SimTime = SimTime::from_ms(60_000);
/// So long it may take from any state to one that was asked for.
const RECOVER_WITHIN: SimTime = SimTime::from_ms(90_000);
/// Between two looks at the status, µs.
const LOOK_US: u64 = 50_000;

/// What did not come about, in a sentence.
pub type Stuck = String;

/// An operator with a session, or with none.
pub struct Operator<C: Core> {
    bench: Bench<C>,
    node: Node,
    session: Option<Session<Bench<C>>>,
}

impl<C: Core> Operator<C> {
    /// Not connected yet.
    pub fn new(bench: &Bench<C>) -> Self {
        let node = bench.rig().node();
        Self { bench: bench.clone(), node, session: None }
    }

    /// The program at the host's end is gone.
    pub fn quit(&mut self) {
        self.session = None;
    }

    /// The session; connects when there is none.
    pub fn session(&mut self) -> Result<&mut Session<Bench<C>>, Stuck> {
        let deadline = self.bench.now() + CONNECT_WITHIN;
        while self.session.is_none() {
            match Session::connect(self.bench.clone(), self.node) {
                Ok(session) => self.session = Some(session),
                Err(error) if self.bench.now() > deadline => return Err(error.to_string()),
                Err(_) => {}
            }
        }
        Ok(self.session.as_mut().expect("just connected"))
    }

    /// Lets time pass.
    pub fn wait(&mut self, span: SimTime) {
        match &mut self.session {
            Some(session) => drop(session.run_for(span.as_us())),
            None => self.bench.abandon_until(self.bench.now() + span),
        }
    }

    /// The state that was heard last.
    fn state(&self) -> Option<State> {
        Some(self.session.as_ref()?.status()?.state)
    }

    /// Goes on until the robot is in a state, by whatever way leads there.
    pub fn reach(&mut self, wanted: State) -> Result<(), Stuck> {
        let deadline = self.bench.now() + RECOVER_WITHIN;
        let mut last = None;
        loop {
            let session = self.session()?;
            let _ = session.run_for(LOOK_US);
            let Some(status) = session.status() else { continue };
            if status.state == wanted {
                return Ok(());
            }
            if self.bench.now() > deadline {
                let last: Option<SessionError> = last;
                let last = last.map_or(String::new(), |error| format!("; last answer: {error}"));
                return Err(format!("{wanted:?} is not reached from {status:?}{last}"));
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

    /// Has a motion played, from SAFE.
    pub fn play(&mut self, code: u8, clip: u8) -> Result<(), Stuck> {
        let deadline = self.bench.now() + RECOVER_WITHIN;
        let mut last = String::new();
        while self.bench.now() <= deadline {
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
        Err(format!("code {code} is not played: {last}, {:?}", self.state()))
    }
}
