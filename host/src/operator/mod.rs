//! Somebody at a console or gamepad, without either: wishes, frames and the time go in, frames and what to show
//! come out. Nothing here blocks.
//!
//! Keeps the heartbeat going, so whoever polls an [`Operator`] is the robot's host. One command is on its way at
//! a time, repeated with the same number until it is answered or too old; of several motions that are asked for
//! the newest counts. What calms the robot does not wait for what moves it, and an emergency stop waits for
//! nothing.
//!
//! Three things bar motion whatever is wished: after an emergency stop, ours or not, both a wish to clear and a
//! wish to arm; a deadman that is not held; and a controller of another protocol or robot. While the deadman is
//! not held it is not one order that stops the robot but a condition: as long as the robot says that it moves it
//! is told not to. And nobody knows whether what is told gets through while nothing is heard: without contact
//! and without the deadman, or leaving, no heartbeat goes out, and the robot goes home by itself.

mod heard;
mod intent;
mod log;
mod orders;
mod rules;
#[cfg(test)]
mod tests;
mod view;

pub use intent::{Deadman, Intent, LetGo};
pub use log::{Message, Weight};
pub use view::{FaultView, JointView, Leaving, LinkView, View};

use crate::catalog::Catalog;
use crate::client::{Client, Incoming, Outgoing};
use crate::describe;
use heard::Heard;
use log::Log;
use orders::{Ended, Order, Orders, Outcome};
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::library::RATE_HZ;
use rollwalk_protocol::wire::transport::{Hello, Request, Response};
use rollwalk_protocol::wire::{
    CommandAck, Node, PROTOCOL_MAJOR, PROTOCOL_MINOR, SCHEMA_HASH, State,
};
use rules::Latch;

/// The controller is asked who it is so often until it says so, µs.
const HELLO_US: u64 = 500_000;
/// A robot that moves without the deadman is told to pause so often, µs, ...
const PAUSE_US: u64 = 100_000;
/// ... and one that is to go home so often, µs.
const HOME_US: u64 = 1_000_000;
/// While a loop plays another speed is asked for at most so often, µs.
const SPEED_US: u64 = 200_000;
/// Time is looked at so often, µs.
const TICK_US: u64 = 20_000;
/// 64ths of the planned speed that are all of it.
const FULL_SPEED: i8 = 64;

/// The operator of one controller.
#[derive(Clone, Debug)]
pub struct Operator {
    client: Client,
    node: Node,
    /// Hash of the configuration that the controller must have, if any will not do.
    config_hash: Option<u32>,
    catalog: Option<Catalog>,
    orders: Orders,
    heard: Heard,
    log: Log,
    hello: Option<Hello>,
    ask_hello_us: u64,
    latch: Latch,
    deadman: Option<Deadman>,
    leaving: Leaving,
    speed_64ths: i8,
    /// The motion that was asked for last, and at which speed.
    asked: Option<(u8, i8)>,
    /// Nothing is ordered without a wish before this instant, µs.
    unasked_us: u64,
    bus_lost: Option<String>,
    /// What the bus says is wrong with it.
    complaint: Option<String>,
    /// The controller speaks another protocol: no heartbeat goes out, no command, only HELLO and the stop.
    visiting: bool,
    /// No heartbeat goes out until the controller is heard again.
    silent: bool,
    /// A frame that the bus did not take.
    unsent: Option<CanFrame>,
}

impl Operator {
    /// An operator who has not heard from the controller yet. With `config_hash` only that robot is armed.
    pub fn new(node: Node, config_hash: Option<u32>) -> Self {
        Self {
            client: Client::new(node),
            node,
            config_hash,
            catalog: None,
            orders: Orders::default(),
            heard: Heard::default(),
            log: Log::default(),
            hello: None,
            ask_hello_us: 0,
            latch: Latch::Open,
            deadman: None,
            leaving: Leaving::No,
            speed_64ths: FULL_SPEED,
            asked: None,
            unasked_us: 0,
            bus_lost: None,
            complaint: None,
            visiting: false,
            silent: false,
            unsent: None,
        }
    }

    /// Names of the controller's library, for messages; which of its motions are loops.
    pub fn set_catalog(&mut self, catalog: Option<Catalog>) {
        self.catalog = catalog;
    }

