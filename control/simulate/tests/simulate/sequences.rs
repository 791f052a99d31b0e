//! Tests of sequences of plans, tracked with an estimator over a bus with latency.

use crate::{ROOT, plan};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rollwalk_multibody::State;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::World;
use rollwalk_physics::motor::Law;
use rollwalk_physics::world::{FallWatch, Parameters, heading_rad};
use rollwalk_planner::building::{Contents, LibraryFiles, LibraryMismatch};
use rollwalk_planner::motion::{Ends, Motion};
use rollwalk_planner::plan::{Plan, Sample, Status};
use rollwalk_planner::{Options, optimise, optimise_transition};
use rollwalk_robot::Robot;
use rollwalk_robot::document::DocumentError;
use rollwalk_simulate::closed_loop::{Measurement, Timing, TrackingError};
use rollwalk_simulate::{Leg, Noise, Script, Sequence, SimulatedSensors};
use rollwalk_tracking::Sensors;
use std::collections::VecDeque;
use std::fs;
use std::ops::ControlFlow;
use std::sync::{Arc, LazyLock};

struct Files;

impl LibraryFiles for Files {
    type Error = DocumentError;

    fn robot(&mut self, named: &str) -> Result<(Robot, String), DocumentError> {
        let (_, file) = named.rsplit_once('/').unwrap();
        let text = fs::read_to_string(format!("{ROOT}/robots/{file}")).unwrap();
        Ok((Robot::from_toml(named, &text)?, named.to_owned()))
    }

    fn motion(&mut self, named: &str) -> Result<(Robot, Motion, String), DocumentError> {
        let text = fs::read_to_string(format!("{ROOT}/motions/{named}")).unwrap();
        let (robot, _) = self.robot(&Motion::robot_path_in_toml(named, &text)?)?;
        let motion = Motion::from_toml(named, &text, &robot)?;
        Ok((robot, motion, named.to_owned()))
    }

    fn plan(&mut self, _: &str) -> Result<(Plan, String), DocumentError> {
        unreachable!("shipped libraries name no plans")
    }

    fn faults(&mut self, error: DocumentError) -> DocumentError {
        error
    }

    fn misfit(&mut self, error: LibraryMismatch) -> DocumentError {
        panic!("{error}")
    }
}

/// Plans of a stand, of the transition into a gait, of the gait, and of the transition back.
struct Plans {
    stand: Plan,
    into: Plan,
    gait: Plan,
    back: Plan,
}

impl Plans {
    /// Plans the motions of a shipped library.
    fn of(library: &str, gait: &str) -> Self {
        let text = fs::read_to_string(format!("{ROOT}/motions/{library}.toml")).unwrap();
        let contents = Contents::read(library, &text, &mut Files).unwrap();
        let index =
            |name: &str| contents.file.motions.iter().position(|of| of.name == name).unwrap();
        let ends @ [from, to] = [contents.file.safe, index(gait)];
        let options = Options::default();
        let mut go_on = |_: &_| ControlFlow::Continue(());
        let [stand, gait] =
            ends.map(|at| optimise(&contents.robot, &contents.motions[at], &options, &mut go_on));
        let mut over = |ends: (usize, usize), [from, to]: [&Plan; 2]| {
            let wanted = contents.file.transitions.iter().find(|of| (of.from, of.to) == ends);
            optimise_transition(&wanted.unwrap().motion, from, to, &options, &mut go_on).unwrap()
        };
        let into = over((from, to), [&stand, &gait]);
        let back = over((to, from), [&gait, &stand]);
        let plans = Self { stand, into, gait, back };
        for plan in [&plans.stand, &plans.into, &plans.gait, &plans.back] {
            assert_eq!(plan.solve.status, Status::Converged, "{}", plan.motion.name);
        }
        plans
    }

    fn legs(&self, cycles: u32) -> Vec<Leg<'_>> {
        vec![
            Leg::new(&self.stand),
            Leg::new(&self.into),
            Leg::new(&self.gait).times(cycles),
            Leg::new(&self.back),
            Leg::new(&self.stand).held(1.0),
        ]
    }

    /// Planned displacement of the body, computed from the samples of the plans instead of their splines.
    fn displacement(&self, cycles: u32) -> Isometry3<f64> {
        let of = |plan: &Plan| {
            let [first, last] = plan.ends().map(planar);
            first.inverse() * last
        };
        let gait = &self.gait;
        assert_eq!(gait.motion.ends, Ends::Periodic);
        let first = planar(gait.ends()[0]);
        let [x, y] = gait.end_placement.offset_m;
        let cycle = first.inverse() * isometry(x, y, gait.end_placement.yaw_rad) * first;
        let all = (0..cycles).fold(Isometry3::identity(), |all, _| all * cycle);
        of(&self.stand) * of(&self.into) * all * of(&self.back) * of(&self.stand)
    }
}

