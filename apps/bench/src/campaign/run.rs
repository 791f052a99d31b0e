//! Execution of a run: the operator plays motions, the fault of the scenario strikes, the run checks the reported faults, and
//! the operator recovers the robot.

use super::operator::{Operator, OperatorFailure};
use super::scenario::{self, Host, Plan, Scenario};
use super::shared_rig::SharedRig;
use super::world::{self, WorldWatch};
use super::{Case, Reaction, RunReport, Subject};
use crate::campaign::monitor::{Monitor, MonitorConfig, StatusChange, shutdown};
use fastrand::Rng;
use rollwalk_bus::link::LinkBus;
use rollwalk_firmware::Settings;
use rollwalk_host::session::SessionError;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_protocol::faults::FaultBits;
use rollwalk_protocol::wire::isotp::{Output, Timing};
use rollwalk_protocol::wire::transport::{Endpoint, Request, frame_to_controller};
use rollwalk_protocol::wire::{
    Action, CommandResult, FromController, HEARTBEAT_PERIOD_MS, HOST_TIMEOUT_MS, State,
};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::Core;
use rollwalk_sim_host::faults::stream::StreamFault;
use rollwalk_sim_host::faults::{Fault, FaultKind, FramePath};
use rollwalk_sim_host::ground::Fall;
use rollwalk_sim_host::interface::LogEntry;
use rollwalk_sim_host::rig::Rig;
use rollwalk_sim_host::servo;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

/// Maximum time from a stop to motors without torque on undisturbed buses.
///
/// Two queued frames and a DISABLE for each motor take less than a millisecond, plus one control period.
const TORQUE_OFF_WITHIN: SimTime = SimTime::from_us(10_000);
/// Maximum delay of a set-point on a disturbed bus in any scenario. The motors' own watchdogs start at the final set-point.
const MAX_FRAME_DELAY: SimTime = SimTime::from_ms(200);
/// Duration of frame loss during a transfer.
const FLASH_LOSS_FOR: SimTime = SimTime::from_ms(20_000);
/// Maximum time of a transfer from the start of the fault.
const FLASH_WITHIN: SimTime = SimTime::from_ms(30_000);
/// Frame loss above which an operator can stop the robot but not arm it, per mille. Runs begin without such a loss; it starts
/// with the fault.
const HOPELESS: u16 = 500;
/// Duration of a frame loss above [`HOPELESS`].
const HOPELESS_FOR: SimTime = SimTime::from_ms(20_000);
/// Multiplier of the hash that combines scenario, loss and seed: 2⁶⁴ over the golden ratio (Fibonacci hashing).
const MIXER: u64 = 0x9E37_79B9_7F4A_7C15;
/// End of faults that last for the whole run.
const FOREVER: SimTime = SimTime::from_ms(u64::MAX / 2_000_000);

/// Duration of `count` control periods, rounded up.
fn periods(count: u64) -> SimTime {
    SimTime::from_us((count * 1_000_000).div_ceil(Settings::default().control_hz.into()))
}

/// Time limits of a shutdown.
fn shutdown_timing(subject: &Subject) -> shutdown::Timing {
    let settings = Settings::default();
    shutdown::Timing {
        host_timeout: SimTime::from_ms(HOST_TIMEOUT_MS.into()),
        // One period until the next tick, and two for rounding.
        notices_within: periods(3),
        way_home: subject.way_home + SimTime::from_us(settings.hold_us.into()),
        damping: SimTime::from_us(settings.damping_us.into()),
    }
}

/// Maximum time from the first frame of an emergency stop to motors without torque, with any frame loss.
///
/// The host sends no heartbeats until the stop is acknowledged. The controller therefore loses the host, returns to SAFE, holds
/// and damps.
fn stopped_within(subject: &Subject) -> SimTime {
    let settings = Settings::default();
    // A heartbeat sent just before the stop arrives within its period.
    SimTime::from_ms(u64::from(HOST_TIMEOUT_MS + HEARTBEAT_PERIOD_MS))
        + subject.way_home
        + SimTime::from_us(u64::from(settings.hold_us + settings.damping_us))
        + TORQUE_OFF_WITHIN
}

