//! One run: what the operator does, when the fault comes, what must follow, and the way back.

use super::bench::Bench;
use super::operator::{Operator, Stuck};
use super::scenario::{self, Host, Plan, Scenario};
use super::{Case, Outcome, Report, Subject};
use crate::monitor::{Change, Monitor, Terms, home};
use fastrand::Rng;
use rollwalk_bus::link::LinkBus;
use rollwalk_firmware::Settings;
use rollwalk_host::session::SessionError;
use rollwalk_protocol::faults::FaultBits;
use rollwalk_protocol::wire::isotp::{Output, Timing};
use rollwalk_protocol::wire::transport::{Endpoint, Request, frame_to_controller};
use rollwalk_protocol::wire::{
    Action, CommandResult, FromController, HEARTBEAT_PERIOD_MS, HOST_TIMEOUT_MS, State,
};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::Core;
use rollwalk_sim_host::faults::stream::Spoil;
use rollwalk_sim_host::faults::{Fault, Harm, Way};
use rollwalk_sim_host::interface::LogEntry;
use rollwalk_sim_host::rig::Rig;
use rollwalk_sim_host::servo;
use std::cell::RefCell;
use std::rc::Rc;

/// A robot that is told to stop has no torque after this, if its buses are well: two frames on their way,
/// and "off" for each of its motors, are less than a millisecond; and a control period.
const PROMPTLY: SimTime = SimTime::from_us(10_000);
/// Setpoints may still come from a bus that is not: as late as the worst of the scenarios makes them. Then the
/// motors' own watchdogs end it.
const STRAGGLERS: SimTime = SimTime::from_ms(200);
/// During a transfer frames get lost so long; then it has to succeed within ...
const FLASH_LOSES_FOR: SimTime = SimTime::from_ms(20_000);
/// ... this time from when the fault began.
const FLASH_GIVES_UP_AFTER: SimTime = SimTime::from_ms(30_000);
/// With more loss than this nothing can be done but stop: it begins when the fault does, and ends.
const HOPELESS: u16 = 500;
const HOPELESS_FOR: SimTime = SimTime::from_ms(20_000);
/// What lasts to the end.
const FOREVER: SimTime = SimTime::from_ms(u64::MAX / 2_000_000);

/// So many control periods, rounded up.
fn periods(count: u64) -> SimTime {
    SimTime::from_us((count * 1_000_000).div_ceil(Settings::default().control_hz.into()))
}

/// How a robot comes down whose host is lost.
fn comes_down(subject: &Subject) -> home::Terms {
    let settings = Settings::default();
    home::Terms {
        host_timeout: SimTime::from_ms(HOST_TIMEOUT_MS.into()),
        // One until the next tick, and what rounding may make of it.
        notices_within: periods(3),
        way_home: subject.way_home + SimTime::from_us(settings.hold_us.into()),
        damping: SimTime::from_us(settings.damping_us.into()),
    }
}

/// After the first frame of an emergency stop was sent no motor has torque after this, whatever is lost: a
/// host that stops sends no heartbeats until the stop is acknowledged, so the controller loses it, goes home,
/// holds, lets itself down.
fn stopped_within(subject: &Subject) -> SimTime {
    let settings = Settings::default();
    // A heartbeat that was sent just before may still be on its way, and comes within its period.
    SimTime::from_ms(u64::from(HOST_TIMEOUT_MS + HEARTBEAT_PERIOD_MS))
        + subject.way_home
        + SimTime::from_us(u64::from(settings.hold_us + settings.damping_us))
        + PROMPTLY
}

