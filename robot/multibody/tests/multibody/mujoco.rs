//! Test of the crate against MuJoCo, on random states of every shipped robot and of ones with springs and prismatic joints.
//!
//! The test is ignored by default because it needs Python with the package `mujoco`, which `cargo xtask test --only multibody`
//! installs. `robot/multibody/tests/compare_with_mujoco.py` compares the results.

use crate::mjcf;
use crate::robots::{State, full_tree, numbers, shipped, sliding, sprung, vector};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Matrix6xX, Vector3};
use rollwalk_multibody::{
    CompositeInertia, JOINTS, Kinematics, RimContact, Tree, about_com, centroidal_momentum_matrix,
    forward_dynamics,
};
use rollwalk_robot::{Joint, Robot};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::{env, fs};

/// Default number of random states for each robot. The environment variable `MULTIBODY_STATES` overrides it.
const STATES: usize = 50;

#[test]
#[ignore = "needs MuJoCo: cargo xtask test --only multibody"]
fn agrees_with_mujoco() {
    let states = env::var("MULTIBODY_STATES").map_or(STATES, |text| text.parse().unwrap());
    let mut robots = shipped();
    let is_plain = |joint: &Joint| joint.linkage.is_none() && !joint.is_prismatic();
    robots.retain(|robot| robot.joints.iter().all(is_plain));
    robots.push(sprung(&robots[0]));
    // Coordinates of a prismatic joint with 1 m/rad are those of MuJoCo, in metres.
    robots.push(sprung(&sliding(&robots[0], &[1.0])));
    let files: Vec<PathBuf> = robots.iter().map(|robot| write(robot, states)).collect();
    let output = compare(&files);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    println!("{}", String::from_utf8_lossy(&output.stdout));
    files.iter().for_each(|file| fs::remove_file(file).unwrap());
}

/// Checks torques of motors with crank and rod, in poses within the limits of the joints.
#[test]
#[ignore = "needs MuJoCo: cargo xtask test --only multibody"]
fn torques_of_linkages_are_those_of_mujoco_with_equalities() {
    let robot = shipped().into_iter().find(|robot| robot.name == "pup_five_bar").unwrap();
    let file = write(&robot, STATES);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/compare_linkages.py");
    let output = Command::new("python3").arg(script).arg(&file).output().expect("python3 runs");
    println!("{}", String::from_utf8_lossy(&output.stdout));
    assert!(output.status.success(), "{output:?}");
    fs::remove_file(file).unwrap();
}

#[test]
#[ignore = "needs MuJoCo: cargo xtask test --only multibody"]
fn a_wrong_number_is_refused() {
    let robot = shipped().into_iter().find(|robot| robot.name == "agilebot").unwrap();
    let robot = Robot { name: "agilebot_wrong".into(), ..robot };
    let file = write(&robot, 1);
    let mut data: Value = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
    let number = &mut data["states"][0]["results"]["contacts"][2]["material_jacobian"][0][9];
    *number = json!(number.as_f64().unwrap() + 1e-6);
    fs::write(&file, data.to_string()).unwrap();
    let output = compare(&[file]);
    let why = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{why}");
    assert!(why.contains("contacts 2 material_jacobian"), "{why}");
}

fn compare(files: &[PathBuf]) -> Output {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/compare_with_mujoco.py");
    Command::new("python3").arg(script).args(files).output().expect("python3 runs")
}

/// Writes a file with a robot, its MuJoCo model, random states, and their results.
fn write(robot: &Robot, states: usize) -> PathBuf {
    let tree = full_tree(robot);
    let mut rng = fastrand::Rng::with_seed(2024);
    let states: Vec<Value> = (0..states)
        .map(|_| {
            let mut state = State::random(&tree, &mut rng);
            if tree.transmission().has_linkages() {
                for (angle, joint) in state.joint_rad.iter_mut().zip(&robot.joints) {
                    let (min, max) = (joint.position_min_rad, joint.position_max_rad);
                    *angle = min + (max - min) * rng.f64();
                }
            }
            let points: Vec<_> = robot.links.iter().map(|_| vector(&mut rng) * 0.2).collect();
            let wheel_rad = numbers(tree.wheels().len(), 3.0, &mut rng);
            let q = state.world_from_body.quaternion();
            let motors = motor_rates(&tree, &state);
            json!({
                "base_position_m": state.base_position_m,
                "world_from_body_wxyz": [q.w, q.i, q.j, q.k],
                "joint_rad": state.joint_rad,
                "wheel_rad": wheel_rad,
                "velocity": state.velocity,
                "acceleration": state.acceleration,
                "force": state.force,
                "gravity_m_s2": state.gravity_m_s2,
                "normal": state.normal,
                "points_in_link_m": points,
                "motor_rad": tree.transmission().motors(&state.joint_rad),
                "motor_rad_s": motors.0,
                "motor_rad_s2": motors.1,
                "results": results(&tree, &state, &points),
            })
        })
        .collect();
    let end_effectors: Vec<Value> = robot
        .end_effectors
        .iter()
        .enumerate()
        .map(|(index, ee)| {
            json!({
                "name": ee.name,
                "link": ee.link,
                "center_in_link_m": ee.center_in_link_m,
                "axis_in_link": ee.contact.axis_in_link(),
                "radius_m": ee.radius_m,
                "spins": tree.wheel_dof(index).is_some(),
            })
        })
        .collect();
    let data = json!({
        "robot": robot.name,
        "mjcf": mjcf::model(&tree),
        "links": robot.links.iter().map(|link| &link.name).collect::<Vec<_>>(),
        "joints": robot.joints.iter().map(|joint| &joint.name).collect::<Vec<_>>(),
        "end_effectors": end_effectors,
        "states": states,
    });
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{}.json", robot.name));
    fs::write(&file, data.to_string()).unwrap();
    file
}

