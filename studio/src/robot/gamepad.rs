//! A gamepad that the page sees. What its buttons do is that of the command line's console (`rollwalk_gamepads`), with two
//! differences: arming takes a second, as with the page's own button, and a page that does not tell of the gamepad holds nothing.

use crate::messages::robot::Seen;
use rollwalk_gamepads::file::{Mapping, North};
use rollwalk_gamepads::pad::{Pad, Wish};
use rollwalk_gamepads::standard::{Snapshot, Standard};
use rollwalk_gamepads::{shipped, shipped_for};
use rollwalk_host::operator::{Deadman, Intent, LetGo, Operator};

/// Time for which the arming button must be held, µs.
const ARM_HOLD_US: u64 = 1_000_000;
/// Age of the page's last report after which the deadman counts as released, µs: the heartbeat timeout of a robot.
const UNSEEN_US: u64 = 250_000;

/// The gamepad that the operator uses.
#[derive(Debug)]
pub struct Gamepad {
    standard: Standard,
    /// The gamepad with its mapping, and its name; none before the first is seen.
    pad: Option<(Pad, String)>,
    seen_us: u64,
}

impl Gamepad {
    /// A gamepad that was not seen yet, so that its deadman is not held.
    pub fn new(now_us: u64, operator: &mut Operator) -> Self {
        operator.want(now_us, Intent::Deadman(Deadman::Released(LetGo::Pause)));
        Self { standard: Standard::default(), pad: None, seen_us: now_us }
    }

    /// Requests that result from the states which the page has seen since the last call; possibly none.
    pub fn wishes(&mut self, now_us: u64, seen: Vec<Seen>) -> Vec<Wish> {
        let mut wishes = Vec::new();
        if !seen.is_empty() {
            self.seen_us = now_us;
        } else if now_us.saturating_sub(self.seen_us) >= UNSEEN_US {
            wishes = self.gone(now_us, "the page has not looked at it for 0.25 s");
        }
        for seen in seen {
            wishes.extend(match seen {
                Seen::There(snapshot) => self.there(now_us, &snapshot),
                Seen::Gone { gone } => self.gone(now_us, &gone),
            });
        }
        if let Some((pad, _)) = &mut self.pad {
            wishes.extend(pad.tick(now_us));
        }
        wishes
    }

    fn there(&mut self, now_us: u64, snapshot: &Snapshot) -> Vec<Wish> {
        let another = self.pad.as_ref().is_none_or(|(_, id)| *id != snapshot.id);
        let mut wishes =
            if another { self.gone(now_us, "another one is there") } else { Vec::new() };
        if another {
            let pad =
                mapping(&snapshot.id).map(|mapping| Pad::new(mapping).arming_after(ARM_HOLD_US));
            self.pad = pad.map(|pad| (pad, snapshot.id.clone()));
        }
        let north = self.pad.as_ref().map_or(North::Top, |(pad, _)| pad.north());
        for event in self.standard.events(north, snapshot) {
            if let Some((pad, _)) = &mut self.pad {
                wishes.extend(pad.on_event(now_us, event));
            }
        }
        wishes
    }

    fn gone(&mut self, now_us: u64, why: &str) -> Vec<Wish> {
        match (self.standard.gone(why), &mut self.pad) {
            (Some(event), Some((pad, _))) => pad.on_event(now_us, event),
            _ => Vec::new(),
        }
    }

    /// The gamepad in a few words.
    pub fn words(&self) -> String {
        match &self.pad {
            Some((pad, _)) => pad.words(),
            None => "no gamepad yet: press one of its buttons".to_owned(),
        }
    }
}

/// The mapping for a gamepad. To a browser all standard gamepads have the same buttons, so that one which no mapping is made for
/// has those of the first.
fn mapping(id: &str) -> Option<Mapping> {
    shipped_for(id).or_else(|| {
        let (path, text) = shipped().next()?;
        Mapping::from_toml(path, text).ok()
    })
}