    /// Who the controller says it is.
    pub fn hello(&self) -> Option<&Hello> {
        self.hello.as_ref()
    }

    /// Says something to the operator.
    pub fn say(&mut self, now_us: u64, weight: Weight, text: impl Into<String>) {
        self.log.say(now_us, weight, text);
    }

    /// The bus is gone, and why. An emergency stop that is not acknowledged goes out when it is back.
    pub fn on_bus_lost(&mut self, now_us: u64, why: &str) {
        if self.bus_lost.replace(why.to_owned()).is_none() {
            self.log.say(now_us, Weight::Warning, format!("the bus is lost: {why}"));
        }
        self.complaint = None;
        self.heard.lose_contact();
        self.forget_orders();
    }

    /// The bus is back.
    pub fn on_bus_back(&mut self, now_us: u64) {
        if self.bus_lost.take().is_some() {
            self.log.say(now_us, Weight::Note, "the bus is back");
        }
        self.client.reset_transport();
        self.hello = None;
        self.ask_hello_us = 0;
    }

    /// What is wrong with a bus that is not lost, and what would help; `None` while nothing is known to be.
    pub fn on_complaint(&mut self, now_us: u64, complaint: Option<String>) {
        // Damaged frames are counted in it.
        let kind = |complaint: &Option<String>| {
            complaint.as_deref().map(|text| text.replace(|c: char| c.is_ascii_digit(), ""))
        };
        if kind(&self.complaint) != kind(&complaint) {
            match &complaint {
                Some(why) => self.log.say(now_us, Weight::Warning, why),
                None => {
                    self.log.say(now_us, Weight::Note, "nothing is wrong with the bus any more")
                }
            }
        }
        self.complaint = complaint;
    }

    /// Takes a frame of the link.
    pub fn on_frame(&mut self, now_us: u64, frame: &CanFrame) {
        match self.client.on_frame(now_us, frame) {
            Some(Incoming::Status(status)) => {
                self.heard.on_status(now_us, status, &mut self.log);
                if status.state == State::EStopped {
                    self.stopped();
                }
                let library = self.hello.and_then(|hello| hello.library);
                if library.map_or(0, |library| library as u8) != status.library {
                    // It has another one than it said.
                    self.hello = None;
                }
                // Without a fault it goes on from there to Disarmed.
                let passing = status.state == State::TorqueOff && status.faults.is_empty();
                if self.leaving == Leaving::WhenHome && !has_torque(status.state) && !passing {
                    self.leaving = Leaving::Now;
                }
            }
            Some(Incoming::Fault(report)) => self.heard.on_fault(now_us, report, &mut self.log),
            Some(Incoming::Joint(joint)) => self.heard.on_joint(now_us, joint),
            Some(Incoming::EstopAck(_)) => {
                self.stopped();
                self.log.say(now_us, Weight::Note, "the emergency stop is acknowledged");
            }
            Some(Incoming::Ack(ack)) => {
                if let Some(ended) = self.orders.on_ack(now_us, ack, &mut self.client) {
                    self.end(now_us, ended);
                }
            }
            Some(Incoming::Response(Response::Hello(hello))) => self.on_hello(now_us, hello),
            Some(
                Incoming::Alive
                | Incoming::Parameter(_)
                | Incoming::TransportFailed(_)
                | Incoming::Response(_),
            )
            | None => {}
        }
    }

    /// What to send now; call again until `None`. After a wish or a frame there may be something at once.
    pub fn poll(&mut self, now_us: u64) -> Option<CanFrame> {
        self.watch_silence(now_us);
        if let Some(frame) = self.unsent.take() {
            return Some(frame);
        }
        if self.heard.watch(now_us, &mut self.log) {
            // When it is heard again it may be another one.
            self.hello = None;
        }
        if self.bus_lost.is_none() {
            self.ask_hello(now_us);
            if !self.visiting
                && self.orders.current().is_none()
                && now_us >= self.unasked_us
                && let Some((order, again_us)) = self.unasked(now_us)
            {
                self.unasked_us = now_us + again_us;
                if order.calms() {
                    self.asked = None;
                }
                self.orders.give(now_us, order, true, &mut self.client);
            }
        }
        while let Some(ended) = self.orders.poll(now_us, &mut self.client) {
            self.end(now_us, ended);
        }
        loop {
            match self.client.poll(now_us)? {
                Outgoing::Frame(frame) => return Some(frame),
                // It is asked again.
                Outgoing::TransportFailed(_) => {}
            }
        }
    }

