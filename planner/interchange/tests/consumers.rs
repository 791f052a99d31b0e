//! Exports read by their tools: MuJoCo, Pinocchio and a URDF reader load the shipped robots, and their poses are compared with
//! those of `rollwalk-multibody`.
//!
//! Ignored by default: needs Python packages that `cargo xtask test --only exports` installs. The comparison is
//! `planner/interchange/tests/consumers.py`.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::{Configuration, Frames, Tree};
use rollwalk_robot::Robot;
use rollwalk_robot::urdf::{Text, import};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// Random poses of each robot.
const POSES: usize = 20;

#[test]
#[ignore = "needs MuJoCo and Pinocchio: cargo xtask test --only exports"]
fn robots_have_the_same_poses_elsewhere() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("exported");
    fs::create_dir_all(&folder).unwrap();
    let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shipped/robots");
    let mut files: Vec<PathBuf> =
        fs::read_dir(robots).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "toml"));
    files.sort();
    assert!(files.len() >= 15, "{files:?}");
    for file in &files {
        let text = fs::read_to_string(file).unwrap();
        let name = file.file_stem().unwrap().to_str().unwrap();
        let (robot, parts) = Robot::with_parts_from_toml(name, &text).unwrap();
        let write = |ending: &str, text: String| {
            fs::write(folder.join(format!("{name}.{ending}")), text).unwrap();
        };
        write("urdf", rollwalk_interchange::urdf(&robot, &parts).unwrap());
        write("xml", rollwalk_interchange::mjcf(&robot, &parts).unwrap());
        write("poses.json", poses(&robot).to_string());
    }
    in_python(&folder);
}

#[test]
#[ignore = "needs MuJoCo and Pinocchio: cargo xtask test --only exports"]
fn an_imported_model_has_the_poses_of_mujoco() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let read = |name: &str| fs::read_to_string(tests.join(name)).unwrap();
    let (model, side) = (read("quadruped.xml"), read("quadruped.side.toml"));
    let model = Text { name: "quadruped.xml", text: &model };
    let side = Text { name: "quadruped.side.toml", text: &side };
    let imported =
        import(model, side).unwrap_or_else(|why| panic!("{:?}", miette::Report::new(why)));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("imported");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("quadruped.xml"), model.text).unwrap();
    let poses = poses(&imported.robot).to_string();
    fs::write(folder.join("quadruped.imported.json"), poses).unwrap();
    in_python(&folder);
}

/// Runs the comparison on a folder.
fn in_python(folder: &Path) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/consumers.py");
    let python = env::var_os("PYTHON").unwrap_or_else(|| "python3".into());
    let output = Command::new(python).arg(script).arg(folder).output().expect("Python runs");
    println!("{}", String::from_utf8_lossy(&output.stdout));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Random poses with quantities computed from them.
fn poses(robot: &Robot) -> Value {
    let tree = Tree::new(robot);
    let mut rng = fastrand::Rng::with_seed(7);
    let mut number = |size: f64| (2.0 * rng.f64() - 1.0) * size;
    let poses: Vec<_> = (0..POSES)
        .map(|_| {
            let joint_rad: Vec<_> = robot.joints.iter().map(|_| number(3.0)).collect();
            let wheel_rad: Vec<_> = robot.end_effectors.iter().map(|_| number(3.0)).collect();
            let frames = Frames::new(
                &tree,
                &Configuration {
                    base_position_m: Vector3::zeros(),
                    world_from_body: Matrix3::identity(),
                    joint_rad: &joint_rad,
                },
            );
            let rows = |m: &Matrix3<f64>| m.transpose().as_slice().to_vec();
            let links: Vec<_> = (0..robot.links.len())
                .map(|link| {
                    json!({
                        "position_m": frames.link_origins[link],
                        "rotation": rows(&frames.world_from_link[link]),
                    })
                })
                .collect();
            let feet = robot.end_effectors.iter();
            let feet: Vec<_> =
                feet.map(|foot| frames.point(foot.link, &foot.center_in_link_m)).collect();
            json!({
                "joint_rad": joint_rad,
                "wheel_rad": wheel_rad,
                "links": links,
                "centers_m": feet,
                "com_m": frames.com(&tree),
                "inertia_kg_m2": rows(&frames.centroidal_inertia(&tree)),
            })
        })
        .collect();
    let feet = robot.end_effectors.iter();
    let feet: Vec<_> =
        feet.map(|foot| json!({"name": foot.name, "spins": foot.contact.spins()})).collect();
    let transmission = robot.transmission();
    let ratios = transmission.nominal();
    json!({
        "mass_kg": robot.total_mass_kg(),
        "links": robot.links.iter().map(|link| &link.name).collect::<Vec<_>>(),
        "joints": robot.joints.iter().map(|joint| &joint.name).collect::<Vec<_>>(),
        "limits": robot.joints.iter().enumerate().map(|(number, joint)| json!({
            "position_rad": [joint.position_min_rad, joint.position_max_rad],
            "torque_nm": joint.actuator.torque_max_nm,
            "joint_speed_rad_s": ratios.joint_speed_max_rad_s(robot, number),
            "joint_torque_nm": ratios.joint_torque_max_nm(robot, number),
            // The rotor of a coupled motor is at its tendon or crank.
            "armature_kg_m2": if joint.is_coupled() { 0.0 } else { joint.actuator.armature_kg_m2 },
        })).collect::<Vec<_>>(),
        "end_effectors": feet,
        "poses": poses,
    })
}
