//! Command queue: one command in flight, repeated until it is answered or expires, and one waiting.

use crate::catalog::Catalog;
use crate::client::{ACK_TIMEOUT_US, COMMAND_LIFE_US, Client, SEQUENCE_TRIES};
use crate::refusal::command_refusal_in;
use crate::tracking::Tracking;
use rollwalk_protocol::library::PlaceCode;
use rollwalk_protocol::wire::{Action, Command, CommandAck, CommandResult};

/// Timeout of a waiting order, µs.
const WAIT_US: u64 = 1_000_000;

/// Command of the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    Play {
        code: u8,
        speed_64ths: i8,
        /// Place at which the operator has confirmed that the robot stands.
        place: Option<PlaceCode>,
    },
    Pause,
    Resume,
    Return,
    Disarm,
    /// Switches torque on, in two steps: request and confirmation.
    Arm,
    /// Clears a latched stop, in two steps: request and confirmation.
    Clear,
    /// Follows streamed set-points.
    Stream,
    /// Sends measurements and follows set-points that answer them.
    Track(Tracking),
}

impl Order {
    fn first_step(self) -> Action {
        match self {
            Order::Play { code, speed_64ths, place } => Action::play(place, code, speed_64ths),
            Order::Pause => Action::Pause,
            Order::Resume => Action::Resume,
            Order::Return => Action::Return,
            Order::Disarm => Action::Disarm,
            Order::Arm => Action::ArmRequest,
            Order::Clear => Action::ClearRequest,
            Order::Stream => Action::Stream,
            Order::Track(tracking) => tracking.action(),
        }
    }

    /// True if the order can start motion.
    pub fn moves(self) -> bool {
        matches!(
            self,
            Order::Play { .. } | Order::Resume | Order::Arm | Order::Stream | Order::Track(_)
        )
    }

    /// True if the order stops motion, and so pre-empts commands that start it.
    pub fn stops(self) -> bool {
        matches!(self, Order::Pause | Order::Return | Order::Disarm)
    }

    /// Description for messages, as an infinitive without "to".
    pub fn words(self, catalog: Option<&Catalog>) -> String {
        let words = match self {
            Order::Play { code, .. } => {
                let motion = catalog
                    .and_then(|catalog| catalog.motions.iter().find(|m| m.code == Some(code)));
                return motion
                    .map_or_else(|| format!("play code {code}"), |m| format!("play {}", m.name));
            }
            Order::Pause => "pause",
            Order::Resume => "resume",
            Order::Return => "return to SAFE",
            Order::Disarm => "disarm",
            Order::Arm => "arm",
            Order::Clear => "clear the stop",
            Order::Stream => "follow streamed setpoints",
            Order::Track(_) => "follow setpoints in closed loop",
        };
        words.to_owned()
    }
}

/// Command in flight.
#[derive(Clone, Copy, Debug)]
struct Flight {
    order: Order,
    command: Command,
    /// True for the second of two steps.
    confirming: bool,
    intent_number: Option<u64>,
    numbers: u32,
    next_us: u64,
    until_us: u64,
}

impl Flight {
    /// First command of an order, due at once.
    fn begin(now_us: u64, order: Order, intent_number: Option<u64>, command: Command) -> Self {
        let until_us = now_us + COMMAND_LIFE_US;
        let (confirming, numbers, next_us) = (false, 1, now_us);
        Self { order, command, confirming, intent_number, numbers, next_us, until_us }
    }
}

/// Order that waits for the one in flight.
#[derive(Clone, Copy, Debug)]
struct WaitingOrder {
    order: Order,
    intent_number: Option<u64>,
    until_us: u64,
}

/// Completed order.
#[derive(Clone, Debug, PartialEq)]
pub struct CompletedOrder {
    pub order: Order,
    pub outcome: OrderOutcome,
    /// Number of the intent; `None` for an automatic order, whose outcome is not reported.
    pub intent_number: Option<u64>,
}

/// Outcome of an order.
#[derive(Clone, Debug, PartialEq)]
pub enum OrderOutcome {
    Done(CommandAck),
    Refused(String),
    Unanswered,
    /// Order that could not be sent in time.
    Unsent,
}

/// Refusal of an order because a stopping order waits.
#[derive(Clone, Copy, Debug)]
pub struct StopPending;

/// Orders in flight and waiting.
#[derive(Clone, Debug, Default)]
pub struct Orders {
    flight: Option<Flight>,
    waiting: Option<WaitingOrder>,
}

impl Orders {
    /// Order in flight, or otherwise the waiting one.
    pub fn current(&self) -> Option<Order> {
        let waiting = self.waiting.map(|waiting| waiting.order);
        self.flight.map(|flight| flight.order).or(waiting)
    }

