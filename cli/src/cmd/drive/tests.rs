//! Drive over the simulated bus in virtual time: AgileBot on the ground, its firmware, an operator, and plans with a given
//! computing time.

use rollwalk_bus::link::LinkBus;
use rollwalk_host::operator::{Deadman, ExitStage, Intent, Operator, ReleaseReaction};
use rollwalk_host::session::Session;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_pilot::{ActionAfterStop, Courses, Phase, Pilot, Request, Route, SteeringRequest};
use rollwalk_planner::receding::{CourseError, Gait, Steering, Stretch};
use rollwalk_planner::{Options, optimise};
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::{Node, State};
use rollwalk_sim_host::rig::Rig;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::planning;
use rollwalk_terminal::validated_library::ValidatedLibrary;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

const S: u64 = 1_000_000;

/// Simulated robot with an operator and a pilot.
struct SteeredRig {
    rig: Rig,
    operator: Operator,
    pilot: Pilot,
    courses: Courses,
    /// Computing time of each plan, µs.
    planning_us: u64,
    /// Time at which the current plan arrives, µs, with the plan.
    planned: Option<(u64, Request, Result<Stretch, CourseError>)>,
}

impl SteeredRig {
    /// Creates AgileBot with its library and the gait of a shipped motion.
    fn new(gait: &str) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shipped");
        let library = root.join("motions/agilebot_library.toml");
        let library = Source::Disk.library(&library).expect("it ships");
        let plans =
            planning::plan_all(&library, false).expect("files").expect("it is not interrupted");
        let built = plans.pack(&library).expect("it holds");
        let packed =
            ValidatedLibrary::new(library.robot.clone(), built.bytes).expect("it was just built");
        let motion = Source::Disk.motion(&root.join(format!("motions/{gait}.toml")));
        let (robot, motion) = motion.expect("it ships");
        let options = Options { refine: false, ..Options::default() };
        let plan = optimise(&robot, &motion, &options, &mut |_| ControlFlow::Continue(()));
        let gait = Gait::of(&plan).expect("it repeats");
        let mut pose = [0.0; MAX_CHANNELS];
        packed.library().safe_pose_into(&mut pose).expect("a pose");
        let safe_rad = pose.iter().take(robot.joints.len()).map(|a| f64::from(*a)).collect();
        let ground: Arc<dyn Ground> = Arc::new(Plane::level());
        let rig = Rig::new(&robot).unwrap().onto_ground(&robot, &ground, Vec::new());
        let node = Node::new(1).unwrap();
        let mut session = Session::connect(rig, node).unwrap();
        session.flash(&packed.file, |_| {}).unwrap();
        let config_hash = robot.controller_config().unwrap().hash();
        let mut drive = Self {
            rig: session.into_bus(),
            operator: Operator::new(node, Some(config_hash)),
            pilot: Pilot::new(false),
            courses: Courses::new(Route { robot, safe_rad, gait: Some(gait) }),
            planning_us: 60_000,
            planned: None,
        };
        // The bench runs until heartbeats of this session replace those of the previous session.
        drive.run(S);
        drive.pilot = Pilot::new(true);
        drive.run_until(10 * S, |drive| drive.pilot.phase() == Phase::Steered);
        drive
    }

    fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    fn state(&self) -> State {
        self.operator.view(self.now_us()).status.expect("it is heard").state
    }

    fn run(&mut self, us: u64) {
        let end_us = self.now_us() + us;
        while self.now_us() < end_us {
            self.step();
        }
    }

    fn run_until(&mut self, most_us: u64, reached: impl Fn(&Self) -> bool) {
        let end_us = self.now_us() + most_us;
        while !reached(self) {
            let messages = self.operator.view(self.now_us()).messages;
            assert!(self.now_us() < end_us, "{:?}: {messages:#?}", self.state());
            self.step();
        }
    }

    fn step(&mut self) {
        let now_us = self.now_us();
        self.pilot.update(now_us, &mut self.operator);
        if let Some((_, request, stretch)) = self.planned.take_if(|(at_us, ..)| *at_us <= now_us) {
            self.pilot.on_stretch(now_us, request, stretch, &mut self.operator);
        }
        if let Some(request) = self.pilot.request(&self.operator) {
            let stretch = self.courses.plan(request, || false);
            self.planned = Some((now_us + self.planning_us, request, stretch));
        }
        while let Some(frame) = self.operator.poll(now_us) {
            if self.rig.send(&frame).is_err() {
                self.operator.not_sent(frame);
                break;
            }
        }
        let wake_us = self.operator.next_poll_us(now_us).clamp(now_us + 500, now_us + 5_000);
        if let Some(frame) = self.rig.receive(wake_us).unwrap() {
            self.operator.on_frame(self.rig.now_us(), &frame);
        }
    }

    fn steer(&mut self, forward_m_s: f64, turn_rad_s: f64) {
        let steering = Steering { forward_m_s, left_m_s: 0.0, turn_rad_s };
        self.pilot.steer(SteeringRequest::of(steering, true));
    }

    /// Position of the body along and across the heading at the start, m, and its heading, rad.
    fn body_pose(&self) -> [f64; 3] {
        let (position, rotation) = self.rig.body().ground().expect("on the ground").world().base();
        [position.x, position.y, rotation[(1, 0)].atan2(rotation[(0, 0)])]
    }

    fn falls(&self) -> usize {
        self.rig.body().ground().expect("on the ground").falls().len()
    }
}

