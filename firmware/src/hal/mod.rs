//! Shared code of all boards: drivers of devices on a microcontroller's pins through `embedded-hal` 1.0, the link on a serial
//! line, and the robot's buses among the board's.
//!
//! | module | is |
//! |---|---|
//! | [`pwm`] | a hobby servo on a PWM output, as an actuator of the Rollwalk profile |
//! | [`estop`] | the contact of an emergency stop |
//! | [`slcan`] | the link on a serial line, as an SLCAN adapter |
//! | [`servo_line`] | a line of serial servos on one wire |
//! | [`usb_serial`] | the link's serial port over USB: the answers at the control endpoint |
//! | [`key_block`] | the keys of an image |
//! | [`ports`] | which bus of the robot is at which port of the board |

pub mod estop;
pub mod key_block;
pub mod ports;
pub mod pwm;
pub mod servo_line;
pub mod slcan;
pub mod usb_serial;
