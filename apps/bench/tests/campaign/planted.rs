//! Tests of the monitor with bugs planted between the controller and its buses. The monitor must report each bug by the rule
//! that it breaks. A monitor that reports nothing proves nothing.

use rollwalk_bench::campaign::monitor::Rule;
use rollwalk_bench::campaign::scenario::Scenario;
use rollwalk_bench::campaign::{Case, RunReport, Subject, run_with};
use rollwalk_bus::link::LinkError;
use rollwalk_firmware::{BusState, Settings};
use rollwalk_protocol::actuator::{Control, JointSetpoint, WheelSetpoint};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::tunnel::{Input, Step, StepResult};
use rollwalk_protocol::wire::{Action, Command, CommandAck, Node, State, ToController};
use rollwalk_sim_host::core::{Core, LocalController};
use std::collections::BTreeSet;

use rollwalk_sim_host::one_leg::BOW;

/// Faulty behaviour of a controller.
type Bug = Box<dyn FnMut(&mut LocalController, Step) -> StepResult>;

struct BuggyController {
    core: LocalController,
    bug: Bug,
}

impl Core for BuggyController {
    fn step(&mut self, step: Step) -> Result<StepResult, LinkError> {
        Ok((self.bug)(&mut self.core, step))
    }

    fn on_bus_state(&mut self, now_us: u64, bus: u8, state: BusState) -> Result<(), LinkError> {
        self.core.on_bus_state(now_us, bus, state)
    }

    fn take_bus_restart(&mut self, bus: u8) -> Result<bool, LinkError> {
        self.core.take_bus_restart(bus)
    }
}

/// Rules whose violations are reported within some runs.
fn reported(scenario: Scenario, seeds: u64, bug: impl Fn() -> Bug) -> BTreeSet<Rule> {
    reported_with(scenario, 0, seeds, bug)
}

/// Rules whose violations are reported within some runs with a loss of link frames, per mille.
fn reported_with(
    scenario: Scenario,
    loss_per_mille: u16,
    seeds: u64,
    bug: impl Fn() -> Bug,
) -> BTreeSet<Rule> {
    let reports = runs(scenario, loss_per_mille, seeds, bug);
    reports.flat_map(|report| report.violations).map(|violation| violation.rule).collect()
}

fn runs(
    scenario: Scenario,
    loss_per_mille: u16,
    seeds: u64,
    bug: impl Fn() -> Bug,
) -> impl Iterator<Item = RunReport> {
    let subject = Subject::one_leg();
    (0..seeds).map(move |seed| {
        let case = Case { scenario, loss_per_mille, seed };
        let config = subject.config();
        let (buses, settings) = (subject.robot.controller_buses(), Settings::default());
        let core = LocalController::with_library(config, buses, settings, &subject.library);
        run_with(&subject, case, BuggyController { core, bug: bug() }).0
    })
}

/// Bug that changes the frames to the actuators.
fn on_its_way(change: impl Fn() -> Box<dyn FnMut(Frame) -> Option<Frame>>) -> Bug {
    let mut change = change();
    Box::new(move |core, step| {
        let mut stepped = core.step(step).unwrap();
        for frame in &mut stepped.actuators {
            *frame = frame.and_then(&mut change);
        }
        stepped
    })
}

/// Bug that sends a frame on bus 0 some time after a stop.
fn after_a_stop(frame: impl Fn(Frame) -> Frame + Copy + 'static) -> Bug {
    let (mut stopped_us, mut last) = (None, None);
    Box::new(move |core, step| {
        if is_stop(&step) {
            stopped_us.get_or_insert(step.now_us);
        }
        let mut stepped = core.step(step).unwrap();
        let [first, ..] = &mut stepped.actuators;
        if let Some(frame) = first.filter(|frame| JointSetpoint::decode(frame).is_some()) {
            last = Some(frame);
        }
        let late = stopped_us.is_some_and(|at| step.now_us > at + 50_000);
        if late && step.free.actuator(0) && first.is_none() && last.is_some() {
            *first = last.take().map(frame);
        }
        stepped
    })
}

