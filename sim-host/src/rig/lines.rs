//! Delivery of packets at the ends of serial lines, and answers of the servos.

use super::{Core, LinkError, Rig};
use crate::interface::{Interface, PacketEntry};
use crate::line::{CrossedPacket, LineSender};
use crate::wire::ActuatorLine;

impl<C: Core> Rig<C> {
    /// Handles the next event of a serial line. Bytes are passed to the controller, or to the servos, which begin to answer.
    pub(super) fn handle_line_event(&mut self, number: u8) -> Result<(), LinkError> {
        let Some(ActuatorLine { line, is_cut, .. }) = self.lines.get_mut(&number) else {
            return Ok(());
        };
        let Some(CrossedPacket { at, from, bytes }) = line.advance(self.now) else { return Ok(()) };
        let (interface, from_controller) =
            (Interface::Actuator(number), from == LineSender::Controller);
        self.packets.push(PacketEntry {
            at_us: at.as_us(),
            interface,
            from_controller,
            bytes: bytes.clone(),
        });
        if *is_cut {
            Ok(())
        } else if from_controller {
            self.reach_servos_of_line(number, &bytes);
            Ok(())
        } else {
            self.controller.on_serial(at.as_us(), number, &bytes)
        }
    }

    fn reach_servos_of_line(&mut self, number: u8, bytes: &[u8]) {
        let now = self.now;
        let Some(ActuatorLine { line, channels, received, .. }) = self.lines.get_mut(&number)
        else {
            return;
        };
        let Some(&first) = channels.first() else { return };
        received.extend(bytes);
        while let Some(packet) = self.body.take_packet(first, received) {
            let mut answers = Vec::new();
            for &channel in channels.iter() {
                if self.faults.on(now).any(|kind| kind.silences(channel)) {
                    self.faults.fire(now, |kind| kind.silences(channel));
                    continue;
                }
                let (setpoint, answer) = self.body.on_packet(channel, now, &packet);
                if let Some(value) = setpoint {
                    self.recorder.on_setpoint(channel, value);
                }
                answers.extend(answer.map(|answer| (channel, answer)));
            }
            line.answer(now, answers);
        }
    }
}
