//! Live view of moving robots in Foxglove and Lichtblick (`--foxglove`).

use clap::Args;
use miette::miette;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use rollwalk_host::joints::{Joint, Joints};
use rollwalk_interchange::foxglove::{Figure, LiveServer, Posture};
use rollwalk_multibody::{Standing, Tree};
use rollwalk_physics::World;
use rollwalk_robot::{Robot, Solid};
use rollwalk_terminal::output;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Default port to which Foxglove connects.
const PORT: &str = "8765";
/// Minimum interval between two pictures; displays are not faster.
const PICTURE: Duration = Duration::from_millis(16);
/// Interval at which solids are sent again, for clients that connected in the meantime.
const SOLIDS: Duration = Duration::from_secs(1);
/// Colour of the measured robot, RGBA.
const MEASURED: [f64; 4] = [0.36, 0.53, 0.78, 1.0];
/// Colour of the planned robot, RGBA; translucent, so that the measured robot stays visible.
const PLANNED: [f64; 4] = [0.55, 0.75, 0.45, 0.4];

/// Options of commands that show a moving robot.
#[derive(Args)]
pub struct LiveArgs {
    /// Serve the robot in 3D to Foxglove or Lichtblick on this computer; they open ws://localhost:PORT.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = PORT)]
    foxglove: Option<u16>,
}

impl LiveArgs {
    /// True if `--foxglove` was given.
    pub fn is_asked_for(&self) -> bool {
        self.foxglove.is_some()
    }

    /// Starts the server if `--foxglove` was given.
    ///
    /// # Errors
    /// Returns an error if the port is in use.
    pub fn begin<'r>(
        &self,
        robot: &'r Robot,
        parts: &[Vec<Solid>],
    ) -> miette::Result<Option<View<'r>>> {
        let Some(port) = self.foxglove else { return Ok(None) };
        let live = LiveServer::start(&robot.name, port).map_err(|error| {
            miette!(
                help = "give another port with --foxglove PORT; 0 stands for any free port",
                "{error}"
            )
        })?;
        output::print_line(format_args!(
            "Foxglove and Lichtblick show the robot at {}",
            live.address()
        ));
        Ok(Some(View::new(live, robot, parts)))
    }
}

/// Measured robot on a server, with the planned robot beside it.
pub struct View<'r> {
    live: LiveServer,
    robot: &'r Robot,
    measured: Figure<'r>,
    planned: Figure<'r>,
    /// Pose of the body if it is unknown: at the height of the standing robot.
    standing: Isometry3<f64>,
    /// Angles of planned wheels, integrated from their speeds, rad.
    rolled_rad: Vec<f64>,
    /// Time of the previous integration of `rolled_rad`.
    rolled_at: Instant,
    pictured: Option<Instant>,
    shown_solids: Option<Instant>,
}

impl<'r> View<'r> {
    fn new(live: LiveServer, robot: &'r Robot, parts: &[Vec<Solid>]) -> Self {
        let height = Standing::new(&Tree::new(robot)).map_or(0.0, |s| s.frames.link_origins[0].z);
        Self {
            live,
            robot,
            measured: Figure::new(robot, parts, "", MEASURED),
            planned: Figure::new(robot, parts, "planned/", PLANNED),
            standing: Isometry3::translation(0.0, 0.0, height),
            rolled_rad: vec![0.0; robot.end_effectors.len()],
            rolled_at: Instant::now(),
            pictured: None,
            shown_solids: None,
        }
    }