fn is_stop(step: &Step) -> bool {
    let Some(Input::Link(frame)) = &step.input else { return false };
    matches!(ToController::decode(frame), Ok((_, ToController::Estop)))
}

fn command_of(step: &Step) -> Option<Command> {
    let Some(Input::Link(frame)) = &step.input else { return None };
    Command::decode(frame).ok().map(|(_, command)| command)
}

/// Changes the set-point of a joint frame. Other frames are unchanged.
fn joint(frame: Frame, change: impl FnOnce(&mut JointSetpoint)) -> Frame {
    let Some((id, mut setpoint)) = JointSetpoint::decode(&frame) else { return frame };
    change(&mut setpoint);
    setpoint.encode(id).unwrap()
}

#[test]
fn without_a_bug_there_is_nothing_to_report() {
    for scenario in [Scenario::Loss, Scenario::EStop, Scenario::HostDead] {
        let rules = reported(scenario, 4, || Box::new(|core, step| core.step(step).unwrap()));
        assert_eq!(rules, BTreeSet::new());
    }
}

#[test]
fn a_setpoint_after_a_stop_is_reported() {
    let rules = reported(Scenario::EStop, 2, || after_a_stop(|last| last));
    assert!(rules.contains(&Rule::NoTorqueUnlessArmed), "{rules:?}");
}

#[test]
fn an_actuator_that_is_enabled_after_a_stop_is_reported() {
    let enable = |_| Control::Enable.encode(1).unwrap();
    let rules = reported(Scenario::EStop, 2, || after_a_stop(enable));
    assert!(rules.contains(&Rule::NoTorqueUnlessArmed), "{rules:?}");
}

#[test]
fn a_stop_that_is_heeded_a_tenth_of_a_second_late_is_reported() {
    let rules = reported(Scenario::EStop, 2, || {
        let mut held: Option<(u64, Input)> = None;
        Box::new(move |core, step| {
            let mut step = step;
            if is_stop(&step) {
                held = held.or(step.input.map(|input| (step.now_us, input)));
                step.input = None;
            }
            if let Some((_, input)) = held.take_if(|(at, _)| step.now_us >= *at + 100_000) {
                core.step(Step { input: Some(input), free: Default::default(), ..step }).unwrap();
            }
            core.step(step).unwrap()
        })
    });
    assert!(rules.contains(&Rule::NoTorqueUnlessArmed), "{rules:?}");
    assert!(rules.contains(&Rule::StopsInTime), "{rules:?}");
}

#[test]
fn motors_that_are_not_told_to_stop_are_reported() {
    let rules = reported(Scenario::EStop, 2, || {
        let mut stopped = false;
        Box::new(move |core, step| {
            stopped |= is_stop(&step);
            let mut stepped = core.step(step).unwrap();
            let disables =
                |frame: &Frame| matches!(Control::decode(frame), Some((_, Control::Disable)));
            for frame in stepped.actuators.iter_mut().filter(|_| stopped) {
                *frame = frame.filter(|frame| !disables(frame));
            }
            stepped
        })
    });
    assert!(rules.contains(&Rule::StopsInTime), "{rules:?}");
}

#[test]
fn a_doubled_step_is_reported() {
    // A library's motion at its greatest speed, and a step of twice a joint's maximum.
    let rules = reported(Scenario::Loss, 1, || {
        on_its_way(|| {
            let mut count = 0;
            Box::new(move |frame| {
                count += 1;
                Some(joint(frame, |to| {
                    to.position_rad += if count % 500 == 0 { 0.1 } else { 0.0 };
                }))
            })
        })
    });
    assert!(rules.contains(&Rule::Slew), "{rules:?}");
}