/// Speeds and accelerations of the motors of joints.
fn motor_rates(tree: &Tree, state: &State) -> (Vec<f64>, Vec<f64>) {
    let joints = JOINTS..JOINTS + tree.robot().joints.len();
    let (speed, acceleration) = (&state.velocity[joints.clone()], &state.acceleration[joints]);
    let ratios = tree.transmission().at(&state.joint_rad);
    let mut accelerations = ratios.motors(acceleration);
    for (motor, sum) in accelerations.iter_mut().enumerate() {
        *sum +=
            ratios.bends(motor).iter().map(|(j, k, by)| by * speed[*j] * speed[*k]).sum::<f64>();
    }
    (ratios.motors(speed), accelerations)
}

fn results(tree: &Tree, state: &State, points_in_link_m: &[Vector3<f64>]) -> Value {
    let at = state.configuration();
    let mut now = Kinematics::new(tree, &at);
    now.update(tree, &at, &state.velocity);
    let frames = &now.frames;
    let mut jacobian = Matrix3xX::zeros(tree.dofs());
    let mut rate = Matrix3xX::zeros(tree.dofs());

    let links: Vec<Value> = (0..tree.robot().links.len())
        .map(|link| {
            let point = frames.point(link, &points_in_link_m[link]);
            let mut value = json!({
                "position": frames.link_origins[link],
                "rotation": rows(&frames.world_from_link[link]),
                "angular_velocity": now.angular_velocity[link],
                "linear_velocity": now.linear_velocity[link],
                "point": point,
                "point_bias": now.point_acceleration(link, &point),
                "angular_bias": now.angular_acceleration[link],
            });
            frames.point_jacobian(tree, link, &point, &mut jacobian);
            value["point_jacobian"] = rows3(&jacobian);
            frames.angular_jacobian(tree, link, &mut jacobian);
            value["angular_jacobian"] = rows3(&jacobian);
            let velocity = now.point_velocity(link, &point);
            now.point_jacobian_derivative(tree, link, &point, &velocity, &mut rate);
            value["point_jacobian_derivative"] = rows3(&rate);
            now.angular_jacobian_derivative(tree, link, &mut rate);
            value["angular_jacobian_derivative"] = rows3(&rate);
            value
        })
        .collect();

    let contacts: Vec<Value> = (0..tree.robot().end_effectors.len())
        .map(|index| {
            let contact = RimContact::new(tree, frames, index, &state.normal).unwrap();
            let motion = contact.motion(&now);
            contact.material_jacobian(tree, frames, &mut jacobian);
            let velocity = &motion.material_velocity;
            contact.material_jacobian_derivative(tree, &now, velocity, &mut rate);
            json!({
                "position": contact.position(),
                "material_jacobian": rows3(&jacobian),
                "material_jacobian_derivative": rows3(&rate),
                "material_velocity": motion.material_velocity,
                "material_bias": motion.material_acceleration,
                "geometric_velocity": motion.geometric_velocity,
                "rolling_bias": motion.rolling_acceleration,
            })
        })
        .collect();

    let mut mass_matrix = DMatrix::zeros(tree.dofs(), tree.dofs());
    CompositeInertia::new(tree, frames).mass_matrix(tree, frames, &mut mass_matrix);
    let to_com = frames.com(tree) - at.base_position_m;
    let mut momentum = Matrix6xX::zeros(tree.dofs());
    centroidal_momentum_matrix(&mass_matrix, &to_com, &mut momentum);
    let mut motion_forces = vec![0.0; tree.dofs()];
    now.inverse_dynamics(tree, &Vector3::zeros(), &mut motion_forces);
    let mut bias = DVector::zeros(tree.dofs());
    now.inverse_dynamics(tree, &state.gravity_m_s2, bias.as_mut_slice());
    let force = DVector::from_column_slice(&state.force);
    let acceleration = forward_dynamics(mass_matrix.clone(), &bias, &force).unwrap();
    frames.com_jacobian(tree, &mut jacobian);
    let mut value = json!({
        "links": links,
        "contacts": contacts,
        "com": frames.com(tree),
        "com_jacobian": rows3(&jacobian),
        "com_bias": now.com_acceleration(tree),
        "centroidal_inertia": rows(&frames.centroidal_inertia(tree)),
        "mass_matrix": mass_matrix.row_iter().map(|row| numbers_of(row.iter())).collect::<Vec<_>>(),
        "centroidal_momentum_matrix":
            momentum.row_iter().map(|row| numbers_of(row.iter())).collect::<Vec<_>>(),
        "centroidal_bias": numbers_of(about_com(&motion_forces, &to_com).iter()),
        "bias_forces": numbers_of(bias.iter()),
        "forward_dynamics": numbers_of(acceleration.iter()),
    });
    now.accelerate(tree, &state.acceleration);
    now.inverse_dynamics(tree, &state.gravity_m_s2, bias.as_mut_slice());
    value["inverse_dynamics"] = numbers_of(bias.iter());
    if tree.transmission().has_linkages() {
        let joints = JOINTS..JOINTS + tree.robot().joints.len();
        let torques = now.frames.ratios(tree).motor_torques(&bias.as_slice()[joints]);
        value["motor_torques"] = numbers_of(torques.iter());
    }
    value
}

fn rows(matrix: &Matrix3<f64>) -> Value {
    matrix.row_iter().map(|row| numbers_of(row.iter())).collect()
}

fn rows3(matrix: &Matrix3xX<f64>) -> Value {
    matrix.row_iter().map(|row| numbers_of(row.iter())).collect()
}

fn numbers_of<'a>(values: impl Iterator<Item = &'a f64>) -> Value {
    values.copied().collect()
}
