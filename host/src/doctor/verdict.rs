//! Verdict of a diagnosis: the state of the robot, and the next command. Every finding that prevents arming decides on it.

use super::{Finding, Gravity, LinkKeyCheck, Observations, finding};
use crate::describe::state_words;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_protocol::wire::{State, Status, Torque};

impl Observations<'_> {
    /// State of the robot and the next command. `is_blocked` is true if another finding prevents arming.
    pub(super) fn state(&self, status: &Status, hello: &Hello, is_blocked: bool) -> Finding {
        let bus = self.bus;
        let clip = status.clip.map(|clip| self.clip(clip)).unwrap_or_default();
        let clip = if clip.is_empty() { clip } else { format!(" ({clip})") };
        // The words name only a fault that stopped the robot. All other faults have findings of their own.
        let words = state_words(status, self.actuators());
        let what = format!("the robot is {words}{clip}");
        let faulty = !status.faults.is_empty();
        // A host that sends no heartbeats has a finding of its own, with the next command.
        let is_held = self.is_held(status);
        let (gravity, help) = match status.state {
            State::Disarmed if hello.library.is_none() => (
                Gravity::Wrong,
                format!("flash a library: rollwalk flash LIB.rwl --robot ROBOT.toml --bus {bus}"),
            ),
            State::Disarmed if is_blocked || faulty => (
                Gravity::Note,
                "it cannot be armed: remove the causes listed here, then run doctor again".into(),
            ),
            State::Disarmed if self.has_host => {
                (Gravity::Fine, "arm the robot in the program that is its host".into())
            }
            State::Disarmed => (Gravity::Fine, format!("arm the robot: {}", self.arm_command())),
            State::EStopped => {
                let help = "remove the cause, then type rollwalk clear --bus";
                (Gravity::Wrong, format!("{help} {bus}"))
            }
            State::TorqueOff if faulty => (
                Gravity::Wrong,
                format!("remove the causes below, then type rollwalk clear --bus {bus}"),
            ),
            State::Damped if faulty => (Gravity::Wrong, self.wait_then_clear()),
            State::Damped | State::TorqueOff => (
                Gravity::Note,
                "run doctor again in a few seconds: the robot will be disarmed then".into(),
            ),
            State::Boot | State::SelfTest if faulty => (
                Gravity::Wrong,
                "correct the configuration of the firmware: rollwalk robot check".into(),
            ),
            State::Boot | State::SelfTest => {
                (Gravity::Fine, "run doctor again in a few seconds".into())
            }
            _ if !is_held => (Gravity::Note, String::new()),
            State::Returning if faulty => (Gravity::Wrong, self.wait_then_clear()),
            State::Aligning | State::Returning => {
                (Gravity::Fine, "wait: the robot moves to SAFE".into())
            }
            State::Ready => (
                Gravity::Fine,
                format!(
                    "play a motion: rollwalk send MOTION --bus {bus}; or switch torque off: \
                     rollwalk disarm --bus {bus}"
                ),
            ),
            State::Playing => (
                Gravity::Fine,
                format!(
                    "pause: rollwalk pause --bus {bus}; return to SAFE: rollwalk return --bus {bus}"
                ),
            ),
            State::Paused => (
                Gravity::Fine,
                format!(
                    "resume: rollwalk resume --bus {bus}; return to SAFE: rollwalk return --bus \
                     {bus}"
                ),
            ),
            State::Streaming => {
                (Gravity::Fine, format!("return to SAFE: rollwalk return --bus {bus}"))
            }
        };
        finding(gravity, what, help)
    }

    /// Command that arms the robot.
    fn arm_command(&self) -> String {
        let key = match self.key {
            LinkKeyCheck::Accepted | LinkKeyCheck::Missing => " --link-key FILE",
            _ => "",
        };
        format!("rollwalk send --arm MOTION{key} --bus {}", self.bus)
    }

    fn wait_then_clear(&self) -> String {
        format!("wait until torque is off, then type rollwalk clear --bus {}", self.bus)
    }

    /// True if a host keeps the robot armed. Heartbeats of a host that was lost meanwhile do not count.
    fn is_held(&self, status: &Status) -> bool {
        self.has_host && !status.faults.contains(Fault::HostLost)
    }

    /// Finding about a robot with torque whose host is gone.
    pub(super) fn host(&self, status: &Status) -> Option<Finding> {
        (status.state.torque() == Torque::Driven && !self.is_held(status)).then(|| {
            let what = if status.state == State::Returning {
                "no host sends heartbeats: the robot returns to SAFE and switches torque off"
            } else {
                "no host sends heartbeats: the robot will return to SAFE and switch torque off"
            };
            finding(Gravity::Wrong, what.into(), self.wait_then_clear())
        })
    }
}