fn isometry(x: f64, y: f64, yaw_rad: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    Isometry3::from_parts(Translation3::new(x, y, 0.0), turn)
}

fn planar(sample: &Sample) -> Isometry3<f64> {
    let [x, y, _] = sample.base_position_m;
    isometry(x, y, sample.base_yaw_pitch_roll_rad[0])
}

/// Bus and sensors of a robot.
#[derive(Clone, Copy, Debug)]
struct Bus {
    rate_hz: u32,
    /// Delay of set-points, ticks.
    delay: u32,
    /// True if the robot has contact switches.
    switches: bool,
    noise: Noise,
    seed: u64,
    /// Interval at which a sample is lost, in samples; `None` if no sample is lost.
    loses: Option<usize>,
    /// Time at which the IMU fails, s.
    imu_until_s: f64,
}

/// Bus with few motors and an IMU with the usual noise.
const BUS: Bus = Bus {
    rate_hz: 120,
    delay: 2,
    switches: true,
    noise: Noise::USUAL,
    seed: 1,
    loses: None,
    imu_until_s: f64::INFINITY,
};

/// Minimum simulation rate, steps per second: drives act between ticks.
const WORLD_HZ: u32 = 480;
/// Time at which the robot starts to move, s.
const GO_S: f64 = 1.5;
/// Time at which the latency is known, s.
const MEASURED_S: f64 = 0.7;
/// Duration of the longest run, s. A stopped sequence never ends.
const LONGEST_S: f64 = 30.0;

/// Result of a sequence.
#[derive(Debug, Default, PartialEq)]
struct Outcome {
    fell_at_s: Option<f64>,
    /// Displacement of the body from the start to the end.
    way: Isometry3<f64>,
    /// Deviation of the final estimate from the reference.
    from_reference: Isometry3<f64>,
    /// Number of ticks in motion without set-points of the tracker.
    untracked: u32,
    stopped: bool,
    /// Indices of the played plans, in order.
    legs: Vec<usize>,
    all_s: f64,
}

impl Outcome {
    /// Deviation from the planned displacement at the end: mm and mrad.
    fn off(&self, planned: &Isometry3<f64>) -> [f64; 2] {
        far(&(planned.inverse() * self.way))
    }

    /// Component of the displacement along the planned one, as a fraction of the planned one.
    fn ratio(&self, planned: &Isometry3<f64>) -> f64 {
        let planned = planned.translation.vector;
        self.way.translation.vector.dot(&planned) / planned.norm_squared()
    }
}

/// Length and angle of a planar displacement, mm and mrad.
fn far(motion: &Isometry3<f64>) -> [f64; 2] {
    [motion.translation.vector.xy().norm(), motion.rotation.angle()].map(|value| 1e3 * value)
}

/// Horizontal position and heading of a body.
fn ground_pose(position_m: &Vector3<f64>, rotation: &Matrix3<f64>) -> Isometry3<f64> {
    isometry(position_m.x, position_m.y, heading_rad(rotation))
}

