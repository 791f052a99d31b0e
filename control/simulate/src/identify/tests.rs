//! Simulates a robot with hidden parameters, adds noise to its measurements, and identifies the parameters.

use super::fit::{Options, identify, predict, replay};
use super::outcome::QuantityVerdict;
use super::parts;
use super::quantity::{Group, Kind, Quantity, SimulationModel};
use super::recording::{DriveSeries, Recording};
use super::rollout::Signal;
use super::series::Series;
use crate::script::servo;
use nalgebra::UnitQuaternion;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::World;
use rollwalk_physics::motor::Law;
use rollwalk_robot::{Channel, Robot, SoftMaterial};
use std::sync::Arc;

/// Duration of a row, s.
const STEP_S: f64 = 1.0 / 120.0;
/// Number of simulation steps in a row, equal to that of a fit.
const PARTS: usize = 2;

fn shipped(name: &str) -> Robot {
    let path = format!("{}/../../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
}

fn agilebot() -> Robot {
    shipped("agilebot")
}

/// Noise with standard deviation 1 from a seed.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    let mut uniform = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as f64 + 0.5) / f64::from(1_u32 << 31)
    };
    move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// Recording of a robot whose wheels accelerate and reverse so hard that they slip, while all joints swing.
fn recording(model: &SimulationModel, steps: usize, mut noise: impl FnMut() -> f64) -> Recording {
    let robot = &model.robot;
    let level: Arc<dyn Ground> = Arc::new(Plane::level());
    let mut world = World::standing(robot, &level, &model.parameters);
    let servos: Vec<Law> = robot.channels().map(|channel| servo(&channel)).collect();
    let nominal: Vec<f64> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
    let mut drives: Vec<[Vec<(f64, f64)>; 5]> = vec![Default::default(); servos.len()];
    let mut place: [Vec<(f64, f64)>; 3] = Default::default();
    let mut turned: [Vec<(f64, f64)>; 4] = Default::default();
    // Commanded angle and speed of a channel in a row.
    let commanded = |channel: usize, kind: &Channel<'_>, row: usize| {
        let time_s = row as f64 * STEP_S;
        let (phase, rate) = (channel as f64, 5.0 + channel as f64 % 3.0);
        match kind {
            Channel::Joint(_) => [
                nominal[channel] + 0.12 * ((rate * time_s + phase).sin() - phase.sin()),
                0.12 * rate * (rate * time_s + phase).cos(),
            ],
            Channel::Wheel(..) => {
                [0.0, if ((time_s / 0.4) as u32).is_multiple_of(2) { 6.0 } else { -6.0 }]
            }
        }
    };
    for step in 0..=steps {
        let time_s = step as f64 * STEP_S;
        for part in if step == 0 { 0..=0 } else { 1..=PARTS } {
            for (channel, kind) in robot.channels().enumerate() {
                let before = commanded(channel, &kind, step.saturating_sub(1));
                let now = commanded(channel, &kind, step);
                let share = part as f64 / PARTS as f64;
                let between = |k: usize| before[k] + share * (now[k] - before[k]);
                let [position_rad, speed_rad_s] = if part == 0 { now } else { [0, 1].map(between) };
                let speed_rad_s = if robot.takes_speed(&kind) { speed_rad_s } else { 0.0 };
                world.set_law(channel, Law { position_rad, speed_rad_s, ..servos[channel] });
            }
            if part > 0 {
                world.step(STEP_S / PARTS as f64).unwrap();
            }
        }
        for (channel, shaft) in world.shafts().enumerate() {
            let law = world.law(channel);
            let targets = [law.position_rad, law.speed_rad_s, law.torque_nm];
            let all = targets.into_iter().chain([shaft[0] + 2e-3 * noise(), shaft[1]]);
            drives[channel].iter_mut().zip(all).for_each(|(to, value)| to.push((time_s, value)));
        }
        let (position, rotation) = world.base();
        place.iter_mut().zip(&position).for_each(|(to, at)| to.push((time_s, at + 2e-3 * noise())));
        let q = UnitQuaternion::from_matrix(&rotation);
        let parts = [q.w, q.i, q.j, q.k].into_iter();
        turned.iter_mut().zip(parts).for_each(|(to, at)| to.push((time_s, at + 1e-3 * noise())));
    }
    let drives = drives.into_iter().map(|columns| {
        let [target_rad, target_rad_s, feedforward_nm, rad, rad_s] = columns.map(Series::new);
        DriveSeries { target_rad, target_rad_s, feedforward_nm, rad, rad_s }
    });
    Recording {
        span_s: [0.0, steps as f64 * STEP_S],
        interval_s: STEP_S,
        drives: drives.collect(),
        position_m: Some(place.map(Series::new)),
        orientation: Some(turned.map(Series::new)),
        gyro_rad_s: None,
    }
}

