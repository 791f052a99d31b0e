//! Tests of the configuration's identity and its checks.

use crate::fixture::{joint, robot, wheel};
use rollwalk_protocol::config::{Channel, ConfigError, RobotConfig, robot_id};
use rollwalk_protocol::crc::crc32c;

/// Do not change the value: controllers compare it with the hash in their libraries.
#[test]
fn hash_is_pinned() {
    assert_eq!(robot(2, 1).hash(), 0x08b7_a61c);
}

#[test]
fn hash_is_the_crc_of_the_postcard_encoding() {
    for config in [robot(0, 0), robot(1, 0), robot(12, 4), robot(24, 0)] {
        let mut buffer = [0; 1024];
        let bytes = postcard::to_slice(&config, &mut buffer).unwrap();
        assert_eq!(config.hash(), crc32c(bytes));
    }
}

#[test]
fn every_field_changes_the_hash() {
    let base = robot(2, 1).hash();
    let changes: [fn(&mut Channel); 9] = [
        |c| c.kind = wheel(0).kind,
        |c| c.min = -1.25,
        |c| c.max = 1.25,
        |c| c.max_rate = 5.0,
        |c| c.max_torque_nm = 2.0,
        |c| c.kp_nm_rad = 1.0,
        |c| c.kd_nm_s_rad = 1.0,
        |c| c.bus = 3,
        |c| c.id = 99,
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let mut config = robot(2, 1);
        change(&mut config.channels[1]);
        assert_ne!(config.hash(), base, "change {i}");
    }
    assert_ne!(RobotConfig { robot: robot_id("twin"), ..robot(2, 1) }.hash(), base);
}

fn with(base: Channel, change: impl Fn(&mut Channel)) -> Result<(), ConfigError> {
    let mut channel = base;
    change(&mut channel);
    RobotConfig { robot: 0, channels: [joint(100), channel].into_iter().collect() }.check()
}

#[test]
fn what_cannot_be_commanded_is_refused_by_name() {
    let refused = |base: Channel, field: &str, change: &dyn Fn(&mut Channel)| {
        let error = with(base, change).unwrap_err();
        assert_eq!((error.channel, error.field), (1, field), "{error}");
    };
    refused(joint(0), "min", &|c| c.min = f32::NAN);
    refused(joint(0), "min", &|c| c.min = -7.0);
    refused(joint(0), "max", &|c| c.max = f32::INFINITY);
    refused(joint(0), "max", &|c| c.max = c.min);
    refused(joint(0), "max_rate", &|c| c.max_rate = 0.0);
    refused(joint(0), "max_rate", &|c| c.max_rate = 66.0);
    refused(joint(0), "max_torque_nm", &|c| c.max_torque_nm = -1.0);
    refused(joint(0), "max_torque_nm", &|c| c.max_torque_nm = 20_001.0);
    refused(joint(0), "kp_nm_rad", &|c| c.kp_nm_rad = 65_001.0);
    refused(joint(0), "kd_nm_s_rad", &|c| c.kd_nm_s_rad = f32::NAN);
    refused(joint(0), "id", &|c| c.id = 128);
    refused(joint(0), "id", &|c| c.id = 100);
    refused(wheel(0), "min", &|c| c.min = 0.5);
    refused(wheel(0), "max", &|c| c.max = 1001.0);
    assert_eq!(with(joint(0), |c| (c.min, c.max) = (-6.3, 6.3)), Ok(()));
    assert_eq!(with(joint(0), |c| (c.bus, c.id) = (1, 100)), Ok(()), "another bus");
    assert_eq!(with(wheel(0), |c| c.max_rate = 5000.0), Ok(()));
    let none = RobotConfig { robot: 0, channels: Default::default() };
    assert_eq!(none.check().unwrap_err().field, "channels");
}
