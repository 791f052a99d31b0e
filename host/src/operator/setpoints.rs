//! Setpoints of a host on their way to the controller, of one of two kinds: [streamed](Stream) ahead of time, or answers to samples.
//!
//! The other kind's frames and measurements change nothing.

use crate::stream::{Stream, Target};
use crate::tracking::{Answer, Measured, Samples};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::{Node, Sample};
use std::collections::VecDeque;

/// Samples that are kept for a program that was held up: what the controller waits for an answer at most, and more.
const SAMPLES_KEPT: usize = 256;

/// Setpoints of a host.
#[derive(Clone, Debug)]
pub enum Setpoints {
    /// Sent ahead of time.
    Streamed(Stream),
    /// Answers to samples.
    Answers(Loop),
}

/// A loop that is closed over the link.
#[derive(Clone, Debug, Default)]
pub struct Loop {
    samples: Samples,
    /// Samples that were not taken yet, the oldest first.
    waiting: VecDeque<Measured>,
    answer: Answer,
    /// Samples a second, once the controller has acknowledged them.
    rate_hz: Option<u16>,
}

impl Loop {
    /// Creates a loop at a rate that the controller has acknowledged, without samples yet.
    pub fn acknowledged(rate_hz: u16) -> Self {
        Self { rate_hz: Some(rate_hz), ..Self::default() }
    }
}

impl Setpoints {
    /// Adds a frame to the stream.
    pub fn push(&mut self, frame: Vec<Target>) {
        if let Self::Streamed(stream) = self {
            stream.push(frame);
        }
    }

    /// Frames of the stream that the controller has not taken yet.
    pub fn ahead(&self) -> usize {
        if let Self::Streamed(stream) = self { stream.ahead() } else { 0 }
    }

    /// Takes the count of frames in a STATUS of the state Streaming.
    pub fn on_status(&mut self, frame: u16) {
        if let Self::Streamed(stream) = self {
            stream.on_status(frame);
        }
    }

    /// Passes a measurement to the batch that it is a part of.
    pub fn on_measurement(&mut self, take: impl FnOnce(&mut Samples)) {
        if let Self::Answers(of) = self {
            take(&mut of.samples);
        }
    }

    /// Ends a batch.
    pub fn on_sample(&mut self, sample: Sample) {
        if let Self::Answers(of) = self
            && let Some(measured) = of.samples.on_sample(sample)
        {
            if of.waiting.len() == SAMPLES_KEPT {
                of.waiting.pop_front();
            }
            of.waiting.push_back(measured);
        }
    }

    /// Takes the oldest sample of those that were not taken yet.
    pub fn take_sample(&mut self) -> Option<Measured> {
        if let Self::Answers(of) = self { of.waiting.pop_front() } else { None }
    }

    /// Answers a sample. An answer to an older one that is not through is dropped.
    pub fn answer(&mut self, number: u64, stiff: bool, targets: Vec<Target>) {
        if let Self::Answers(of) = self {
            of.answer = Answer::new(number, stiff, targets);
        }
    }

    /// Samples a second that the controller has acknowledged, and how many of them did not arrive.
    pub fn sampled(&self) -> Option<(u16, u64)> {
        match self {
            Self::Answers(of) => of.rate_hz.map(|rate_hz| (rate_hz, of.samples.lost())),
            Self::Streamed(_) => None,
        }
    }

    /// The next message.
    pub fn poll(&mut self, to: Node) -> Option<Frame> {
        match self {
            Self::Streamed(stream) => stream.poll(to),
            Self::Answers(of) => of.answer.poll(to),
        }
    }
}
