//! Set-points of the host, which replace the player in the motion stage: streamed frames, or answers to samples.

use rollwalk_protocol::library::{Library, LibraryReadError};
use rollwalk_protocol::wire::{SampleAnswer, Setpoint};

use super::{Motion, Setup, Stage, ramp_to_safe, safe};
use crate::limiter::within;
use crate::settings::Settings;
use crate::stream::Stream;
use crate::track::{Track, Tracking};

impl Motion {
    /// Sets the tracking settings of the next stream; `None` if its set-points do not answer samples.
    pub fn want_tracking(&mut self, tracking: Option<Tracking>) {
        self.tracking = tracking;
    }

    /// Returns the number of the sample that is due, once; otherwise `None`.
    pub fn take_sample(&mut self) -> Option<u8> {
        self.sample.take()
    }

    /// Answer in force of a tracked robot.
    pub fn answered(&self, settings: &Settings) -> Option<SampleAnswer> {
        match &self.stage {
            Stage::Tracking(track) => track.answered(settings.period_s()),
            _ => None,
        }
    }

    /// Begins to follow set-points of the host, at rest in SAFE.
    // A separate function, because a stream is large on the stack.
    #[inline(never)]
    pub fn start_stream(
        &mut self,
        setup: &Setup,
        library: Option<Library<'_>>,
    ) -> Result<(), LibraryReadError> {
        let tracking = self.tracking.take();
        let (values, torques) = safe(&library.ok_or(LibraryReadError)?)?;
        match tracking {
            Some(tracking) => self.stage = Stage::Tracking(Track::start(tracking, values, torques)),
            None => {
                let ticks_per_frame = setup.settings.ticks_per_frame();
                self.stage = Stage::Streaming(Stream::start(values, torques, ticks_per_frame));
            }
        }
        Ok(())
    }

    /// Accepts a set-point of the host. Ignores it unless the robot follows set-points.
    pub fn stream(&mut self, setup: &Setup, setpoint: &Setpoint) {
        let nearest_rad = setup.settings.align_tolerance_rad;
        match &mut self.stage {
            Stage::Streaming(stream) => stream.receive(&setup.config, setpoint, nearest_rad),
            Stage::Tracking(track) => track.receive(&setup.config, setpoint, nearest_rad),
            _ => {}
        }
    }

    /// Ramps to SAFE from the values at which the channels can rest without a change of torque.
    pub fn align_from_stream(
        &mut self,
        setup: &Setup,
        library: Option<Library<'_>>,
    ) -> Result<(), LibraryReadError> {
        let library = library.ok_or(LibraryReadError)?;
        let config = &setup.config;
        let feed_forward = self.parameters.feed_forward();
        // The ramp starts from the commands of the actuators, because a streamed set-point may exceed their limits.
        let ramp = ramp_to_safe(setup, &library, feed_forward, |i| {
            let most_nm = config.channels.get(i)?.max_torque_nm;
            let torque_nm = match &self.stage {
                Stage::Streaming(stream) => stream.target(config, i)?.torque_nm * feed_forward,
                Stage::Tracking(track) => track.target(config, i)?.0.torque_nm,
                _ => return None,
            };
            let is_number = torque_nm.is_finite();
            let torque_nm = if is_number { within(torque_nm, -most_nm, most_nm) } else { 0.0 };
            Some((self.rest(setup, i)?, torque_nm))
        })?;
        self.stage = Stage::Ramping { ramp, settling_ticks: 0 };
        Ok(())
    }

    /// Brings the stream to rest at the current pose.
    pub fn halt_stream(&mut self) {
        match &mut self.stage {
            Stage::Streaming(stream) => stream.halt(),
            Stage::Tracking(track) => track.halt(),
            _ => {}
        }
    }

    /// Number of frames taken from the stream, or of answers that have taken effect, modulo 65,536; 0 in other stages.
    pub fn streamed_frames(&self) -> u16 {
        match &self.stage {
            Stage::Streaming(stream) => stream.taken(),
            Stage::Tracking(track) => track.answers(),
            _ => 0,
        }
    }
}