    /// Displays joints of a robot on a bus. The bus does not report the pose of the body, so the body stands still.
    pub fn show_joints(&mut self, joints: &Joints) {
        if !self.live.has_clients() {
            return;
        }
        let (figure, channel, all) = match joints {
            Joints::Measured(all) => (&self.measured, &self.live.measured, all),
            Joints::Planned(all) => (&self.planned, &self.live.planned, all),
        };
        let by_channel = |channel: usize| all.iter().find(|j| usize::from(j.channel) == channel);
        let nominal: Vec<_> = self.robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        let transmission = self.robot.transmission();
        let angle =
            |of: Option<&Joint>, other: f64| of.and_then(|j| j.position_rad).unwrap_or(other);
        let motors_rad = transmission.motors(&nominal);
        let nominal = self.robot.of_driven_joints(&motors_rad).enumerate();
        let driven = nominal.map(|(k, nominal_rad)| angle(by_channel(k), nominal_rad));
        let motor_rad = self.robot.all_joints(driven, |_, joint| joint.nominal_rad);
        let joint_rad = transmission.joints(&motor_rad);
        let mut wheel_rad = vec![0.0; self.robot.end_effectors.len()];
        let gone_s = self.rolled_at.elapsed().as_secs_f64();
        for (channel, wheel) in wheels(self.robot) {
            let of = by_channel(channel);
            if of.is_some_and(|joint| joint.position_rad.is_none()) {
                let speed_rad_s = of.and_then(|joint| joint.speed_rad_s).unwrap_or(0.0);
                self.rolled_rad[wheel] += speed_rad_s * gone_s;
            }
            wheel_rad[wheel] = angle(of, self.rolled_rad[wheel]);
        }
        if matches!(joints, Joints::Planned(_)) {
            self.rolled_at = Instant::now();
        }
        let posture = Posture {
            world_from_body: self.standing,
            joint_rad: &joint_rad,
            wheel_rad: &wheel_rad,
        };
        let speeds: Vec<_> = all.iter().map(|joint| joint.speed_rad_s.unwrap_or(0.0)).collect();
        let torques: Vec<_> = all.iter().filter_map(|joint| joint.torque_nm).collect();
        let now_s = since_1970_s();
        self.live.frames.log(&figure.transforms(&posture, now_s), now_s);
        channel.log(&figure.joint_states(&posture, &speeds, &torques, now_s), now_s);
        self.show_solids(now_s);
    }

    /// Displays a robot in its simulated world, and its joints at the targets of its drives.
    pub fn show_world(&mut self, world: &World) {
        let is_due = self.pictured.is_none_or(|at| at.elapsed() >= PICTURE);
        if !is_due || !self.live.has_clients() {
            return;
        }
        self.pictured = Some(Instant::now());
        let (position, rotation) = world.base();
        let turn = UnitQuaternion::from_matrix(&rotation);
        let world_from_body = Isometry3::from_parts(Translation3::from(position), turn);
        let shafts: Vec<_> = world.shafts().collect();
        let joints = self.robot.joints.len();
        let feet = self.robot.end_effectors.iter().enumerate();
        let angle_rad = |(number, foot)| world.wheel_rad(number, foot).unwrap_or_default();
        let mut wheel_rad: Vec<_> = feet.map(angle_rad).collect();
        // Angles of motors count full turns.
        for (channel, wheel) in wheels(self.robot) {
            wheel_rad[wheel] = shafts[channel][0];
        }
        let joint_rad: Vec<_> = (0..joints).map(|joint| world.joint(joint)[0]).collect();
        let posture = Posture { world_from_body, joint_rad: &joint_rad, wheel_rad: &wheel_rad };
        let speeds: Vec<_> = shafts.iter().map(|shaft| shaft[1]).collect();
        let torques: Vec<_> = shafts.iter().map(|shaft| shaft[2]).collect();
        let laws: Vec<_> = (0..shafts.len()).map(|channel| world.law(channel)).collect();
        let of_motors = laws.iter().map(|law| law.position_rad);
        let targets = self.robot.all_joints(of_motors, |joint, _| joint_rad[joint]);
        let targets = self.robot.transmission().joints(&targets);
        let target_speeds: Vec<_> = laws.iter().map(|law| law.speed_rad_s).collect();
        let target = Posture { world_from_body, joint_rad: &targets, wheel_rad: &wheel_rad };
        let touches = world.touches().map(|touch| (touch.point.into(), touch.force.into()));
        let touches: Vec<_> = touches.collect();
        let now_s = since_1970_s();
        let measured = self.measured.joint_states(&posture, &speeds, &torques, now_s);
        let planned = self.planned.joint_states(&target, &target_speeds, &[], now_s);
        self.live.frames.log(&self.measured.transforms(&posture, now_s), now_s);
        self.live.frames.log(&self.planned.transforms(&target, now_s), now_s);
        self.live.measured.log(&measured, now_s);
        self.live.planned.log(&planned, now_s);
        self.live.forces.log(&self.measured.forces(&touches, now_s), now_s);
        self.show_solids(now_s);
    }

    fn show_solids(&mut self, now_s: f64) {
        if self.shown_solids.is_none_or(|at| at.elapsed() >= SOLIDS) {
            self.shown_solids = Some(Instant::now());
            self.live.robot.log(&self.measured.solids(now_s), now_s);
            self.live.robot.log(&self.planned.solids(now_s), now_s);
        }
    }
}

/// Channels of driven wheels, each with the index of its end effector.
fn wheels(robot: &Robot) -> impl Iterator<Item = (usize, usize)> + '_ {
    let all = robot.end_effectors.iter().enumerate();
    let driven = all.filter(|(_, foot)| foot.contact.actuator().is_some());
    (robot.driven_joints().count()..).zip(driven.map(|(index, _)| index))
}

fn since_1970_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}
