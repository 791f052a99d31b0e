//! Drivers that boards may use: for devices on a microcontroller's pins, through `embedded-hal`
//! 1.0, and for the link on a serial line.
//!
//! | module | is |
//! |---|---|
//! | [`pwm`] | a hobby servo on a PWM output, as an actuator of the Rollwalk profile |
//! | [`estop`] | the contact of an emergency stop |
//! | [`slcan`] | the link on a serial line, as an SLCAN adapter |

pub mod estop;
pub mod pwm;
pub mod slcan;
