//! Messages to the operator, with their times.

use std::collections::VecDeque;

/// Maximum number of messages kept.
const KEPT: usize = 200;

/// Importance of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// Information.
    Note,
    /// Refused command.
    Refused,
    /// Problem with robot, link or host.
    Warning,
}

/// Message to the operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Sequence number of the message, counted from 1.
    pub number: u64,
    /// Time, µs.
    pub at_us: u64,
    /// Importance.
    pub weight: Weight,
    /// Text of the message.
    pub text: String,
    /// Number of the [intent](super::Operator::latest_intent) whose outcome the message reports. A [`Weight::Note`] reports
    /// success.
    pub answers: Option<u64>,
}

/// Latest messages, oldest first.
#[derive(Clone, Debug, Default)]
pub struct Log {
    kept: VecDeque<Message>,
    said: u64,
}

impl Log {
    /// Adds a message.
    pub fn notify(&mut self, at_us: u64, weight: Weight, text: impl Into<String>) {
        self.push(at_us, weight, text.into(), None);
    }

    /// Adds the outcome of an intent.
    pub fn answer(
        &mut self,
        at_us: u64,
        intent_number: u64,
        weight: Weight,
        text: impl Into<String>,
    ) {
        self.push(at_us, weight, text.into(), Some(intent_number));
    }

    fn push(&mut self, at_us: u64, weight: Weight, text: String, answers: Option<u64>) {
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.said += 1;
        self.kept.push_back(Message { number: self.said, at_us, weight, text, answers });
    }

    /// Messages kept, oldest first.
    pub fn messages(&self) -> &VecDeque<Message> {
        &self.kept
    }
}