    /// The bus did not take the last frame of [`poll`](Self::poll), which gives it once more unless
    /// something comes between that calms or stops the robot.
    pub fn not_sent(&mut self, frame: CanFrame) {
        self.unsent = Some(frame);
    }

    /// When [`poll`](Self::poll) has something to do next, at the latest.
    pub fn next_poll_us(&self, now_us: u64) -> u64 {
        let next_us = self.client.next_poll_us(now_us).min(self.orders.next_us());
        next_us.min(now_us + TICK_US)
    }

    /// What there is to show.
    pub fn view(&self, now_us: u64) -> View {
        let status = self.heard.status();
        let advice = match status {
            Some(status) => describe::advice(status.state, status.faults),
            None => "wait: the controller was not heard yet",
        };
        View {
            now_us,
            node: self.node.number(),
            link: self.heard.link(now_us, &self.client),
            bus_lost: self.bus_lost.clone(),
            complaint: self.complaint.clone(),
            hello: self.hello,
            stranger: self.stranger(),
            status,
            faults: self.heard.faults(now_us),
            advice,
            joints: self.heard.joints(now_us),
            speed_64ths: self.speed_64ths,
            asked: self.asked,
            asking: self.orders.current().map(|order| order.words(self.catalog.as_ref())),
            stopping: self.client.is_stopping(),
            deadman_held: self.deadman.map(|deadman| deadman == Deadman::Held),
            leaving: self.leaving,
            messages: self.log.messages().clone(),
        }
    }

    /// Part of the planned speed that motions are asked for at, in 64ths.
    pub fn speed_64ths(&self) -> i8 {
        self.speed_64ths
    }

    /// Whether the operator is leaving.
    pub fn leaving(&self) -> Leaving {
        self.leaving
    }

    /// A robot that is to halt, and of which nothing is heard, may not hear us either, or hear nothing but us. It
    /// halts for certain when it hears no heartbeat. Holding the deadman again does not change that: only a sign
    /// of life does.
    fn watch_silence(&mut self, now_us: u64) {
        if self.heard.in_contact(now_us) {
            self.silent = false;
        } else if self.leaving != Leaving::No || matches!(self.deadman, Some(Deadman::Released(_)))
        {
            if !self.silent {
                // It may be a heartbeat. Afterwards none is made, and what waits then may be a stop.
                self.unsent = None;
                if self.heard.state().is_some_and(has_torque) {
                    let text = "no heartbeats any more: an armed robot returns to SAFE by itself";
                    self.log.say(now_us, Weight::Warning, text);
                }
            }
            self.silent = true;
        }
        self.client.set_silent(self.silent);
    }

    fn ask_hello(&mut self, now_us: u64) {
        // A board with several ports tells how it is where it was spoken to last: a host that sends no heartbeats
        // has to say something else to be told.
        let may_ask = self.silent || self.heard.in_contact(now_us);
        if self.hello.is_some() || now_us < self.ask_hello_us || !may_ask {
            return;
        }
        self.ask_hello_us = now_us + HELLO_US;
        self.client.reset_transport();
        let request = Request::Hello { major: PROTOCOL_MAJOR, minor: PROTOCOL_MINOR };
        // Nothing else is on its way, and what does not get through is asked again.
        let _ = self.client.request(&request);
    }

    fn on_hello(&mut self, now_us: u64, hello: Hello) {
        self.hello = Some(hello);
        self.ask_hello_us = now_us + HELLO_US;
        if let Some(why) = self.stranger() {
            self.log.say(now_us, Weight::Warning, why);
            self.forget_orders();
        }
        let visiting = (hello.major, hello.schema_hash) != (PROTOCOL_MAJOR, SCHEMA_HASH);
        if visiting != self.visiting {
            self.visiting = visiting;
            let stopping = self.client.is_stopping();
            let made = if visiting { Client::visitor } else { Client::new };
            self.client = made(self.node);
            if stopping {
                self.client.estop(now_us);
            }
        }
    }

