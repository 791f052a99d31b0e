//! What hangs on a microcontroller's pins, through `embedded-hal` 1.0: for boards, which own the pins.
//!
//! | module | is |
//! |---|---|
//! | [`pwm`] | a hobby servo on a PWM output, as an actuator of the Rollwalk profile |
//! | [`estop`] | the contact of an emergency stop |

pub mod estop;
pub mod pwm;