    /// Time of the next repetition, µs.
    pub fn next_us(&self) -> u64 {
        self.flight.map_or(u64::MAX, |flight| flight.next_us)
    }

    /// True if the order of this intent is in flight or waiting.
    pub fn has(&self, intent_number: u64) -> bool {
        let intent_numbers = [
            self.flight.and_then(|of| of.intent_number),
            self.waiting.and_then(|of| of.intent_number),
        ];
        intent_numbers.contains(&Some(intent_number))
    }

    /// Queues an order in place of the waiting one. A stopping order also withdraws a motion command in flight.
    ///
    /// # Errors
    /// Returns an error if a stopping order waits, which only another stopping order may replace.
    pub fn give(
        &mut self,
        now_us: u64,
        order: Order,
        intent_number: Option<u64>,
        client: &mut Client,
    ) -> Result<(), StopPending> {
        if order.stops() {
            self.drop_moving(client);
        } else if self.waiting.is_some_and(|waiting| waiting.order.stops()) {
            return Err(StopPending);
        }
        self.waiting = Some(WaitingOrder { order, intent_number, until_us: now_us + WAIT_US });
        Ok(())
    }

    /// Drops the orders in flight and waiting.
    pub fn forget(&mut self, client: &mut Client) {
        *self = Self::default();
        client.withdraw_command();
    }

    /// Drops motion orders in flight and waiting.
    pub fn drop_moving(&mut self, client: &mut Client) {
        if self.flight.is_some_and(|flight| flight.order.moves()) {
            self.flight = None;
            client.withdraw_command();
        }
        self.waiting = self.waiting.filter(|waiting| !waiting.order.moves());
    }

    /// Sends the command that is due. Returns an order that has timed out.
    pub fn poll(&mut self, now_us: u64, client: &mut Client) -> Option<CompletedOrder> {
        if let Some(flight) = self.flight.filter(|flight| now_us >= flight.until_us) {
            self.flight = None;
            client.withdraw_command();
            let Flight { order, intent_number, .. } = flight;
            return Some(CompletedOrder {
                order,
                outcome: OrderOutcome::Unanswered,
                intent_number,
            });
        }
        if let Some(waiting) = self.waiting.filter(|waiting| now_us >= waiting.until_us) {
            self.waiting = None;
            let WaitingOrder { order, intent_number, .. } = waiting;
            return Some(CompletedOrder { order, outcome: OrderOutcome::Unsent, intent_number });
        }
        if self.flight.is_none()
            && let Some(WaitingOrder { order, intent_number, .. }) = self.waiting
            && now_us >= client.next_command_us()
            && let Some(command) = client.command(now_us, order.first_step())
        {
            self.waiting = None;
            self.flight = Some(Flight::begin(now_us, order, intent_number, command));
        }
        if let Some(flight) = &mut self.flight
            && now_us >= flight.next_us
        {
            flight.next_us = now_us + ACK_TIMEOUT_US;
            client.send_command(flight.command);
        }
        None
    }

    /// Processes an answer. Returns the order that it completes.
    pub fn on_ack(
        &mut self,
        now_us: u64,
        ack: CommandAck,
        client: &mut Client,
    ) -> Option<CompletedOrder> {
        let flight = self.flight.take_if(|flight| {
            (ack.seq, ack.kind) == (flight.command.seq, flight.command.action.kind())
        })?;
        client.withdraw_command();
        let Flight { order, intent_number, .. } = flight;
        let next = match (ack.result, order) {
            (CommandResult::Ok, Order::Arm) if !flight.confirming => {
                Some((Action::ArmConfirm { nonce: ack.value }, true, 1))
            }
            (CommandResult::Ok, Order::Clear) if !flight.confirming => {
                Some((Action::ClearConfirm { nonce: ack.value }, true, 1))
            }
            // The controller has not executed it: it is sent again with the next sequence number.
            (CommandResult::OutOfOrder, _) if flight.numbers < SEQUENCE_TRIES => {
                Some((flight.command.action, flight.confirming, flight.numbers + 1))
            }
            _ => None,
        };
        if let Some((action, confirming, numbers)) = next
            && let Some(command) = client.command(now_us, action)
        {
            let begun = Flight::begin(now_us, order, intent_number, command);
            self.flight = Some(Flight { confirming, numbers, ..begun });
            return None;
        }
        let outcome = match ack.result {
            CommandResult::Ok => OrderOutcome::Done(ack),
            result => {
                OrderOutcome::Refused(command_refusal_in(result, Some(ack.state), None, None))
            }
        };
        Some(CompletedOrder { order, outcome, intent_number })
    }
}
