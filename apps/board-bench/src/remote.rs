//! Controller on a real or emulated board at the other end of a serial line.
//!
//! The board only answers requests ([`rollwalk_protocol::tunnel`]). Its time stops while the host computes, so that runs are
//! reproducible.

use crate::empty_queues::EmptyQueues;
use rollwalk_bus::link::LinkError;
use rollwalk_protocol::tunnel::{Answer, Deframer, Figures, Hello, Request, Step, StepResult};
use rollwalk_sim_host::core::Core;
use std::io::{Read, Write};

pub struct Remote<T> {
    line: T,
    deframer: Deframer,
    sequence: u8,
    steps: u64,
    quiet: EmptyQueues,
}

impl<T: Read + Write> Remote<T> {
    /// Connects to the board at the other end and requests its identity. The line needs a read timeout.
    ///
    /// # Errors
    /// Returns an error if the line fails, or if the answer is not the identity of a board with this protocol.
    pub fn connect(line: T) -> Result<(Self, Hello), LinkError> {
        let mut remote = Self {
            line,
            deframer: Deframer::default(),
            sequence: 0,
            steps: 0,
            quiet: EmptyQueues::default(),
        };
        match remote.ask(Request::Hello)? {
            Answer::Hello(hello) => Ok((remote, hello)),
            other => Err(unexpected_answer(&other)),
        }
    }

    /// Number of steps that were sent over the line.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Requests the run time and stack usage of the steps.
    ///
    /// # Errors
    /// Returns an error if the line fails, or if the board sends another answer.
    pub fn figures(&mut self) -> Result<Figures, LinkError> {
        match self.ask(Request::Figures)? {
            Answer::Figures(figures) => Ok(figures),
            other => Err(unexpected_answer(&other)),
        }
    }

    fn ask(&mut self, request: Request) -> Result<Answer, LinkError> {
        let down = |error: std::io::Error| LinkError::Down(format!("serial line: {error}"));
        self.sequence = self.sequence.wrapping_add(1);
        let question = request.encode(self.sequence);
        let question = question.ok_or_else(|| {
            LinkError::Down(format!(
                "the request {request:?} cannot be \
                encoded"
            ))
        })?;
        self.line.write_all(&question).map_err(down)?;
        self.line.flush().map_err(down)?;
        loop {
            let mut bytes = [0; 256];
            let count = self.line.read(&mut bytes).map_err(down)?;
            if count == 0 {
                return Err(LinkError::Down("serial line: the board closed the connection".into()));
            }
            for &byte in &bytes[..count] {
                let packet = self.deframer.push(byte);
                if let Some((sequence, answer)) = packet.and_then(Answer::decode)
                    && sequence == self.sequence
                {
                    return Ok(answer);
                }
            }
        }
    }
}

impl<T: Read + Write> Core for Remote<T> {
    fn step(&mut self, step: Step) -> Result<StepResult, LinkError> {
        if let Some(stepped) = self.quiet.answer(&step) {
            return Ok(stepped);
        }
        let stepped = match self.ask(Request::Step(step))? {
            Answer::Stepped(stepped) => stepped,
            other => return Err(unexpected_answer(&other)),
        };
        self.steps += 1;
        self.quiet.after(&step, &stepped);
        Ok(stepped)
    }
}

fn unexpected_answer(answer: &Answer) -> LinkError {
    LinkError::Down(format!("the board answered another request: {answer:?}"))
}
