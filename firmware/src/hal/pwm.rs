//! Hobby servo on a PWM output, as an actuator of the Rollwalk profile.
//!
//! A virtual actuator bus stands for the PWM outputs of a board. The board passes its frames to the servo, and the answers of
//! the servo to the controller.
//!
//! A hobby servo measures nothing: it reports the angle assumed at creation, later the angle of its latest set-point. It must
//! therefore be at the assumed angle before its torque is switched on. It has no gains: it either holds an angle or has no
//! torque. A set-point without stiffness removes the torque, and so do too many ticks without a set-point. A feed-forward
//! torque becomes an offset of the angle.

use embedded_hal::pwm::SetDutyCycle;
use rollwalk_protocol::actuator::{ActuatorStatus, Control, Feedback, JointSetpoint};
use rollwalk_protocol::actuators::maestro::Pulse;
use rollwalk_protocol::can::Frame;

use crate::limiter::MAX_OFFSET_RAD;

/// Settings of a hobby servo and its output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PwmSettings {
    /// Address on the virtual actuator bus.
    pub id: u8,
    /// Pulse lengths for the servo's angles.
    pub pulse: Pulse,
    /// Pulse period of the output, µs; 20,000 for most servos.
    pub period_us: f32,
    /// Timeout of set-points, ticks. The servo loses its torque after it.
    pub patience_ticks: u16,
}

/// Reason why an output cannot drive a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PwmError<E> {
    /// Invalid pulse settings, with the requirement that they violate.
    Settings(&'static str),
    /// Error of the output.
    Output(E),
}

/// Hobby servo on a PWM output.
#[derive(Clone, Debug)]
pub struct PwmServo<P> {
    pwm: P,
    settings: PwmSettings,
    position_rad: f32,
    status: ActuatorStatus,
    counter: u8,
    silent_ticks: u16,
}

impl<P: SetDutyCycle> PwmServo<P> {
    /// Creates a servo without torque, assumed to be at `assumed_rad`.
    pub fn new(
        pwm: P,
        settings: PwmSettings,
        assumed_rad: f32,
    ) -> Result<Self, PwmError<P::Error>> {
        let PwmSettings { pulse, period_us, .. } = settings;
        let (shortest, longest) = pulse.limits_us;
        // Written so that a NaN is refused.
        if !(shortest > 0.0 && longest >= shortest && longest < period_us && period_us < 1e6) {
            return Err(PwmError::Settings(
                "pulses above 0 µs, in ascending order, and shorter than the period",
            ));
        }
        if !(pulse.us_per_rad != 0.0 && (pulse.us_per_rad + pulse.centre_us).is_finite()) {
            return Err(PwmError::Settings("a pulse that changes with the angle"));
        }
        let (status, counter) = (ActuatorStatus(0), 0);
        let mut servo =
            Self { pwm, settings, position_rad: assumed_rad, status, counter, silent_ticks: 0 };
        if servo.duty(assumed_rad).is_none() {
            return Err(PwmError::Settings("an assumed pose within the limits of the pulse"));
        }
        servo.pwm.set_duty_cycle(0).map_err(PwmError::Output)?;
        Ok(servo)
    }

    /// Executes a frame of its bus and returns the answer; `None` if the frame addresses another actuator.
    pub fn on_frame(&mut self, frame: &Frame) -> Option<Frame> {
        if let Some((id, control)) = Control::decode(frame) {
            if id != self.settings.id {
                return None;
            }
            match control {
                Control::Disable => self.let_go(ActuatorStatus(0)),
                // No pulses before the first setpoint.
                Control::Enable if !self.status.faulty() => {
                    self.let_go(ActuatorStatus(ActuatorStatus::ENABLED));
                    self.silent_ticks = 0;
                }
                Control::Enable | Control::Query => {}
            }
        } else {
            let (_, setpoint) = JointSetpoint::decode(frame).filter(|s| s.0 == self.settings.id)?;
            if self.status.enabled() {
                self.follow(&setpoint);
            }
        }
        self.feedback()
    }

    /// Counts a control period. Removes the torque if set-points have timed out.
    pub fn tick(&mut self) {
        self.silent_ticks = self.silent_ticks.saturating_add(1);
        if self.status.enabled() && self.silent_ticks > self.settings.patience_ticks {
            self.let_go(ActuatorStatus(ActuatorStatus::TIMED_OUT));
        }
    }

    fn follow(&mut self, setpoint: &JointSetpoint) {
        self.silent_ticks = 0;
        self.status = ActuatorStatus(ActuatorStatus::ENABLED);
        if setpoint.kp_nm_rad <= 0.0 {
            // The servo cannot damp.
            return self.let_go(self.status);
        }
        // Offset that the gain turns into the torque, dropped below if the pulse would be out of range.
        let offset_rad = setpoint.torque_nm / setpoint.kp_nm_rad;
        let offset_rad = offset_rad.clamp(-MAX_OFFSET_RAD, MAX_OFFSET_RAD);
        let duty = self.duty(setpoint.position_rad + offset_rad);
        let Some(duty) = duty.or_else(|| self.duty(setpoint.position_rad)) else {
            // The servo stays at the last setpoint.
            self.status.0 |= ActuatorStatus::POSITION_LIMITED;
            return;
        };
        if self.pwm.set_duty_cycle(duty).is_err() {
            return self.let_go(ActuatorStatus(ActuatorStatus::HARDWARE));
        }
        self.position_rad = setpoint.position_rad;
    }