pub fn run<C: Core>(subject: &Subject, case: Case, core: C) -> (RunReport, Vec<LogEntry>) {
    let mut random = Rng::with_seed(case.seed ^ u64::from(case.loss_per_mille) << 48);
    let mut rig = Rig::with_core(&subject.robot, core).expect("the robot is sound");
    let late = servo::WATCHDOG + MAX_FRAME_DELAY;
    // Two periods, and one for frames on the bus.
    let pose_age = periods(3);
    let config = MonitorConfig {
        control_hz: Settings::default().control_hz.into(),
        node: rig.node(),
        codes: subject.codes.clone(),
        on_the_way: subject.on_the_way.clone(),
        pose_age: match case.scenario {
            // The controller cannot detect a damaged pose.
            Scenario::ActuatorCorruption | Scenario::Chaos => None,
            Scenario::ActuatorDisorder => Some(pose_age + MAX_FRAME_DELAY),
            _ => Some(pose_age),
        },
        motors_off_within: if case.scenario.disturbs_actuators() {
            late
        } else {
            TORQUE_OFF_WITHIN
        },
        // In chaos any number of earlier heartbeats may arrive after the stop.
        stopped_within: (case.scenario != Scenario::Chaos).then_some(
            stopped_within(subject)
                + if case.scenario.disturbs_actuators() { late } else { SimTime::ZERO },
        ),
        shutdown: shutdown_timing(subject),
    };
    let monitor = Rc::new(RefCell::new(Monitor::new(subject.config(), config)));
    let world = subject.on_ground.then(|| {
        // The world has its own random generator, so that a robot on a stand meets the same faults.
        let number = Scenario::ALL.iter().position(|&one| one == case.scenario);
        let loss = u64::from(case.loss_per_mille);
        let mixed = [case.seed, loss, number.unwrap_or_default() as u64];
        let mixed = mixed.iter().fold(0u64, |all, one| (all ^ one).wrapping_mul(MIXER));
        let mut random = Rng::with_seed(mixed);
        let slope_deg = world::SLOPE_MAX_DEG * (2.0 * random.f64() - 1.0);
        let slope_rad = if random.bool() { slope_deg.to_radians() } else { 0.0 };
        Rc::new(RefCell::new(WorldWatch::new(slope_rad)))
    });
    match &world {
        Some(watch) => {
            let slope_rad = watch.borrow().report().slope_rad;
            let ground: Arc<dyn Ground> = Arc::new(Plane::rising(slope_rad));
            rig = rig.onto_ground(&subject.robot, &ground, Vec::new());
            rig.set_observer((Rc::clone(&monitor), Rc::clone(watch)));
        }
        None => rig.set_observer(Rc::clone(&monitor)),
    }
    rig.set_fault_seed(random.u64(..));

    let rig = SharedRig::new(rig);
    let operator = Operator::new(&rig);
    let mut run = Run {
        subject,
        case,
        rig,
        monitor,
        world,
        operator,
        random,
        began: SimTime::ZERO,
        losses: 0,
        host_failed: false,
        errors: Vec::new(),
        transfer: None,
    };
    if let Err(error) = run.execute() {
        run.errors.push(error);
    }
    run.report()
}

/// Maximum time until a controller reports a silent actuator: the permitted silent ticks, the tick of detection and the tick of
/// the report.
fn report_within() -> SimTime {
    periods(u64::from(Settings::default().silent_ticks) + 2)
}

/// Run in progress.
struct Run<'a, C: Core> {
    subject: &'a Subject,
    case: Case,
    rig: SharedRig<C>,
    monitor: Rc<RefCell<Monitor>>,
    world: Option<Rc<RefCell<WorldWatch>>>,
    operator: Operator<C>,
    random: Rng,
    /// Start of the fault.
    began: SimTime,
    /// Number of initial faults that implement the loss of the case.
    losses: usize,
    /// True if the host ended, stalled or stopped the robot.
    host_failed: bool,
    errors: Vec<String>,
    /// Outcome of a transfer.
    transfer: Option<Reaction>,
}

