//! Closed-loop motions over a simulated bus in virtual time: AgileBot on the ground, its firmware, an operator, and a host with
//! a given computing time per tick.

use super::conductor::{Conductor, Phase, wheels};
use super::route::{self, Play};
use super::{timing, tracking};
use rollwalk_bus::link::LinkBus;
use rollwalk_host::operator::{ExitStage, Operator};
use rollwalk_host::session::Session;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::library::identity;
use rollwalk_protocol::wire::{FromController, Node, Sample, State};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::rig::Rig;
use rollwalk_simulate::Sequence;
use rollwalk_terminal::inputs::{Library, Source};
use rollwalk_terminal::planning::{self, Plans};
use rollwalk_terminal::validated_library::ValidatedLibrary;
use std::path::Path;
use std::sync::Arc;

const S: u64 = 1_000_000;
/// Computing time of a tick, µs.
const TICK_US: u64 = 1_000;

/// Library with its plans.
struct PlannedLibrary {
    library: Library,
    plans: Plans,
    file: Vec<u8>,
}

impl PlannedLibrary {
    fn agilebot() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shipped");
        let library = Source::Disk.library(&root.join("motions/agilebot_library.toml"));
        let library = library.expect("it ships");
        let plans = planning::plan_all(&library, false).expect("files").expect("not interrupted");
        let file = plans.pack(&library).expect("it holds").bytes;
        Self { library, plans, file }
    }

    fn conductor(&self, play: &[&str], rate_hz: u32) -> Conductor<'_> {
        self.conductor_for(play, rate_hz, identity(&self.file).expect("a library"))
    }

    /// Creates a conductor that expects a controller with the given library.
    fn conductor_for(&self, play: &[&str], rate_hz: u32, library: u32) -> Conductor<'_> {
        let play: Vec<Play> = play.iter().map(|text| text.parse().expect("a motion")).collect();
        let legs = route::legs(&self.library, &self.plans, &play).expect("a way");
        let sequence = Sequence::new(legs, timing(rate_hz)).expect("they follow each other");
        let robot = &self.library.robot;
        let wheels = wheels(robot, sequence.tree());
        Conductor::new(sequence, robot, wheels, tracking(rate_hz), library)
    }
}

/// Messages that are dropped on their way to the host.
#[derive(Clone, Copy, PartialEq, Eq)]
enum DroppedMessages {
    Nothing,
    /// Final messages of the samples. Without them the host does not answer.
    Samples,
    Imu,
    /// Readings of the contact switches.
    Contacts,
}

/// Simulated robot with a host.
struct Bench<'p> {
    rig: Rig,
    operator: Operator,
    conductor: Conductor<'p>,
    /// True while the conductor is not called.
    waits: bool,
    loses: DroppedMessages,
    at_us: Option<u64>,
}

impl<'p> Bench<'p> {
    fn new(planned: &PlannedLibrary, conductor: Conductor<'p>) -> Self {
        let robot = &planned.library.robot;
        let packed =
            ValidatedLibrary::new(robot.clone(), planned.file.clone()).expect("it was built");
        let ground: Arc<dyn Ground> = Arc::new(Plane::level());
        let rig = Rig::new(robot).unwrap().onto_ground(robot, &ground, Vec::new());
        let node = Node::new(1).unwrap();
        let mut session = Session::connect(rig, node).unwrap();
        session.flash(&packed.file, |_| {}).unwrap();
        let config_hash = robot.controller_config().unwrap().hash();
        let operator = Operator::new(node, Some(config_hash));
        let rig = session.into_bus();
        let mut bench = Self {
            rig,
            operator,
            conductor,
            waits: true,
            loses: DroppedMessages::Nothing,
            at_us: None,
        };
        // The bench runs until heartbeats of this session replace those of the previous session.
        bench.run(S);
        bench.waits = false;
        bench
    }

    fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    fn state(&self) -> State {
        self.operator.view(self.now_us()).status.expect("it is heard").state
    }

