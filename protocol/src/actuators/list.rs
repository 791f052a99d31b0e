//! List of the actuator protocols, and the only dispatch to their codecs.
//!
//! A protocol consists of a row of the list, a codec and a simulated drive. The row names the module of the codec, and the module
//! of the drive in `rollwalk-drives`. Robot files, firmware, simulator and tests use a protocol only through [`Protocol`].

use serde::{Deserialize, Serialize};

use super::rollwalk::Rollwalk;
use super::serial::{Answer, ReceiveBuffer};
use super::settings::{Keys, Report};
use super::{
    ActuatorCommand, CanCodec, Capabilities, Codec, Decoded, Feedback, Packet, Refusal,
    SerialCodec, Traffic,
};
use crate::can::Frame;

/// Passes the list of protocols to a macro, after the given arguments. A row contains the module, the type of the codec, the
/// transport, and the name in robot files.
///
/// The first row is the Rollwalk profile, the default of a bus, which has no settings. Append a new protocol at the end:
/// postcard encodes a [`Protocol`] by its position in this list, and the hash of a robot's configuration covers that encoding
/// (`docs/formats/wire-format.md`). In another order, controllers would refuse the libraries of robots with these buses.
#[macro_export]
macro_rules! actuator_protocols {
    ($macro:ident $(, $argument:tt)*) => {
        $macro! {
            $($argument,)*
            rollwalk Rollwalk can "rollwalk",
            mit Mit can "mit",
            odrive Odrive can "odrive",
            cybergear CyberGear can "cybergear",
            dynamixel Dynamixel serial "dynamixel",
            maestro Maestro serial "maestro",
            feetech Feetech serial "feetech",
        }
    };
}

/// Selects the first expression for a protocol on CAN, the second for one on a serial line.
macro_rules! by_transport {
    (can, $on_can:expr, $on_serial:expr) => {
        $on_can
    };
    (serial, $on_can:expr, $on_serial:expr) => {
        $on_serial
    };
}

macro_rules! define_protocol {
    (
        $profile:ident $Profile:ident can $profile_key:literal,
        $($module:ident $Codec:ident $transport:ident $key:literal,)*
    ) => {
        /// Protocol of a bus, with the settings of the actuators on it.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        pub enum Protocol {
            #[doc = concat!("Settings of [`", stringify!($profile), "`](super::", stringify!($profile), "): none.")]
            #[serde(rename = $profile_key)]
            $Profile,
            $(
                #[doc = concat!("Settings of [`", stringify!($module), "`](super::", stringify!($module), ").")]
                #[serde(rename = $key)]
                $Codec(super::$module::$Codec),
            )*
        }

        /// Evaluates an expression with the codec of a protocol.
        macro_rules! with_codec {
            ($protocol:expr, $codec:ident => $do:expr) => {
                match $protocol {
                    Protocol::$Profile => {
                        let $codec = &$Profile;
                        $do
                    }
                    $(Protocol::$Codec($codec) => $do,)*
                }
            };
        }

        /// Evaluates an expression with the codec of a protocol on CAN; `$other` for a protocol on a serial line.
        macro_rules! with_can_codec {
            ($protocol:expr, $codec:ident => $do:expr, $other:expr) => {
                match $protocol {
                    Protocol::$Profile => {
                        let $codec = &$Profile;
                        $do
                    }
                    $(Protocol::$Codec($codec) => by_transport!($transport, $do, {
                        let _ = $codec;
                        $other
                    }),)*
                }
            };
        }

        /// Evaluates an expression with the codec of a protocol on a serial line; `$other` for a protocol on CAN.
        macro_rules! with_serial_codec {
            ($protocol:expr, $codec:ident => $do:expr, $other:expr) => {
                match $protocol {
                    Protocol::$Profile => $other,
                    $(Protocol::$Codec($codec) => by_transport!($transport, {
                        let _ = $codec;
                        $other
                    }, $do),)*
                }
            };
        }

        impl Protocol {
            /// Names of the protocols in robot files.
            pub const KEYS: &'static [&'static str] = &[$profile_key, $($key,)*];

            /// Name of the protocol in robot files.
            pub const fn key(&self) -> &'static str {
                match self {
                    Self::$Profile => $profile_key,
                    $(Self::$Codec(_) => $key,)*
                }
            }

            /// Reads the settings of the protocol at index `number` of [`Self::KEYS`] from a robot file.
            pub fn read(number: usize, keys: &dyn Keys) -> Self {
                match Self::KEYS.get(number).copied() {
                    $(Some($key) => Self::$Codec(super::$module::$Codec::from_keys(keys)),)*
                    _ => Self::$Profile,
                }
            }

            /// Examples of every protocol with practical settings, several of some protocols.
            pub fn examples() -> impl Iterator<Item = Self> {
                let examples = [Self::$Profile].into_iter();
                $(let examples = examples.chain(
                    super::$module::$Codec::EXAMPLES.iter().copied().map(Self::$Codec),
                );)*
                examples
            }
        }
    };
}
actuator_protocols!(define_protocol);

