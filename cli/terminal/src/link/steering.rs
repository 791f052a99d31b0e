//! Inputs of continuous steering: the motion library with its SAFE pose, a gait, and the maximum speeds.

use super::reach::Reach;
use crate::inputs::{self, number_within};
use crate::output;
use crate::validated_library::ValidatedLibrary;
use miette::{IntoDiagnostic, Report, miette};
use rollwalk_host::catalog::Catalog;
use rollwalk_pilot::{Fastest, Route};
use rollwalk_planner::plan::Plan;
use rollwalk_planner::receding::Gait;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_robot::{Contact, Robot};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Maximum speed of a robot whose gait does not define one, m/s.
const SPEED_M_S: f64 = 0.2;

/// Options of steering.
#[derive(clap::Args)]
pub struct SteeringArgs {
    /// Periodic plan (JSON) whose gait the robot walks in while it is steered.
    #[arg(long, value_name = "PLAN.json")]
    pub gait: Option<PathBuf>,
    /// Maximum speed that keys, sticks or velocities of ROS 2 command, m/s [default: mean speed of the gait, or 0.2].
    #[arg(long, value_name = "M/S", value_parser = fast)]
    speed: Option<f64>,
    /// Maximum turn rate that keys, sticks or velocities of ROS 2 command, rad/s.
    #[arg(long, value_name = "RAD/S", default_value_t = 0.4, value_parser = fast)]
    turn: f64,
    /// Time limit of each plan, in milliseconds. At the limit the best plan so far is used if it meets the constraints.
    #[arg(long, value_name = "MS", default_value_t = 90, value_parser = clap::value_parser!(u64).range(10..=200))]
    budget_ms: u64,
}

fn fast(text: &str) -> Result<f64, String> {
    number_within(text, 0.01..=20.0)
}

/// Prepared inputs of steering.
pub struct SteeringInputs {
    /// Robot in its SAFE pose, with its gait.
    pub route: Route,
    /// Maximum speeds of steering.
    pub fastest: Fastest,
    /// Speeds that no plan exceeds; `None` if they are unknown.
    pub reach: Option<Reach>,
    /// Names of the library whose SAFE pose the robot starts in.
    pub catalog: Catalog,
}

impl SteeringInputs {
    /// Checks that the robot can move: without a gait, all end effectors must roll.
    ///
    /// # Errors
    /// Returns a message with the names of the end effectors that cannot roll.
    pub fn check_goes(&self) -> Result<(), String> {
        let Route { robot, gait, .. } = &self.route;
        let stays = |contact: &Contact| !contact.rolls() || contact.rolls_with_link();
        let feet = robot.end_effectors.iter().filter(|of| stays(&of.contact));
        let feet: Vec<_> = feet.map(|of| &*of.name).collect();
        if gait.is_some() || feet.is_empty() {
            return Ok(());
        }
        Err(format!(
            "{} cannot drive without a gait, because these feet or fixed wheels do not roll: {}",
            robot.name,
            feet.join(", ")
        ))
    }
}

/// Advice to give a gait to a robot that does not roll.
pub const GIVE_GAIT: &str = "give a gait with --gait PLAN.json, a plan with ends = \"periodic\"";

impl SteeringArgs {
    /// Reads the library, the robot and the gait.
    ///
    /// # Errors
    /// Returns an error if a file is missing or wrong, if the gait is of another robot, or if the robot's motion cannot be
    /// planned.
    pub fn prepare(&self, library: &Path, robot: Option<&Path>) -> miette::Result<SteeringInputs> {
        let packed = ValidatedLibrary::read(library, robot)?;
        let (route, fastest, reach) = self.route(library, &packed)?;
        // Planning errors must appear before the robot is armed.
        route.course().map_err(Report::msg)?;
        Ok(SteeringInputs { route, fastest, reach, catalog: packed.catalog() })
    }

    /// Time limit of a plan.
    pub fn budget(&self) -> Duration {
        Duration::from_millis(self.budget_ms)
    }

    /// Route with the SAFE pose and the gait, the maximum speeds, and the speeds that no plan exceeds.
    fn route(
        &self,
        library: &Path,
        packed: &ValidatedLibrary,
    ) -> miette::Result<(Route, Fastest, Option<Reach>)> {
        let robot = packed.robot.clone();
        let mut pose = [0.0; MAX_CHANNELS];
        packed
            .library()
            .safe_pose_into(&mut pose)
            .ok_or_else(|| miette!("cannot read the SAFE pose of {}", library.display()))?;
        let angles = pose.iter().map(|&angle| f64::from(angle));
        let safe_rad = robot.all_joints(angles, |_, joint| joint.nominal_rad);
        let plan = self.gait.as_deref().map(inputs::plan).transpose()?;
        if let Some(plan) = &plan {
            check_gait(library, plan, &robot)?;
        }
        let gait = plan.as_ref().map(Gait::of).transpose().into_diagnostic()?;
        let speed_m_s = self.speed.or(plan.as_ref().and_then(mean_speed_m_s)).unwrap_or(SPEED_M_S);
        let fastest = Fastest { speed_m_s, turn_rad_s: self.turn };
        let reach = Reach::new(&robot, plan.as_ref());
        Ok((Route { robot, safe_rad, gait }, fastest, reach))
    }
}

fn check_gait(library: &Path, plan: &Plan, robot: &Robot) -> miette::Result<()> {
    let name = &plan.motion.name;
    if plan.robot != *robot {
        return Err(miette!(
            help = "plan the gait with the robot file that the library was built from",
            "the gait `{name}` was planned for robot `{}`, but {} is for robot `{}` or another \
             version of its file",
            plan.robot.name,
            library.display(),
            robot.name
        ));
    }
    if let Some(why) = &plan.motion.needs_feedback {
        output::print_line(format_args!(
            "warning: `{name}` needs whole-body feedback ({why}), but is played without feedback"
        ));
    }
    Ok(())
}

/// Mean speed of a plan over the ground; `None` if it is at most 0.01 m/s.
fn mean_speed_m_s(plan: &Plan) -> Option<f64> {
    let [x, y] = plan.end_placement.offset_m;
    let speed_m_s = x.hypot(y) / plan.motion.duration_s;
    (speed_m_s > 0.01).then_some(speed_m_s)
}
