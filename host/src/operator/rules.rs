//! Interlocks, which decide on the intents that become orders.

use super::log::Weight;
use super::orders::{Order, StopPending};
use super::setpoints::{Loop, Setpoints};
use super::view::ExitStage;
use super::{Deadman, Intent, Operator, ReleaseReaction, UNSTOPPED_US, has_torque};
use crate::stream::Stream;
use rollwalk_protocol::library::{PlaceCode, place_of};
use rollwalk_protocol::wire::{PROTOCOL_MAJOR, PROTOCOL_MINOR, SCHEMA_HASH, State};
use std::ops::RangeInclusive;

/// Interlock after an emergency stop or a failed bus: the operator must clear and arm before anything moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Latch {
    /// Motion is permitted.
    Open,
    /// Stopped, and not cleared yet.
    Stopped,
    /// Cleared, and not armed yet.
    Cleared,
}

impl Latch {
    pub(super) fn cleared(self) -> Self {
        if self == Latch::Stopped { Latch::Cleared } else { self }
    }

    pub(super) fn armed(self) -> Self {
        if self == Latch::Cleared { Latch::Open } else { self }
    }
}

/// Time after a request for a motion with a place in which the same request confirms the place, µs. Keys that are held repeat
/// sooner.
const CONFIRMS_US: RangeInclusive<u64> = 1_000_000..=10_000_000;

impl Operator {
    /// Processes an intent.
    pub fn request(&mut self, now_us: u64, intent: Intent) {
        self.latest_intent += 1;
        if !matches!(intent, Intent::Play { .. } | Intent::Speed { .. } | Intent::Deadman(_)) {
            self.asked_at_place = None;
        }
        match intent {
            Intent::Estop => self.estop(now_us),
            Intent::Speed { sixty_fourths } => self.speed_64ths = sixty_fourths.clamp(1, 64),
            Intent::Deadman(deadman) => self.on_deadman(now_us, deadman),
            Intent::Quit => self.quit(now_us),
            Intent::Play { code } => {
                let speed_64ths = self.speed_64ths;
                match self.confirmed_place(now_us, code) {
                    Ok(place) => self.order(now_us, Order::Play { code, speed_64ths, place }),
                    Err(why) => {
                        self.refuse(now_us, Order::Play { code, speed_64ths, place: None }, &why);
                    }
                }
            }
            Intent::PauseOrResume => {
                let paused = self.link.state() == Some(State::Paused);
                self.order(now_us, if paused { Order::Resume } else { Order::Pause });
            }
            Intent::Pause => self.order(now_us, Order::Pause),
            Intent::Return => self.order(now_us, Order::Return),
            Intent::Disarm => self.order(now_us, Order::Disarm),
            Intent::Arm => self.order(now_us, Order::Arm),
            Intent::Clear => self.order(now_us, Order::Clear),
            Intent::Stream => self.order(now_us, Order::Stream),
            Intent::Track(tracking) => self.order(now_us, Order::Track(tracking)),
        }
    }

    /// Reason why this host must not arm the controller.
    pub(super) fn mismatch(&self) -> Option<String> {
        let hello = self.hello?;
        if (hello.major, hello.schema_hash) != (PROTOCOL_MAJOR, SCHEMA_HASH) {
            return Some(format!(
                "the controller uses protocol {}.{} (schema {:08x}), this host \
                 {PROTOCOL_MAJOR}.{PROTOCOL_MINOR} (schema {SCHEMA_HASH:08x}): build both from the \
                 same release",
                hello.major, hello.minor, hello.schema_hash
            ));
        }
        let ours = self.config_hash.filter(|&ours| ours != hello.config_hash)?;
        Some(format!(
            "the controller is for another robot (configuration {:08x}, the robot file has \
             {ours:08x}): give the robot file and library of the controller",
            hello.config_hash
        ))
    }

    /// Handles an emergency stop that this host or another node has sent.
    pub(super) fn stopped(&mut self) {
        if self.latch != Latch::Stopped {
            self.latch = Latch::Stopped;
            self.asked = None;
            // A pending CLEAR is dropped too: it was meant for an earlier stop.
            self.forget_orders();
        }
    }

    fn estop(&mut self, now_us: u64) {
        self.latch = Latch::Stopped;
        self.asked = None;
        self.forget_orders();
        // Repeated presses give one message.
        if !self.client.is_stopping() {
            self.log.notify(now_us, Weight::Warning, "EMERGENCY STOP");
            self.warn_unstopped_us = Some(now_us + UNSTOPPED_US);
        }
        self.client.estop(now_us);
        self.warn_unstopped(now_us);
    }

    fn on_deadman(&mut self, now_us: u64, deadman: Deadman) {
        if self.deadman == Some(deadman) {
            return;
        }
        self.deadman = Some(deadman);
        if let Deadman::Released(_) = deadman {
            self.drop_moving();
            self.automatic_us = now_us;
        }
        if matches!(self.link.state(), Some(State::Playing | State::Aligning | State::Paused)) {
            let held = deadman == Deadman::Held;
            let text = if held { "the deadman is held" } else { "the deadman was released" };
            self.log.notify(now_us, Weight::Note, text);
        }
    }

