//! Plans as keyframes of MuJoCo, as trajectories of ROS and as recordings.

use rollwalk_planner::export::Rate;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

const CAR: &str = include_str!("../../../shipped/robots/car.toml");
const DRIVE: &str = include_str!("../../../shipped/motions/car_drive.toml");

/// Plan of a car that turns by 5 rad, made without a solver.
fn turn() -> Plan {
    let robot = Robot::from_toml("car.toml", CAR).unwrap();
    let few = DRIVE.replacen("samples = 24", "samples = 8", 1);
    let motion = Motion::from_toml("car_drive.toml", &few, &robot).unwrap();
    let mut plan =
        optimise(&robot, &motion, &Options::default(), &mut |_| ControlFlow::Continue(()));
    let last = (plan.samples.len() - 1) as f64;
    for (number, sample) in plan.samples.iter_mut().enumerate() {
        sample.base_yaw_pitch_roll_rad[0] = 5.0 * number as f64 / last;
    }
    plan.after.base_yaw_pitch_roll_rad[0] = 5.0;
    plan
}

#[test]
fn quaternions_do_not_change_their_sign_along_a_turn() {
    let (plan, rate) = (turn(), Rate::new(30.0).unwrap());
    let model = rollwalk_interchange::motion(&plan, rate).unwrap();
    let model = roxmltree::Document::parse(&model).unwrap();
    let keys = model.descendants().filter(|node| node.has_tag_name("key"));
    let number = |text: &str| text.parse::<f64>().unwrap();
    let wxyz = |node: roxmltree::Node<'_, '_>| {
        let qpos: Vec<_> = node.attribute("qpos").unwrap().split(' ').map(number).collect();
        [qpos[3], qpos[4], qpos[5], qpos[6]]
    };
    let keyframes: Vec<_> = keys.map(wxyz).collect();
    let trajectory: Value =
        serde_json::from_str(&rollwalk_interchange::trajectory(&plan, rate)).unwrap();
    let points = trajectory["multi_dof_joint_trajectory"]["points"].as_array().unwrap();
    let wxyz = |point: &Value| {
        let rotation = &point["transforms"][0]["rotation"];
        ["w", "x", "y", "z"].map(|of| rotation[of].as_f64().unwrap())
    };
    let points: Vec<_> = points.iter().map(wxyz).collect();
    for quaternions in [keyframes, points] {
        assert_eq!(quaternions.len(), 61);
        assert!((quaternions[60][0] - 2.5f64.cos()).abs() < 1e-9, "{:?}", quaternions[60]);
        for two in quaternions.windows(2) {
            let dot: f64 = two[0].iter().zip(two[1]).map(|(a, b)| a * b).sum();
            assert!(dot > 0.9, "{two:?}");
        }
    }
}

/// Asserts that a message has only fields of its JSON schema, with the types of the schema.
fn conforms(value: &Value, schema: &Value) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| conforms(item, &schema["items"])),
        Value::Object(fields) => {
            fields.iter().for_each(|(name, field)| conforms(field, &schema["properties"][name]));
        }
        Value::String(_) => assert_eq!(schema["type"], "string"),
        Value::Bool(_) => assert_eq!(schema["type"], "boolean"),
        Value::Number(number) if number.is_u64() => assert_eq!(schema["type"], "integer"),
        Value::Number(_) => assert_eq!(schema["type"], "number"),
        Value::Null => panic!("null is no {schema}"),
    }
}

#[test]
fn recordings_have_messages_of_their_schemas_at_every_frame() {
    let (plan, rate) = (turn(), Rate::new(30.0).unwrap());
    let bytes = rollwalk_interchange::foxglove::recording(&plan, rate).unwrap();
    assert!(rollwalk_interchange::foxglove::recording(&plan, rate).unwrap() == bytes);
    let mut found: BTreeMap<(String, String), u32> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let (channel, schema) =
            (&message.channel, message.channel.schema.as_ref().expect("a schema"));
        assert_eq!((&*channel.message_encoding, &*schema.encoding), ("json", "jsonschema"));
        let (value, of) = (&message.data, &schema.data);
        conforms(&serde_json::from_slice(value).unwrap(), &serde_json::from_slice(of).unwrap());
        *found.entry((channel.topic.clone(), schema.name.clone())).or_default() += 1;
    }
    let of =
        |topic: &str, name: &str, count| ((topic.to_owned(), format!("foxglove.{name}")), count);
    let expected = [
        of("/com", "Point3InFrame", 61),
        of("/forces", "SceneUpdate", 61),
        of("/joint_states", "JointStates", 61),
        of("/robot", "SceneUpdate", 1),
        of("/tf", "FrameTransforms", 61),
    ];
    assert_eq!(found, BTreeMap::from(expected));
}