/// Tells it.
pub fn tell<C: Core>(subject: &Subject, case: Case, core: C) -> (Report, Vec<LogEntry>) {
    let mut random = Rng::with_seed(case.seed ^ u64::from(case.loss_per_mille) << 48);
    let mut rig = Rig::with_core(&subject.robot, core).expect("the robot is sound");
    let late = servo::WATCHDOG + STRAGGLERS;
    // Two, and one until it has crossed the bus.
    let pose_age = periods(3);
    let terms = Terms {
        control_hz: Settings::default().control_hz.into(),
        node: rig.node(),
        codes: subject.codes.clone(),
        pose_age: match case.scenario {
            // Nobody can know that a pose was damaged.
            Scenario::ActuatorCorruption | Scenario::Chaos => None,
            Scenario::ActuatorDisorder => Some(pose_age + STRAGGLERS),
            _ => Some(pose_age),
        },
        motors_off_within: if case.scenario.disturbs_actuators() { late } else { PROMPTLY },
        // In chaos heartbeats of before the stop may arrive after it, in any number.
        stopped_within: (case.scenario != Scenario::Chaos).then_some(
            stopped_within(subject)
                + if case.scenario.disturbs_actuators() { late } else { SimTime::ZERO },
        ),
        home: comes_down(subject),
    };
    let monitor = Rc::new(RefCell::new(Monitor::new(subject.config(), terms)));
    rig.set_observer(Rc::clone(&monitor));
    rig.set_fault_seed(random.u64(..));

    let bench = Bench::new(rig);
    let operator = Operator::new(&bench);
    let mut story = Story {
        subject,
        case,
        bench,
        monitor,
        operator,
        random,
        began: SimTime::ZERO,
        losses: 0,
        host_failed: false,
        complaints: Vec::new(),
        transfer: None,
    };
    if let Err(stuck) = story.go() {
        story.complaints.push(stuck);
    }
    story.report()
}

/// So long it takes at most until a controller knows that an actuator is silent, and has told it: the ticks that
/// it may be silent, the one in which that is too long, and one to tell it.
fn noticed_within() -> SimTime {
    periods(u64::from(Settings::default().silent_ticks) + 2)
}

struct Story<'a, C: Core> {
    subject: &'a Subject,
    case: Case,
    bench: Bench<C>,
    monitor: Rc<RefCell<Monitor>>,
    operator: Operator<C>,
    random: Rng,
    /// When the fault began.
    began: SimTime,
    /// The first so many faults are the loss that all scenarios have.
    losses: usize,
    /// Something was wrong with the host, which is none of those faults.
    host_failed: bool,
    complaints: Vec<String>,
    /// What became of a transfer.
    transfer: Option<Outcome>,
}