    fn quit(&mut self, now_us: u64) {
        let torque = self.link.state().is_some_and(has_torque);
        self.leaving = match self.leaving {
            ExitStage::No if torque && !self.visiting => {
                self.forget_orders();
                self.automatic_us = now_us;
                let text = if self.link.in_contact(now_us) && self.bus_lost.is_none() {
                    "quitting: the robot returns to SAFE, then torque is switched off"
                } else {
                    "no contact with the controller: quit again to end at once"
                };
                self.log.notify(now_us, Weight::Note, text);
                ExitStage::WhenHome
            }
            _ => ExitStage::Now,
        };
    }

    fn order(&mut self, now_us: u64, order: Order) {
        match self.permit(order) {
            Ok(()) => {
                let intent_number = Some(self.latest_intent);
                if let Err(StopPending) =
                    self.orders.give(now_us, order, intent_number, &mut self.client)
                {
                    let why = "a stop command is sent first; try again";
                    return self.refuse(now_us, order, why);
                }
                self.automatic_us = self.automatic_us.max(now_us);
                if order.stops() {
                    self.drop_moving();
                }
                // Supersedes the previous motion, even if that is unanswered.
                if matches!(order, Order::Play { .. } | Order::Return | Order::Disarm) {
                    self.asked = None;
                }
                self.ends_stream =
                    order == Order::Return && self.link.state() == Some(State::Streaming);
                if self.link.state() != Some(State::Streaming) {
                    match order {
                        Order::Stream => self.setpoints = Setpoints::Streamed(Stream::default()),
                        Order::Track(_) => self.setpoints = Setpoints::Answers(Loop::default()),
                        _ => {}
                    }
                }
            }
            Err(IntentRejection::Refused(why)) => self.refuse(now_us, order, &why),
            Err(IntentRejection::NeedsNothing(latch, why)) => {
                self.latch = latch;
                self.log.answer(now_us, self.latest_intent, Weight::Note, why);
            }
        }
    }

    /// Returns the place of a motion if the operator asks for the motion again, which confirms that the robot stands there.
    /// `None` for a motion without a place, and for a robot that no person watches.
    fn confirmed_place(&mut self, now_us: u64, code: u8) -> Result<Option<PlaceCode>, String> {
        let before = self.asked_at_place.take();
        let motions = self.catalog.iter().flat_map(|catalog| &catalog.motions);
        let motion = motions.into_iter().find(|motion| motion.code == Some(code));
        let Some(place) = motion.and_then(|motion| place_of(&motion.name)) else { return Ok(None) };
        if self.unwatched {
            return Ok(None);
        }
        let confirms = |(asked, at_us): (u8, u64)| {
            asked == code && CONFIRMS_US.contains(&now_us.saturating_sub(at_us))
        };
        if before.is_some_and(confirms) {
            return Ok(Some(PlaceCode::named(place)));
        }
        let why = format!(
            "the motion begins at `{place}`; if the robot stands there, request the motion again \
             after 1 to 10 s"
        );
        self.asked_at_place = Some((code, now_us));
        Err(why)
    }

    fn refuse(&mut self, now_us: u64, order: Order, why: &str) {
        let words = order.words(self.catalog.as_ref());
        let text = format!("the command to {words} was not sent: {why}");
        self.log.answer(now_us, self.latest_intent, Weight::Refused, text);
    }

    fn permit(&self, order: Order) -> Result<(), IntentRejection> {
        let refused = |why: &str| Err(IntentRejection::Refused(why.to_owned()));
        if let Some(why) = &self.bus_lost {
            return refused(&format!("the bus is lost ({why})"));
        }
        if self.unattended && order.moves() {
            return refused("the page or terminal does not respond");
        }
        if let Some(why) = self.mismatch()
            && (self.visiting || order.moves())
        {
            return refused(&why);
        }
        if self.leaving != ExitStage::No && order != Order::Disarm {
            return refused("this program is ending, and the robot returns to SAFE");
        }
        let state = self.link.state();
        match (order, self.latch) {
            (Order::Disarm, _) => return Ok(()),
            (Order::Clear, Latch::Stopped) => {
                if self.client.is_stopping() {
                    return refused("the emergency stop is not acknowledged yet");
                }
                let latched = matches!(state, Some(State::EStopped | State::TorqueOff) | None);
                if !latched {
                    let why = "there is no stop to clear; arm the robot";
                    return Err(IntentRejection::NeedsNothing(Latch::Cleared, why));
                }
                return Ok(());
            }
            (Order::Clear, _) => return Ok(()),
            (_, Latch::Stopped) => {
                return refused("the robot has stopped; clear the stop, then arm");
            }
            (Order::Arm, Latch::Cleared) if state.is_some_and(has_torque) => {
                return Err(IntentRejection::NeedsNothing(
                    Latch::Open,
                    "the robot is already armed",
                ));
            }
            (Order::Arm, _) | (_, Latch::Open) => {}
            (_, Latch::Cleared) => {
                return refused("the robot was not armed after the stop; arm it first");
            }
        }
        if order == Order::Arm && self.hello.is_none() {
            return refused("the controller has not reported its identity yet");
        }
        if let Some(Deadman::Released(let_go)) = self.deadman {
            // With another reaction configured, RETURN would move a paused robot.
            let home = order == Order::Return
                && (let_go == ReleaseReaction::Return || state == Some(State::Streaming));
            if order.moves() || order == Order::Return && !home {
                return refused("hold the deadman");
            }
        }
        Ok(())
    }
}

/// Reason why an intent does not become an order.
enum IntentRejection {
    /// Intent barred by an interlock, with the reason for the operator.
    Refused(String),
    /// Intent whose requested state is already reached, with the new latch and a message to the operator.
    NeedsNothing(Latch, &'static str),
}