#[test]
fn a_steered_robot_walks_as_it_is_steered_and_goes_home() {
    let mut drive = SteeredRig::new("walk");
    drive.steer(0.1, 0.0);
    drive.run(3 * S);
    let before = drive.body_pose();
    drive.run(5 * S);
    let after = drive.body_pose();
    let speed = (after[0] - before[0]).hypot(after[1] - before[1]) / 5.0;
    assert!((speed - 0.1).abs() < 0.03, "{speed} m/s");
    drive.steer(0.0, 0.3);
    drive.run(2 * S);
    let before = drive.body_pose();
    drive.run(3 * S);
    let turn = (drive.body_pose()[2] - before[2]) / 3.0;
    assert!((turn - 0.3).abs() < 0.1, "{turn} rad/s");
    let now_us = drive.now_us();
    drive.pilot.stop(now_us, ActionAfterStop::Leave, &mut drive.operator);
    drive.run_until(20 * S, |drive| drive.operator.leaving() == ExitStage::Now);
    assert_eq!(drive.state(), State::Disarmed);
    assert_eq!(drive.falls(), 0);
    let tally = drive.pilot.tally();
    assert_eq!(tally.rejected, 0);
    assert!(tally.least_ahead.is_some_and(|least| least >= 4), "{tally:?}");
}

#[test]
fn a_plan_that_comes_too_late_holds_the_robot_and_one_that_never_comes_lets_it_down() {
    let mut drive = SteeredRig::new("walk");
    drive.steer(0.1, 0.0);
    drive.run(2 * S);
    // The plan is later than the buffered frames last, but earlier than the controller's timeout.
    drive.planning_us = 400_000;
    drive.run(S);
    assert_eq!(drive.state(), State::Streaming);
    drive.planning_us = 60_000;
    drive.run(2 * S);
    assert_eq!((drive.state(), drive.falls()), (State::Streaming, 0));
    drive.planning_us = 60 * S;
    drive.run_until(2 * S, |drive| drive.state() == State::Returning);
    drive.run(S / 10);
    let faults = drive.operator.view(drive.now_us()).status.unwrap().faults;
    assert!(faults.contains(Fault::SetpointTimeout));
    assert_eq!(drive.pilot.phase(), Phase::Off);
    drive.run_until(5 * S, |drive| drive.state() == State::TorqueOff);
}

#[test]
fn after_an_emergency_stop_it_is_cleared_armed_and_steered_again() {
    let mut drive = SteeredRig::new("walk");
    drive.steer(0.1, 0.0);
    drive.run(2 * S);
    drive.operator.request(drive.now_us(), Intent::Estop);
    drive.run_until(S, |drive| drive.state() == State::EStopped);
    drive.steer(0.0, 0.0);
    // The hoist picks the robot up.
    drive.run(5 * S);
    assert_eq!(drive.pilot.phase(), Phase::Off);
    drive.operator.request(drive.now_us(), Intent::Clear);
    drive.run_until(2 * S, |drive| drive.state() == State::Disarmed);
    drive.operator.request(drive.now_us(), Intent::Arm);
    drive.pilot.rise();
    drive.run_until(10 * S, |drive| drive.pilot.phase() == Phase::Steered);
    drive.steer(0.1, 0.0);
    let before = drive.body_pose();
    drive.run(4 * S);
    let after = drive.body_pose();
    assert!((after[0] - before[0]).hypot(after[1] - before[1]) > 0.2);
    assert_eq!(drive.state(), State::Streaming);
}

#[test]
fn a_stream_that_another_program_ends_is_not_begun_again_by_itself() {
    let mut drive = SteeredRig::new("walk");
    drive.operator.request(drive.now_us(), Intent::Return);
    drive.run_until(10 * S, |drive| drive.state() == State::Ready);
    drive.steer(0.1, 0.0);
    drive.run(2 * S);
    assert_eq!((drive.state(), drive.pilot.phase()), (State::Ready, Phase::Off));
    drive.pilot.rise();
    drive.run_until(5 * S, |drive| drive.pilot.phase() == Phase::Steered);
}

#[test]
fn a_robot_whose_deadman_is_let_go_goes_home_on_its_feet() {
    for let_go in [ReleaseReaction::Pause, ReleaseReaction::Return] {
        let mut drive = SteeredRig::new("walk");
        drive.operator.request(drive.now_us(), Intent::Deadman(Deadman::Held));
        drive.steer(0.1, 0.0);
        drive.run(2 * S);
        drive.operator.request(drive.now_us(), Intent::Deadman(Deadman::Released(let_go)));
        drive.steer(0.0, 0.0);
        drive.run(S);
        assert_eq!(drive.state(), State::Streaming);
        let now_us = drive.now_us();
        drive.pilot.stop(now_us, ActionAfterStop::Rest, &mut drive.operator);
        drive.run_until(10 * S, |drive| drive.state() == State::Ready);
        assert_eq!(drive.falls(), 0);
    }
}