    fn run_until(&mut self, most_us: u64, reached: impl Fn(&Self) -> bool) {
        let end_us = self.now_us() + most_us;
        while !reached(self) {
            let messages = self.operator.view(self.now_us()).messages;
            assert!(self.now_us() < end_us, "{:?}: {messages:#?}", self.state());
            self.step();
        }
    }

    fn run(&mut self, us: u64) {
        let end_us = self.now_us() + us;
        while self.now_us() < end_us {
            self.step();
        }
    }

    fn step(&mut self) {
        let now_us = self.now_us();
        if !self.waits {
            self.conductor.update(now_us, &mut self.operator);
        }
        if self.at_us.is_some_and(|at_us| now_us >= at_us) {
            self.at_us = None;
            self.conductor.answer(now_us, &mut self.operator);
        }
        while let Some(frame) = self.operator.poll(now_us) {
            if self.rig.send(&frame).is_err() {
                self.operator.not_sent(frame);
                break;
            }
        }
        let wake_us = self.operator.next_poll_us(now_us).clamp(now_us + 200, now_us + 1_000);
        let wake_us = self.at_us.map_or(wake_us, |at_us| wake_us.min(at_us.max(now_us + 1)));
        if let Some(frame) = self.rig.receive(wake_us).unwrap()
            && let Some(frame) = self.deliver(frame)
        {
            let now_us = self.rig.now_us();
            self.operator.on_frame(now_us, &frame);
            let is_sample =
                matches!(FromController::decode(&frame), Ok((_, FromController::Sample(_))));
            if is_sample {
                self.at_us = Some(now_us + TICK_US);
            }
        }
    }

    /// Returns the frame that the host receives; `None` if it is dropped.
    fn deliver(&self, frame: Frame) -> Option<Frame> {
        use FromController as M;
        match (self.loses, FromController::decode(&frame)) {
            (DroppedMessages::Samples, Ok((_, M::Sample(_)))) => None,
            (DroppedMessages::Imu, Ok((_, M::Gyro(_) | M::Accelerometer(_)))) => None,
            (DroppedMessages::Contacts, Ok((from, M::Sample(sample)))) => {
                Some(Sample { contacts: None, ..sample }.encode(from))
            }
            _ => Some(frame),
        }
    }

    /// Position of the body, m, and its heading, rad.
    fn body_pose(&self) -> [f64; 3] {
        let (position, rotation) = self.rig.body().ground().expect("on the ground").world().base();
        [position.x, position.y, rotation[(1, 0)].atan2(rotation[(0, 0)])]
    }

    fn falls(&self) -> usize {
        self.rig.body().ground().expect("on the ground").falls().len()
    }
}

/// Distance covered by the body, as a fraction of the planned distance.
fn covered_fraction(bench: &Bench<'_>, before: [f64; 3]) -> f64 {
    let after = bench.body_pose();
    let legs = bench.conductor.sequence().legs().iter();
    let planned_m: f64 =
        legs.map(|leg| leg.plan().end_placement.offset_m[0] * f64::from(leg.cycles())).sum();
    (after[0] - before[0]).hypot(after[1] - before[1]) / planned_m
}

fn plays(bench: &Bench<'_>) -> bool {
    bench.conductor.phase() == Phase::Playing
}

fn has_left(bench: &Bench<'_>) -> bool {
    bench.operator.leaving() == ExitStage::Now
}

#[test]
fn a_robot_walks_in_closed_loop_and_waits_for_answers_that_are_missing() {
    let planned = PlannedLibrary::agilebot();
    let mut bench = Bench::new(&planned, planned.conductor(&["walk:4"], 120));
    bench.run_until(10 * S, plays);
    let before = bench.body_pose();
    bench.run(3 * S);
    // Some lost samples, and a host that stalls: longer than the limit of a missed sample, shorter than the limit that ends the
    // session.
    bench.loses = DroppedMessages::Samples;
    bench.run(S / 30);
    bench.loses = DroppedMessages::Nothing;
    bench.run(S);
    let until = bench.rig.now() + SimTime::from_us(S / 8);
    bench.rig.run_until(until);
    bench.run_until(60 * S, |bench| !plays(bench));
    let way = covered_fraction(&bench, before);
    assert!((way - 1.0).abs() < 0.05, "{way}");
    bench.run_until(20 * S, has_left);
    assert_eq!((bench.state(), bench.falls()), (State::Disarmed, 0));
    let tally = bench.conductor.tally();
    assert!(tally.complete && tally.lost == 4, "{tally:?}");
}

