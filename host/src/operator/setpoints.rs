//! Set-points of a host on their way to the controller, of one of two kinds: [streamed](Stream) ahead of time, or answers to
//! samples.
//!
//! Calls that belong to the kind not in use have no effect.

use crate::stream::{Stream, Target};
use crate::tracking::{Answer, Measurements, Samples};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::{Node, Sample};
use std::collections::VecDeque;

/// Number of samples kept for a program that was delayed. It covers the controller's timeout for an answer.
const SAMPLES_KEPT: usize = 256;

/// Set-points of a host.
#[derive(Clone, Debug)]
pub enum Setpoints {
    /// Set-points sent ahead of time.
    Streamed(Stream),
    /// Answers to samples.
    Answers(Loop),
}

/// Control loop that is closed over the link.
#[derive(Clone, Debug, Default)]
pub struct Loop {
    samples: Samples,
    /// Samples that were not taken yet, oldest first.
    waiting: VecDeque<Measurements>,
    answer: Answer,
    /// Rate of samples, Hz; `None` until the controller has acknowledged it.
    rate_hz: Option<u16>,
}

impl Loop {
    /// Creates a loop without samples yet, at a rate that the controller has acknowledged.
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

    /// Number of streamed frames that the controller has not taken yet.
    pub fn ahead(&self) -> usize {
        if let Self::Streamed(stream) = self { stream.ahead() } else { 0 }
    }

    /// Processes the number of frames in a STATUS of the state Streaming.
    pub fn on_status(&mut self, frame: u16) {
        if let Self::Streamed(stream) = self {
            stream.on_status(frame);
        }
    }

    /// Adds a measurement to the current batch.
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

    /// Removes and returns the oldest sample that was not taken yet.
    pub fn take_sample(&mut self) -> Option<Measurements> {
        if let Self::Answers(of) = self { of.waiting.pop_front() } else { None }
    }

    /// Answers a sample. Drops an unfinished answer to an older sample.
    pub fn answer(&mut self, number: u64, stiff: bool, targets: Vec<Target>) {
        if let Self::Answers(of) = self {
            of.answer = Answer::new(number, stiff, targets);
        }
    }

    /// Rate of samples that the controller has acknowledged, Hz, and number of samples that did not arrive.
    pub fn sampled(&self) -> Option<(u16, u64)> {
        match self {
            Self::Answers(of) => of.rate_hz.map(|rate_hz| (rate_hz, of.samples.lost())),
            Self::Streamed(_) => None,
        }
    }

    /// Returns the next message.
    pub fn poll(&mut self, to: Node) -> Option<Frame> {
        match self {
            Self::Streamed(stream) => stream.poll(to),
            Self::Answers(of) => of.answer.poll(to),
        }
    }
}
