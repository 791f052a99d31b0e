//! Emergency stop contact on an input pin.
//!
//! The contact is normally closed, between the pin and ground, with a pull-up. A pressed button or a broken wire opens it. A
//! pin that cannot be read counts as open. Opening takes effect at once. Because contacts bounce, closing counts only after
//! several closed samples in a row. Releasing the button does not end the stop: the operator must clear it.

use embedded_hal::digital::InputPin;

/// Emergency stop on a pin.
#[derive(Clone, Debug)]
pub struct EstopInput<I> {
    pin: I,
    release_samples: u16,
    /// Number of closed samples in a row.
    closed: u16,
}

impl<I: InputPin> EstopInput<I> {
    /// Creates an input that counts as released after `release_samples` closed samples in a row, at least 1. Until then it
    /// stops the robot.
    pub fn new(pin: I, release_samples: u16) -> Self {
        Self { pin, release_samples: release_samples.max(1), closed: 0 }
    }

    /// Samples the pin, and returns true if the robot must stop.
    ///
    /// The board calls this in every control period before [`crate::Controller::tick`]. If it returns true, the board calls
    /// [`crate::Controller::estop`].
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

    /// Readings of the pin in order; `None` is a read error.
    struct Pin<'a>(core::slice::Iter<'a, Option<bool>>);

    #[derive(Debug)]
    struct BrokenPin;

    impl Error for BrokenPin {
        fn kind(&self) -> ErrorKind {
            ErrorKind::Other
        }
    }

    impl ErrorType for Pin<'_> {
        type Error = BrokenPin;
    }

    impl InputPin for Pin<'_> {
        fn is_high(&mut self) -> Result<bool, BrokenPin> {
            self.0.next().copied().flatten().ok_or(BrokenPin)
        }

        fn is_low(&mut self) -> Result<bool, BrokenPin> {
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
                // After power-on: too few closed samples yet.
                (CLOSED, true),
                (CLOSED, true),
                (CLOSED, false),
                (CLOSED, false),
                (OPEN, true),
                // The contact bounces.
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
        // At least one closed sample is required.
        check(0, &[(OPEN, true), (CLOSED, false)]);
    }

    /// A contact that is closed for more samples than the counter can count stays released.
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