#[test]
fn without_contact_switches_contacts_are_those_of_the_plan() {
    let planned = PlannedLibrary::agilebot();
    let mut bench = Bench::new(&planned, planned.conductor(&["walk:2"], 60));
    bench.loses = DroppedMessages::Contacts;
    bench.run_until(10 * S, plays);
    let before = bench.body_pose();
    bench.run_until(60 * S, |bench| !plays(bench));
    let way = covered_fraction(&bench, before);
    assert!((way - 1.0).abs() < 0.05, "{way}");
    assert_eq!(bench.falls(), 0);
    assert!(bench.conductor.tally().complete);
}

#[test]
fn a_host_that_falls_silent_has_the_robot_hold_still_and_let_down() {
    let planned = PlannedLibrary::agilebot();
    let mut bench = Bench::new(&planned, planned.conductor(&["walk:4"], 120));
    bench.run_until(10 * S, plays);
    bench.run(3 * S);
    bench.loses = DroppedMessages::Samples;
    bench.run_until(S, |bench| bench.state() == State::Returning);
    let faults = bench.operator.view(bench.now_us()).status.unwrap().faults;
    assert!(faults.contains(Fault::SetpointTimeout));
    bench.run_until(5 * S, |bench| bench.state() == State::TorqueOff);
    assert_eq!(bench.falls(), 0);
    bench.run_until(10 * S, has_left);
    assert!(!bench.conductor.tally().complete);
}

#[test]
#[ignore = "a minute"]
fn a_robot_whose_samples_are_lost_at_any_moment_of_its_walk_stays_on_its_feet() {
    let planned = PlannedLibrary::agilebot();
    for moment in 0..6 {
        for lost_ms in [40, 50, 100, 150, 200, 5_000] {
            let mut bench = Bench::new(&planned, planned.conductor(&["walk:4"], 120));
            bench.run_until(10 * S, plays);
            bench.run(3 * S + moment * S / 4);
            bench.loses = DroppedMessages::Samples;
            bench.run(lost_ms * 1_000);
            bench.loses = DroppedMessages::Nothing;
            bench.run_until(60 * S, has_left);
            let complete = bench.conductor.tally().complete;
            println!("{moment} {lost_ms} {complete} {:?}", bench.state());
            assert_eq!(bench.falls(), 0, "{moment}, {lost_ms} ms");
            // After 0.05 s without the IMU, the state is unknown, and the robot stops.
            assert!(complete == (lost_ms == 40) || lost_ms == 50, "{moment}, {lost_ms} ms");
        }
    }
}

#[test]
fn a_robot_without_its_imu_is_brought_to_a_stop_and_home() {
    let planned = PlannedLibrary::agilebot();
    let mut bench = Bench::new(&planned, planned.conductor(&["walk:4"], 120));
    bench.run_until(10 * S, plays);
    bench.run(3 * S);
    bench.loses = DroppedMessages::Imu;
    bench.run_until(5 * S, |bench| bench.conductor.phase() == Phase::Homeward);
    bench.run_until(20 * S, has_left);
    assert_eq!((bench.state(), bench.falls()), (State::Disarmed, 0));
    let tally = bench.conductor.tally();
    assert!(!tally.complete && tally.untracked > 10, "{tally:?}");
}

