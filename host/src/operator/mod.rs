//! Core of an operator's console, without terminal, gamepad or bus.
//!
//! The caller passes intents, frames and the time, and receives frames and a [`View`]. No call blocks.
//!
//! An [`Operator`] sends heartbeats, so it is the robot's host while it is polled. A single command is in flight at a time. It
//! is repeated with the same number until it is answered or expires. A newer motion command replaces a waiting one. Stopping
//! commands pre-empt motion commands, a motion command cannot replace a waiting stopping command, and an emergency stop
//! pre-empts everything.
//!
//! [Set-points](Operator::stream) are sent while the controller is Streaming. The program that streams decides on the effect of
//! a released deadman: the stream can stop the robot on its feet, which a command cannot.
//!
//! Three interlocks bar motion:
//!
//! - an emergency stop, until the operator has cleared and armed
//! - a deadman that is not held
//! - a controller with another protocol or robot
//!
//! A released deadman is a condition, not a single command: while STATUS reports motion, stopping commands are repeated.
//!
//! Without contact, the operator cannot verify that commands arrive. A released deadman, leaving, or a host
//! [without a person](Operator::unwatched) then withholds heartbeats, and the robot returns to SAFE on the timeout.

mod flashing;
mod incoming;
mod intent;
mod link_status;
mod log;
mod orders;
mod rules;
mod setpoints;
#[cfg(test)]
mod tests;
mod view;

pub use intent::{Deadman, Intent, ReleaseReaction};
pub use log::{Message, Weight};
pub use view::{ExitStage, FaultView, JointView, LinkView, View};

use crate::actuators::Actuators;
use crate::authentication::{NoSession, Peer};
use crate::catalog::Catalog;
use crate::client::{Client, Outgoing};
use crate::describe::{self, LEFT_ALONE};
use crate::stream::{Stream, Target};
use crate::tracking::Measurements;
use flashing::Flashing;
use link_status::LinkStatus;
use log::Log;
use orders::{Order, Orders};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::transport::{Hello, Request};
use rollwalk_protocol::wire::{PROTOCOL_MAJOR, PROTOCOL_MINOR, State, Torque};
use rules::Latch;
use setpoints::Setpoints;

/// Interval between HELLO requests until the controller answers, µs.
const HELLO_US: u64 = 500_000;
/// Repetition interval of PAUSE while the deadman is released, µs.
const PAUSE_US: u64 = 100_000;
/// Repetition interval of RETURN and DISARM while the deadman is released or the operator leaves, µs.
const HOME_US: u64 = 1_000_000;
/// Shortest interval between speed changes while a loop plays, µs.
const SPEED_US: u64 = 200_000;
/// Longest interval between polls, µs.
const TICK_US: u64 = 20_000;
/// Delay before a frame that the bus refused is sent again, µs.
const BUSY_US: u64 = 500;
/// Time without an acknowledgement after which the operator is warned of an emergency stop, µs.
const UNSTOPPED_US: u64 = 500_000;
/// Warning of an emergency stop that the controller may not have received.
pub const NOT_STOPPED: &str =
    "the emergency stop is NOT acknowledged: press the robot's own emergency stop";
/// Planned speed in 64ths.
const FULL_SPEED: i8 = 64;

