//! What the operator is told, with times: the last of it is kept.

use std::collections::VecDeque;

/// So many messages are kept.
const KEPT: usize = 200;

/// How much a message matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// Something went as it should.
    Note,
    /// A wish was not fulfilled.
    Refused,
    /// Something is wrong.
    Warning,
}

/// A message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// When, µs.
    pub at_us: u64,
    /// How much it matters.
    pub weight: Weight,
    /// What is said.
    pub text: String,
}

/// The last messages, oldest first.
#[derive(Clone, Debug, Default)]
pub struct Log(VecDeque<Message>);

impl Log {
    /// Says something.
    pub fn say(&mut self, at_us: u64, weight: Weight, text: impl Into<String>) {
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        self.0.push_back(Message { at_us, weight, text: text.into() });
    }

    /// All that is kept, oldest first.
    pub fn messages(&self) -> &VecDeque<Message> {
        &self.0
    }
}
