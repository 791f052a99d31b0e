//! Inputs of continuous steering: the motion library with its SAFE pose, a gait, and the fastest speeds.

use crate::inputs::{self, number_within};
use crate::output;
use crate::packed::Packed;
use miette::{IntoDiagnostic, Report, miette};
use rollwalk_host::catalog::Catalog;
use rollwalk_pilot::{Fastest, Route};
use rollwalk_planner::plan::Plan;
use rollwalk_planner::receding::Gait;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_robot::{Contact, Robot};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Fastest speed of a robot whose gait does not set one, m/s.
const SPEED_M_S: f64 = 0.2;

/// Options for steering a robot.
#[derive(clap::Args)]
pub struct SteeringArgs {
    /// Periodic plan (JSON) in whose gait the robot walks while it is steered.
    #[arg(long, value_name = "PLAN.json")]
    pub gait: Option<PathBuf>,
    /// Fastest speed that keys, sticks or velocities of ROS 2 ask for, m/s [default: that of the gait, or 0.2].
    #[arg(long, value_name = "M/S", value_parser = fast)]
    speed: Option<f64>,
    /// Fastest turn that they ask for, rad/s.
    #[arg(long, value_name = "RAD/S", default_value_t = 0.4, value_parser = fast)]
    turn: f64,
    /// Longest time to plan, in milliseconds; the best plan so far counts then, if it meets the constraints.
    #[arg(long, value_name = "MS", default_value_t = 90, value_parser = clap::value_parser!(u64).range(10..=200))]
    budget_ms: u64,
}

fn fast(text: &str) -> Result<f64, String> {
    number_within(text, 0.01..=20.0)
}

/// Inputs of steering.
pub struct Prepared {
    /// Robot in its SAFE pose, and its gait.
    pub route: Route,
    /// Fastest speeds of steering.
    pub fastest: Fastest,
    /// Names of the library whose SAFE pose it begins in.
    pub catalog: Catalog,
}

impl Prepared {
    /// Checks that the robot can move: without a gait all end effectors have to roll.
    ///
    /// # Errors
    /// Names of the end effectors that cannot roll, in words.
    pub fn check_goes(&self) -> Result<(), String> {
        let Route { robot, gait, .. } = &self.route;
        let stays = |contact: &Contact| !contact.rolls() || contact.rolls_with_link();
        let feet = robot.end_effectors.iter().filter(|of| stays(&of.contact));
        let feet: Vec<_> = feet.map(|of| &*of.name).collect();
        if gait.is_some() || feet.is_empty() {
            return Ok(());
        }
        Err(format!(
            "{} cannot drive with all its end effectors on the ground, because these feet, or wheels that are fixed to their links, cannot roll: {}",
            robot.name,
            feet.join(", ")
        ))
    }
}

/// Advice that gives a gait to a robot that does not roll.
pub const GIVE_GAIT: &str = "--gait PLAN.json gives it a gait: a plan with ends = \"periodic\"";

impl SteeringArgs {
    /// Reads the files.
    ///
    /// # Errors
    /// A file is missing or wrong, the gait is of another robot, or no motion of the robot can be planned as it goes.
    pub fn prepare(&self, library: &Path, robot: Option<&Path>) -> miette::Result<Prepared> {
        let packed = Packed::read(library, robot)?;
        let (route, fastest) = self.route(library, &packed)?;
        // Whether it can be planned shows before the robot is armed.
        route.course().map_err(Report::msg)?;
        Ok(Prepared { route, fastest, catalog: packed.catalog() })
    }

    /// Longest time of a plan.
    pub fn budget(&self) -> Duration {
        Duration::from_millis(self.budget_ms)
    }

    /// Robot in its SAFE pose, its gait, and its fastest speeds.
    fn route(&self, library: &Path, packed: &Packed) -> miette::Result<(Route, Fastest)> {
        let robot = packed.robot.clone();
        let mut pose = [0.0; MAX_CHANNELS];
        packed
            .library()
            .safe_pose_into(&mut pose)
            .ok_or_else(|| miette!("{}: its SAFE pose cannot be read", library.display()))?;
        let safe_rad =
            pose.iter().take(robot.joints.len()).map(|&angle| f64::from(angle)).collect();
        let plan = self.gait.as_deref().map(inputs::plan).transpose()?;
        if let Some(plan) = &plan {
            check_gait(library, plan, &robot)?;
        }
        let gait = plan.as_ref().map(Gait::of).transpose().into_diagnostic()?;
        let speed_m_s = self.speed.or(plan.as_ref().and_then(mean_speed_m_s)).unwrap_or(SPEED_M_S);
        let fastest = Fastest { speed_m_s, turn_rad_s: self.turn };
        Ok((Route { robot, safe_rad, gait }, fastest))
    }
}

fn check_gait(library: &Path, plan: &Plan, robot: &Robot) -> miette::Result<()> {
    let name = &plan.motion.name;
    if plan.robot != *robot {
        return Err(miette!(
            help = "plan the gait with the robot file that the library was built from",
            "the gait `{name}` is of robot `{}`, {} is for `{}`, or their files differ",
            plan.robot.name,
            library.display(),
            robot.name
        ));
    }
    if let Some(why) = &plan.motion.needs_feedback {
        output::say(format_args!(
            "warning: `{name}` needs feedback of the whole body ({why}), and is played without"
        ));
    }
    Ok(())
}

/// Mean speed of a plan over the ground, if it goes anywhere.
fn mean_speed_m_s(plan: &Plan) -> Option<f64> {
    let [x, y] = plan.end_placement.offset_m;
    let speed_m_s = x.hypot(y) / plan.motion.duration_s;
    (speed_m_s > 0.01).then_some(speed_m_s)
}
