//! Tests of the crate's public interface.

mod actuator_golden;
mod actuators_all;
mod actuators_cybergear;
mod actuators_dynamixel;
mod actuators_feetech;
mod actuators_maestro;
mod actuators_mit;
mod actuators_odrive;
mod authentication_golden;
mod config;
mod encode_again;
mod fixture;
mod isotp;
mod library_encode;
mod library_golden;
mod library_hostile;
mod library_reject;
mod library_round_trip;
mod library_size;
mod library_torques;
mod reason_codes;
mod refusal;
mod reseal;
mod transport_golden;
mod wire_golden;
mod wire_properties;
