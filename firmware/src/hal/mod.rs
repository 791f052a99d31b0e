//! Code shared by all boards: device drivers on `embedded-hal` 1.0, the link on a serial line, and the assignment of buses to
//! ports.
//!
//! | module | contents |
//! |---|---|
//! | [`pwm`] | a hobby servo on a PWM output, as an actuator of the Rollwalk profile |
//! | [`estop`] | the contact of an emergency stop |
//! | [`slcan`] | the link on a serial line, as an SLCAN adapter |
//! | [`servo_line`] | a half-duplex line of serial servos |
//! | [`usb_serial`] | the link's serial port over USB: the answers at the control endpoint |
//! | [`key_block`] | the keys of an image |
//! | [`ports`] | the assignment of the robot's buses to the board's ports |

pub mod estop;
pub mod key_block;
pub mod ports;
pub mod pwm;
pub mod servo_line;
pub mod slcan;
pub mod usb_serial;