/// Operator of one controller.
#[derive(Clone, Debug)]
pub struct Operator {
    client: Client,
    peer: Peer,
    /// Reason why there is no authenticated session.
    no_session: Option<NoSession>,
    /// Required hash of the controller's configuration; `None` accepts any.
    config_hash: Option<u32>,
    catalog: Option<Catalog>,
    orders: Orders,
    latest_intent: u64,
    link: LinkStatus,
    log: Log,
    hello: Option<Hello>,
    ask_hello_us: u64,
    latch: Latch,
    /// Time at which the operator is warned of an unacknowledged emergency stop, µs.
    warn_unstopped_us: Option<u64>,
    deadman: Option<Deadman>,
    leaving: ExitStage,
    speed_64ths: i8,
    /// Code of a motion for a place that the operator asked for, and the time, µs. Asking again confirms the place.
    asked_at_place: Option<(u8, u64)>,
    /// Code and speed of the latest accepted motion command.
    asked: Option<(u8, i8)>,
    /// Earliest time of the next automatic command, µs.
    automatic_us: u64,
    bus_lost: Option<String>,
    /// Diagnosis of the bus adapter.
    complaint: Option<String>,
    /// True if the controller uses another protocol: only HELLO and ESTOP are sent.
    visiting: bool,
    /// True if heartbeats are withheld until a frame of the controller arrives.
    silent: bool,
    /// True if no operator is at the controls.
    unattended: bool,
    /// True if no person watches the robot.
    unwatched: bool,
    /// True for a program without keys and deadman, which is ended by Ctrl-C.
    scripted: bool,
    /// Frame that the bus refused.
    unsent: Option<Frame>,
    /// Transfer of a library in progress.
    flashing: Option<Flashing>,
    /// Set-points to send.
    setpoints: Setpoints,
    /// True from RETURN in [`State::Streaming`] until the robot is in SAFE.
    ends_stream: bool,
    /// Identity of the transferred library, until HELLO reports the active one.
    awaited: Option<u32>,
}

impl Operator {
    /// Creates an operator without contact yet. If `config_hash` is given, it only arms a robot with the given configuration.
    pub fn new(peer: impl Into<Peer>, config_hash: Option<u32>) -> Self {
        let peer = peer.into();
        Self {
            client: Client::new(peer.clone()),
            peer,
            no_session: None,
            config_hash,
            catalog: None,
            orders: Orders::default(),
            latest_intent: 0,
            link: LinkStatus::default(),
            log: Log::default(),
            hello: None,
            ask_hello_us: 0,
            latch: Latch::Open,
            warn_unstopped_us: None,
            deadman: None,
            leaving: ExitStage::No,
            speed_64ths: FULL_SPEED,
            asked_at_place: None,
            asked: None,
            automatic_us: 0,
            bus_lost: None,
            complaint: None,
            visiting: false,
            silent: false,
            unattended: false,
            unwatched: false,
            scripted: false,
            unsent: None,
            flashing: None,
            setpoints: Setpoints::Streamed(Stream::default()),
            ends_stream: false,
            awaited: None,
        }
    }

    /// Configures the operator for a robot that no person watches.
    ///
    /// When contact is lost with torque on, the operator withholds heartbeats until a frame of the controller arrives. The
    /// robot's state is then unknown, and commands may not reach it.
    #[must_use]
    pub fn unwatched(mut self) -> Self {
        self.unwatched = true;
        self
    }

    /// Configures the operator for a program without keys and gamepad, which is ended by Ctrl-C.
    #[must_use]
    pub fn scripted(mut self) -> Self {
        self.scripted = true;
        self
    }