#[test]
fn setpoints_beyond_the_limits_are_reported() {
    let stiff = reported(Scenario::Loss, 1, || {
        on_its_way(|| Box::new(|frame| Some(joint(frame, |to| to.kp_nm_rad *= 3.0))))
    });
    assert!(stiff.contains(&Rule::Limits), "{stiff:?}");
    // Not from the first set-point on, because a joint that starts outside may stay there.
    let far = reported(Scenario::Loss, 1, || {
        on_its_way(|| {
            let mut count = 0;
            Box::new(move |frame| {
                Some(joint(frame, |to| {
                    count += 1;
                    to.position_rad = if count > 100 { 1.6 } else { to.position_rad };
                }))
            })
        })
    });
    assert!(far.contains(&Rule::Limits), "{far:?}");
    let strong = reported(Scenario::Loss, 1, || {
        on_its_way(|| {
            Box::new(|frame| match WheelSetpoint::decode(&frame) {
                Some((id, wheel)) => WheelSetpoint { torque_limit_nm: 4.0, ..wheel }.encode(id),
                None => Some(frame),
            })
        })
    });
    assert!(strong.contains(&Rule::Limits), "{strong:?}");
}

#[test]
fn a_start_beside_the_pose_is_reported() {
    let rules = reported(Scenario::Loss, 1, || {
        on_its_way(|| Box::new(|frame| Some(joint(frame, |to| to.position_rad += 0.02))))
    });
    assert!(rules.contains(&Rule::StartsAtPose), "{rules:?}");
}

#[test]
fn stiffness_while_damped_is_reported() {
    let rules = reported(Scenario::HostDead, 4, || {
        on_its_way(|| {
            Box::new(|frame| Some(joint(frame, |to| to.kp_nm_rad = to.kp_nm_rad.max(5.0))))
        })
    });
    assert!(rules.contains(&Rule::CompliantWhenDamped), "{rules:?}");
}

#[test]
fn rubbish_on_an_actuator_bus_is_reported() {
    let rules = reported(Scenario::Loss, 1, || {
        on_its_way(|| {
            let mut count = 0;
            Box::new(move |frame| {
                count += 1;
                if count == 300 { Frame::standard(0x7FF, &[0]) } else { Some(frame) }
            })
        })
    });
    assert!(rules.contains(&Rule::ValidFrame), "{rules:?}");
}

/// Bug: the controller handles its faults but does not report them.
#[test]
fn a_fault_that_is_not_told_is_reported() {
    use rollwalk_protocol::faults::FaultBits;
    use rollwalk_protocol::wire::{FromController, Status};
    let silence = || -> Bug {
        Box::new(|core, step| {
            let mut stepped = core.step(step).unwrap();
            stepped.link = stepped.link.map(|frame| match FromController::decode(&frame) {
                Ok((from, FromController::Status(status))) => {
                    Status { faults: FaultBits::default(), ..status }.encode(from)
                }
                _ => frame,
            });
            stepped
        })
    };
    for scenario in [Scenario::ActuatorDead, Scenario::EStop, Scenario::HostDead] {
        let errors: Vec<_> =
            runs(scenario, 0, 4, silence).flat_map(|report| report.errors).collect();
        let untold = errors.iter().any(|text| text.starts_with("did not report any of"));
        assert!(untold, "{scenario:?}: {errors:?}");
    }
}