    /// No order is on its way or waits any more, also none that the bus has not taken.
    fn forget_orders(&mut self) {
        self.orders.forget(&mut self.client);
        self.unsent = None;
    }

    /// No order that moves the robot is on its way or waits any more. What the bus has not taken may be one; whatever
    /// else it is will be made again.
    fn drop_moving(&mut self) {
        self.orders.drop_moving(&mut self.client);
        self.unsent = None;
    }

    /// What has become of an order.
    fn end(&mut self, now_us: u64, ended: Ended) {
        let Ended { order, outcome, quiet } = ended;
        let words = order.words(self.catalog.as_ref());
        let (weight, text) = match outcome {
            Outcome::Done(ack) => {
                let text = self.done(order, ack);
                (Weight::Note, text)
            }
            Outcome::Refused(why) => {
                (Weight::Refused, format!("the controller refused to {words}: {why}"))
            }
            Outcome::Unanswered => {
                (Weight::Warning, format!("no answer to the command to {words}: try again"))
            }
            Outcome::Unsent => (Weight::Warning, format!("not sent, no contact: to {words}")),
        };
        if !quiet {
            self.log.say(now_us, weight, text);
        }
    }

    fn done(&mut self, order: Order, ack: CommandAck) -> String {
        match order {
            Order::Play { code, speed_64ths } => {
                self.asked = Some((code, speed_64ths));
                let begins_s = f64::from(ack.value) / f64::from(RATE_HZ);
                let words = order.words(self.catalog.as_ref());
                return format!("to {words}: begins in {begins_s:.1} s");
            }
            Order::Arm => self.latch = self.latch.armed(),
            Order::Clear => self.latch = self.latch.cleared(),
            Order::Return | Order::Disarm => self.asked = None,
            Order::Pause | Order::Resume => {}
        }
        let words = match order {
            Order::Arm => "armed: it goes to SAFE",
            Order::Clear => "cleared: it tests itself, then it can be armed",
            Order::Return => "it returns to SAFE",
            Order::Disarm => "it returns to SAFE, then torque goes off",
            Order::Pause => "it halts where it is",
            _ => "it goes on",
        };
        words.to_owned()
    }

    /// What is to be ordered without a wish, and after how long again.
    fn unasked(&self, now_us: u64) -> Option<(Order, u64)> {
        if !self.heard.in_contact(now_us) {
            return None;
        }
        let status = self.heard.status()?;
        if self.leaving == Leaving::WhenHome {
            let coming =
                matches!(status.state, State::Returning | State::Damped | State::TorqueOff);
            return (!coming).then_some((Order::Disarm, HOME_US));
        }
        if let Some(Deadman::Released(let_go)) = self.deadman {
            return match (status.state, let_go) {
                (State::Aligning, _) | (State::Playing, LetGo::Disarm) => {
                    Some((Order::Disarm, HOME_US))
                }
                (State::Playing, LetGo::Pause) => Some((Order::Pause, PAUSE_US)),
                (State::Playing, LetGo::Return) => Some((Order::Return, HOME_US)),
                _ => None,
            };
        }
        // A loop changes its speed while it plays; what ends would be played once more.
        let (code, speed_64ths) = self.asked?;
        let catalog = self.catalog.as_ref()?;
        let clip = status.clip.map(usize::from)?;
        let motion = catalog.motions.get(clip)?;
        let changes = status.state == State::Playing
            && self.latch == Latch::Open
            && motion.looping
            && motion.code == Some(code)
            && speed_64ths != self.speed_64ths;
        changes.then_some((Order::Play { code, speed_64ths: self.speed_64ths }, SPEED_US))
    }
}

fn has_torque(state: State) -> bool {
    match state {
        State::Boot | State::SelfTest | State::Disarmed | State::TorqueOff | State::EStopped => {
            false
        }
        State::Aligning
        | State::Ready
        | State::Playing
        | State::Paused
        | State::Returning
        | State::Damped => true,
    }
}
