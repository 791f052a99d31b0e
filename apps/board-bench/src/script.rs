//! Script of a scenario for the memory of the emulated board: every step with the answer of the firmware in this process.

use crate::empty_queues::EmptyQueues;
use rollwalk_bus::link::LinkError;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::tunnel::{Answer, Request, Step, StepResult};
use rollwalk_sim_host::core::Core;

/// Steps of a controller with their expected answers.
#[derive(Clone, Default)]
pub struct Script {
    steps: Vec<(Step, StepResult)>,
}

impl Script {
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Number of frames that the controller sends.
    pub fn frames(&self) -> usize {
        let frames = |stepped: &StepResult| {
            stepped.link.iter().chain(stepped.actuators.iter().flatten()).count()
        };
        self.steps.iter().map(|(_, stepped)| frames(stepped)).sum()
    }

    /// Expected answer to a step, counted from 1.
    pub fn expected(&self, step: usize) -> Option<&StepResult> {
        self.steps.get(step.checked_sub(1)?).map(|(_, stepped)| stepped)
    }

    /// Encodes the script for the memory of the board.
    ///
    /// The first four bytes are the length of the rest in bytes (`u32`, little-endian). Request and answer of each step follow in
    /// their UART encoding.
    ///
    /// # Errors
    /// Returns an error if a step does not fit into a packet.
    pub fn encode(&self) -> Result<Vec<u8>, String> {
        let mut bytes = vec![0; 4];
        for (number, &(step, stepped)) in self.steps.iter().enumerate() {
            let sequence = number as u8;
            let request = Request::Step(step).encode(sequence);
            let answer = Answer::Stepped(stepped).encode(sequence);
            let (Some(request), Some(answer)) = (request, answer) else {
                return Err(format!("step {} cannot be encoded: {step:?}", number + 1));
            };
            bytes.extend(request);
            bytes.extend(answer);
        }
        let length = u32::try_from(bytes.len() - 4).map_err(|_| "the script is too long")?;
        bytes[..4].copy_from_slice(&length.to_le_bytes());
        Ok(bytes)
    }

    /// Returns the number of a step halfway through, and a copy of the script with one bit flipped in an expected frame of this
    /// step.
    pub fn corrupted(&self) -> Option<(usize, Self)> {
        let mut script = self.clone();
        let after = script.steps.iter_mut().enumerate().skip(self.len() / 2);
        let mut frames = after.flat_map(|(index, (_, stepped))| {
            stepped.actuators.iter_mut().flatten().map(move |frame| (index + 1, frame))
        });
        let (number, frame) = frames.find(|(_, frame)| !frame.data().is_empty())?;
        let mut data = frame.data().to_vec();
        *data.last_mut()? ^= 1;
        *frame = Frame::new(frame.id(), &data)?;
        Some((number, script))
    }
}

/// Controller whose steps are recorded.
pub struct Recording<C> {
    core: C,
    quiet: EmptyQueues,
    script: Script,
}

impl<C> Recording<C> {
    /// Records the steps of a controller that has just been switched on.
    pub fn new(core: C) -> Self {
        Self { core, quiet: EmptyQueues::default(), script: Script::default() }
    }

    /// Script of the steps so far.
    pub fn script(&self) -> &Script {
        &self.script
    }
}

impl<C: Core> Core for Recording<C> {
    fn step(&mut self, step: Step) -> Result<StepResult, LinkError> {
        let stepped = self.core.step(step)?;
        match self.quiet.answer(&step) {
            None => {
                self.quiet.after(&step, &stepped);
                self.script.steps.push((step, stepped));
            }
            Some(expected) if expected == stepped => {}
            Some(expected) => {
                let why = format!(
                    "the board skips step {step:?}, so that {expected:?} was expected, but the \
                    firmware answered {stepped:?}"
                );
                return Err(LinkError::Down(why));
            }
        }
        Ok(stepped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::tunnel::{Buses, Deframer, Input};

    /// Sends one frame on actuator bus 0 after every tick.
    struct FramePerTick(Option<Frame>);

    impl Core for FramePerTick {
        fn step(&mut self, step: Step) -> Result<StepResult, LinkError> {
            if step.input.is_some() {
                self.0 = Frame::standard(0x101, &[step.now_us as u8, 2]);
            }
            let mut stepped = StepResult::default();
            if step.free.actuator(0) {
                stepped.actuators[0] = self.0.take();
            }
            Ok(stepped)
        }
    }

    fn recorded() -> Script {
        let mut recording = Recording::new(FramePerTick(None));
        let free = Buses::default().with_actuator(0);
        for now_us in 0..4 {
            // The tick takes the frame. The second step finds nothing, and the third step is not made.
            for input in [Some(Input::Tick), None, None] {
                recording.step(Step { now_us, input, free }).unwrap();
            }
        }
        recording.script().clone()
    }

    #[test]
    fn steps_are_recorded_as_the_uart_would_carry_them() {
        let script = recorded();
        assert_eq!((script.len(), script.frames()), (8, 4));
        let bytes = script.encode().unwrap();
        assert_eq!(bytes[..4], (bytes.len() as u32 - 4).to_le_bytes());
        let mut deframer = Deframer::default();
        let packets: Vec<_> =
            bytes[4..].iter().filter_map(|&byte| deframer.push(byte).map(<[u8]>::to_vec)).collect();
        assert_eq!(packets.len(), 16);
        for (number, packet) in packets.chunks(2).enumerate() {
            let (step, stepped) = script.steps[number];
            assert_eq!(Request::decode(&packet[0]), Some((number as u8, Request::Step(step))));
            assert_eq!(Answer::decode(&packet[1]), Some((number as u8, Answer::Stepped(stepped))));
        }
    }

    #[test]
    fn a_corrupted_script_differs_in_one_bit_of_one_frame() {
        let script = recorded();
        let (number, corrupted) = script.corrupted().unwrap();
        let (right, wrong) =
            (script.expected(number).unwrap(), corrupted.expected(number).unwrap());
        let data = |stepped: &StepResult| stepped.actuators[0].unwrap().data().to_vec();
        assert_eq!((data(right), data(wrong)), (vec![2, 2], vec![2, 3]));
        assert_eq!(number, 5);
        let same = (1..=8).filter(|&n| script.expected(n) == corrupted.expected(n)).count();
        assert_eq!(same, 7);
    }

    #[test]
    fn a_controller_that_sends_without_an_input_is_refused() {
        let mut recording = Recording::new(FramePerTick(None));
        let step = Step { now_us: 0, input: None, free: Buses::default().with_actuator(0) };
        recording.step(step).unwrap();
        recording.core.0 = Frame::standard(1, &[]);
        assert!(recording.step(step).is_err());
    }
}
