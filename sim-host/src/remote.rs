//! A controller on a board at the other end of a serial line, or of what an emulator makes of one.
//!
//! The board answers questions and does nothing by itself (docs: [`rollwalk_protocol::tunnel`]); so
//! time stands still for it while the host works, and a run is the same every time.

use crate::core::Core;
use rollwalk_bus::link::LinkError;
use rollwalk_protocol::tunnel::{Answer, Buses, Deframer, Figures, Hello, Request, Step, Stepped};
use std::io::{Read, Write};

/// A board.
pub struct Remote<T> {
    line: T,
    deframer: Deframer,
    sequence: u8,
    steps: u64,
    playing: Option<(u8, u16, f32)>,
    /// Buses for which it had nothing to send, and cannot have before it is told something.
    silent: Buses,
}

impl<T: Read + Write> Remote<T> {
    /// Asks the board at the other end who it is. A read that takes too long must fail: set a
    /// timeout.
    ///
    /// # Errors
    /// The line failed, or what answers is no board of this protocol.
    pub fn connect(line: T) -> Result<(Self, Hello), LinkError> {
        let mut remote = Self {
            line,
            deframer: Deframer::default(),
            sequence: 0,
            steps: 0,
            playing: None,
            silent: Buses::default(),
        };
        match remote.ask(Request::Hello)? {
            Answer::Hello(hello) => Ok((remote, hello)),
            other => Err(out_of_turn(&other)),
        }
    }

    /// What control periods cost the board so far, and its stack.
    ///
    /// # Errors
    /// The line failed, or the board answers something else.
    pub fn figures(&mut self) -> Result<Figures, LinkError> {
        match self.ask(Request::Figures)? {
            Answer::Figures(figures) => Ok(figures),
            other => Err(out_of_turn(&other)),
        }
    }

    /// Steps that crossed the line.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    fn ask(&mut self, request: Request) -> Result<Answer, LinkError> {
        let down = |error: std::io::Error| LinkError::Down(format!("serial line: {error}"));
        self.sequence = self.sequence.wrapping_add(1);
        let question = request.encode(self.sequence);
        let question =
            question.ok_or_else(|| LinkError::Down(format!("no packet for {request:?}")))?;
        self.line.write_all(&question).map_err(down)?;
        self.line.flush().map_err(down)?;
        loop {
            let mut bytes = [0; 256];
            let count = self.line.read(&mut bytes).map_err(down)?;
            if count == 0 {
                return Err(LinkError::Down("serial line: the board hung up".into()));
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
    fn step(&mut self, step: Step) -> Result<Stepped, LinkError> {
        // Whether a bus has something to send changes when something happens, not while it waits.
        if step.input.is_none() && step.free.without(self.silent).is_empty() {
            return Ok(Stepped { playing: self.playing, ..Stepped::default() });
        }
        let stepped = match self.ask(Request::Step(step))? {
            Answer::Stepped(stepped) => stepped,
            other => return Err(out_of_turn(&other)),
        };
        self.steps += 1;
        self.playing = stepped.playing;
        if step.input.is_some() {
            self.silent = Buses::default();
        }
        if step.free.link() && stepped.link.is_none() {
            self.silent = self.silent.with_link();
        }
        for (bus, frame) in (0..).zip(&stepped.actuators) {
            if step.free.actuator(bus) && frame.is_none() {
                self.silent = self.silent.with_actuator(bus);
            }
        }
        Ok(stepped)
    }
}

fn out_of_turn(answer: &Answer) -> LinkError {
    LinkError::Down(format!("the board answered {answer:?}, which was not asked"))
}