impl<C: Core> Story<'_, C> {
    fn go(&mut self) -> Result<(), Stuck> {
        let flashes = self.case.scenario == Scenario::Flash;
        let hopeless = self.case.loss_per_mille > HOPELESS;
        if flashes {
            self.lose(SimTime::ZERO, FLASH_LOSES_FOR);
            // No torque is on, so no fault has to be told: nothing to judge but the transfer.
            return self.flash().and_then(|()| self.come_back());
        }
        if !hopeless {
            self.lose(SimTime::ZERO, FOREVER);
        }
        self.operator.session()?;
        let early = self.random.u8(0..5) == 0 && !hopeless;
        if !early {
            self.operator.reach(State::Ready)?;
        }
        let start = self.bench.now() + self.between(50, if early { 500 } else { 1500 });
        if hopeless {
            self.lose(start, start + HOPELESS_FOR);
        }
        let plan = self.plan(self.case.scenario, start);
        self.act(&plan)?;
        self.judge(&plan);
        self.come_back()
    }

    fn between(&mut self, least_ms: u64, most_ms: u64) -> SimTime {
        scenario::between(&mut self.random, least_ms, most_ms)
    }

    /// The loss that all scenarios have.
    fn lose(&mut self, from: SimTime, until: SimTime) {
        let loss = self.case.loss_per_mille;
        if loss == 0 {
            return;
        }
        for way in [Way::LinkToController, Way::LinkToHost] {
            let harm = Harm::Stream(way, Spoil::Lose(loss));
            self.bench.rig().add_fault(Fault { harm, from, until });
            self.losses += 1;
        }
    }

    /// What will go wrong, from an instant on.
    fn plan(&mut self, scenario: Scenario, start: SimTime) -> Plan {
        let config = self.subject.config();
        let plan = scenario.plan(start, self.case.loss_per_mille, &config, &mut self.random);
        self.began = start;
        let mut rig = self.bench.rig();
        rig.set_adapter(plan.adapter);
        plan.faults.iter().for_each(|&fault| rig.add_fault(fault));
        plan
    }

    /// The operator goes on with whatever comes to mind, until all is over.
    fn act(&mut self, plan: &Plan) -> Result<(), Stuck> {
        let until = plan.until + self.between(100, 800);
        let mut host = Some(plan.host);
        while self.bench.now() < until {
            self.turn_of_the_host(&mut host)?;
            self.whim()?;
        }
        while host.is_some_and(|host| host != Host::Stays) {
            self.turn_of_the_host(&mut host)?;
            self.operator.wait(SimTime::from_ms(20));
        }
        // What came last is told in the next control period, and is judged after that.
        self.operator.wait(periods(2));
        Ok(())
    }

    /// What the plan has for the host, when its time has come.
    fn turn_of_the_host(&mut self, host: &mut Option<Host>) -> Result<(), Stuck> {
        let now = self.bench.now();
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
        // In chaos other things have begun before.
        if self.case.scenario != Scenario::Chaos {
            self.began = self.bench.now();
        }
        let now = self.bench.now();
        self.host_failed = true;
        match host.take() {
            Some(Host::Dies(from, until)) => {
                self.operator.quit();
                self.bench.abandon_until(now + (until - from));
                self.operator.session()?;
            }
            Some(Host::Stalls(from, until)) => {
                // What it had queued is sent, and what comes for it waits.
                let until = now + (until - from);
                self.bench.rig().run_until(until);
            }
            Some(Host::Stops(_)) => {
                // When nobody answers within a second the stop goes on with whatever is done next.
                // Where all gets lost, until something gets through again.
                if self.operator.session()?.estop().is_err() {
                    self.operator.wait(stopped_within(self.subject).max(HOPELESS_FOR));
                }
            }
            Some(Host::Stays) | None => {}
        }
        Ok(())
    }

    /// Something to do. That it fails is no surprise.
    fn whim(&mut self) -> Result<(), Stuck> {
        let motions = &self.subject.codes;
        let code = motions[self.random.usize(0..motions.len())];
        let span = self.between(10, 400);
        let choice = self.random.u8(0..20);
        // One thing after the other, faster than anything can move.
        let hasty: Vec<u8> = (0..self.random.usize(2..24))
            .map(|_| motions[self.random.usize(0..motions.len())])
            .collect();
        let session = self.operator.session()?;
        let state = session.status().map(|status| status.state);
        if (14..=15).contains(&choice) && state == Some(State::Disarmed) {
            let _ = self.confirm_what_is_void();
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
            0..=13 if state == Some(State::Disarmed) => session.arm(),
            _ => session.run_for(span.as_us()),
        };
        // Whatever failed at once is not tried again at once.
        self.operator.wait(SimTime::from_ms(1));
        Ok(())
    }

    /// Asks for torque, makes the answer void, and confirms it. That it stays off is the monitor's to see.
    fn confirm_what_is_void(&mut self) -> Result<(), SessionError> {
        let (choice, span) = (self.random.u8(0..4), self.between(2010, 2500));
        let node = self.bench.rig().node();
        let mut bench = self.bench.clone();
        let Ok(session) = self.operator.session() else { return Ok(()) };
        let nonce = session.command("arm", Action::ArmRequest)?.value;
        match choice {
            0 => session.run_for(span.as_us())?,
            1 => session.command("disarm", Action::Disarm).map(drop)?,
            2 => session.command("arm", Action::ArmRequest).map(drop)?,
            // A step of a transfer, whose answer nobody waits for.
            _ => {
                let mut transport = Endpoint::new(Timing::default());
                transport.send(&[Request::Finish.kind()]).expect("nothing else is on its way");
                if let Output::Send(pdu) = transport.poll(bench.now_us()) {
                    bench.send(&frame_to_controller(node, &pdu))?;
                }
            }
        }
        session.command("arm", Action::ArmConfirm { nonce }).map(drop)
    }

    /// Whether the robot ended where it had to.
    fn judge(&mut self, plan: &Plan) {
        let rig = self.bench.rig();
        let monitor = self.monitor.borrow();
        let history = monitor.history();
        let began = self.began;
        let before = history.iter().rev().find(|change| change.at <= began);
        let later = history.iter().filter(|change| change.at > began);
        let told = later.fold(FaultBits::default(), |all, c| FaultBits(all.0 | c.faults.0));
        let is_required = before.is_some_and(|c| driven(c.state) && c.faults.is_empty())
            && !plan.required.is_empty()
            // Whoever takes torque off before anybody could notice leaves nothing to be told.
            && !disarms(rig.log(), began, began + noticed_within());
        let unexpected = FaultBits(told.0 & !plan.allowed.0);
        if !unexpected.is_empty() {
            let names: Vec<_> = unexpected.iter().collect();
            self.complaints.push(format!("told faults that nothing has caused: {names:?}"));
        }
        if is_required && plan.required.0 & told.0 == 0 {
            let names: Vec<_> = plan.required.iter().collect();
            self.complaints.push(format!("did not tell any of {names:?}"));
        }
    }

    /// From wherever it is to a motion, and off again: what an operator can always do.
    fn come_back(&mut self) -> Result<(), Stuck> {
        self.operator.reach(State::Ready)?;
        let motion = self.random.usize(1..self.subject.codes.len());
        self.operator.play(self.subject.codes[motion], motion as u8)?;
        self.operator.reach(State::Disarmed)
    }

    /// The library is transferred, whatever it takes.
    fn flash(&mut self) -> Result<(), Stuck> {
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
        let start = self.bench.now() + self.between(1, 30);
        self.plan(disturbance, start);
        let library = &self.subject.library;
        let mut failed = false;
        while self.bench.now() < start + FLASH_GIVES_UP_AFTER {
            let session = self.operator.session()?;
            match session.flash(library, |_| {}) {
                Ok(()) => {
                    let now = if failed { Outcome::TakenUp } else { Outcome::Transferred };
                    self.transfer = Some(now);
                    return Ok(());
                }
                // Another program, or the same one again.
                Err(_) if self.random.bool() => self.operator.quit(),
                Err(_) => {}
            }
            failed = true;
        }
        Err("the library could not be transferred, also when all was well again".into())
    }

    fn outcome(&self, history: &[Change]) -> Outcome {
        if let Some(transfer) = self.transfer {
            return transfer;
        }
        let later = || history.iter().filter(|c| c.at > self.began && !c.faults.is_empty());
        if later().any(|c| c.state == State::EStopped) {
            Outcome::Stopped
        } else if later().any(|c| c.state == State::Returning) {
            Outcome::WentHome
        } else if later().any(|c| matches!(c.state, State::Damped | State::TorqueOff)) {
            Outcome::LetDown
        } else {
            Outcome::WentOn
        }
    }

    fn report(mut self) -> (Report, Vec<LogEntry>) {
        self.operator.quit();
        let rig = self.bench.rig();
        let monitor = self.monitor.borrow();
        let fired: Vec<u64> = rig.faults().all().map(|(_, fired)| fired).collect();
        let (losses, others) = fired.split_at(self.losses);
        let sum = |counts: &[u64]| counts.iter().sum::<u64>();
        let mut complaints = std::mem::take(&mut self.complaints);
        if !losses.is_empty() && sum(losses) == 0 {
            complaints.push("no frame was lost".into());
        }
        // Frames of a host that stands still cannot be held up.
        if !others.is_empty() && sum(others) == 0 && !self.host_failed {
            complaints.push("no fault has fired".into());
        }
        if self.case.scenario == Scenario::EStop && monitor.stopped_after().is_none() {
            complaints.push("nobody has stopped the robot".into());
        }
        let seen = monitor.seen();
        if seen.setpoints == 0 || seen.starts == 0 || seen.commands == 0 {
            complaints.push(format!("the monitor has looked at nothing: {seen:?}"));
        }
        let history = monitor.history();
        let report = Report {
            case: self.case,
            outcome: self.outcome(history),
            violations: monitor.violations().to_vec(),
            complaints,
            fired: [sum(losses), sum(others)],
            seen,
            stopped_after: monitor.stopped_after(),
            took: rig.now(),
        };
        let log = rig.log().to_vec();
        (report, log)
    }
}

/// Whether the controller says yes to a DISARM in this time.
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
        State::Aligning | State::Ready | State::Playing | State::Paused | State::Returning
    )
}
