//! Measurements of the demo and their limits.

use super::score::{Score, scores};
use super::world::World;
use crate::tour::TourResult;
use miette::IntoDiagnostic;
use rollwalk_firmware::Settings;
use rollwalk_planner::families::Family;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::report::{Grid, Report};
use rollwalk_protocol::config::{ChannelKind, RobotConfig};
use rollwalk_protocol::library::{self, ClipId, validate};
use rollwalk_terminal::inputs::Library;
use rollwalk_terminal::planning::{Plans, TimedPlan};
use serde::Serialize;

/// Limit of the difference between planned and commanded joint angles, rad.
///
/// Packing may shift the ends of a transition by this tolerance, so that they meet the motions. Rounding and the controller's
/// cubic interpolation stay below it.
const COMMAND_JOINT_RAD: f64 = library::JOIN_TOLERANCE_RAD as f64;
/// Limit of the relative error of distance and turn on the ground. The thesis finds this error of the centre of mass speed in
/// its full-body simulation (sec. 2.6.4).
const WAY_SHARE: f64 = 0.06;
/// Maximum load of a bus, 0 to 1. Above it there is no capacity left for retransmissions.
const BUS_LOAD: f64 = 0.7;

#[derive(Serialize)]
pub struct DemoOutcome {
    /// Name of the robot.
    pub robot: String,
    pub clips: Vec<Clip>,
    /// Size of the motion library, bytes.
    pub library_bytes: usize,
    /// Time of the library transfer on the simulated bus, s.
    pub flash_s: f64,
    /// Time from power-on to disarmed, on the clock of the simulated robot, s.
    pub session_s: f64,
    /// Results on the ground; null on a stand.
    pub world: Option<World>,
    /// Reason why the tour ended early; null after a complete tour.
    pub stopped: Option<String>,
    /// Names of the motions in the order of playing.
    pub tour: Vec<String>,
    pub bounds: Vec<Bound>,
}

/// Measurements of a motion or transition.
#[derive(Serialize)]
pub struct Clip {
    pub name: String,
    /// Command code; null for a transition.
    pub code: Option<u8>,
    /// Status of the solve.
    pub status: Status,
    /// Number of optimiser iterations.
    pub iterations: usize,
    /// Wall time of the solve, s.
    pub solve_s: f64,
    /// Worst residual of the linear dynamics at the samples, N.
    pub dynamics_n: f64,
    /// Worst residual of the angular dynamics at the samples, N·m.
    pub dynamics_nm: f64,
    /// Worst slip of a wheel or foot in stance at the samples, mm/s.
    pub slip_mm_s: f64,
    /// Size of the motion's frames in the library, bytes.
    pub bytes: u32,
    /// Playing time, s.
    pub played_s: f64,
    /// Worst difference between plan and commanded set-point of a joint, rad.
    pub command_joint_rad: f64,
    /// Worst difference between plan and commanded set-point of a wheel, rad/s.
    pub command_wheel_rad_s: f64,
    /// Worst difference between commanded set-point and measured angle of a joint, rad.
    pub tracking_joint_rad: f64,
    /// Worst difference between commanded set-point and measured speed of a wheel, rad/s.
    pub tracking_wheel_rad_s: f64,
    /// Number of set-points that arrived after their control period.
    pub late_setpoints: usize,
    /// Load of the busiest bus during the motion, 0 to 1.
    pub bus_load: f64,
}

/// Worst value of a quantity over all clips, with its limit.
#[derive(Serialize)]
pub struct Bound {
    pub name: &'static str,
    pub worst: f64,
    pub bound: f64,
    pub unit: &'static str,
    pub holds: bool,
}

impl DemoOutcome {
    /// Collects the measurements of a demo.
    ///
    /// # Errors
    /// Returns an error if the played library cannot be read back.
    pub fn new(
        library: &Library,
        plans: &Plans,
        packed: &[u8],
        played: &TourResult,
    ) -> miette::Result<Self> {
        let rig = &played.rig;
        let index = validate(packed, rig.config()).into_diagnostic()?;
        let view = library::Library::open(packed, &index)
            .ok_or_else(|| miette::miette!("the library that was just built cannot be read"))?;
        let in_clip_order: Vec<&Plan> = plans.all().map(|planned| &planned.plan).collect();
        let scores = scores(&in_clip_order, rig, &library.robot);
        let mut clips = Vec::new();
        let mut levels = Levels::default();
        for (number, planned) in plans.all().enumerate() {
            let id = ClipId(u8::try_from(number).into_diagnostic()?);
            let facts = view.clip(id);
            let score = scores.get(&id).cloned().unwrap_or_default();
            let report = Report::new(&planned.plan);
            levels.note(&report);
            clips.push(Clip {
                code: facts.and_then(|facts| facts.code),
                bytes: facts.map_or(0, |facts| facts.bytes),
                ..clip(planned, &report, &score)
            });
        }
        let ground = rig.body().ground();
        let world = ground.map(|ground| World::new(plans, &played.travels, ground));
        let mut bounds = bounds(&clips, &levels, rig.config(), world.is_some());
        bounds.extend(world.iter().flat_map(bounds_on_ground));
        Ok(Self {
            robot: library.robot.name.clone(),
            bounds,
            clips,
            world,
            library_bytes: packed.len(),
            flash_s: played.flash_s,
            session_s: played.session_s,
            stopped: played.stopped.as_ref().map(ToString::to_string),
            tour: played.tour.clone(),
        })
    }

    /// True if the tour was completed, every plan converged, every clip was played and every limit was met.
    pub fn holds(&self) -> bool {
        self.stopped.is_none()
            && self.bounds.iter().all(|bound| bound.holds)
            && self.clips.iter().all(|clip| clip.status == Status::Converged && clip.played_s > 0.0)
    }
}

