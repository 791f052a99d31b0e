//! Messages of Foxglove's well-known schemas, in JSON: <https://docs.foxglove.dev/docs/sdk/schemas>.
//!
//! One definition gives the fields of a message and its JSON schema. Lists that are always empty are included because readers
//! require them.

use serde::Serialize;
use serde_json::{Map, Value, json};

/// Value with a JSON schema.
pub trait Schema: Serialize {
    /// Name of the schema; empty for plain values.
    const NAME: &'static str = "";

    /// Returns the JSON schema.
    fn schema() -> Value;
}

impl Schema for f64 {
    fn schema() -> Value {
        json!({ "type": "number" })
    }
}

impl Schema for u32 {
    fn schema() -> Value {
        json!({ "type": "integer", "minimum": 0 })
    }
}

impl Schema for bool {
    fn schema() -> Value {
        json!({ "type": "boolean" })
    }
}

impl Schema for String {
    fn schema() -> Value {
        json!({ "type": "string" })
    }
}

impl<T: Schema> Schema for Option<T> {
    fn schema() -> Value {
        T::schema()
    }
}

impl<T: Schema> Schema for Vec<T> {
    fn schema() -> Value {
        json!({ "type": "array", "items": T::schema() })
    }
}

macro_rules! messages {
    ($($name:ident = $title:literal { $($(#[$attribute:meta])* $field:ident: $kind:ty,)* })*) => {$(
        #[derive(Clone, Debug, Default, PartialEq, Serialize)]
        pub struct $name {
            $($(#[$attribute])* pub $field: $kind,)*
        }

        impl Schema for $name {
            const NAME: &'static str = $title;

            fn schema() -> Value {
                let fields: &[(&str, Value)] = &[$((stringify!($field), <$kind>::schema()),)*];
                let fields = fields.iter().map(|(name, of)| ((*name).to_owned(), of.clone()));
                let properties: Map<String, Value> = fields.collect();
                json!({ "title": $title, "type": "object", "properties": properties })
            }
        }
    )*};
}

messages! {
    Time = "time" { sec: u32, nsec: u32, }
    Duration = "duration" { sec: u32, nsec: u32, }
    Vector3 = "foxglove.Vector3" { x: f64, y: f64, z: f64, }
    Point3 = "foxglove.Point3" { x: f64, y: f64, z: f64, }
    Quaternion = "foxglove.Quaternion" { x: f64, y: f64, z: f64, w: f64, }
    Pose = "foxglove.Pose" { position: Vector3, orientation: Quaternion, }
    Color = "foxglove.Color" { r: f64, g: f64, b: f64, a: f64, }

    FrameTransforms = "foxglove.FrameTransforms" { transforms: Vec<FrameTransform>, }
    FrameTransform = "foxglove.FrameTransform" {
        timestamp: Time,
        parent_frame_id: String,
        child_frame_id: String,
        translation: Vector3,
        rotation: Quaternion,
    }

    JointStates = "foxglove.JointStates" { timestamp: Time, joints: Vec<JointState>, }
    JointState = "foxglove.JointState" {
        name: String,
        #[serde(skip_serializing_if = "Option::is_none")]
        position: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        velocity: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        effort: Option<f64>,
    }

    Point3InFrame = "foxglove.Point3InFrame" { timestamp: Time, frame_id: String, point: Point3, }

    SceneUpdate = "foxglove.SceneUpdate" { deletions: Vec<Unused>, entities: Vec<SceneEntity>, }
    SceneEntity = "foxglove.SceneEntity" {
        timestamp: Time,
        frame_id: String,
        id: String,
        lifetime: Duration,
        frame_locked: bool,
        metadata: Vec<Unused>,
        arrows: Vec<ArrowPrimitive>,
        cubes: Vec<CubePrimitive>,
        spheres: Vec<SpherePrimitive>,
        cylinders: Vec<CylinderPrimitive>,
        lines: Vec<Unused>,
        triangles: Vec<Unused>,
        texts: Vec<Unused>,
        models: Vec<Unused>,
    }
    ArrowPrimitive = "foxglove.ArrowPrimitive" {
        pose: Pose,
        shaft_length: f64,
        shaft_diameter: f64,
        head_length: f64,
        head_diameter: f64,
        color: Color,
    }
    CubePrimitive = "foxglove.CubePrimitive" { pose: Pose, size: Vector3, color: Color, }
    SpherePrimitive = "foxglove.SpherePrimitive" { pose: Pose, size: Vector3, color: Color, }
    CylinderPrimitive = "foxglove.CylinderPrimitive" {
        pose: Pose,
        size: Vector3,
        bottom_scale: f64,
        top_scale: f64,
        color: Color,
    }

    Unused = "" { }
}