    /// Duty cycle for an angle, in steps of the output; `None` if the pulse length is out of range.
    fn duty(&self, position_rad: f32) -> Option<u16> {
        let PwmSettings { pulse, period_us, .. } = self.settings;
        let us = pulse.centre_us + position_rad * pulse.us_per_rad;
        let (shortest, longest) = pulse.limits_us;
        let steps = us / period_us * f32::from(self.pwm.max_duty_cycle()) + 0.5;
        // Less than one step would be no pulse.
        (us >= shortest && us <= longest && steps >= 1.0).then_some(steps as u16)
    }

    /// Stops the pulses and sets the status. An output that cannot be switched off is a fault.
    fn let_go(&mut self, status: ActuatorStatus) {
        let off = self.pwm.set_duty_cycle(0);
        self.status = if off.is_ok() { status } else { ActuatorStatus(ActuatorStatus::HARDWARE) };
    }

    fn feedback(&mut self) -> Option<Frame> {
        self.counter = self.counter.wrapping_add(1);
        let feedback = Feedback {
            position_rad: self.position_rad,
            velocity_rad_s: 0.0,
            torque_nm: 0.0,
            status: self.status,
            counter: self.counter,
        };
        feedback.encode(self.settings.id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::cell::Cell;
    use core::f32::consts::FRAC_PI_2;
    use embedded_hal::pwm::{Error, ErrorKind, ErrorType};

    #[derive(Debug, PartialEq)]
    struct StuckOutput;

    impl Error for StuckOutput {
        fn kind(&self) -> ErrorKind {
            ErrorKind::Other
        }
    }

    /// Output with 16 bits over 20 ms: 3.2767 steps a microsecond.
    struct Output<'a> {
        duty: &'a Cell<u16>,
        works: &'a Cell<bool>,
    }

    impl ErrorType for Output<'_> {
        type Error = StuckOutput;
    }

    impl SetDutyCycle for Output<'_> {
        fn max_duty_cycle(&self) -> u16 {
            u16::MAX
        }