/// Bug that continues without heartbeats. If `tells` is true, the controller reports that it receives none.
fn deaf_to_silence(tells: bool) -> Bug {
    use rollwalk_protocol::wire::{FromController, Heartbeat, HeartbeatReply, Status};
    let (mut beat, mut asked, mut heard_us, mut fed_us) = (0u8, 0u8, 0, 0);
    Box::new(move |core, step| {
        let mut step = step;
        let now_us = step.now_us;
        let mut feed = |to| {
            beat = beat.wrapping_add(1);
            Input::Link(Heartbeat { seq: beat, host_ms: 0 }.encode(to))
        };
        if let Some(Input::Link(frame)) = &step.input
            && let Ok((to, ToController::Heartbeat(heartbeat))) = ToController::decode(frame)
        {
            (asked, heard_us) = (heartbeat.seq, now_us);
            step.input = Some(feed(to));
            fed_us = now_us;
        }
        if now_us > fed_us + 60_000 {
            fed_us = now_us;
            let input = Some(feed(Node::BROADCAST));
            core.step(Step { now_us, input, free: Default::default() }).unwrap();
        }
        let mut stepped = core.step(step).unwrap();
        stepped.link = stepped.link.map(|frame| match FromController::decode(&frame) {
            Ok((from, FromController::HeartbeatReply(reply))) => {
                HeartbeatReply { seq: asked, ..reply }.encode(from)
            }
            Ok((from, FromController::Status(status)))
                if tells && now_us > heard_us + 250_000 && status.state == State::Playing =>
            {
                Status { faults: status.faults.with(Fault::HostLost), ..status }.encode(from)
            }
            _ => frame,
        });
        stepped
    })
}

#[test]
fn a_lost_host_that_is_ignored_is_reported() {
    let rules = reported(Scenario::HostDead, 4, || deaf_to_silence(false));
    assert!(rules.contains(&Rule::ReturnsInTime), "{rules:?}");
    assert!(!rules.contains(&Rule::StateFitsFaults), "{rules:?}");
}

#[test]
fn a_lost_host_that_is_told_but_ignored_is_reported() {
    let rules = reported(Scenario::HostDead, 4, || deaf_to_silence(true));
    assert!(rules.contains(&Rule::StateFitsFaults), "{rules:?}");
}

/// Bug: the controller reports that it lowers the robot, but holds it up.
#[test]
fn a_robot_that_is_let_down_for_too_long_is_reported() {
    let rules = reported(Scenario::HostDead, 4, || {
        let mut held: Option<u64> = None;
        Box::new(move |core, step| {
            // The controller's clock stops for two seconds.
            let down = core.controller_mut().state() == State::Damped;
            let since = *held.get_or_insert(step.now_us);
            if !down {
                held = None;
            } else if step.now_us < since + 2_000_000 && step.input == Some(Input::Tick) {
                return core.step(Step { now_us: since, ..step }).unwrap();
            }
            core.step(step).unwrap()
        })
    });
    assert!(rules.contains(&Rule::ReturnsInTime), "{rules:?}");
}

/// Bug: the controller plays a motion again a second later, under an unused sequence number, and sends no acknowledgement.
#[test]
fn a_command_that_is_executed_twice_is_reported() {
    let rules = reported(Scenario::Loss, 100, || {
        let mut again: Option<(u64, Command)> = None;
        let mut quiet = None;
        Box::new(move |core, step| {
            if let Some(command) = command_of(&step)
                && matches!(command.action, Action::Play { code: BOW, .. })
            {
                again = Some((step.now_us + 1_000_000, command));
            }
            if let Some((_, command)) = again.take_if(|(at, _)| step.now_us >= *at) {
                let valid_until_ms = (step.now_us / 1000) as u16 + 100;
                let command = Command { seq: (command.seq + 8) & 0xF, valid_until_ms, ..command };
                let input = Input::Link(command.encode(Node::BROADCAST));
                quiet = Some(command.seq);
                let free = Default::default();
                core.step(Step { input: Some(input), free, ..step }).unwrap();
            }
            let mut stepped = core.step(step).unwrap();
            if let Some(frame) = &stepped.link
                && let Ok((_, ack)) = CommandAck::decode(frame)
                && quiet == Some(ack.seq)
            {
                (quiet, stepped.link) = (None, None);
            }
            stepped
        })
    });
    assert!(rules.contains(&Rule::ExecutedOnce), "{rules:?}");
}

