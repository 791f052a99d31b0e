//! Pilot: turns the operator's steering into a stream of set-points, and decides when to arm, plan and stop. Independent of
//! clock, bus and planner.
//!
//! The planner thread plans one horizon at a time. [`Pilot::request`] requests the next one when few frames are left, and
//! [`Pilot::on_stretch`] queues its frames. Meanwhile the robot plays the previous horizon. When a horizon violates a
//! constraint, the pilot requests a stand on all feet until the planner returns an accepted one.

use rollwalk_host::operator::{ExitStage, Intent, Operator, View, Weight};
use rollwalk_host::stream::Target;
use rollwalk_planner::receding::{CourseError, Steering, Stretch};
use rollwalk_protocol::wire::State;

/// Number of remaining frames at which the next horizon is requested: 0.25 s. The controller already has half of these frames.
const RESERVE: usize = 15;
/// Number of played horizon parts ([`Stretch`]) for which a stopped robot stands before it moves to SAFE.
const STANDS_STRETCHES: u32 = 6;
/// Largest planned speed at which a robot counts as standing, m/s and rad/s.
const STANDS_BELOW: f64 = 0.02;
/// Time after which a command without effect is repeated, µs.
pub const AGAIN_US: u64 = 1_000_000;
/// Number of automatic attempts to arm. The first ones may fail because feedback of actuators is missing just after power-on.
pub const ARMS: u8 = 5;
/// Time between automatic attempts to arm, µs.
pub const ARM_AGAIN_US: u64 = 300_000;
/// Timeout of a stop, µs. If the planner finds no plan to a stand by then, RETURN moves the robot to SAFE from its present
/// pose.
const STOPS_US: u64 = 10_000_000;

/// Motion that a horizon is planned for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SteeringRequest {
    /// Velocity of the body.
    pub steering: Steering,
    /// True if the robot walks in its gait; false if all end effectors are in stance.
    pub walks: bool,
}

impl SteeringRequest {
    /// Selects the gait if the robot may walk and the steering is not zero.
    pub fn of(steering: Steering, may_walk: bool) -> Self {
        Self { steering, walks: may_walk && steering != Steering::default() }
    }
}

/// Request for a horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Number of the course. A new course begins at rest in SAFE.
    pub course: u32,
    /// Motion to plan.
    pub wanted: SteeringRequest,
}

/// Action after the robot has stopped and moved to SAFE.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ActionAfterStop {
    /// Remains in SAFE, with torque.
    Rest,
    Disarm,
    /// Switches torque off and ends the program.
    Leave,
}

/// Phase of a steered drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The robot does not follow streamed set-points.
    Off,
    /// Stays in SAFE while a stream is prepared.
    Beginning,
    /// Follows the steering.
    Steered,
    /// Stops before it moves to SAFE.
    Stopping,
    /// Moves to SAFE.
    Homeward,
}

/// Statistics of the horizons.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    pub planned: u32,
    /// Number of planned horizons that were not accepted.
    pub rejected: u32,
    /// Mean planned velocity of the previous [`Stretch`]: forward and left in the heading frame, m/s, and turning rate, rad/s.
    pub velocity: [f64; 3],
    /// Smallest number of remaining frames when a horizon arrived.
    pub least_ahead: Option<usize>,
}

/// Pilot of one robot.
#[derive(Clone, Debug)]
pub struct Pilot {
    wanted: SteeringRequest,
    phase: Phase,
    after: ActionAfterStop,
    /// True if the robot stays in SAFE until [`rise`](Pilot::rise).
    rests: bool,
    /// Number of remaining automatic attempts to arm.
    arms: u8,
    /// True if the pilot arms the robot, and no operator steers it.
    is_scripted: bool,
    /// True if the end of the stream was requested before the controller followed it.
    ends: bool,
    course: u32,
    is_planning: bool,
    /// True if the previous horizon was not accepted.
    is_unsure: bool,
    /// True if the planner could not plan the previous horizon at all.
    has_failed: bool,
    /// True if the present error of the planner was already reported.
    has_said_why: bool,
    /// First frames of a stream, until the command STREAM is sent.
    first: Option<Vec<Vec<Target>>>,
    /// Number of consecutive [`Stretch`]es in which the robot was commanded to stand and stood.
    stood: u32,
    /// Deadline of the previous command, µs. The pilot then repeats the command or gives up.
    again_us: u64,
    tally: Tally,
}