impl Protocol {
    /// Commands and settings that the protocol supports.
    pub fn capabilities(&self) -> Capabilities {
        with_codec!(self, codec => codec.capabilities())
    }

    /// Name of the protocol or of the actuator model, for messages.
    pub fn name(&self) -> &'static str {
        with_codec!(self, codec => codec.name())
    }

    /// True if the protocol runs over a serial line instead of CAN.
    pub fn is_serial(&self) -> bool {
        with_can_codec!(self, _codec => false, true)
    }

    /// True if `rollwalk dbc` describes the frames of the protocol.
    pub fn has_dbc(&self) -> bool {
        with_codec!(self, codec => codec.has_dbc())
    }

    /// Rate of the feedback that actuators send on a timer, Hz; `None` if they answer commands instead.
    pub fn feedback_hz(&self) -> Option<u32> {
        with_codec!(self, codec => codec.feedback_hz())
    }

    /// Maximum traffic of the set-points and answers of `actuators` actuators.
    pub fn traffic(&self, actuators: u32) -> Traffic {
        with_codec!(self, codec => codec.traffic(actuators))
    }

    /// Refuses an order that the protocol has no frames for.
    ///
    /// # Errors
    /// Returns the reason if the protocol cannot encode the order.
    pub fn check(&self, order: &ActuatorCommand) -> Result<(), Refusal> {
        with_codec!(self, codec => codec.check(order))
    }

    /// Bit rates that the actuators can be set to, bit/s; empty if the maker publishes no list.
    pub fn bit_rates(&self) -> &'static [u32] {
        with_codec!(self, codec => codec.bit_rates())
    }

    /// Reports settings that no actuator can have.
    pub fn check_settings(&self, report: &mut dyn Report) {
        with_codec!(self, codec => codec.check_settings(report));
    }

    /// Reports the range of a quantity, if the codec has more detail than [`Capabilities`]. `quantity` is the name in
    /// [`Refusal::OutOfRange`].
    pub fn explain_range(
        &self,
        quantity: &'static str,
        report: &mut dyn FnMut(core::fmt::Arguments<'_>),
    ) {
        with_codec!(self, codec => codec.explain_range(quantity, report));
    }

    /// Passes the frames of an order to `send`. A protocol on a serial line has no frames.
    ///
    /// # Errors
    /// Returns the reason if the protocol cannot encode the order; `send` is then not called.
    pub fn emit(
        &self,
        order: &ActuatorCommand,
        send: &mut dyn FnMut(Frame),
    ) -> Result<(), Refusal> {
        with_can_codec!(self, codec => codec.emit(order, send), Ok(()))
    }

    /// Forwards to [`CanCodec::decode`].
    pub fn decode(&self, received: &Frame) -> Option<(u8, Feedback)> {
        with_can_codec!(self, codec => codec.decode(received), None)
    }

    /// Forwards to [`CanCodec::decode_counted`].
    pub fn decode_counted(&self, received: &Frame) -> Option<(u8, Decoded)> {
        with_can_codec!(self, codec => codec.decode_counted(received), None)
    }

    /// Passes the packets of orders to `send`. A protocol on CAN has no packets.
    ///
    /// # Errors
    /// Returns the index of the first refused order and the reason; `send` is then not called.
    pub fn encode(
        &self,
        orders: &[ActuatorCommand],
        send: &mut dyn FnMut(Packet),
    ) -> Result<(), (usize, Refusal)> {
        with_serial_codec!(self, codec => codec.encode(orders, send), Ok(()))
    }

    /// Forwards to [`SerialCodec::receive`].
    pub fn receive(&self, buffer: &mut ReceiveBuffer, byte: u8, is_awaited: bool) {
        with_serial_codec!(self, codec => codec.receive(buffer, byte, is_awaited), ());
    }

    /// Forwards to [`SerialCodec::take`].
    pub fn take(&self, buffer: &mut ReceiveBuffer, is_silent: bool) -> Option<Answer> {
        with_serial_codec!(self, codec => codec.take(buffer, is_silent), None)
    }

    /// True if an adapter answers for all actuators of its line ([`SerialCodec::ADAPTER_ANSWERS`]).
    pub fn adapter_answers(&self) -> bool {
        with_serial_codec!(self, codec => adapter_answers(codec), false)
    }
}

fn adapter_answers<C: SerialCodec>(_: &C) -> bool {
    C::ADAPTER_ANSWERS
}

#[cfg(test)]
mod tests {
    use super::Protocol;
    use std::mem::discriminant;
    use std::vec::Vec;

    #[test]
    fn names_tell_protocols_apart() {
        let all: Vec<_> = Protocol::examples().collect();
        for (one, other) in all.iter().flat_map(|one| all.iter().map(move |other| (one, other))) {
            let same = discriminant(one) == discriminant(other);
            assert!(same || one.name() != other.name(), "{one:?} and {other:?}");
        }
    }
}
