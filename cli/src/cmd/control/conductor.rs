//! Closed-loop session of a robot on a bus: from Disarmed through a sequence of plans and back.
//!
//! The conductor reads the operator's view, sends intents, and answers samples. It has no access to clock or bus.

use nalgebra::Vector3;
use rollwalk_host::operator::{ExitStage, Intent, Operator, View, Weight};
use rollwalk_host::stream::Target;
use rollwalk_host::tracking::{Measurements, Tracking};
use rollwalk_multibody::{Tree, Wheel};
use rollwalk_physics::motor::Law;
use rollwalk_pilot::{AGAIN_US, ARM_AGAIN_US, ARMS};
use rollwalk_protocol::wire::State;
use rollwalk_robot::{Channel, Robot, Transmission};
use rollwalk_simulate::closed_loop::{self, TrackingError};
use rollwalk_simulate::sequence::Sequence;
use rollwalk_tracking::Sensors;

/// Standing time before the sequence begins, s. The estimator finds the gyro bias, and the conductor measures the latency.
const STANDS_S: f64 = 1.5;
/// Maximum time until the state of a standing robot is known, s.
const KNOWN_S: f64 = 10.0;
/// Maximum time until the robot is armed and stands in SAFE, µs.
const ARMED_US: u64 = 30_000_000;
/// Smallest latency with which the conductor refuses to start, s. The robot would fall before the answer acts, and samples cannot
/// measure longer latencies.
pub const LATENCY_MAX_S: f64 = 0.05;
/// Maximum age of valid contact readings, s.
const CONTACTS_S: f64 = 0.05;
/// Maximum number of samples answered in one call, so that the caller can send heartbeats in between.
const AT_ONCE: usize = 8;
/// Number of entries of the lateness counts.
const LATE_MAX: usize = 16;

/// Phase of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Arming the robot, and moving it to SAFE.
    Arming,
    /// Requesting samples from the controller.
    Beginning,
    /// Standing until the state of the robot is estimated.
    Standing,
    /// Playing the sequence.
    Playing,
    /// Returning to SAFE and disarming.
    Homeward,
    Over,
}

/// Counters of samples and answers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// Samples answered, including those answered with set-points of the plan.
    pub answered: u64,
    /// Samples answered with set-points of the plan because the robot could not be tracked.
    pub untracked: u64,
    /// Number of samples for each lateness of the answer in force, in samples; the last entry counts 15 and more.
    pub late: [u64; LATE_MAX],
    /// Number of channels missing from samples.
    pub stale: u64,
    /// Samples that did not arrive.
    pub lost: u64,
    /// True if all motions and cycles were completed.
    pub complete: bool,
}

/// Closed-loop session over a bus.
pub struct Conductor<'p> {
    sequence: Sequence<'p>,
    /// Channel of each spinning wheel.
    wheels: Vec<usize>,
    /// Map between the measured motors and the joints.
    transmission: Transmission,
    end_effectors: usize,
    tracking: Tracking,
    tick_s: f64,
    /// Identity of the library whose SAFE pose the sequence starts in.
    library: u32,
    phase: Phase,
    arms: u8,
    again_us: u64,
    /// Time of the first contact with the controller, µs; `None` before that.
    begun_us: Option<u64>,
    /// Number of the first sample.
    first: Option<u64>,
    /// Number of the most recent sample.
    last: u64,
    /// True if the operator has requested an early end.
    stops: bool,
    /// Most recent reason why the robot was not tracked.
    why: Option<TrackingError>,
    tally: Tally,
    /// Delays of answers, measured while the robot stands, s.
    delays_s: Vec<f64>,
    /// Leg and cycle of the previous message.
    said: Option<(usize, u32)>,
    /// Contact bits of the end effectors at the most recent reading of the switches, and the number of that sample.
    contacts: Option<(u32, u64)>,
    /// True if planned contacts replace missing switch readings.
    planned_contacts: bool,
    /// True once the operator was notified about planned contacts.
    said_contacts: bool,
    touches: Vec<bool>,
    joint_rad: Vec<f64>,
    speed_rad_s: Vec<f64>,
}

/// Returns the channel of each spinning wheel.
///
/// # Panics
/// Panics if a spinning wheel has no motor.
pub fn wheels(robot: &Robot, tree: &Tree) -> Vec<usize> {
    let of = |wheel: &Wheel| {
        let name = &robot.end_effectors[wheel.end_effector].name;
        let is =
            |channel: Channel<'_>| matches!(channel, Channel::Wheel(of, _) if of.name == *name);
        robot.channels().position(is).expect("a wheel with a motor")
    };
    tree.wheels().iter().map(of).collect()
}