        fn set_duty_cycle(&mut self, duty: u16) -> Result<(), StuckOutput> {
            if !self.works.get() {
                return Err(StuckOutput);
            }
            self.duty.set(duty);
            Ok(())
        }
    }

    const SETTINGS: PwmSettings = PwmSettings {
        id: 5,
        pulse: Pulse {
            centre_us: 1500.0,
            us_per_rad: 1000.0 / FRAC_PI_2,
            limits_us: (1000.0, 2000.0),
        },
        period_us: 20_000.0,
        patience_ticks: 3,
    };

    struct Bench<'a> {
        servo: PwmServo<Output<'a>>,
        duty: &'a Cell<u16>,
        works: &'a Cell<bool>,
    }

    fn with(check: impl FnOnce(Bench<'_>)) {
        let (duty, works) = (Cell::new(777), Cell::new(true));
        let output = Output { duty: &duty, works: &works };
        let servo = PwmServo::new(output, SETTINGS, 0.1).unwrap();
        check(Bench { servo, duty: &duty, works: &works });
    }

    impl Bench<'_> {
        fn command(&mut self, frame: Frame) -> Feedback {
            Feedback::decode(&self.servo.on_frame(&frame).expect("an answer")).unwrap().1
        }

        fn control(&mut self, control: Control) -> Feedback {
            self.command(control.encode(5).unwrap())
        }

        fn go(&mut self, position_rad: f32, kp_nm_rad: f32) -> Feedback {
            let setpoint = JointSetpoint {
                position_rad,
                velocity_rad_s: 0.0,
                kp_nm_rad,
                kd_nm_s_rad: 0.5,
                torque_nm: 0.0,
            };
            self.command(setpoint.encode(5).unwrap())
        }
    }

    #[test]
    fn pulses_are_as_long_as_the_angle_says() {
        with(|mut bench| {
            assert_eq!(bench.duty.get(), 0, "off from the start");
            assert_eq!(bench.control(Control::Query).position_rad, 0.1);
            bench.go(0.1, 20.0);
            assert_eq!(bench.duty.get(), 0, "setpoints do nothing before it is enabled");
            assert!(bench.control(Control::Enable).status.enabled());
            assert_eq!(bench.duty.get(), 0, "nor does enabling, before a setpoint");
            // 1500 µs of 20 ms are 7.5 % of 65535; 22.5° are 250 µs.
            for (rad, steps) in [(0.0, 4915), (FRAC_PI_2 / 4.0, 5734), (-FRAC_PI_2 / 4.0, 4096)] {
                let told = bench.go(rad, 20.0);
                assert!(bench.duty.get().abs_diff(steps) <= 1, "{}", bench.duty.get());
                assert!((told.position_rad - rad).abs() < 2e-4 && told.status.enabled());
            }
        });
    }

    #[test]
    fn a_torque_is_an_offset_by_the_gain() {
        with(|mut bench| {
            bench.control(Control::Enable);
            let mut go = |position_rad: f32, torque_nm: f32| {
                let kp_nm_rad = 20.0;
                let setpoint =
                    JointSetpoint { position_rad, kp_nm_rad, torque_nm, ..Default::default() };
                (bench.command(setpoint.encode(5).unwrap()), bench.duty.get())
            };
            let (_, offset) = go(0.1, 1.0);
            let (told, _) = go(0.1, 1.0);
            assert!((told.position_rad - 0.1).abs() < 2e-4, "where it is meant to be");
            assert!(go(0.15, 0.0).1.abs_diff(offset) <= 1, "1 N·m by 20 N·m/rad");
            let most = go(0.1 + MAX_OFFSET_RAD, 0.0).1;
            assert!(go(0.1, 20.0).1.abs_diff(most) <= 1, "and no further");
            let plain = go(0.75, 0.0).1;
            assert_eq!(go(0.75, 1.0).1, plain, "the pulse would be too long");
        });
    }

    #[test]
    fn what_is_out_of_range_is_refused() {
        with(|mut bench| {
            bench.control(Control::Enable);
            bench.go(0.2, 20.0);
            let before = bench.duty.get();
            let told = bench.go(0.9, 20.0);
            assert_eq!(bench.duty.get(), before);
            assert_eq!((told.position_rad, told.status.enabled()), (0.2, true));
            assert_ne!(told.status.0 & ActuatorStatus::POSITION_LIMITED, 0);
            assert_eq!(bench.go(0.3, 20.0).status.0, ActuatorStatus::ENABLED);
            let frame = Control::Disable.encode(6).unwrap();
            assert!(bench.servo.on_frame(&frame).is_none(), "for another");
            assert_ne!(bench.duty.get(), 0);
        });
    }

    #[test]
    fn it_is_let_go_when_disabled_when_damped_and_when_nothing_comes() {
        with(|mut bench| {
            for how in 0..3 {
                bench.control(Control::Disable);
                bench.control(Control::Enable);
                bench.go(0.1, 20.0);
                assert_ne!(bench.duty.get(), 0);
                match how {
                    0 => assert!(!bench.control(Control::Disable).status.enabled()),
                    1 => assert!(bench.go(0.1, 0.0).status.enabled()),
                    _ => {
                        (0..3).for_each(|_| bench.servo.tick());
                        assert_ne!(bench.duty.get(), 0);
                        bench.servo.tick();
                    }
                }
                assert_eq!(bench.duty.get(), 0, "{how}");
            }
            // The timeout is reported until the servo is disabled.
            assert_eq!(bench.control(Control::Query).status.0, ActuatorStatus::TIMED_OUT);
            bench.control(Control::Enable);
            bench.go(0.1, 20.0);
            assert_eq!(bench.duty.get(), 0);
            bench.control(Control::Disable);
            bench.control(Control::Enable);
            bench.go(0.1, 20.0);
            assert_ne!(bench.duty.get(), 0);
        });
    }

    #[test]
    fn an_output_that_fails_is_a_fault() {
        with(|mut bench| {
            bench.control(Control::Enable);
            bench.works.set(false);
            let told = bench.go(0.1, 20.0);
            assert!(told.status.faulty() && !told.status.enabled());
            assert!(bench.control(Control::Disable).status.faulty(), "it may still give pulses");
        });
    }

    #[test]
    fn settings_that_are_none_are_refused() {
        let (duty, works) = (Cell::new(0), Cell::new(true));
        let good = SETTINGS.pulse;
        for (pulse, period_us, assumed_rad) in [
            (Pulse { limits_us: (2000.0, 1000.0), ..good }, 20_000.0, 0.0),
            (Pulse { limits_us: (0.0, 2000.0), ..good }, 20_000.0, 0.0),
            (Pulse { us_per_rad: f32::NAN, ..good }, 20_000.0, 0.0),
            (Pulse { us_per_rad: 0.0, ..good }, 20_000.0, 0.0),
            (good, 1500.0, 0.0),
            (good, f32::NAN, 0.0),
            (good, 20_000.0, 0.9),
        ] {
            let output = Output { duty: &duty, works: &works };
            let settings = PwmSettings { pulse, period_us, ..SETTINGS };
            let refused = PwmServo::new(output, settings, assumed_rad).err();
            assert!(matches!(refused, Some(PwmError::Settings(_))), "{pulse:?} {period_us}");
        }
        works.set(false);
        let output = Output { duty: &duty, works: &works };
        let failed = PwmServo::new(output, SETTINGS, 0.0).err();
        assert_eq!(failed, Some(PwmError::Output(StuckOutput)));
    }
}
