//! Poses in files: a position and a quaternion with w first, as everywhere in this project. The serialisation of nalgebra has w
//! last.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Maximum deviation of a quaternion's norm from 1.
const UNIT_TOLERANCE: f64 = 1e-6;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseFields {
    position_m: [f64; 3],
    orientation_wxyz: [f64; 4],
}

/// Serialises a pose, for `#[serde(with)]`.
pub fn serialize<S: Serializer>(pose: &Isometry3<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    let q = pose.rotation.quaternion();
    let fields = PoseFields {
        position_m: pose.translation.vector.into(),
        orientation_wxyz: [q.w, q.i, q.j, q.k],
    };
    fields.serialize(serializer)
}

/// Deserialises a pose, for `#[serde(with)]`.
///
/// # Errors
/// If a field is missing, or `orientation_wxyz` is not a unit quaternion.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Isometry3<f64>, D::Error> {
    let PoseFields { position_m: [x, y, z], orientation_wxyz: [w, i, j, k] } =
        PoseFields::deserialize(deserializer)?;
    let quaternion = Quaternion::new(w, i, j, k);
    let norm = quaternion.norm();
    if norm.is_nan() || (norm - 1.0).abs() > UNIT_TOLERANCE {
        return Err(D::Error::custom(format!(
            "orientation_wxyz has norm {norm}; expected a unit quaternion [w, x, y, z]"
        )));
    }
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::new_unchecked(quaternion)))
}

/// Roll, pitch and yaw of a rotation, rad: R = Rz(yaw) Ry(pitch) Rx(roll). They are exact at every pitch, right angles included.
#[must_use]
pub fn roll_pitch_yaw(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let r = rotation.to_rotation_matrix().into_inner();
    let pitch = (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)]));
    // At a pitch near a right angle, any roll is right together with the remaining yaw.
    let roll = r[(2, 1)].atan2(r[(2, 2)]);
    let (s, c) = roll.sin_cos();
    let yaw = (r[(0, 2)] * s - r[(0, 1)] * c).atan2(r[(1, 1)] * c - r[(1, 2)] * s);
    [roll, pitch, yaw]
}

#[cfg(test)]
mod tests {
    use super::roll_pitch_yaw;
    use nalgebra::{Quaternion, UnitQuaternion, Vector3};
    use std::f64::consts::FRAC_PI_2;

    #[derive(serde::Serialize, serde::Deserialize)]
    struct Holder(#[serde(with = "super")] nalgebra::Isometry3<f64>);

    #[test]
    fn poses_have_w_first_and_must_be_unit() {
        let text = r#"{"position_m":[1.0,2.0,3.0],"orientation_wxyz":[0.6,0.0,0.8,0.0]}"#;
        let Holder(pose) = serde_json::from_str(text).unwrap();
        assert_eq!(pose.rotation.w, 0.6);
        assert_eq!(serde_json::to_string(&Holder(pose)).unwrap(), text);
        let error = serde_json::from_str::<Holder>(&text.replace("0.6", "0.9")).err().unwrap();
        assert!(error.to_string().contains("expected a unit quaternion"), "{error}");
    }

    #[test]
    fn angles_give_their_rotation_back() {
        let of_axis = |axis, angle| {
            UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_normalize(axis), angle)
        };
        let axes = [Vector3::x(), Vector3::y(), Vector3::z(), Vector3::new(0.3, -0.5, 0.8)];
        let angles = [0.0, 1e-9, 0.4, FRAC_PI_2, FRAC_PI_2 + 1e-13, 3.0, -FRAC_PI_2, -3.1];
        let mut turns: Vec<_> =
            axes.iter().flat_map(|axis| angles.map(|angle| of_axis(*axis, angle))).collect();
        // A hip of HyQReal: half a turn about x - z.
        turns.push(UnitQuaternion::from_quaternion(Quaternion::new(0.0, 1.0, 0.0, -1.0)));
        for turn in turns {
            let [roll, pitch, yaw] = roll_pitch_yaw(&turn);
            let back = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            let [back, given] = [back, turn].map(|turn| turn.to_rotation_matrix().into_inner());
            assert!((back - given).norm() < 1e-11, "{turn}: {}", back - given);
        }
    }
}
