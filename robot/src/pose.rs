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

#[cfg(test)]
mod tests {
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
}