impl Pilot {
    /// Creates the pilot of a disarmed robot. If `arms` is true the pilot arms it automatically.
    pub fn new(arms: bool) -> Self {
        Self {
            wanted: SteeringRequest::default(),
            phase: Phase::Off,
            after: ActionAfterStop::Rest,
            rests: false,
            arms: if arms { ARMS } else { 0 },
            is_scripted: arms,
            ends: false,
            course: 0,
            is_planning: false,
            is_unsure: false,
            has_failed: false,
            has_said_why: false,
            first: None,
            stood: 0,
            again_us: 0,
            tally: Tally::default(),
        }
    }

    /// Sets the motion that the robot is steered to.
    pub fn steer(&mut self, wanted: SteeringRequest) {
        self.wanted = wanted;
    }

    /// Motion that the robot is steered to.
    pub fn steered(&self) -> SteeringRequest {
        self.wanted
    }

    /// Stops the robot and moves it to SAFE.
    ///
    /// A robot that is not streaming has already stopped. A second request to leave ends the program at once.
    pub fn stop(&mut self, now_us: u64, after: ActionAfterStop, operator: &mut Operator) {
        self.wanted = SteeringRequest::default();
        (self.rests, self.arms) = (true, 0);
        match self.phase {
            Phase::Steered => {
                (self.phase, self.after, self.stood) = (Phase::Stopping, after, 0);
                self.again_us = now_us + STOPS_US;
            }
            Phase::Stopping | Phase::Homeward if after > self.after => self.after = after,
            Phase::Stopping | Phase::Homeward if after == ActionAfterStop::Leave => {
                // The operator requested it twice.
                operator.request(now_us, Intent::Quit);
            }
            Phase::Stopping | Phase::Homeward => {}
            Phase::Beginning if self.again_us > 0 => (self.ends, self.after) = (true, after),
            Phase::Off | Phase::Beginning => {
                self.after = after;
                self.end(now_us, operator);
            }
        }
    }

    /// Keeps a robot that does not follow a stream in SAFE until [`rise`](Self::rise).
    pub fn rest(&mut self) {
        self.rests = true;
    }

    /// Permits steering of a robot that rests in SAFE.
    pub fn rise(&mut self) {
        self.rests = false;
    }

    /// Phase of a steered drive.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// True if the robot stops because the planner returns no accepted plan.
    pub fn is_unsure(&self) -> bool {
        self.is_unsure
    }

    /// True if the planner could not plan the previous horizon at all, so that slower steering is no remedy.
    pub fn has_failed(&self) -> bool {
        self.has_failed
    }

    /// True if the robot does not follow the steering, and no attempt is pending: the controller did not follow set-points, or
    /// refused the last attempt to arm.
    pub fn has_given_up(&self, now_us: u64, view: &View) -> bool {
        let is_disarmed = view.status.is_some_and(|status| status.state == State::Disarmed);
        let is_refused = is_disarmed && self.arms == 0 && view.asking.is_none();
        self.phase == Phase::Off && (self.rests || is_refused && now_us >= self.again_us)
    }

    /// Statistics of the horizons.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// Evaluates the state of the robot and gives commands. Call it often.
    pub fn update(&mut self, now_us: u64, operator: &mut Operator) {
        let view = operator.view(now_us);
        let Some(status) = view.status.filter(|_| view.link.contact) else { return };
        let state = status.state;
        let streams = state == State::Streaming;
        match self.phase {
            Phase::Off if state == State::Ready && !self.rests => {
                (self.phase, self.after, self.again_us) =
                    (Phase::Beginning, ActionAfterStop::Rest, 0);
            }
            Phase::Off if state == State::Disarmed && self.may_arm(now_us, &view) => {
                (self.arms, self.again_us) = (self.arms - 1, now_us + ARM_AGAIN_US);
                operator.request(now_us, Intent::Arm);
            }
            Phase::Beginning if streams => {
                self.phase = if self.ends { Phase::Stopping } else { Phase::Steered };
                self.again_us = now_us + STOPS_US;
                (self.first, self.arms) = (None, 0);
            }
            Phase::Beginning if state != State::Ready => self.end(now_us, operator),
            Phase::Beginning => self.begin(now_us, operator),
            Phase::Steered | Phase::Stopping if !streams => {
                // Streaming has ended, for any reason. The robot must not start again by itself.
                self.rests = true;
                self.end(now_us, operator);
            }
            Phase::Stopping if self.stood >= STANDS_STRETCHES || now_us >= self.again_us => {
                (self.phase, self.again_us) = (Phase::Homeward, now_us + AGAIN_US);
                operator.request(now_us, Intent::Return);
            }
            Phase::Homeward if streams && now_us >= self.again_us => {
                self.again_us = now_us + AGAIN_US;
                operator.request(now_us, Intent::Return);
            }
            Phase::Homeward if !streams && state != State::Aligning => self.end(now_us, operator),
            _ => {}
        }
    }