fn of(robot: &Robot, kind: Kind, name: &str, which: impl Fn(&Channel<'_>) -> bool) -> Quantity {
    let channels = robot.channels().enumerate();
    let members = channels.filter(|(_, channel)| which(channel)).map(|(number, _)| number);
    Quantity { kind, group: Some(Group { name: name.to_owned(), members: members.collect() }) }
}

fn friction() -> Quantity {
    Quantity { kind: Kind::Friction, group: None }
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn a_slipping_robot_tells_its_friction_and_its_gains() {
    let robot = agilebot();
    let joint = |channel: &Channel<'_>| matches!(channel, Channel::Joint(_));
    let quantities = [
        friction(),
        of(&robot, Kind::PositionGain, "joints", joint),
        of(&robot, Kind::SpeedGain, "joints", joint),
        of(&robot, Kind::SpeedGain, "wheels", |channel| !joint(channel)),
    ];
    let mut hidden = SimulationModel::new(&robot);
    let truth = [0.25, 60.0, 1.4, 0.35];
    quantities.iter().zip(truth).for_each(|(of, value)| of.set(&mut hidden, value));
    let recording = recording(&hidden, 150, noise(1));
    let found = identify(&robot, recording, &quantities, &Options::default(), |_| true).unwrap();
    for (of, truth) in found.found.iter().zip(truth) {
        assert_eq!(of.verdict, QuantityVerdict::Changed, "{of:?}");
        // One of four values exceeds 2.4 deviations in every 15th draw.
        assert!((of.fitted - truth).abs() < 3.0 * of.deviation, "{:?}", found.found);
        assert!(of.deviation < 0.02 * of.fitted, "{of:?}");
    }
    for signal in [Signal::Joint, Signal::Position, Signal::Orientation] {
        let [before, after] = found
            .predicted
            .each_ref()
            .map(|quality| quality.as_ref().and_then(|quality| quality.of_signal(signal)).unwrap());
        assert!(after < 4e-3 && before > 2.0 * after, "{signal:?}: {before} to {after}");
    }
}

#[test]
fn another_run_is_predicted_by_the_numbers_that_made_it() {
    let robot = agilebot();
    let file = SimulationModel::new(&robot);
    let mut hidden = file.clone();
    friction().set(&mut hidden, 0.25);
    let run = recording(&hidden, 120, noise(3));
    let options = Options { iterations: 8, ..Options::default() };
    let rms = |model: &SimulationModel| {
        let found = predict(model, run.clone(), &options, |_| true).unwrap().unwrap();
        [Signal::Joint, Signal::Position].map(|signal| found.of_signal(signal).unwrap())
    };
    // Noise is 2 mrad and 2 mm.
    let [own, other] = [&hidden, &file].map(rms);
    assert!(own.iter().all(|rms| *rms < 2.4e-3), "{own:?}");
    assert!(other[1] > 2.0 * own[1], "{other:?} and {own:?}");
}

#[test]
fn parts_of_a_run_begin_where_it_was_measured_then() {
    let robot = agilebot();
    let model = SimulationModel::new(&robot);
    let replay = replay(recording(&model, 300, || 0.0), &model, &Options::default()).unwrap();
    let all = parts::of(&replay, &model, 300);
    let spans_s: Vec<_> = all.iter().map(|part| part.recording.span_s).collect();
    for (number, [begin_s, end_s]) in (0..).zip(&spans_s) {
        let expected_s = f64::from(number) * 100.0 * STEP_S;
        assert!((begin_s - expected_s).abs() < 1e-9, "{spans_s:?}");
        assert!((end_s - expected_s - 100.0 * STEP_S).abs() < 1e-9, "{spans_s:?}");
        // The second part begins in the middle of a swing, and its start has the error of a parabola through a tenth of a
        // second.
        let part = &all[number as usize];
        let place = replay.recording.position_m.as_ref().unwrap()[0].at(*begin_s)[0];
        assert!((part.start.state.base_position_m.x - place).abs() < 1e-3, "{number}");
        assert_eq!(part.steps, 100);
    }
    assert_eq!(all.len(), 3);
    assert!(parts::of(&replay, &model, 250).is_empty());
}

/// Recording of a robot whose joints and wheels swing gently.
fn gentle(robot: &Robot) -> Recording {
    let mut recording = recording(&SimulationModel::new(robot), 90, || 0.0);
    let wheels = &mut recording.drives[robot.joints.len()..];
    for drive in wheels {
        drive.target_rad_s = Series::new((0..=90).map(|k| {
            let time_s = f64::from(k) * STEP_S;
            (time_s, 0.5 * (3.0 * time_s).sin())
        }));
    }
    recording
}

#[test]
#[ignore = "ten seconds and more: cargo xtask nightly --only long"]
fn what_a_run_does_not_tell_stays_as_it_is() {
    let robot = agilebot();
    let mut model = SimulationModel::new(&robot);
    let mut quiet = gentle(&robot);
    // Commands of joints that stand still, and the resulting motion.
    for (drive, joint) in quiet.drives.iter_mut().zip(&robot.joints) {
        drive.target_rad = Series::constant(joint.nominal_rad);
        drive.target_rad_s = Series::default();
        drive.rad = Series::default();
        drive.rad_s = Series::default();
    }
    quiet.position_m = None;
    quiet.orientation = None;
    let quantities = [friction()];
    let options = Options { iterations: 3, ..Options::default() };
    let found = identify(&robot, quiet, &quantities, &options, |_| true).unwrap();
    assert!(
        matches!(found.found[0].verdict, QuantityVerdict::Silent | QuantityVerdict::Vague),
        "{found:?}"
    );
    assert_eq!(found.model, SimulationModel::new(&robot));
    quantities[0].set(&mut model, 0.4);
    assert_ne!(found.model, model);
}

#[test]
fn derivatives_by_quantities_are_those_of_finite_differences() {
    let robot = agilebot();
    let all = |_: &Channel<'_>| true;
    let links = Group { name: "legs".into(), members: (1..robot.links.len()).collect() };
    let quantities = [
        friction(),
        of(&robot, Kind::PositionGain, "joints", |channel| matches!(channel, Channel::Joint(_))),
        of(&robot, Kind::SpeedGain, "all", all),
        of(&robot, Kind::Armature, "all", all),
        Quantity { kind: Kind::Mass, group: Some(links) },
        Quantity { kind: Kind::Stiffness, group: None },
        Quantity { kind: Kind::Stick, group: None },
        Quantity { kind: Kind::Delay, group: None },
    ];
    let mut model = SimulationModel::new(&robot);
    // A friction that lets feet slip, equal gains for all, and a delay that is not a whole number of steps.
    let values = [0.2, 70.0, 1.2, 5e-3, 1.5, 3e4, 4e3, 0.0047];
    quantities.iter().zip(values).for_each(|(of, value)| of.set(&mut model, value));
    let mut recording = recording(&SimulationModel::new(&robot), 60, || 0.0);
    for (channel, drive) in (0..).zip(&mut recording.drives) {
        let wave = |step| (f64::from(step) * STEP_S, 0.4 * f64::from(step * 2 + channel).sin());
        drive.feedforward_nm = Series::new((0..=60).map(wave));
    }
    agree(recording, &model, &quantities);
}

/// Replays a run with commanded speeds on servos that accept no speed of joints.
#[test]
fn speeds_that_servos_do_not_take_have_no_effect() {
    let mut robot = agilebot();
    let bus = shipped("pup").buses[&0];
    let numbers: Vec<_> = robot.channels().map(|channel| channel.actuator().bus).collect();
    robot.buses.extend(numbers.into_iter().map(|number| (number, bus)));
    let delay = Quantity { kind: Kind::Delay, group: None };
    let model = SimulationModel { delay_s: 0.0047, ..SimulationModel::new(&robot) };
    let joints = robot.joints.len();
    let silent = recording(&SimulationModel::new(&robot), 60, || 0.0);
    let mut commanded = silent.clone();
    for (number, drive) in (0..).zip(&mut commanded.drives[..joints]) {
        let wave = |step| (f64::from(step) * STEP_S, f64::from(step + number).sin());
        drive.target_rad_s = Series::new((0..=60).map(wave));
    }
    let misses = |recording: &Recording, robot: &Robot| {
        let model = SimulationModel { delay_s: 0.0047, ..SimulationModel::new(robot) };
        let replay = replay(recording.clone(), &model, &Options::default()).unwrap();
        let changes = vec![0.0; replay.start.count()];
        replay.play(&model, &changes, &[], false, 20).unwrap().weighted(&[1.0; 6]).0
    };
    assert_eq!(misses(&commanded, &robot), misses(&silent, &robot));
    assert_ne!(misses(&commanded, &agilebot()), misses(&silent, &agilebot()));
    agree(commanded, &model, &[delay]);
}

/// Checks the derivatives of a rollout with respect to quantities and start state.
fn agree(recording: Recording, model: &SimulationModel, quantities: &[Quantity]) {
    let replay = replay(recording, model, &Options::default()).unwrap();
    let changes = vec![0.05; replay.start.count()];
    let noise = [1.0; 6];
    let values = |model: &SimulationModel| {
        let played = replay.play(model, &changes, &[], false, 20).unwrap();
        nalgebra::DVector::from_vec(played.weighted(&noise).0)
    };
    let played = replay.play(model, &changes, quantities, true, 20).unwrap();
    let jacobian = played.weighted(&noise).1();
    let agrees = |name: &str, difference: nalgebra::DVector<f64>, number: usize| {
        let off = (&difference - jacobian.column(number)).norm() / difference.norm();
        assert!(off < 1e-3, "{name}: off by {off:e} of {}", difference.norm());
    };
    // A soft foot is meshed at the initial position of its link, so it differs for each start.
    let is_rigid = model.robot.end_effectors.iter().all(|of| of.soft.is_none());
    for number in 0..if is_rigid { changes.len() } else { 0 } {
        let by = 1e-6;
        let moved = |by: f64| {
            let mut changes = changes.clone();
            changes[number] += by;
            let played = replay.play(model, &changes, &[], false, 20).unwrap();
            nalgebra::DVector::from_vec(played.weighted(&noise).0)
        };
        let difference = (moved(by) - moved(-by)) / (2.0 * by);
        agrees("the start", difference, quantities.len() + number);
    }
    for (number, quantity) in quantities.iter().enumerate() {
        let by = 1e-5;
        let moved = |by: f64| {
            let value = quantity.value(model);
            let mut model = model.clone();
            quantity.set(&mut model, quantity.of_parameter(value, by));
            values(&model)
        };
        agrees(&quantity.name(), (moved(by) - moved(-by)) / (2.0 * by), number);
    }
}

#[test]
fn soft_feet_have_derivatives_by_all_but_their_links_masses() {
    let mut robot = shipped("legbot");
    for foot in &mut robot.end_effectors {
        foot.soft = Some(SoftMaterial {
            young_pa: 3e5,
            poisson: 0.3,
            density_kg_m3: 60.0,
            viscosity_pa_s: 300.0,
        });
    }
    robot.validate().unwrap();
    // Not a whole number of steps, so that slopes of commands jump within a step.
    let model = SimulationModel { delay_s: 0.0047, ..SimulationModel::new(&robot) };
    let whole = |kind| Quantity { kind, group: None };
    agree(
        recording(&model, 60, || 0.0),
        &model,
        &[friction(), whole(Kind::Stiffness), whole(Kind::Stick), whole(Kind::Delay)],
    );
    let links = |name: &str, link| {
        let group = Some(Group { name: name.to_owned(), members: vec![link] });
        Quantity { kind: Kind::Mass, group }
    };
    let foot = robot.end_effectors[0].link;
    assert_eq!(links("body", 0).soft_link(&robot), None);
    let quantities = [links("body", 0), links("shank", foot)];
    let options = Options::default();
    let run = recording(&model, 60, || 0.0);
    let refused = identify(&robot, run, &quantities, &options, |_| true).unwrap_err();
    assert!(refused.to_string().contains(&robot.links[foot].name), "{refused}");
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn motors_alone_tell_gains() {
    let robot = agilebot();
    let gain = of(
        &robot,
        Kind::PositionGain,
        "pitch",
        |channel| matches!(channel, Channel::Joint(joint) if joint.name.ends_with("_pitch")),
    );
    let mut hidden = SimulationModel::new(&robot);
    gain.set(&mut hidden, 70.0);
    let mut recording = recording(&hidden, 100, noise(2));
    (recording.position_m, recording.orientation) = (None, None);
    let options = Options { iterations: 6, ..Options::default() };
    let found = identify(&robot, recording, &[gain], &options, |_| true).unwrap();
    let [of] = &found.found[..] else { panic!("one quantity") };
    assert_eq!(of.verdict, QuantityVerdict::Changed);
    assert!((of.fitted - 70.0).abs() < 2.5 * of.deviation && of.deviation < 1.0, "{of:?}");
}