    /// Advice on how a person at the robot can stop it when contact is lost; `None` if no person watches the robot.
    fn way_out(&self) -> Option<&'static str> {
        match self.deadman {
            _ if self.unwatched => None,
            _ if self.scripted => Some("end this program with Ctrl-C"),
            Some(Deadman::Held) => Some("release the deadman"),
            // Heartbeats are withheld already.
            Some(Deadman::Released(_)) => None,
            None => Some("quit"),
        }
    }

    /// Adds a frame with set-points of all channels to the stream.
    ///
    /// [`Intent::Stream`] begins a new stream. Its first frames are added after the intent, before the controller follows them.
    pub fn stream(&mut self, frame: Vec<Target>) {
        self.setpoints.push(frame);
    }

    /// Number of streamed frames that the controller has not taken yet.
    pub fn streamed_ahead(&self) -> usize {
        self.setpoints.ahead()
    }

    /// Removes and returns the oldest sample that was not taken yet. A controller sends samples after [`Intent::Track`].
    pub fn take_sample(&mut self) -> Option<Measurements> {
        self.setpoints.take_sample()
    }

    /// Answers a sample with set-points of all channels. Drops an unfinished answer to an older sample.
    pub fn answer(&mut self, number: u64, stiff: bool, targets: Vec<Target>) {
        self.setpoints.answer(number, stiff, targets);
    }

    /// Rate of samples that the controller has acknowledged, Hz, and number of samples that did not arrive.
    pub fn sampled(&self) -> Option<(u16, u64)> {
        self.setpoints.sampled()
    }

    /// Sets the catalog of the controller's library, with names for messages and the looping motions.
    pub fn set_catalog(&mut self, catalog: Option<Catalog>) {
        let actuators = catalog.as_ref().map(|catalog| catalog.actuators.clone());
        self.link.set_actuators(actuators.unwrap_or_default());
        self.catalog = catalog;
    }

    /// Sets the actuators of a robot whose library is unknown. Descriptions of faults depend on their buses.
    pub fn set_actuators(&mut self, actuators: Actuators) {
        self.link.set_actuators(actuators);
    }

    /// Identity of the controller.
    pub fn hello(&self) -> Option<&Hello> {
        self.hello.as_ref()
    }

    /// Sets the presence of an operator at the controls, for programs whose controls run separately from the link.
    ///
    /// Without an operator, heartbeats are withheld, so that an armed robot returns to SAFE on the timeout. Commands that
    /// move the robot are not sent.
    pub fn set_attended(&mut self, now_us: u64, attended: bool) {
        if self.unattended == attended {
            if attended {
                self.log.notify(now_us, Weight::Note, "the page or terminal responds again");
            } else {
                self.asked = None;
                self.drop_moving();
                let text = format!(
                    "the page or terminal does not respond, so this host sends no heartbeats, and {LEFT_ALONE}"
                );
                self.log.notify(now_us, Weight::Warning, text);
            }
        }
        self.unattended = !attended;
    }

    /// Shows a message to the operator.
    pub fn notify(&mut self, now_us: u64, weight: Weight, text: impl Into<String>) {
        self.log.notify(now_us, weight, text);
    }

    /// Handles the loss of the bus. An unacknowledged emergency stop is sent when the bus is back.
    pub fn on_bus_lost(&mut self, now_us: u64, why: &str) {
        if self.bus_lost.replace(why.to_owned()).is_none() {
            let alone = self.link.state().and_then(describe::alone);
            let alone = alone.map_or_else(String::new, |alone| format!("; {alone}"));
            self.log.notify(now_us, Weight::Warning, format!("the bus is lost: {why}{alone}"));
        }
        self.complaint = None;
        self.break_off_flashing(now_us);
        self.link.lose_contact();
        self.forget_orders();
        self.warn_unstopped(now_us);
    }

    /// Warns of an unacknowledged emergency stop when the warning is due, or at once if the bus is lost.
    fn warn_unstopped(&mut self, now_us: u64) {
        let is_due = |&mut at_us: &mut u64| now_us >= at_us || self.bus_lost.is_some();
        if self.warn_unstopped_us.take_if(is_due).is_some() {
            self.log.notify(now_us, Weight::Warning, NOT_STOPPED);
        }
    }

    /// Handles the return of the bus.
    pub fn on_bus_back(&mut self, now_us: u64) {
        if self.bus_lost.take().is_some() {
            self.log.notify(now_us, Weight::Note, "the bus is back");
        }
        self.client.reset_transport();
        self.hello = None;
        self.ask_hello_us = 0;
    }

    /// Processes a diagnosis of the bus with its remedy; `None` for a healthy bus.
    pub fn on_complaint(&mut self, now_us: u64, complaint: Option<String>) {
        // Counts of damaged frames change all the time.
        let kind = |complaint: &Option<String>| {
            complaint.as_deref().map(|text| text.replace(|c: char| c.is_ascii_digit(), ""))
        };
        if kind(&self.complaint) != kind(&complaint) {
            match &complaint {
                Some(why) => self.log.notify(now_us, Weight::Warning, why),
                None => self.log.notify(now_us, Weight::Note, "the bus has no errors any more"),
            }
        }
        self.complaint = complaint;
    }

    /// Returns the next frame to send at `now_us`. Call it until it returns `None`, also after an intent or a frame.
    pub fn poll(&mut self, now_us: u64) -> Option<Frame> {
        self.update_silence(now_us);
        self.warn_unstopped(now_us);
        if let Some(frame) = self.unsent.take() {
            return Some(frame);
        }
        let leave = self.way_out();
        if self.link.watch(now_us, leave, &mut self.log) {
            // After a loss of contact another controller may answer.
            self.hello = None;
        }
        if self.bus_lost.is_none() {
            self.ask_hello(now_us);
            self.poll_flashing(now_us);
            if !self.visiting
                && self.orders.current().is_none()
                && now_us >= self.automatic_us
                && let Some((order, again_us)) = self.automatic(now_us)
            {
                self.automatic_us = now_us + again_us;
                if order.stops() {
                    self.asked = None;
                }
                // No order is waiting that this order could not replace.
                let _ = self.orders.give(now_us, order, None, &mut self.client);
            }
        }
        while let Some(ended) = self.orders.poll(now_us, &mut self.client) {
            self.end(now_us, ended);
        }
        loop {
            match self.client.poll(now_us) {
                Some(Outgoing::Frame(frame)) => return Some(frame),
                // HELLO is repeated after a loss.
                Some(Outgoing::TransportFailed(_)) => self.on_transfer_lost(now_us),
                None => return self.poll_stream(now_us),
            }
        }
    }

    /// Next set-point, for a controller that follows set-points.
    fn poll_stream(&mut self, now_us: u64) -> Option<Frame> {
        let follows = self.link.state() == Some(State::Streaming) && self.link.in_contact(now_us);
        let stopped = self.latch != Latch::Open || self.client.is_stopping();
        let may =
            follows && !stopped && !self.visiting && !self.unattended && self.bus_lost.is_none();
        if may { self.setpoints.poll(self.peer.node) } else { None }
    }

    /// Takes back a frame that the bus refused. [`poll`](Self::poll) returns it again unless a stopping command comes first.
    pub fn not_sent(&mut self, frame: Frame) {
        self.unsent = Some(frame);
    }

    /// Latest time of the next [`poll`](Self::poll), µs.
    pub fn next_poll_us(&self, now_us: u64) -> u64 {
        // Other frames may wait behind a frame that the bus refused.
        if self.unsent.is_some() {
            return now_us + BUSY_US;
        }
        let next_us = self.client.next_poll_us(now_us).min(self.orders.next_us());
        next_us.min(now_us + TICK_US)
    }

    /// Snapshot of the state that a console shows.
    pub fn view(&self, now_us: u64) -> View {
        let status = self.link.status();
        let link = self.link.link(now_us, &self.client);
        let advice = match status {
            _ if self.client.is_stopping() => "press the robot's own emergency stop",
            Some(status) if !link.contact && has_torque(status.state) => {
                "press the robot's own emergency stop if it moves; check bus and power"
            }
            Some(_) if !link.contact => "wait, or check bus and power",
            Some(status) => describe::advice(status.state, status.faults, self.link.bus_kind()),
            None => "wait for the controller, or check bus and power",
        };
        View {
            now_us,
            node: self.peer.node.number(),
            link,
            bus_lost: self.bus_lost.clone(),
            complaint: self.complaint.clone(),
            hello: self.hello,
            mismatch: self.mismatch(),
            status,
            condition: self.link.condition(),
            faults: self.link.faults(now_us),
            advice,
            joints: self.link.joints(now_us),
            speed_64ths: self.speed_64ths,
            asked: self.asked,
            asking: self.orders.current().map(|order| order.words(self.catalog.as_ref())),
            stopping: self.client.is_stopping(),
            deadman_held: self.deadman.map(|deadman| deadman == Deadman::Held),
            leaving: self.leaving,
            transfer: self.flashing.as_ref().map(|flashing| flashing.transfer().progress()),
            messages: self.log.messages().clone(),
        }
    }

    /// Number of the latest intent. A message that [answers](Message::answers) an intent contains its number.
    pub fn latest_intent(&self) -> u64 {
        self.latest_intent
    }

    /// True if the command of this intent is in flight or waits to be sent. If it is false and no message answers the intent,
    /// the command was dropped.
    pub fn is_asking(&self, intent_number: u64) -> bool {
        self.orders.has(intent_number)
    }

    /// Commanded speed in 64ths of the planned speed.
    pub fn speed_64ths(&self) -> i8 {
        self.speed_64ths
    }

    /// Stage of the operator's exit.
    pub fn leaving(&self) -> ExitStage {
        self.leaving
    }

    /// Withholds heartbeats from a robot that must stop but whose frames do not arrive.
    ///
    /// Commands may not reach it, or only frames of the host may still arrive; without heartbeats it stops in either case.
    /// Holding the deadman again does not resume heartbeats. A frame of the controller does.
    fn update_silence(&mut self, now_us: u64) {
        if self.link.in_contact(now_us) {
            self.silent = false;
        } else if self.leaving != ExitStage::No
            || matches!(self.deadman, Some(Deadman::Released(_)))
            || self.unwatched && self.link.state().is_some_and(has_torque)
        {
            if !self.silent {
                // The refused frame may be a heartbeat. A frame that is refused later is not a heartbeat, and may be a stop.
                self.unsent = None;
                if self.link.state().is_some_and(has_torque) {
                    let text = format!("this host sends no heartbeats, and {LEFT_ALONE}");
                    self.log.notify(now_us, Weight::Warning, text);
                }
            }
            self.silent = true;
        }
        self.client.set_silent(self.silent || self.unattended);
    }

    fn ask_hello(&mut self, now_us: u64) {
        // A board with several ports sends STATUS to the port of the last frame it received: without heartbeats,
        // HELLO is that frame.
        let may_ask = self.silent || self.link.in_contact(now_us);
        // A request for a session would be lost.
        let waits = self.client.needs_session() && self.no_session.is_none();
        let has_asked = self.hello.is_some() || self.flashing.is_some();
        if has_asked || now_us < self.ask_hello_us || !may_ask || waits {
            return;
        }
        self.ask_hello_us = now_us + HELLO_US;
        self.client.reset_transport();
        let request = Request::Hello { major: PROTOCOL_MAJOR, minor: PROTOCOL_MINOR };
        // No other request is in flight, and a lost one is repeated.
        let _ = self.client.request(&request);
    }

    /// Drops all commands: in flight, waiting, or refused by the bus.
    fn forget_orders(&mut self) {
        self.orders.forget(&mut self.client);
        self.unsent = None;
    }

    /// Drops all commands that move the robot. Also drops the frame that the bus refused, which may be such a command; other
    /// frames are created again.
    fn drop_moving(&mut self) {
        self.orders.drop_moving(&mut self.client);
        self.unsent = None;
    }

    /// Command that the situation requires without an intent, and its repetition interval, µs.
    fn automatic(&self, now_us: u64) -> Option<(Order, u64)> {
        if !self.link.in_contact(now_us) {
            return None;
        }
        let status = self.link.status()?;
        if self.leaving == ExitStage::WhenHome {
            let coming =
                matches!(status.state, State::Returning | State::Damped | State::TorqueOff);
            return (!coming).then_some((Order::Disarm, HOME_US));
        }
        if let Some(Deadman::Released(let_go)) = self.deadman {
            return match (status.state, let_go) {
                // The robot moves from the end of a stream to SAFE, on all feet.
                (State::Aligning, _) if self.ends_stream => None,
                (State::Aligning, _) | (State::Playing, ReleaseReaction::Disarm) => {
                    Some((Order::Disarm, HOME_US))
                }
                (State::Playing, ReleaseReaction::Pause) => Some((Order::Pause, PAUSE_US)),
                (State::Playing, ReleaseReaction::Return) => Some((Order::Return, HOME_US)),
                _ => None,
            };
        }
        // Only a loop may change its speed while it plays. Any other motion would play once more.
        let (code, speed_64ths) = self.asked?;
        let catalog = self.catalog.as_ref()?;
        let clip = status.clip.map(usize::from)?;
        let motion = catalog.motions.get(clip)?;
        let changes = status.state == State::Playing
            && self.latch == Latch::Open
            && motion.looping
            && motion.code == Some(code)
            && speed_64ths != self.speed_64ths;
        let speed_64ths = self.speed_64ths;
        changes.then_some((Order::Play { code, speed_64ths, place: None }, SPEED_US))
    }
}

fn has_torque(state: State) -> bool {
    state.torque() != Torque::Off
}
