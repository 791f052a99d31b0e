//! Controller's side of requests about gains and limits: executes each once, answers every one, and saves the
//! parameters on request.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::{
    Parameter, ParameterAck, ParameterAction, ParameterOrigin, ParameterRequest, ParameterResult,
    State, Torque,
};

use crate::controller::Controller;
use crate::parameters::Refusal;
use crate::store::{LibraryStore, ParameterStore};

/// The parameter store, and the last request with its answer.
pub(crate) struct Tuning<P> {
    store: P,
    last: Option<(Frame, ParameterAck)>,
    origin: ParameterOrigin,
    loaded: bool,
}

impl<P: ParameterStore> Tuning<P> {
    pub fn new(store: P) -> Self {
        Self { store, last: None, origin: ParameterOrigin::Configuration, loaded: false }
    }

    /// Returns the store.
    pub fn into_store(self) -> P {
        self.store
    }

    /// The answer to a request that is not to be executed, because it has been before or is out of order.
    fn known(&self, frame: &Frame, seq: u8) -> Option<Result<ParameterAck, Refusal>> {
        let (last, ack) = self.last?;
        // As for commands, a number 1 to 8 ahead, modulo 16, is newer.
        match seq.wrapping_sub(ack.seq) & 0xF {
            // A refused request had no effect and may be possible by now: it is executed again.
            0 if *frame == last => (ack.result == ParameterResult::Ok).then_some(Ok(ack)),
            1..=8 => None,
            _ => Some(Err((ParameterResult::OutOfOrder, 0.0))),
        }
    }
}

impl<S: LibraryStore, P: ParameterStore> Controller<S, P> {
    /// Applies the parameters saved for this robot, in the first self test after power-on.
    pub(crate) fn load_parameters(&mut self) {
        if core::mem::replace(&mut self.tuning.loaded, true) {
            return;
        }
        let setup = &self.setup;
        self.tuning.origin = match self.tuning.store.load() {
            None => ParameterOrigin::Configuration,
            Some(set) if set.config_hash != setup.config.hash() => {
                ParameterOrigin::OtherConfiguration
            }
            Some(set) => {
                let parameters = &mut self.motion.parameters;
                if parameters.restore(&setup.config, &setup.settings, &set) {
                    ParameterOrigin::Saved
                } else {
                    ParameterOrigin::OutOfRange
                }
            }
        };
    }

    /// Answers a request that is not authentic, without learning of it.
    pub(crate) fn refuse_parameter(&mut self, request: ParameterRequest) {
        let (parameter, channel) = request.action.about();
        self.link.acknowledge_parameter(ParameterAck {
            seq: request.seq,
            kind: request.action.kind(),
            result: ParameterResult::AuthenticationRequired,
            parameter,
            channel,
            value: 0.0,
        });
    }

    /// Processes a request, which came in `frame`.
    pub(crate) fn on_parameter(&mut self, frame: &Frame, request: ParameterRequest) {
        let outcome = match self.tuning.known(frame, request.seq) {
            Some(Ok(ack)) => {
                self.link.acknowledge_parameter(ack);
                return;
            }
            Some(Err(refusal)) => Err(refusal),
            None => self.tune(request.action),
        };
        let (result, value) = match outcome {
            Ok(value) => (ParameterResult::Ok, value),
            Err(refusal) => refusal,
        };
        let (parameter, channel) = request.action.about();
        let kind = request.action.kind();
        let ack = ParameterAck { seq: request.seq, kind, result, parameter, channel, value };
        if result != ParameterResult::OutOfOrder {
            self.tuning.last = Some((*frame, ack));
        }
        self.link.acknowledge_parameter(ack);
    }

    fn tune(&mut self, action: ParameterAction) -> Result<f32, Refusal> {
        let state = self.state();
        let driven = state.torque() != Torque::Off;
        let setup = &self.setup;
        let parameters = &mut self.motion.parameters;
        match action {
            ParameterAction::Get { parameter, channel } => parameters.get(parameter, channel),
            ParameterAction::Set { parameter, channel, value } => {
                let actuators = &self.motion.actuators;
                let heeded = |which| actuators.heeds(&setup.config, usize::from(channel), which);
                if parameters.get(parameter, channel).is_ok()
                    && !Parameter::from_code(parameter).is_some_and(heeded)
                {
                    return Err((ParameterResult::NotSupported, 0.0));
                }
                // The drive's frames cannot carry a setpoint with a gain beyond its scale.
                let most = actuators.max_gains(&setup.config, usize::from(channel));
                let most = most.and_then(|gains| match Parameter::from_code(parameter)? {
                    Parameter::Kp => Some(gains.kp_nm_rad),
                    Parameter::Kd => Some(gains.kd_nm_s_rad),
                    Parameter::MaxTorque | Parameter::FeedForward => None,
                });
                if let Some(most) = most.filter(|&most| value > most) {
                    return Err((ParameterResult::OutOfRange, most));
                }
                let which = (parameter, channel);
                let set = parameters.set(&setup.config, &setup.settings, which, value, driven)?;
                // An operator who is about to arm has requested that with other gains.
                self.gate.void();
                Ok(set)
            }
            ParameterAction::Reset => {
                parameters.reset(&setup.config, driven);
                self.gate.void();
                Ok(0.0)
            }
            // The control loop stops while flash is written.
            ParameterAction::Save if state != State::Disarmed => {
                Err((ParameterResult::WrongState, 0.0))
            }
            ParameterAction::Save => {
                let set = parameters.all(&setup.config);
                let saved = self.tuning.store.save(&set);
                self.gate.void();
                saved.map(|()| 0.0).map_err(|_| (ParameterResult::StoreFailed, 0.0))
            }
            ParameterAction::Origin => Ok(f32::from(self.tuning.origin.code())),
            ParameterAction::Unknown { .. } => Err((ParameterResult::UnknownRequest, 0.0)),
        }
    }
}