fn clip(planned: &TimedPlan, report: &Report, score: &Score) -> Clip {
    let worst = |family| report.row(family, Grid::Samples).map_or(0.0, |row| row.worst);
    Clip {
        name: planned.plan.motion.name.clone(),
        code: None,
        status: planned.plan.solve.status,
        iterations: planned.plan.solve.iterations,
        solve_s: planned.took.as_secs_f64(),
        dynamics_n: worst(Family::LinearDynamics),
        dynamics_nm: worst(Family::AngularDynamics),
        slip_mm_s: worst(Family::Slip),
        bytes: 0,
        played_s: score.played_s,
        command_joint_rad: score.command_joint_rad,
        command_wheel_rad_s: score.command_wheel_rad_s,
        tracking_joint_rad: score.tracking.joint_rad,
        tracking_wheel_rad_s: score.tracking.wheel_rad_s,
        late_setpoints: score.late_setpoints,
        bus_load: score.bus_load,
    }
}

/// Tolerances from the reports, and the maximum ratio of a residual to its tolerance.
#[derive(Default)]
struct Levels {
    linear: f64,
    angular: f64,
    slip: f64,
    worst_part: f64,
}

impl Levels {
    fn note(&mut self, report: &Report) {
        let level = |family| report.row(family, Grid::Samples).and_then(|row| row.level);
        self.linear = level(Family::LinearDynamics).unwrap_or(self.linear);
        self.angular = level(Family::AngularDynamics).unwrap_or(self.angular);
        self.slip = level(Family::Slip).unwrap_or(self.slip);
        let worst = report.worst().map_or(0.0, |row| row.part_of_level());
        self.worst_part = self.worst_part.max(worst);
    }
}

/// Limit for wheels, rad/s: between planned and commanded speeds, and between commanded and motor speeds.
///
/// The limit is the maximum change of speed in one 60 Hz frame. Packing may shift the ends of a transition by as much, and a
/// motor lags by at most one frame.
fn wheel_step_rad_s(config: &RobotConfig) -> f64 {
    fastest(config, ChannelKind::WheelSpeed) / f64::from(library::RATE_HZ)
}

/// Maximum rate of any channel of a kind: rad/s for joints, rad/s² for wheels.
fn fastest(config: &RobotConfig, kind: ChannelKind) -> f64 {
    let channels = config.channels.iter().filter(|channel| channel.kind == kind);
    channels.map(|channel| f64::from(channel.max_rate)).fold(0.0, f64::max)
}

/// Limit for joints between commanded and measured angles, rad: the maximum change of angle in one control period. The motor
/// receives the set-point of a period only at its end.
fn joint_step_rad(config: &RobotConfig) -> f64 {
    fastest(config, ChannelKind::JointPosition) / f64::from(Settings::default().control_hz)
}

fn bounds_on_ground(world: &World) -> Vec<Bound> {
    let bound =
        |name, worst, bound: f64| Bound { name, worst, bound, unit: "", holds: worst <= bound };
    let contacts = world.obstacle_contacts.as_ref();
    let touched = contacts.map(|of| bound("motions that touch obstacles", of.len() as f64, 0.0));
    let falls = bound("falls on the ground", world.falls as f64, 0.0);
    let error = world.goal_error();
    let error = bound("distance and turn on the ground, relative error", error, WAY_SHARE);
    [falls, error].into_iter().chain(touched).collect()
}

fn bounds(clips: &[Clip], levels: &Levels, config: &RobotConfig, is_on_ground: bool) -> Vec<Bound> {
    // Tolerance of a joint angle in a plan. Servos deflect under the legs' weight, and lag behind fast swings. On the ground,
    // an impact can stop a joint at its greatest speed within a period.
    let on_ground_rad = if is_on_ground { joint_step_rad(config) } else { 0.0 };
    let tracking_joint_rad = Family::JointLimit.level().at(1.0) + on_ground_rad;
    let wheel_step_rad_s = wheel_step_rad_s(config);
    let bound = |name, unit, bound: f64, value: fn(&Clip) -> f64| {
        let worst = clips.iter().map(value).fold(0.0, f64::max);
        Bound { name, worst, bound, unit, holds: worst <= bound }
    };
    let residuals = Bound {
        name: "largest residual / tolerance of the plans",
        worst: levels.worst_part,
        bound: 1.0,
        unit: "",
        holds: levels.worst_part <= 1.0,
    };
    vec![
        bound("linear dynamics of the plans", "N", levels.linear, |clip| clip.dynamics_n),
        bound("angular dynamics of the plans", "N·m", levels.angular, |clip| clip.dynamics_nm),
        bound("slip of wheels and feet in the plans", "mm/s", levels.slip, |clip| clip.slip_mm_s),
        residuals,
        bound("difference between plan and command, joints", "rad", COMMAND_JOINT_RAD, |c| {
            c.command_joint_rad
        }),
        bound("difference between plan and command, wheels", "rad/s", wheel_step_rad_s, |clip| {
            clip.command_wheel_rad_s
        }),
        bound("difference between command and motor, joints", "rad", tracking_joint_rad, |clip| {
            clip.tracking_joint_rad
        }),
        bound("difference between command and motor, wheels", "rad/s", wheel_step_rad_s, |clip| {
            clip.tracking_wheel_rad_s
        }),
        bound("setpoints later than their control period", "", 0.0, |clip| {
            clip.late_setpoints as f64
        }),
        bound("load of the busiest bus", "", BUS_LOAD, |clip| clip.bus_load),
    ]
}