/// Loses the contact switches in the middle of a step. Their old readings must not remain in force.
#[test]
fn contact_switches_that_are_lost_give_way_to_planned_contacts() {
    let planned = PlannedLibrary::agilebot();
    let mut bench = Bench::new(&planned, planned.conductor(&["walk:3"], 120));
    bench.run_until(10 * S, plays);
    let before = bench.body_pose();
    bench.run(3 * S);
    bench.loses = DroppedMessages::Contacts;
    bench.run_until(60 * S, |bench| !plays(bench));
    let way = covered_fraction(&bench, before);
    assert!((way - 1.0).abs() < 0.05, "{way}");
    assert!(bench.conductor.tally().complete && bench.falls() == 0);
    let messages = bench.operator.view(bench.now_us()).messages;
    let warns = |text: &str| text.contains("contact switches no longer send data");
    assert!(messages.iter().any(|message| warns(&message.text)), "{messages:?}");
}

/// Stops between the start of the sequence and the first sample of the motion.
#[test]
fn one_that_is_stopped_before_it_moves_goes_home_at_once() {
    let planned = PlannedLibrary::agilebot();
    let mut bench = Bench::new(&planned, planned.conductor(&["walk:4"], 120));
    bench.run_until(10 * S, plays);
    assert!(!bench.conductor.sequence().progress().moves);
    let now_us = bench.now_us();
    bench.conductor.stop(now_us, &mut bench.operator);
    bench.run_until(20 * S, has_left);
    assert_eq!((bench.state(), bench.falls()), (State::Disarmed, 0));
    assert!(!bench.conductor.sequence().progress().moves);
}

#[test]
fn it_ends_early_with_its_cycle() {
    let planned = PlannedLibrary::agilebot();
    let mut bench = Bench::new(&planned, planned.conductor(&["walk:1000"], 120));
    bench.run_until(10 * S, plays);
    bench.run(5 * S);
    let now_us = bench.now_us();
    bench.conductor.stop(now_us, &mut bench.operator);
    // The robot completes its cycle, plays the transition to the stand, and returns.
    bench.run_until(10 * S, has_left);
    assert_eq!((bench.state(), bench.falls()), (State::Disarmed, 0));
    assert!(!bench.conductor.tally().complete);
}

#[test]
fn a_robot_with_another_library_is_not_armed() {
    let planned = PlannedLibrary::agilebot();
    let mut bench = Bench::new(&planned, planned.conductor_for(&["walk"], 120, 1));
    bench.run_until(10 * S, has_left);
    assert_eq!(bench.state(), State::Disarmed);
    let view = bench.operator.view(bench.now_us());
    assert!(view.messages.iter().any(|message| message.text.contains("another library")));
}

#[test]
fn ways_lead_along_the_graph() {
    let planned = PlannedLibrary::agilebot();
    let names = |play: &[&str]| {
        let play: Vec<Play> = play.iter().map(|text| text.parse().unwrap()).collect();
        let legs = route::legs(&planned.library, &planned.plans, &play);
        legs.map(|legs| {
            let names = legs.iter().map(|leg| leg.plan().motion.name.clone());
            names.collect::<Vec<_>>().join(", ")
        })
    };
    assert_eq!(names(&["walk:3"]).unwrap(), "stand, stand to walk, walk, walk to stand, stand");
    // Two motions that are joined directly, and a finite motion that plays twice.
    let joined = "stand, stand to walk, walk, walk to turn_in_place, turn_in_place, turn_in_place to stand, stand";
    assert_eq!(names(&["walk", "turn_in_place"]).unwrap(), joined);
    let twice = "stand, stand to drive_1m, drive_1m, drive_1m to stand, stand, stand to drive_1m, drive_1m, \
                 drive_1m to stand, stand";
    assert_eq!(names(&["drive_1m:2"]).unwrap(), twice);
    // A stand stays a stand, and a loop repeats.
    assert_eq!(names(&["stand:2"]).unwrap(), "stand, stand, stand");
    let again = "stand, stand, stand to walk, walk, walk, walk to stand, stand";
    assert_eq!(names(&["stand", "walk", "walk:2"]).unwrap(), again);
    planned.conductor(&["stand:2", "walk", "walk:2"], 120);
    let unknown = names(&["run"]).unwrap_err();
    assert_eq!(unknown.to_string(), "agilebot has no motion `run`");
}