    /// True if the pilot arms the robot now.
    fn may_arm(&self, now_us: u64, view: &View) -> bool {
        self.arms > 0 && now_us >= self.again_us && view.hello.is_some() && view.asking.is_none()
    }

    /// Sends the command STREAM when the first frames of the stream have been planned.
    fn begin(&mut self, now_us: u64, operator: &mut Operator) {
        if operator.leaving() != ExitStage::No {
            return;
        }
        match self.first.take() {
            Some(first) => {
                self.again_us = now_us + AGAIN_US;
                operator.request(now_us, Intent::Stream);
                first.into_iter().for_each(|frame| operator.stream(frame));
            }
            // The command had no effect.
            None if self.again_us > 0 && now_us >= self.again_us => {
                self.rests = true;
                let text = if self.is_scripted {
                    "the controller does not follow setpoints; `rollwalk doctor` names the cause"
                } else {
                    "the controller does not follow setpoints; steer to try again"
                };
                operator.notify(now_us, Weight::Warning, text);
                self.end(now_us, operator);
            }
            None => {}
        }
    }

    /// Discards the plans of a stream that has ended, then disarms or leaves if the operator requested it.
    fn end(&mut self, now_us: u64, operator: &mut Operator) {
        self.phase = Phase::Off;
        self.course += 1;
        (self.is_planning, self.is_unsure, self.has_said_why) = (false, false, false);
        (self.has_failed, self.ends) = (false, false);
        (self.first, self.stood, self.again_us) = (None, 0, 0);
        if operator.leaving() != ExitStage::No {
            return;
        }
        match std::mem::replace(&mut self.after, ActionAfterStop::Rest) {
            ActionAfterStop::Rest => {}
            ActionAfterStop::Disarm => operator.request(now_us, Intent::Disarm),
            ActionAfterStop::Leave => operator.request(now_us, Intent::Quit),
        }
    }

    /// Returns the next horizon to plan; `None` if no horizon is due.
    pub fn request(&mut self, operator: &Operator) -> Option<Request> {
        let is_due = match self.phase {
            Phase::Off => false,
            Phase::Beginning if self.again_us == 0 => self.first.is_none(),
            _ => operator.streamed_ahead() < RESERVE,
        };
        if !is_due || self.is_planning {
            return None;
        }
        self.is_planning = true;
        let follows = matches!(self.phase, Phase::Beginning | Phase::Steered) && !self.is_unsure;
        let wanted = if follows { self.wanted } else { SteeringRequest::default() };
        Some(Request { course: self.course, wanted })
    }

    /// Receives a requested horizon and queues its frames.
    pub fn on_stretch(
        &mut self,
        now_us: u64,
        request: Request,
        planned: Result<Stretch, CourseError>,
        operator: &mut Operator,
    ) {
        if request.course != self.course {
            return;
        }
        self.is_planning = false;
        self.tally.planned += 1;
        let was_unsure = self.is_unsure;
        self.has_failed = matches!(planned, Err(CourseError::Horizon(_)));
        let stretch = match planned {
            Ok(stretch) => stretch,
            Err(error) => {
                (self.is_unsure, self.tally.rejected) = (true, self.tally.rejected + 1);
                if !std::mem::replace(&mut self.has_said_why, true) {
                    let text = format!("{error}: the robot halts");
                    operator.notify(now_us, Weight::Warning, text);
                }
                return;
            }
        };
        self.is_unsure = !stretch.accepted;
        self.has_said_why &= self.is_unsure;
        self.tally.rejected += u32::from(!stretch.accepted);
        if self.is_unsure && !was_unsure {
            let text = "a planned horizon does not meet all constraints: the robot stops until a \
                horizon meets them";
            operator.notify(now_us, Weight::Warning, text);
        }
        let stands = request.wanted == SteeringRequest::default()
            && stretch.velocity.iter().all(|speed| speed.abs() < STANDS_BELOW);
        self.stood = if stands && stretch.accepted { self.stood + 1 } else { 0 };
        self.tally.velocity = stretch.velocity;
        let frames = stretch.frames.into_iter().map(|frame| {
            let of_channels = frame.values.iter().zip(&frame.torques_nm);
            let target = |(&value, &torque_nm): (&f64, &f64)| Target {
                value: value as f32,
                torque_nm: torque_nm as f32,
            };
            of_channels.map(target).collect::<Vec<_>>()
        });
        if self.phase == Phase::Beginning && self.again_us == 0 {
            self.first = Some(frames.collect());
        } else {
            let ahead = operator.streamed_ahead();
            self.tally.least_ahead =
                Some(self.tally.least_ahead.map_or(ahead, |least| least.min(ahead)));
            frames.for_each(|frame| operator.stream(frame));
        }
    }
}

#[cfg(test)]
mod tests;