impl<C: Core> Run<'_, C> {
    fn execute(&mut self) -> Result<(), OperatorFailure> {
        let flashes = self.case.scenario == Scenario::Flash;
        let hopeless = self.case.loss_per_mille > HOPELESS;
        if flashes {
            self.add_loss(SimTime::ZERO, FLASH_LOSS_FOR);
            // Torque is off, so no fault bit is required: only the transfer counts.
            return self.flash().and_then(|()| self.recover());
        }
        if !hopeless {
            self.add_loss(SimTime::ZERO, FOREVER);
        }
        self.operator.session()?;
        let early = self.random.u8(0..5) == 0 && !hopeless;
        if !early {
            self.operator.reach(State::Ready)?;
        }
        let start = self.rig.now() + self.between(50, if early { 500 } else { 1500 });
        if hopeless {
            self.add_loss(start, start + HOPELESS_FOR);
        }
        let plan = self.plan(self.case.scenario, start);
        self.operate(&plan)?;
        self.check_reported_faults(&plan);
        self.recover()
    }

    fn between(&mut self, least_ms: u64, most_ms: u64) -> SimTime {
        scenario::between(&mut self.random, least_ms, most_ms)
    }

    /// Adds the loss of the case to the link in both directions.
    fn add_loss(&mut self, from: SimTime, until: SimTime) {
        let loss = self.case.loss_per_mille;
        if loss == 0 {
            return;
        }
        for path in [FramePath::LinkToController, FramePath::LinkToHost] {
            let kind = FaultKind::Stream(path, StreamFault::Lose(loss));
            self.rig.borrow().add_fault(Fault { kind, from, until });
            self.losses += 1;
        }
    }

    /// Draws the faults of a scenario and schedules them.
    fn plan(&mut self, scenario: Scenario, start: SimTime) -> Plan {
        let config = self.subject.config();
        let plan = scenario.plan(start, self.case.loss_per_mille, &config, &mut self.random);
        self.began = start;
        let mut rig = self.rig.borrow();
        rig.set_adapter(plan.adapter);
        plan.faults.iter().for_each(|&fault| rig.add_fault(fault));
        plan
    }

    /// Lets the operator act randomly until all faults are over.
    fn operate(&mut self, plan: &Plan) -> Result<(), OperatorFailure> {
        let until = plan.until + self.between(100, 800);
        let mut host = Some(plan.host);
        while self.rig.now() < until {
            self.run_host_event(&mut host)?;
            self.act_at_random()?;
        }
        while host.is_some_and(|host| host != Host::Stays) {
            self.run_host_event(&mut host)?;
            self.operator.wait(SimTime::from_ms(20));
        }
        // The controller reports a last fault in the next control period.
        self.operator.wait(periods(2));
        Ok(())
    }

    /// Executes the event of the host at its time.
    fn run_host_event(&mut self, host: &mut Option<Host>) -> Result<(), OperatorFailure> {
        let now = self.rig.now();
        let at = match *host {
            Some(Host::Dies(at, _) | Host::Stalls(at, _) | Host::Stops(at)) => at,
            Some(Host::Stays) | None => return Ok(()),
        };
        if now + SimTime::from_ms(200) < at {
            return Ok(());
        }
        if now < at {
            self.operator.wait(at - now);
        }
        // In chaos, other faults have started earlier.
        if self.case.scenario != Scenario::Chaos {
            self.began = self.rig.now();
        }
        let now = self.rig.now();
        self.host_failed = true;
        match host.take() {
            Some(Host::Dies(from, until)) => {
                self.operator.quit();
                self.rig.abandon_until(now + (until - from));
                self.operator.session()?;
            }
            Some(Host::Stalls(from, until)) => {
                // The queued frames of the host are sent, and frames for the host wait.
                let until = now + (until - from);
                self.rig.borrow().run_until(until);
            }
            Some(Host::Stops(_)) => {
                // If no acknowledgement arrives within a second, the session repeats the stop during later calls. With total
                // loss, it repeats the stop until frames arrive again.
                if self.operator.session()?.estop().is_err() {
                    self.operator.wait(stopped_within(self.subject).max(HOPELESS_FOR));
                }
            }
            Some(Host::Stays) | None => {}
        }
        Ok(())
    }

    /// Performs a random action, which may fail.
    fn act_at_random(&mut self) -> Result<(), OperatorFailure> {
        let motions = &self.subject.codes;
        let code = motions[self.random.usize(0..motions.len())];
        let span = self.between(10, 400);
        let choice = self.random.u8(0..20);
        // Selections in quick succession, faster than any transition.
        let hasty: Vec<u8> = (0..self.random.usize(2..24))
            .map(|_| motions[self.random.usize(0..motions.len())])
            .collect();
        let session = self.operator.session()?;
        let state = session.status().map(|status| status.state);
        if (14..=15).contains(&choice) && state == Some(State::Disarmed) {
            let _ = self.confirm_revoked_nonce();
            return Ok(());
        }
        let session = self.operator.session()?;
        let ready = matches!(state, Some(State::Ready | State::Playing | State::Paused));
        let _ = match choice {
            0..=7 if ready => session.select(code).map(|_| ()),
            8 if ready => session.select_at(code, 32).map(|_| ()),
            9 if ready => session.pause(),
            10 if ready => session.resume(),
            11 if ready => hasty.iter().try_for_each(|&code| session.select(code).map(|_| ())),
            12 if ready => session.return_to_safe(),
            13 if ready => session.disarm(),
            0..=13 if state == Some(State::Disarmed) => {
                self.operator.set_up();
                self.operator.session()?.arm()
            }
            _ => session.run_for(span.as_us()),
        };
        // An immediate failure is not repeated in the same instant.
        self.operator.wait(SimTime::from_ms(1));
        Ok(())
    }

    /// Requests a nonce, revokes it, and still confirms it. The monitor checks that torque stays off.
    fn confirm_revoked_nonce(&mut self) -> Result<(), SessionError> {
        let (choice, span) = (self.random.u8(0..4), self.between(2010, 2500));
        let node = self.rig.borrow().node();
        let mut link = self.rig.clone();
        let Ok(session) = self.operator.session() else { return Ok(()) };
        let nonce = session.command("arm", Action::ArmRequest)?.value;
        match choice {
            0 => session.run_for(span.as_us())?,
            1 => session.command("disarm", Action::Disarm).map(drop)?,
            2 => session.command("arm", Action::ArmRequest).map(drop)?,
            // A transfer request without waiting for its answer.
            _ => {
                let mut transport = Endpoint::new(Timing::default());
                transport.send(&[Request::Finish.kind()]).expect("the endpoint is idle");
                if let Output::Send(pdu) = transport.poll(link.now_us()) {
                    link.send(&frame_to_controller(node, &pdu))?;
                }
            }
        }
        session.command("arm", Action::ArmConfirm { nonce }).map(drop)
    }

    /// Compares the reported fault bits with those that the plan requires and allows.
    fn check_reported_faults(&mut self, plan: &Plan) {
        let rig = self.rig.borrow();
        let monitor = self.monitor.borrow();
        let history = monitor.history();
        let began = self.began;
        let before = history.iter().rev().find(|change| change.at <= began);
        let later = history.iter().filter(|change| change.at > began);
        let reported = later.fold(FaultBits::default(), |all, c| FaultBits(all.0 | c.faults.0));
        let is_required = before.is_some_and(|c| driven(c.state) && c.faults.is_empty())
            && !plan.required.is_empty()
            // A DISARM before the controller can detect the fault leaves nothing to report.
            && !disarms(rig.log(), began, began + report_within());
        let unexpected = FaultBits(reported.0 & !plan.allowed.0);
        if !unexpected.is_empty() {
            let names: Vec<_> = unexpected.iter().collect();
            self.errors.push(format!("reported faults without a cause: {names:?}"));
        }
        if is_required && plan.required.0 & reported.0 == 0 {
            let names: Vec<_> = plan.required.iter().collect();
            self.errors.push(format!("did not report any of {names:?}"));
        }
    }

    /// Arms the robot from any state, plays a motion and disarms, which must always be possible.
    fn recover(&mut self) -> Result<(), OperatorFailure> {
        self.operator.reach(State::Ready)?;
        let motion = self.random.usize(1..self.subject.codes.len());
        self.operator.play(self.subject.codes[motion], motion as u8)?;
        self.operator.reach(State::Disarmed)
    }

    /// Transfers the library, with retries.
    fn flash(&mut self) -> Result<(), OperatorFailure> {
        const DISTURBED_BY: [Scenario; 8] = [
            Scenario::Loss,
            Scenario::Repeats,
            Scenario::Reorder,
            Scenario::Delay,
            Scenario::Corruption,
            Scenario::BabbleLink,
            Scenario::LinkUnplugged,
            Scenario::BridgeStall,
        ];
        let disturbance = DISTURBED_BY[self.random.usize(0..DISTURBED_BY.len())];
        self.operator.session()?;
        let start = self.rig.now() + self.between(1, 30);
        self.plan(disturbance, start);
        let library = &self.subject.library;
        let mut failed = false;
        while self.rig.now() < start + FLASH_WITHIN {
            let session = self.operator.session()?;
            match session.flash(library, |_| {}) {
                Ok(()) => {
                    let now = if failed { Reaction::TakenUp } else { Reaction::Transferred };
                    self.transfer = Some(now);
                    return Ok(());
                }
                // A new host program, or another attempt by the same one.
                Err(_) if self.random.bool() => self.operator.quit(),
                Err(_) => {}
            }
            failed = true;
        }
        Err("the library was not transferred, even after the faults had ended".into())
    }

    fn outcome(&self, history: &[StatusChange]) -> Reaction {
        if let Some(transfer) = self.transfer {
            return transfer;
        }
        let later = || history.iter().filter(|c| c.at > self.began && !c.faults.is_empty());
        if later().any(|c| c.state == State::EStopped) {
            Reaction::Stopped
        } else if later().any(|c| c.state == State::Returning) {
            Reaction::WentHome
        } else if later().any(|c| matches!(c.state, State::Damped | State::TorqueOff)) {
            Reaction::LetDown
        } else {
            Reaction::WentOn
        }
    }

    fn report(mut self) -> (RunReport, Vec<LogEntry>) {
        self.operator.quit();
        let rig = self.rig.borrow();
        let monitor = self.monitor.borrow();
        let fired: Vec<u64> = rig.faults().all().map(|(_, fired)| fired).collect();
        let (losses, others) = fired.split_at(self.losses);
        let sum = |counts: &[u64]| counts.iter().sum::<u64>();
        let mut errors = std::mem::take(&mut self.errors);
        if !losses.is_empty() && sum(losses) == 0 {
            errors.push("no frame was lost".into());
        }
        // A stalled host sends no frames that a fault could disturb.
        if !others.is_empty() && sum(others) == 0 && !self.host_failed {
            errors.push("no fault took effect".into());
        }
        if self.case.scenario == Scenario::EStop && monitor.stopped_after().is_none() {
            errors.push("the robot was not stopped".into());
        }
        let coverage = monitor.coverage();
        if coverage.setpoints == 0 || coverage.starts == 0 || coverage.commands == 0 {
            errors.push(format!("the monitor received nothing to check: {coverage:?}"));
        }
        let world = self.world.as_ref().map(|watch| watch.borrow().report().clone());
        for Fall { at, how } in world.iter().flat_map(|world| &world.falls) {
            let slope_deg = world.as_ref().map_or(0.0, |world| world.slope_rad.to_degrees());
            let at_s = at.as_s();
            errors.push(format!(
                "on a slope of {slope_deg:.1} degrees the robot fell at {at_s:.3} s: {how:?}"
            ));
        }
        let history = monitor.history();
        let report = RunReport {
            case: self.case,
            outcome: self.outcome(history),
            violations: monitor.violations().to_vec(),
            errors,
            fired: [sum(losses), sum(others)],
            coverage,
            stopped_after: monitor.stopped_after(),
            world,
            took: rig.now(),
        };
        let log = rig.log().to_vec();
        (report, log)
    }
}

/// True if the controller executes a DISARM between two times.
fn disarms(log: &[LogEntry], from: SimTime, until: SimTime) -> bool {
    let span = from.as_us()..=until.as_us();
    let frames = log.iter().filter(|entry| span.contains(&entry.at_us));
    frames.filter_map(|entry| FromController::decode(&entry.frame).ok()).any(|(_, message)| {
        matches!(message, FromController::CommandAck(ack)
            if ack.kind == Action::Disarm.kind() && ack.result == CommandResult::Ok)
    })
}

fn driven(state: State) -> bool {
    matches!(
        state,
        State::Aligning
            | State::Ready
            | State::Playing
            | State::Paused
            | State::Streaming
            | State::Returning
    )
}
