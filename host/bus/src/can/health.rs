//! Health of a CAN interface: its error state from the driver's reports, and advice to the user.

use rollwalk_protocol::serial::BusState;
use socketcan::errors::{CanError, ControllerProblems, ErrorCause, Location, ViolationTypes};

/// Health of an interface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Health {
    state: BusState,
    /// Number of damaged frames since the interface was last reported healthy.
    damaged: u32,
}

impl Health {
    /// Error state.
    pub fn state(&self) -> BusState {
        self.state
    }

    /// Processes an error frame of the driver; returns true if the driver has emptied its transmit queue.
    pub fn report(&mut self, error: &CanError) -> bool {
        let mut emptied = false;
        for cause in error {
            match *cause {
                ErrorCause::BusOff => self.state = BusState::Off,
                ErrorCause::Restarted => {
                    *self = Self::default();
                    emptied = true;
                }
                ErrorCause::NoAck => self.no_acknowledgement(),
                ErrorCause::Protocol { location: Location::AckSlot, .. } => {
                    self.no_acknowledgement();
                }
                ErrorCause::Protocol { types, .. } => {
                    let damage = ViolationTypes::FORM
                        | ViolationTypes::STUFF
                        | ViolationTypes::BIT
                        | ViolationTypes::BIT0
                        | ViolationTypes::BIT1;
                    self.damaged += u32::from(types.intersects(damage));
                }
                ErrorCause::Controller(problems) => self.controller(problems),
                _ => {}
            }
        }
        emptied
    }

    /// Records that a frame has crossed the bus.
    pub fn works(&mut self) {
        if self.state == BusState::NotAcknowledged {
            self.state = BusState::Active;
        }
    }

    /// Records that no frame is transmitted, even if the driver reports no cause.
    pub fn stuck(&mut self) {
        self.no_acknowledgement();
    }

    fn no_acknowledgement(&mut self) {
        if self.state != BusState::Off {
            self.state = BusState::NotAcknowledged;
        }
    }

    fn controller(&mut self, problems: ControllerProblems) {
        let passive = ControllerProblems::TX_PASSIVE | ControllerProblems::RX_PASSIVE;
        if problems.contains(ControllerProblems::ACTIVE) {
            *self = Self::default();
        } else if problems.intersects(passive) && self.state == BusState::Active {
            // A sender without acknowledgement also becomes passive. The missing acknowledgement is the more specific report.
            self.state = BusState::Passive;
        }
    }

    /// Description of the fault, with the command that helps; `None` without a fault.
    pub fn fault_and_remedy(&self, interface: &str, bitrate: Option<u32>) -> Option<String> {
        let rate = bitrate.map(|rate| format!(" at {rate} bit/s")).unwrap_or_default();
        let wrong = match self.state {
            BusState::Off => format!(
                "{interface} is bus-off{rate} after too many errors. Check the bitrate, shorts and \
                 the termination, then restart the interface: sudo ip link set {interface} down; \
                 sudo ip link set {interface} up"
            ),
            BusState::NotAcknowledged => format!(
                "no node acknowledges frames on {interface}{rate}. Check power, cable and bitrate \
                 of the other end; error counters: ip -details -statistics link show {interface}"
            ),
            BusState::Passive => format!(
                "{interface} is error-passive{rate}, so most frames fail. Check bitrate, \
                 termination and cable; error counters: ip -details -statistics link show \
                 {interface}"
            ),
            BusState::Active if self.damaged > 0 => format!(
                "{} damaged frames on {interface}{rate}. Check the bitrate, and the termination at \
                 both ends of the bus; error counters: ip -details -statistics link show \
                 {interface}",
                self.damaged
            ),
            BusState::Active => return None,
        };
        Some(wrong)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use socketcan::CanErrorFrame;

    /// Encodes an error as the kernel does: class bits of `linux/can/error.h`, then eight bytes of detail.
    fn error(class: u32, data: [u8; 8]) -> CanError {
        CanErrorFrame::new_error(class, &data).unwrap().into_error()
    }

    const CONTROLLER: u32 = 0x04;
    const PROTOCOL: u32 = 0x08;
    const NO_ACK: u32 = 0x20;
    const BUS_OFF: u32 = 0x40;
    const RESTARTED: u32 = 0x100;

    #[test]
    fn drivers_errors_become_states() {
        let mut health = Health::default();
        // TX warning.
        health.report(&error(CONTROLLER, [0, 0x08, 0, 0, 0, 0, 96, 0]));
        assert_eq!(
            (health.state(), health.fault_and_remedy("can0", None)),
            (BusState::Active, None)
        );
        // TX passive, then its reason.
        health.report(&error(CONTROLLER, [0, 0x20, 0, 0, 0, 0, 128, 0]));
        assert_eq!(health.state(), BusState::Passive);
        health.report(&error(NO_ACK, [0; 8]));
        assert_eq!(health.state(), BusState::NotAcknowledged);
        health.report(&error(CONTROLLER, [0, 0x20, 0, 0, 0, 0, 128, 0]));
        assert_eq!(health.state(), BusState::NotAcknowledged);
        health.works();
        assert_eq!(health.state(), BusState::Active);

        assert!(!health.report(&error(BUS_OFF, [0; 8])));
        health.works();
        health.stuck();
        assert_eq!(health.state(), BusState::Off, "only a restart ends it");
        assert!(health.report(&error(RESTARTED, [0; 8])));
        assert_eq!(health, Health::default());
    }

    #[test]
    fn some_drivers_report_a_missing_acknowledgement_by_its_place() {
        let mut health = Health::default();
        // Location 0x19: ACK slot.
        health.report(&error(PROTOCOL, [0, 0, 0, 0x19, 0, 0, 0, 0]));
        assert_eq!(health.state(), BusState::NotAcknowledged);
    }

    #[test]
    fn damage_is_counted_until_the_bus_is_well() {
        let mut health = Health::default();
        // Stuff errors, which a wrong bit rate causes.
        health.report(&error(PROTOCOL, [0, 0, 0x04, 0, 0, 0, 0, 0]));
        health.report(&error(PROTOCOL, [0, 0, 0x04, 0x08, 0, 0, 0, 0]));
        let complaint = health.fault_and_remedy("can0", Some(500_000)).unwrap();
        assert!(complaint.starts_with("2 damaged frames on can0 at 500000 bit/s"), "{complaint}");
        health.report(&error(CONTROLLER, [0, 0x40, 0, 0, 0, 0, 0, 0]));
        assert_eq!(health.fault_and_remedy("can0", Some(500_000)), None);
    }

    #[test]
    fn complaints_say_what_to_type() {
        let mut health = Health::default();
        health.report(&error(BUS_OFF, [0; 8]));
        let complaint = health.fault_and_remedy("can1", None).unwrap();
        assert!(complaint.contains("sudo ip link set can1 down; sudo ip link set can1 up"));
        let mut health = Health::default();
        health.stuck();
        let complaint = health.fault_and_remedy("can1", Some(1_000_000)).unwrap();
        assert!(complaint.contains("ip -details -statistics link show can1"), "{complaint}");
        assert!(complaint.contains("1000000 bit/s"), "{complaint}");
    }
}
