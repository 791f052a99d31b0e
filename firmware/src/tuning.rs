//! Requests to read, change and save gains and limits. A repetition of a successful request gets the same answer, but is not
//! executed again.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::{
    Parameter, ParameterAck, ParameterAction, ParameterOrigin, ParameterRequest, ParameterResult,
    State, Torque,
};

use crate::gate::Gate;
use crate::motion::{Motion, Setup};
use crate::parameters::{Parameters, Refusal};
use crate::store::ParameterStore;

/// Robot state that a request changes, and robot state that decides whether the change is allowed.
pub(crate) struct Robot<'a> {
    pub state: State,
    pub setup: &'a Setup,
    pub motion: &'a mut Motion,
    /// Gate of arming. Every change voids a pending confirmation, because the operator requested it with other gains.
    pub gate: &'a mut Gate,
}

/// Parameter store, and the latest request with its answer.
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

    /// Applies the saved parameters of this robot. Call it in every self test; only the first call after power-on has an effect.
    pub fn load(&mut self, setup: &Setup, parameters: &mut Parameters) {
        if core::mem::replace(&mut self.loaded, true) {
            return;
        }
        self.origin = match self.store.load() {
            None => ParameterOrigin::Configuration,
            Some(set) if set.config_hash != setup.config.hash() => {
                ParameterOrigin::OtherConfiguration
            }
            Some(set) => {
                if parameters.restore(&setup.config, &setup.settings, &set) {
                    ParameterOrigin::Saved
                } else {
                    ParameterOrigin::OutOfRange
                }
            }
        };
    }

    /// Answers a request that arrived in `frame`. Executes the request unless it is a repetition.
    pub fn answer(
        &mut self,
        frame: &Frame,
        request: ParameterRequest,
        robot: Robot<'_>,
    ) -> ParameterAck {
        let outcome = match self.known(frame, request.seq) {
            Some(Ok(ack)) => return ack,
            Some(Err(refusal)) => Err(refusal),
            None => self.tune(request.action, robot),
        };
        let ack = ack(request, outcome);
        if ack.result != ParameterResult::OutOfOrder {
            self.last = Some((*frame, ack));
        }
        ack
    }

    /// Returns the answer to a request that was executed before or is out of order; `None` if it must be executed.
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

    fn tune(&mut self, action: ParameterAction, robot: Robot<'_>) -> Result<f32, Refusal> {
        let Robot { state, setup, motion, gate } = robot;
        let driven = state.torque() != Torque::Off;
        let parameters = &mut motion.parameters;
        match action {
            ParameterAction::Get { parameter, channel } => parameters.get(parameter, channel),
            ParameterAction::Set { parameter, channel, value } => {
                let actuators = &motion.actuators;
                let heeded =
                    |which| actuators.uses_parameter(&setup.config, usize::from(channel), which);
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
                gate.void();
                Ok(set)
            }
            ParameterAction::Reset => {
                parameters.reset(&setup.config, driven);
                gate.void();
                Ok(0.0)
            }
            // The control loop stops while flash is written.
            ParameterAction::Save if state != State::Disarmed => {
                Err((ParameterResult::WrongState, 0.0))
            }
            ParameterAction::Save => {
                let set = parameters.all(&setup.config);
                let saved = self.store.save(&set);
                gate.void();
                saved.map(|()| 0.0).map_err(|_| (ParameterResult::StoreFailed, 0.0))
            }
            ParameterAction::Origin => Ok(f32::from(self.origin.code())),
            ParameterAction::Unknown { .. } => Err((ParameterResult::UnknownRequest, 0.0)),
        }
    }
}

/// Answer to a request that is not authentic.
pub(crate) fn unauthenticated(request: ParameterRequest) -> ParameterAck {
    ack(request, Err((ParameterResult::AuthenticationRequired, 0.0)))
}

fn ack(request: ParameterRequest, outcome: Result<f32, Refusal>) -> ParameterAck {
    let (result, value) = match outcome {
        Ok(value) => (ParameterResult::Ok, value),
        Err(refusal) => refusal,
    };
    let (parameter, channel) = request.action.about();
    let kind = request.action.kind();
    ParameterAck { seq: request.seq, kind, result, parameter, channel, value }
}
