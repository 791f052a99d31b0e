//! Messages to the operator, with times.

use std::collections::VecDeque;

/// Number of messages kept.
const KEPT: usize = 200;

/// Importance of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// Information.
    Note,
    /// A command was refused.
    Refused,
    /// Something is wrong.
    Warning,
}

/// A message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Time, µs.
    pub at_us: u64,
    /// Importance.
    pub weight: Weight,
    /// The message.
    pub text: String,
}

/// The last messages, oldest first.
#[derive(Clone, Debug, Default)]
pub struct Log(VecDeque<Message>);

impl Log {
    /// Adds a message.
    pub fn say(&mut self, at_us: u64, weight: Weight, text: impl Into<String>) {
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        self.0.push_back(Message { at_us, weight, text: text.into() });
    }

    /// The messages kept, oldest first.
    pub fn messages(&self) -> &VecDeque<Message> {
        &self.0
    }
}
