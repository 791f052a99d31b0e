//! Processing of the controller's frames: status, faults, measurements, identity and outcomes of commands.

use super::log::Weight;
use super::orders::{CompletedOrder, Order, OrderOutcome};
use super::setpoints::{Loop, Setpoints};
use super::{ExitStage, HELLO_US, Operator, has_torque};
use crate::authentication::NoSession;
use crate::client::{Client, Incoming};
use crate::refusal::session_refusal;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::library::RATE_HZ;
use rollwalk_protocol::wire::transport::{Hello, Response};
use rollwalk_protocol::wire::{CommandAck, PROTOCOL_MAJOR, SCHEMA_HASH, State};

impl Operator {
    /// Processes a frame of the link.
    pub fn on_frame(&mut self, now_us: u64, frame: &Frame) {
        let was_stopping = self.client.is_stopping();
        match self.client.on_frame(now_us, frame) {
            Some(Incoming::Status(status)) => {
                self.link.on_status(now_us, status, &mut self.log);
                if status.state == State::EStopped {
                    self.stopped();
                }
                self.ends_stream &= matches!(status.state, State::Streaming | State::Aligning);
                if status.state == State::Streaming {
                    self.setpoints.on_status(status.frame);
                }
                let library = self.hello.and_then(|hello| hello.library);
                if library.map_or(0, |library| library as u8) != status.library {
                    // The library has changed since HELLO.
                    self.hello = None;
                }
                // Without a fault the next state is Disarmed.
                let passing = status.state == State::TorqueOff && status.faults.is_empty();
                if self.leaving == ExitStage::WhenHome && !has_torque(status.state) && !passing {
                    self.leaving = ExitStage::Now;
                }
            }
            Some(Incoming::Fault(report)) => self.link.on_fault(now_us, report, &mut self.log),
            Some(Incoming::Joint(joint)) => {
                self.link.on_joint(now_us, joint);
                self.setpoints.on_measurement(|samples| samples.on_joint(joint));
            }
            Some(Incoming::Readings(readings)) => self.link.on_readings(now_us, readings),
            Some(Incoming::Gyro(gyro)) => {
                self.setpoints.on_measurement(|samples| samples.on_gyro(gyro))
            }
            Some(Incoming::Accelerometer(accelerometer)) => {
                self.setpoints.on_measurement(|samples| samples.on_accelerometer(accelerometer));
            }
            Some(Incoming::Sample(sample)) => self.setpoints.on_sample(sample),
            Some(Incoming::EstopAck(ack)) => {
                self.stopped();
                self.link.on_stopped(ack.state);
                self.warn_unstopped_us = None;
                // The controller acknowledges every repetition.
                if was_stopping {
                    self.log.notify(now_us, Weight::Note, "the emergency stop is acknowledged");
                }
            }
            Some(Incoming::Ack(ack)) => {
                if let Some(ended) = self.orders.on_ack(now_us, ack, &mut self.client) {
                    self.end(now_us, ended);
                }
            }
            Some(Incoming::Response(Response::Hello(hello))) => self.on_hello(now_us, hello),
            Some(Incoming::Restarted) => {
                self.log.notify(now_us, Weight::Warning, "the controller has restarted");
                // The controller may have lost its library, or be another controller.
                self.hello = None;
                self.ask_hello_us = now_us;
                self.break_off_flashing(now_us);
                self.forget_orders();
            }
            Some(Incoming::Session(begun)) => self.on_session(now_us, begun),
            Some(Incoming::Response(response)) => self.on_transfer_answer(now_us, response),
            Some(Incoming::SessionLost | Incoming::TransportFailed(_)) => {
                self.on_transfer_lost(now_us);
            }
            Some(Incoming::Alive | Incoming::Parameter(_)) | None => {}
        }
    }

    fn on_session(&mut self, now_us: u64, begun: Result<(), NoSession>) {
        let before = std::mem::replace(&mut self.no_session, begun.err());
        if let Some(why) = self.no_session.filter(|why| before != Some(*why)) {
            let text = format!("controller {} {}", self.peer.node.number(), session_refusal(why));
            self.log.notify(now_us, Weight::Warning, text);
        }
    }

    pub(super) fn on_hello(&mut self, now_us: u64, hello: Hello) {
        self.hello = Some(hello);
        self.ask_hello_us = now_us + HELLO_US;
        self.check_flashed(now_us, hello.library);
        if let Some(why) = self.mismatch() {
            self.log.notify(now_us, Weight::Warning, why);
            self.forget_orders();
        }
        let visiting = (hello.major, hello.schema_hash) != (PROTOCOL_MAJOR, SCHEMA_HASH);
        if visiting != self.visiting {
            self.visiting = visiting;
            let stopping = self.client.is_stopping();
            if let Some(own) = &mut self.peer.credentials {
                // Beyond all nonces of the previous client.
                own.nonce = own.nonce.wrapping_add(1 << 32);
            }
            self.client = if visiting {
                Client::visitor(self.peer.node)
            } else {
                Client::new(self.peer.clone())
            };
            if stopping {
                self.client.estop(now_us);
            }
        }
    }

    /// Reports the outcome of an order.
    pub(super) fn end(&mut self, now_us: u64, ended: CompletedOrder) {
        let CompletedOrder { order, outcome, intent_number } = ended;
        let words = order.words(self.catalog.as_ref());
        let (weight, text) = match outcome {
            OrderOutcome::Done(ack) => {
                let text = self.done(order, ack);
                (Weight::Note, text)
            }
            OrderOutcome::Refused(why) => {
                (Weight::Refused, format!("the controller refused to {words}: {why}"))
            }
            OrderOutcome::Unanswered => {
                (Weight::Warning, format!("no answer to the command to {words}; try again"))
            }
            OrderOutcome::Unsent => {
                (Weight::Warning, format!("the command to {words} was not sent: no contact"))
            }
        };
        if let Some(intent_number) = intent_number {
            self.log.answer(now_us, intent_number, weight, text);
        }
    }

    fn done(&mut self, order: Order, ack: CommandAck) -> String {
        match order {
            Order::Play { code, speed_64ths, .. } => {
                self.asked = Some((code, speed_64ths));
                let begins_s = f64::from(ack.value) / f64::from(RATE_HZ);
                let words = order.words(self.catalog.as_ref());
                return format!("{words}: begins in {begins_s:.1} s");
            }
            Order::Arm => self.latch = self.latch.armed(),
            Order::Clear => self.latch = self.latch.cleared(),
            Order::Return | Order::Disarm => self.asked = None,
            Order::Track(_) => {
                // Earlier samples of a tracked robot have other numbers.
                self.setpoints = Setpoints::Answers(Loop::acknowledged(ack.value));
            }
            Order::Pause | Order::Resume | Order::Stream => {}
        }
        let words = match order {
            Order::Arm => "armed: the robot moves to SAFE",
            Order::Clear => "cleared: arm the robot after its self-test",
            Order::Return => "the robot returns to SAFE",
            Order::Disarm => "the robot returns to SAFE, then torque is switched off",
            Order::Pause => "the robot halts",
            Order::Stream => "the robot follows streamed setpoints",
            Order::Track(_) => "the robot follows setpoints in closed loop",
            _ => "the robot resumes the motion",
        };
        words.to_owned()
    }
}