/// Bug: the controller executes a repetition of the previous command again. Each repetition gets the next sequence number.
#[test]
fn a_last_command_that_is_executed_again_is_reported() {
    let rules = reported_with(Scenario::Loss, 100, 4, || {
        let (mut last, mut ahead, mut theirs) = (None::<Command>, 0u8, [0u8; 16]);
        Box::new(move |core, step| {
            let mut step = step;
            if let (Some(command), Some(Input::Link(frame))) = (command_of(&step), &step.input) {
                ahead = ahead.wrapping_add(u8::from(last.replace(command) == Some(command)));
                let seq = command.seq.wrapping_add(ahead) & 0xF;
                theirs[usize::from(seq)] = command.seq;
                let (node, _) = Command::decode(frame).unwrap();
                step.input = Some(Input::Link(Command { seq, ..command }.encode(node)));
            }
            let mut stepped = core.step(step).unwrap();
            if let Some(Ok((node, ack))) = stepped.link.as_ref().map(CommandAck::decode) {
                let seq = theirs[usize::from(ack.seq)];
                stepped.link = Some(CommandAck { seq, ..ack }.encode(node));
            }
            stepped
        })
    });
    assert!(rules.contains(&Rule::ExecutedOnce), "{rules:?}");
}

/// Bug: the controller accepts a void nonce. For each second step it requests a fresh nonce itself.
#[test]
fn a_void_nonce_that_is_taken_is_reported() {
    let rules = reported(Scenario::Loss, 100, || {
        let (mut last, mut ahead, mut theirs) = (None::<Command>, 0u8, [0u8; 16]);
        Box::new(move |core, step| {
            let mut step = step;
            if let (Some(mut command), Some(Input::Link(frame))) = (command_of(&step), &step.input)
            {
                let (to, _) = Command::decode(frame).unwrap();
                let is_new = last.replace(command) != Some(command);
                let number = |seq: u8, ahead: u8| seq.wrapping_add(ahead) & 0xF;
                if is_new && let Action::ArmConfirm { nonce } = &mut command.action {
                    let (seq, action) = (number(command.seq, ahead), Action::ArmRequest);
                    let request = Command { seq, action, ..command };
                    let input = Some(Input::Link(request.encode(to)));
                    let free = rollwalk_protocol::tunnel::Buses::default().with_link();
                    let mut said = core.step(Step { input, free, ..step }).unwrap().link;
                    while let Some(frame) = said {
                        if let Ok((_, ack)) = CommandAck::decode(&frame) {
                            *nonce = if ack.seq == seq { ack.value } else { *nonce };
                        }
                        said = core.step(Step { input: None, free, ..step }).unwrap().link;
                    }
                    ahead = ahead.wrapping_add(1);
                }
                let seq = number(command.seq, ahead);
                theirs[usize::from(seq)] = command.seq;
                step.input = Some(Input::Link(Command { seq, ..command }.encode(to)));
            }
            let mut stepped = core.step(step).unwrap();
            if let Some(Ok((node, ack))) = stepped.link.as_ref().map(CommandAck::decode) {
                let seq = theirs[usize::from(ack.seq)];
                stepped.link = Some(CommandAck { seq, ..ack }.encode(node));
            }
            stepped
        })
    });
    assert!(rules.contains(&Rule::NoTorqueUnlessArmed), "{rules:?}");
}

/// Bug: the controller ignores the expiry of commands.
#[test]
fn a_command_that_is_executed_too_late_is_reported() {
    let rules = reported(Scenario::BridgeStall, 100, || {
        Box::new(|core, step| {
            let mut step = step;
            if let (Some(command), Some(Input::Link(frame))) = (command_of(&step), &step.input) {
                let valid_until_ms = (step.now_us / 1000) as u16 + 100;
                let (node, _) = Command::decode(frame).unwrap();
                let command = Command { valid_until_ms, ..command };
                step.input = Some(Input::Link(command.encode(node)));
            }
            core.step(step).unwrap()
        })
    });
    assert!(rules.contains(&Rule::NotExpired), "{rules:?}");
}
