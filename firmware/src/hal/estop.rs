//! The contact of an emergency stop.
//!
//! Normally closed, between the pin and ground, with a pull-up: what opens it stops, and a broken wire
//! opens it. A pin that cannot be read stops as well. Pressing counts at once, releasing only when the
//! contact was closed for a number of samples in a row: contacts bounce. That it is released takes no stop
//! back, that is the operator's clear.

use embedded_hal::digital::InputPin;

/// An emergency stop on a pin.
#[derive(Clone, Debug)]
pub struct EstopInput<I> {
    pin: I,
    release_samples: u16,
    /// Samples in a row in which it was closed.
    closed: u16,
}

impl<I: InputPin> EstopInput<I> {
    /// A contact that counts as released once it was closed for so many samples in a row, at least 1. It
    /// has not been yet.
    pub fn new(pin: I, release_samples: u16) -> Self {
        Self { pin, release_samples: release_samples.max(1), closed: 0 }
    }

    /// Looks at the pin: whether to stop. To be asked in every control period, before
    /// [`crate::Controller::tick`], and [`crate::Controller::estop`] called when it says so.
    pub fn stops(&mut self) -> bool {
        self.closed = match self.pin.is_low() {
            Ok(true) => self.closed.saturating_add(1),
            Ok(false) | Err(_) => 0,
        };
        self.closed < self.release_samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::convert::Infallible;
    use embedded_hal::digital::{Error, ErrorKind, ErrorType};

    /// What the pin reads, one after the other; `None` is an error.
    struct Pin<'a>(core::slice::Iter<'a, Option<bool>>);

    #[derive(Debug)]
    struct Broken;

    impl Error for Broken {
        fn kind(&self) -> ErrorKind {
            ErrorKind::Other
        }
    }

    impl ErrorType for Pin<'_> {
        type Error = Broken;
    }

    impl InputPin for Pin<'_> {
        fn is_high(&mut self) -> Result<bool, Broken> {
            self.0.next().copied().flatten().ok_or(Broken)
        }

        fn is_low(&mut self) -> Result<bool, Broken> {
            self.is_high().map(|high| !high)
        }
    }

    #[track_caller]
    fn check(release_samples: u16, samples: &[(Option<bool>, bool)]) {
        let levels: heapless::Vec<_, 16> = samples.iter().map(|&(level, _)| level).collect();
        let mut input = EstopInput::new(Pin(levels.iter()), release_samples);
        for (i, &(_, stops)) in samples.iter().enumerate() {
            assert_eq!(input.stops(), stops, "sample {i}");
        }
    }

    const OPEN: Option<bool> = Some(true);
    const CLOSED: Option<bool> = Some(false);
    const UNREADABLE: Option<bool> = None;

    #[test]
    fn pressing_counts_at_once_and_releasing_after_it_has_settled() {
        check(
            3,
            &[
                // Switched on: not seen closed often enough yet.
                (CLOSED, true),
                (CLOSED, true),
                (CLOSED, false),
                (CLOSED, false),
                (OPEN, true),
                // It bounces.
                (CLOSED, true),
                (CLOSED, true),
                (OPEN, true),
                (CLOSED, true),
                (CLOSED, true),
                (CLOSED, false),
            ],
        );
    }

    #[test]
    fn a_broken_wire_and_a_pin_that_cannot_be_read_stop() {
        check(2, &[(OPEN, true), (OPEN, true), (OPEN, true), (OPEN, true)]);
        check(1, &[(CLOSED, false), (UNREADABLE, true), (CLOSED, false)]);
        check(2, &[(CLOSED, true), (CLOSED, false), (UNREADABLE, true), (CLOSED, true)]);
        // No samples at all would be no contact at all.
        check(0, &[(OPEN, true), (CLOSED, false)]);
    }

    /// Closed for longer than can be counted.
    #[test]
    fn it_stays_released() {
        struct Grounded;
        impl ErrorType for Grounded {
            type Error = Infallible;
        }
        impl InputPin for Grounded {
            fn is_high(&mut self) -> Result<bool, Infallible> {
                Ok(false)
            }
            fn is_low(&mut self) -> Result<bool, Infallible> {
                Ok(true)
            }
        }
        let mut input = EstopInput::new(Grounded, u16::MAX);
        let stops = (0..u32::from(u16::MAX) + 10).filter(|_| input.stops()).count();
        assert_eq!(stops, usize::from(u16::MAX) - 1);
    }
}
