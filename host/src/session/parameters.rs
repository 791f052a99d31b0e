//! Gains and torque limits of servos: reading, setting, and saving them over a power cycle.

use super::{Session, SessionError};
use rollwalk_bus::link::LinkBus;
use rollwalk_protocol::wire::{Parameter, ParameterAction, ParameterOrigin};

impl<B: LinkBus> Session<B> {
    /// Reads a parameter of a channel.
    pub fn parameter(&mut self, parameter: Parameter, channel: u8) -> Result<f32, SessionError> {
        let get = ParameterAction::Get { parameter: parameter.code(), channel };
        self.exchange.parameter("read a parameter", get)
    }

    /// Sets a parameter of a channel, at once while torque is off and otherwise within half a second.
    ///
    /// The value stays in force until it is set again or power fails.
    pub fn set_parameter(
        &mut self,
        parameter: Parameter,
        channel: u8,
        value: f32,
    ) -> Result<(), SessionError> {
        let set = ParameterAction::Set { parameter: parameter.code(), channel, value };
        self.exchange.parameter("set a parameter", set).map(|_| ())
    }

    /// Resets all parameters to the robot's configuration.
    pub fn reset_parameters(&mut self) -> Result<(), SessionError> {
        self.exchange.parameter("reset the parameters", ParameterAction::Reset).map(|_| ())
    }

    /// Saves the current values across power cycles. The controller must be disarmed.
    pub fn save_parameters(&mut self) -> Result<(), SessionError> {
        self.exchange.parameter("save the parameters", ParameterAction::Save).map(|_| ())
    }

    /// Reads the origin of the values that were in force after power-on.
    pub fn parameter_origin(&mut self) -> Result<ParameterOrigin, SessionError> {
        let what = "read the origin of its parameters";
        let code = self.exchange.parameter(what, ParameterAction::Origin)?;
        // The cast saturates; codes are small whole numbers.
        ParameterOrigin::from_code(code as u8).ok_or(self.exchange.silent(what))
    }
}
