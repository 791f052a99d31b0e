//! Gamepad that the page can see. Buttons have the functions of the command line's console (`rollwalk_gamepads`), with two
//! differences. Arming takes a second, as with the page's own button. If the page stops reporting the gamepad, the deadman
//! switch counts as released.

use crate::messages::robot::GamepadState;
use rollwalk_gamepads::file::{Mapping, North};
use rollwalk_gamepads::mapped_gamepad::{GamepadRequest, MappedGamepad};
use rollwalk_gamepads::standard::{Snapshot, Standard};
use rollwalk_gamepads::{shipped, shipped_for};
use rollwalk_host::operator::{Deadman, Intent, Operator, ReleaseReaction};

/// Time for which the arming button must be held, µs.
const ARM_HOLD_US: u64 = 1_000_000;
/// Timeout of the page's reports, after which the deadman switch counts as released, µs: the heartbeat timeout of a robot.
const UNSEEN_US: u64 = 250_000;

/// Gamepad that the operator uses.
#[derive(Debug)]
pub struct Gamepad {
    standard: Standard,
    /// Gamepad with its mapping, and its name; `None` before the first is seen.
    pad: Option<(MappedGamepad, String)>,
    seen_us: u64,
}

impl Gamepad {
    /// Creates the state before a gamepad was seen; its deadman switch counts as released.
    pub fn new(now_us: u64, operator: &mut Operator) -> Self {
        operator.request(now_us, Intent::Deadman(Deadman::Released(ReleaseReaction::Pause)));
        Self { standard: Standard::default(), pad: None, seen_us: now_us }
    }

    /// Operator requests from the states that the page has reported since the previous call.
    pub fn requests(&mut self, now_us: u64, seen: Vec<GamepadState>) -> Vec<GamepadRequest> {
        let mut requests = Vec::new();
        if !seen.is_empty() {
            self.seen_us = now_us;
        } else if now_us.saturating_sub(self.seen_us) >= UNSEEN_US {
            requests = self.gone(now_us, "the page has not reported the gamepad for 0.25 s");
        }
        for seen in seen {
            requests.extend(match seen {
                GamepadState::There(snapshot) => self.there(now_us, &snapshot),
                GamepadState::Gone { gone } => self.gone(now_us, &gone),
            });
        }
        if let Some((pad, _)) = &mut self.pad {
            requests.extend(pad.tick(now_us));
        }
        requests
    }

    fn there(&mut self, now_us: u64, snapshot: &Snapshot) -> Vec<GamepadRequest> {
        let another = self.pad.as_ref().is_none_or(|(_, id)| *id != snapshot.id);
        let mut requests =
            if another { self.gone(now_us, "another gamepad is in use") } else { Vec::new() };
        if another {
            let pad = mapping(&snapshot.id)
                .map(|mapping| MappedGamepad::new(mapping).arming_after(ARM_HOLD_US));
            self.pad = pad.map(|pad| (pad, snapshot.id.clone()));
        }
        let north = self.pad.as_ref().map_or(North::Top, |(pad, _)| pad.north());
        for event in self.standard.events(north, snapshot) {
            if let Some((pad, _)) = &mut self.pad {
                requests.extend(pad.on_event(now_us, event));
            }
        }
        requests
    }

    fn gone(&mut self, now_us: u64, why: &str) -> Vec<GamepadRequest> {
        match (self.standard.gone(why), &mut self.pad) {
            (Some(event), Some((pad, _))) => pad.on_event(now_us, event),
            _ => Vec::new(),
        }
    }

    /// Short description of the gamepad.
    pub fn words(&self) -> String {
        match &self.pad {
            Some((pad, _)) => pad.words(),
            None => "no gamepad yet: press a button of the gamepad".to_owned(),
        }
    }
}

/// Mapping of a gamepad. Browsers give all standard gamepads the same buttons, so a gamepad without a shipped mapping gets the
/// first one.
fn mapping(id: &str) -> Option<Mapping> {
    shipped_for(id).or_else(|| {
        let (path, text) = shipped().next()?;
        Mapping::from_toml(path, text).ok()
    })
}
