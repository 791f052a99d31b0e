//! Plans a walk of AgileBot, and prints distance, duration, effort, torques and ground forces. The picture shows the plan over
//! time.
//!
//! `cargo run --release -p rollwalk-planner --example plan -- walk.svg`

use cpu_time::ProcessTime;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::plot::{JointPanels, figure};
use rollwalk_planner::torque::InverseDynamics;
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::{GRAVITY_M_S2, Robot};
use std::error::Error;
use std::fs::{read_to_string, write};
use std::ops::ControlFlow;
use std::path::PathBuf;

const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots/agilebot.toml");
const MOTION: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/motions/walk.toml");
/// Number of times at which torques and forces are evaluated.
const TIMES: usize = 400;

/// Plan with its torques and forces.
pub struct Walk {
    pub plan: Plan,
    pub cpu_s: f64,
    pub weight_n: f64,
    /// Sum of the vertical ground forces, mean over the period, N.
    pub mean_force_n: f64,
    /// End effector with the largest ground force, and the force, N.
    pub largest_force_n: (String, f64),
    /// Joint with the largest torque, and the torque, N·m.
    pub largest_torque_nm: (String, f64),
    /// Picture as SVG text.
    pub picture: String,
}

/// Plans the walk and evaluates the inverse dynamics over a period.
pub fn walk() -> Result<Walk, Box<dyn Error>> {
    let robot = Robot::from_toml(ROBOT, &read_to_string(ROBOT)?)?;
    let motion = Motion::from_toml(MOTION, &read_to_string(MOTION)?, &robot)?;

    let begin = ProcessTime::now();
    // The callback sees every iteration and may stop the solve.
    let progress = &mut |_: &_| ControlFlow::Continue(());
    let plan = optimise(&robot, &motion, &Options::default(), progress);
    let cpu_s = begin.elapsed().as_secs_f64();

    // Torques of the played motion at any time. Samples of the plan are 50 ms apart.
    let mut dynamics = InverseDynamics::new(&plan);
    let (mut mean_force_n, mut largest_force_n, mut largest_torque_nm) = (0.0, (0, 0.0), (0, 0.0));
    for k in 0..TIMES {
        let actuation = dynamics.at(plan.motion.duration_s * k as f64 / TIMES as f64);
        mean_force_n += actuation.force_n.iter().map(|force| force.z).sum::<f64>() / TIMES as f64;
        for (foot, force) in actuation.force_n.iter().enumerate() {
            largest_force_n = larger(largest_force_n, (foot, force.norm()));
        }
        for (joint, torque_nm) in actuation.joint_nm.iter().enumerate() {
            largest_torque_nm = larger(largest_torque_nm, (joint, torque_nm.abs()));
        }
    }
    let ((foot, force_n), (joint, torque_nm)) = (largest_force_n, largest_torque_nm);
    Ok(Walk {
        cpu_s,
        weight_n: GRAVITY_M_S2 * robot.links.iter().map(|link| link.mass_kg).sum::<f64>(),
        mean_force_n,
        largest_force_n: (robot.end_effectors[foot].name.clone(), force_n),
        largest_torque_nm: (robot.joints[joint].name.clone(), torque_nm),
        picture: figure(&plan, JointPanels::Limb),
        plan,
    })
}

fn larger(one: (usize, f64), other: (usize, f64)) -> (usize, f64) {
    if other.1 > one.1 { other } else { one }
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1).map(PathBuf::from);
    let path = path.unwrap_or_else(|| std::env::temp_dir().join("walk.svg"));
    let walk = walk()?;
    write(&path, &walk.picture)?;

    let [forward_m, left_m, _] = walk.plan.reached();
    let (solve, motion) = (&walk.plan.solve, &walk.plan.motion);
    println!("{} of {}: {:?}", motion.name, walk.plan.robot.name, solve.status);
    println!("distance              {forward_m:.3} m forward, {left_m:.3} m to the left");
    println!("duration              {:.2} s", motion.duration_s);
    println!("effort                {} iterations, {:.2} s CPU time", solve.iterations, walk.cpu_s);
    let (joint, torque_nm) = &walk.largest_torque_nm;
    println!("largest joint torque  {torque_nm:.2} N·m at {joint}");
    let (foot, force_n) = &walk.largest_force_n;
    println!("largest ground force  {force_n:.1} N at {foot}");
    println!("mean of their sum     {:.1} N up, weight {:.1} N", walk.mean_force_n, walk.weight_n);
    println!("picture               {}", path.display());
    Ok(())
}