impl<'p> Conductor<'p> {
    /// Creates a session for a disarmed robot, with `tracking.rate_hz` ticks a second. `wheels` is the result of [`wheels`];
    /// `library` is the identity of the library that the controller must have.
    pub fn new(
        sequence: Sequence<'p>,
        robot: &Robot,
        wheels: Vec<usize>,
        tracking: Tracking,
        library: u32,
    ) -> Self {
        Self {
            sequence,
            wheels,
            transmission: robot.transmission(),
            end_effectors: robot.end_effectors.len(),
            tick_s: 1.0 / f64::from(tracking.rate_hz),
            tracking,
            library,
            phase: Phase::Arming,
            arms: ARMS,
            again_us: 0,
            begun_us: None,
            first: None,
            last: 0,
            stops: false,
            why: None,
            tally: Tally::default(),
            delays_s: Vec::new(),
            said: None,
            contacts: None,
            planned_contacts: true,
            said_contacts: false,
            touches: Vec::new(),
            joint_rad: Vec::new(),
            speed_rad_s: Vec::new(),
        }
    }

    /// Current phase of the session.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Counters of samples and answers.
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Sample rate that the controller is asked for, Hz.
    pub fn rate_hz(&self) -> u16 {
        self.tracking.rate_hz
    }

    #[cfg(test)]
    pub fn sequence(&self) -> &Sequence<'p> {
        &self.sequence
    }

    /// Ends early. A moving robot completes its cycle and follows the remaining plans to SAFE; any other robot returns to SAFE
    /// at once.
    pub fn stop(&mut self, now_us: u64, operator: &mut Operator) {
        let moves = self.sequence.progress().moves;
        if !moves {
            self.sequence.stop();
        }
        if self.phase == Phase::Playing && moves && !std::mem::replace(&mut self.stops, true) {
            operator.notify(
                now_us,
                Weight::Note,
                "the robot completes its cycle, then returns to SAFE",
            );
            self.sequence.stop();
        } else {
            self.end(now_us, operator);
        }
    }

    /// Sends the intents that follow from the robot's state; call often.
    pub fn update(&mut self, now_us: u64, operator: &mut Operator) {
        let view = operator.view(now_us);
        let Some(status) = view.status.filter(|_| view.link.contact) else { return };
        let streams = status.state == State::Streaming;
        let begun_us = *self.begun_us.get_or_insert(now_us);
        if self.phase == Phase::Arming && now_us - begun_us > ARMED_US {
            let text = "the robot is not armed after 30 s; `rollwalk doctor` names the cause";
            operator.notify(now_us, Weight::Warning, text);
            return self.end(now_us, operator);
        }
        match (self.phase, status.state) {
            (Phase::Over, _) => {}
            (Phase::Arming, State::Disarmed) => self.arm(now_us, &view, operator),
            (Phase::Arming, State::Ready) => {
                (self.phase, self.again_us) = (Phase::Beginning, now_us + AGAIN_US);
                operator.request(now_us, Intent::Track(self.tracking));
            }
            (Phase::Arming, State::Aligning | State::Boot | State::SelfTest) => {}
            (Phase::Beginning, _) if streams => self.phase = Phase::Standing,
            (Phase::Beginning, State::Ready) if now_us < self.again_us => {}
            (Phase::Beginning, State::Ready) => {
                let text = format!(
                    "the controller does not accept setpoints in closed loop at {} samples/s. Give \
                     its control rate with --rate (120 on our boards); a controller with a library key never accepts setpoints",
                    self.tracking.rate_hz
                );
                operator.notify(now_us, Weight::Warning, text);
                self.end(now_us, operator);
            }
            (Phase::Standing | Phase::Playing, _) if streams => {}
            (Phase::Homeward, _) if streams && now_us >= self.again_us => {
                self.again_us = now_us + AGAIN_US;
                operator.request(now_us, Intent::Return);
            }
            (Phase::Homeward, State::Streaming | State::Aligning) => {}
            (Phase::Homeward, _) => {
                self.phase = Phase::Over;
                operator.request(now_us, Intent::Quit);
            }
            _ => {
                let condition = view.condition.unwrap_or_default();
                let text = format!("the motion has ended: the robot is {condition}");
                operator.notify(now_us, Weight::Warning, text);
                self.phase = Phase::Over;
                if operator.leaving() == ExitStage::No {
                    operator.request(now_us, Intent::Quit);
                }
            }
        }
    }

    /// Arms the robot if it has the right library.
    fn arm(&mut self, now_us: u64, view: &View, operator: &mut Operator) {
        let Some(hello) = &view.hello else { return };
        if hello.library != Some(self.library) {
            let text = "the controller has another library: build this library with `rollwalk \
                library build`, and flash it with `rollwalk flash`";
            operator.notify(now_us, Weight::Refused, text);
            self.end(now_us, operator);
        } else if now_us >= self.again_us && view.asking.is_none() {
            if self.arms == 0 {
                return self.end(now_us, operator);
            }
            (self.arms, self.again_us) = (self.arms - 1, now_us + ARM_AGAIN_US);
            operator.request(now_us, Intent::Arm);
        }
    }

    /// Sends the robot to SAFE. If it is already returning, or the session is over, quits.
    fn end(&mut self, now_us: u64, operator: &mut Operator) {
        if !matches!(self.phase, Phase::Homeward | Phase::Over) {
            (self.phase, self.again_us) = (Phase::Homeward, now_us + AGAIN_US);
            operator.request(now_us, Intent::Return);
        } else {
            operator.request(now_us, Intent::Quit);
        }
    }

    /// Answers waiting samples; call often. After a delay the state estimate uses all of them, and the newest answer supersedes
    /// the others. Samples are also answered while the robot returns to SAFE.
    pub fn answer(&mut self, now_us: u64, operator: &mut Operator) {
        for _ in 0..AT_ONCE {
            let Some(measured) = operator.take_sample() else { return };
            self.answer_one(now_us, &measured, operator);
        }
    }

    fn answer_one(&mut self, now_us: u64, measured: &Measurements, operator: &mut Operator) {
        if let Some((rate_hz, lost)) = operator.sampled() {
            self.tally.lost = lost;
            if rate_hz != self.tracking.rate_hz && self.phase == Phase::Standing {
                let text =
                    format!("the controller sends {rate_hz} samples/s: give --rate {rate_hz}");
                operator.notify(now_us, Weight::Refused, text);
                return self.end(now_us, operator);
            }
        }
        self.count(measured);
        let (laws, untracked) = self.tick(measured);
        let lost_contacts = self.planned_contacts && self.contacts.is_some();
        if lost_contacts && !std::mem::replace(&mut self.said_contacts, true) {
            let text =
                "the contact switches no longer send data: tracking uses the planned contacts";
            operator.notify(now_us, Weight::Warning, text);
        }
        self.tally.answered += 1;
        self.tally.untracked += u64::from(untracked.is_some());
        if untracked != self.why {
            if let Some(why) = untracked.filter(|_| self.phase == Phase::Playing) {
                let text = format!(
                    "the robot is not tracked, so setpoints follow the plan in open loop: {why}"
                );
                operator.notify(now_us, Weight::Warning, text);
            }
            self.why = untracked;
        }
        let targets = laws.iter().enumerate().map(|(channel, law)| self.target(channel, law));
        operator.answer(measured.number, untracked.is_some(), targets.collect());
        self.go_on(now_us, measured.number, operator);
    }

    fn count(&mut self, measured: &Measurements) {
        self.first.get_or_insert(measured.number);
        self.last = measured.number;
        self.tally.stale += measured.stale as u64;
        if let Some(delay_s) = measured.delay_s.filter(|_| self.phase == Phase::Standing) {
            self.delays_s.push(f64::from(delay_s));
        }
        if let Some(late) = measured.late {
            self.tally.late[usize::from(late).min(LATE_MAX - 1)] += 1;
        }
    }

    /// Computes the set-points that answer a sample.
    fn tick(&mut self, measured: &Measurements) -> (Vec<Law>, Option<TrackingError>) {
        let vector = |of: [f32; 3]| Vector3::from(of.map(f64::from));
        // The state of a channel without a measurement is unknown.
        let joint = |channel: usize| measured.joints.get(channel).copied().flatten();
        let angle = |channel| joint(channel).map_or(f64::NAN, |of| f64::from(of.position_rad));
        let speed = |channel| joint(channel).map_or(f64::NAN, |of| f64::from(of.velocity_rad_s));
        let joints = self.transmission.motor_count();
        let motor_rad: Vec<_> = (0..joints).map(angle).collect();
        let motor_rad_s: Vec<_> = (0..joints).map(speed).collect();
        self.joint_rad = self.transmission.joints(&motor_rad);
        self.speed_rad_s = self.transmission.at(&self.joint_rad).joints(&motor_rad_s);
        self.speed_rad_s.extend(self.wheels.iter().copied().map(speed));
        let contacts = self.fresh_contacts(measured);
        self.planned_contacts = contacts.is_none();
        let contacts = contacts.unwrap_or(0);
        self.touches.clear();
        self.touches.extend((0..self.end_effectors).map(|of| contacts >> of & 1 != 0));
        let sensors = Sensors {
            gyro_rad_s: measured.gyro_rad_s.map(vector),
            accelerometer_m_s2: measured.force_m_s2.map(vector),
            joint_rad: &self.joint_rad,
            speed_rad_s: &self.speed_rad_s,
            touches: &self.touches,
        };
        let time_s = measured.number as f64 * self.tick_s;
        let sequence = &mut self.sequence;
        sequence.use_planned_contacts(self.planned_contacts);
        sequence.tick(time_s, closed_loop::Measurement::Sensors(&sensors))
    }

    /// Most recent contact readings, if they are fresh. Switches may be read less often than samples are taken.
    fn fresh_contacts(&mut self, measured: &Measurements) -> Option<u32> {
        let number = measured.number;
        self.contacts = measured.contacts.map(|contacts| (contacts, number)).or(self.contacts);
        let (contacts, heard) = self.contacts?;
        ((number - heard) as f64 * self.tick_s < CONTACTS_S).then_some(contacts)
    }

    fn target(&self, channel: usize, law: &Law) -> Target {
        let value = if channel < self.transmission.motor_count() {
            law.position_rad
        } else {
            law.speed_rad_s
        };
        Target { value: value as f32, torque_nm: law.torque_nm as f32 }
    }

    /// Starts the sequence when the robot's state is known, and ends the session after it.
    fn go_on(&mut self, now_us: u64, number: u64, operator: &mut Operator) {
        let sequence = &mut self.sequence;
        let stood_s = (number - self.first.unwrap_or(number)) as f64 * self.tick_s;
        match self.phase {
            Phase::Standing if stood_s >= STANDS_S && sequence.is_ready() => {
                // The median ignores occasional delays.
                self.delays_s.sort_by(f64::total_cmp);
                let latency_s = self.delays_s.get(self.delays_s.len() / 2).copied();
                let latency_s = latency_s.unwrap_or(2.0 * self.tick_s);
                if latency_s >= LATENCY_MAX_S {
                    let text = "setpoints act 50 ms or more after their sample, because the link \
                        or this computer is too slow: end other programs, or give a lower --rate";
                    operator.notify(now_us, Weight::Refused, text);
                    return self.end(now_us, operator);
                }
                sequence.change_latency(latency_s);
                sequence.go();
                self.phase = Phase::Playing;
                let text = format!(
                    "the state of the robot is estimated; setpoints act {:.0} ms after their \
                     sample",
                    1e3 * latency_s
                );
                operator.notify(now_us, Weight::Note, text);
            }
            Phase::Standing if stood_s >= KNOWN_S => {
                let why = self.why.map_or_else(String::new, |why| format!(": {why}"));
                let text =
                    format!("the state of the robot is still unknown after {KNOWN_S} s{why}");
                operator.notify(now_us, Weight::Warning, text);
                self.end(now_us, operator);
            }
            // The robot has stopped on all its feet, at the position that it reached.
            Phase::Playing
                if self.why == Some(TrackingError::Stopped) && sequence.has_stopped() =>
            {
                self.end(now_us, operator);
            }
            Phase::Playing if sequence.is_over() => {
                self.tally.complete = !self.stops;
                self.end(now_us, operator);
            }
            Phase::Playing => {
                let progress = sequence.progress();
                let place = (progress.leg, progress.cycle);
                if progress.moves && self.said != Some(place) {
                    self.said = Some(place);
                    let leg = &sequence.legs()[progress.leg];
                    let cycle = match progress.cycle {
                        0 => String::new(),
                        cycle => format!(", cycle {}", cycle + 1),
                    };
                    let text = format!("{}{cycle}", leg.plan().motion.name);
                    operator.notify(now_us, Weight::Note, text);
                }
            }
            _ => {}
        }
    }
}