/// Plays a sequence until it is over, or for [`LONGEST_S`]. The robot stands at the start of the first plan; `each` is called
/// before every tick.
fn play(
    plans: &Plans,
    cycles: u32,
    bus: Bus,
    mut each: impl FnMut(&mut Sequence<'_>, f64),
) -> Outcome {
    let tick_s = 1.0 / f64::from(bus.rate_hz);
    let latency_s = f64::from(bus.delay) * tick_s;
    let steps = WORLD_HZ.div_ceil(bus.rate_hz);
    let timing = Timing { tick_s, latency_s: 0.0 };
    let mut sequence = Sequence::new(plans.legs(cycles), timing).unwrap();
    sequence.use_planned_contacts(!bus.switches);
    let script = Script::new(&plans.stand, true);
    let robot = script.robot();
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let start = script.start(&Rotation3::identity());
    let mut world = World::new(robot, &ground, &Parameters::new(robot), &start);
    let mut fall_watch = FallWatch::new(&world, &ground);
    let mut sensors = SimulatedSensors::new(sequence.tree().clone(), bus.noise, bus.seed);
    let mut on_their_way: VecDeque<Vec<Law>> = (0..bus.delay).map(|_| script.laws(0.0)).collect();
    let mut outcome = Outcome::default();
    let mut start = None;
    for tick in 0.. {
        let time_s = tick as f64 * tick_s;
        if time_s > MEASURED_S {
            // After the start, the latency does not change.
            let is_taken = sequence.change_latency(latency_s);
            assert_eq!(is_taken, start.is_none());
        }
        if time_s > GO_S {
            sequence.go();
        }
        each(&mut sequence, time_s);
        let sensed = sensors.sample(&world, tick_s);
        // Without switches, the contacts are unknown.
        let none = vec![false; sensed.touches.len()];
        let touches = if bus.switches { sensed.touches } else { &none };
        let gyro_rad_s = sensed.gyro_rad_s.filter(|_| time_s < bus.imu_until_s);
        let sensed = Sensors { touches, gyro_rad_s, ..sensed };
        if bus.loses.is_none_or(|every| tick % every != every - 1) {
            let (laws, untracked) = sequence.tick(time_s, Measurement::Sensors(&sensed));
            outcome.stopped |= untracked == Some(TrackingError::Stopped);
            let progress = sequence.progress();
            if progress.moves {
                start.get_or_insert_with(|| ground_pose(&world.base().0, &world.base().1));
                outcome.untracked += u32::from(untracked.is_some());
                outcome.legs.push(progress.leg);
            }
            on_their_way.push_back(laws);
        } else if let Some(last) = on_their_way.back().cloned() {
            on_their_way.push_back(last);
        }
        outcome.all_s = time_s;
        if sequence.is_over() || time_s > LONGEST_S {
            break;
        }
        for (channel, law) in on_their_way.pop_front().unwrap().into_iter().enumerate() {
            world.set_law(channel, law);
        }
        for _ in 0..steps {
            world.step(tick_s / f64::from(steps)).unwrap();
        }
        if fall_watch.check(&world).is_some() {
            outcome.fell_at_s = Some(time_s);
            break;
        }
    }
    outcome.legs.dedup();
    let of = |state: &State| ground_pose(&state.base_position_m, &state.world_from_body);
    let reference = of(&sequence.reference().unwrap().state);
    outcome.from_reference = reference.inverse() * of(sequence.estimate());
    let end = ground_pose(&world.base().0, &world.base().1);
    outcome.way = start.map_or(Isometry3::identity(), |start| start.inverse() * end);
    outcome
}

/// Plans of AgileBot's walk.
static WALK: LazyLock<Plans> = LazyLock::new(|| Plans::of("agilebot_library", "walk"));

/// Checks that all plans were played, that all ticks in motion had set-points, and that the robot ended at its reference.
fn check(outcome: &Outcome) {
    assert!(outcome.fell_at_s.is_none() && !outcome.stopped, "{outcome:?}");
    assert_eq!((outcome.untracked, &outcome.legs[..]), (0, &[0, 1, 2, 3, 4][..]), "{outcome:?}");
    let [mm, mrad] = far(&outcome.from_reference);
    // The robot stands at its last footholds, and no wheel corrects the sideways error.
    assert!(mm < 20.0 && mrad < 10.0, "{mm} {mrad} {outcome:?}");
}

/// Plays all plans with exact and with noisy sensors. Noise lets the estimate drift by less than 3 % of the distance.
#[test]
fn a_robot_stands_walks_and_stands_on_a_slow_bus() {
    let planned = WALK.displacement(3);
    let exact = play(&WALK, 3, Bus { noise: Noise::default(), ..BUS }, |_, _| {});
    check(&exact);
    let [mm, mrad] = exact.off(&planned);
    assert!(mm < 5.0 && mrad < 12.0, "{mm} {mrad} {exact:?}");
    let noisy = play(&WALK, 3, BUS, |_, _| {});
    check(&noisy);
    let [mm, mrad] = noisy.off(&planned);
    assert!((noisy.ratio(&planned) - 1.0).abs() < 0.03 && mm < 35.0 && mrad < 20.0, "{noisy:?}");
    assert!(noisy != exact);
}

/// Loses one of twelve samples, without contact switches.
#[test]
fn without_switches_and_all_of_its_samples_a_robot_walks_as_well() {
    let planned = WALK.displacement(2);
    let outcome = play(&WALK, 2, Bus { switches: false, loses: Some(12), ..BUS }, |_, _| {});
    check(&outcome);
    let [mm, mrad] = outcome.off(&planned);
    assert!(mm < 35.0 && mrad < 20.0, "{mm} {mrad} {outcome:?}");
}

/// Stops in the second of a hundred cycles, and before the first one.
#[test]
fn a_sequence_ends_early_where_its_plans_can_be_left() {
    let bus = Bus { noise: Noise::default(), ..BUS };
    let [stand_s, into_s, period_s] =
        [&WALK.stand, &WALK.into, &WALK.gait].map(|plan| plan.motion.duration_s);
    for (after_s, cycles) in [(into_s + 1.5 * period_s, 2), (0.5 * into_s, 0)] {
        let outcome = play(&WALK, 100, bus, |sequence, time_s| {
            if time_s > GO_S + stand_s + after_s {
                sequence.stop();
            }
        });
        assert!(outcome.fell_at_s.is_none() && outcome.untracked == 0, "{outcome:?}");
        let [mm, mrad] = outcome.off(&WALK.displacement(cycles));
        assert!(mm < 5.0 && mrad < 12.0, "{cycles}: {mm} {mrad} {outcome:?}");
        assert_eq!(outcome.legs.contains(&2), cycles > 0);
        assert_eq!(outcome.legs.last(), Some(&4));
    }
}

#[test]
fn a_robot_whose_imu_fails_comes_to_rest_for_good() {
    let outcome = play(&WALK, 3, Bus { imu_until_s: 5.2, ..BUS }, |_, _| {});
    assert!(outcome.fell_at_s.is_none() && outcome.stopped, "{outcome:?}");
    assert_eq!(outcome.legs.last(), Some(&2));
}

/// Tests a robot in motion, whose pose cannot be initialised.
#[test]
fn a_robot_that_was_not_at_rest_does_not_begin() {
    let mut sequence =
        Sequence::new(WALK.legs(1), Timing { tick_s: 0.01, latency_s: 0.0 }).unwrap();
    let tree = sequence.tree().clone();
    let speed_rad_s = vec![1.0; tree.dofs() - 6];
    let joint_rad = vec![0.0; tree.robot().joints.len()];
    let sensed = Sensors {
        gyro_rad_s: Some(Vector3::zeros()),
        accelerometer_m_s2: Some(9.81 * Vector3::z()),
        joint_rad: &joint_rad,
        speed_rad_s: &speed_rad_s,
        touches: &[true; 4],
    };
    sequence.go();
    // NaN, infinity, and a time in the past.
    for time_s in [f64::NAN, f64::INFINITY, 0.01, 0.0].into_iter().chain((1..200).map(f64::from)) {
        let (laws, untracked) = sequence.tick(time_s, Measurement::Sensors(&sensed));
        assert!(matches!(untracked, Some(TrackingError::State(_))), "{untracked:?}");
        assert!(laws.iter().all(|law| law.position_rad.is_finite()));
    }
    assert!(!sequence.is_ready() && !sequence.progress().moves && !sequence.is_over());
}

#[test]
fn plans_that_do_not_follow_each_other_make_no_sequence() {
    let Plans { stand, into, gait, back } = &*WALK;
    let other = plan("car", "car_drive");
    let why = |plans: &[&Plan]| {
        let legs = plans.iter().map(|plan| Leg::new(plan)).collect();
        let timing = Timing { tick_s: 0.01, latency_s: 0.0 };
        Sequence::new(legs, timing).err().map(|why| why.to_string())
    };
    assert_eq!(why(&[stand, into, gait, back, stand]), None);
    for (plans, words) in [
        (&[][..], "has no plans"),
        (&[stand, into, gait], "must begin and end at rest, but `walk` does not"),
        (&[into, gait, back, stand], "at rest, but `stand to walk` does not"),
        (&[stand, &other], "`car_drive` is planned for a different robot from `stand`"),
        (&[stand, gait, back, stand], "rad away from its angle at the end of `stand`"),
    ] {
        let why = why(plans).unwrap();
        assert!(why.contains(words), "{why}");
    }
}

/// Plays both gaits with and without switches, and with different noise.
#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn sequences_of_both_gaits_come_where_their_plans_lead() {
    for (library, gait) in [("agilebot_library", "walk"), ("agilebot_skills_library", "trot")] {
        let plans = Plans::of(library, gait);
        let planned = plans.displacement(3);
        for (seed, switches) in [(1, true), (2, false), (3, true), (4, false)] {
            for rate_hz in [120, 240] {
                let outcome = play(&plans, 3, Bus { rate_hz, seed, switches, ..BUS }, |_, _| {});
                check(&outcome);
                let [mm, mrad] = outcome.off(&planned);
                // The yaw of the estimate drifts with the unknown part of the gyro bias.
                assert!(mm < 40.0 && mrad < 80.0, "{gait} {seed}: {mm} {mrad} {outcome:?}");
            }
        }
    }
}
