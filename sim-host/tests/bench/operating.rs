//! Operator of the host with the simulated robot, as in a console but without one.

use crate::robot::{self, BOW, ROLL, STAND, SWING};
use crate::{S, connect, rig};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::lossy::Lossy;
use rollwalk_host::catalog::Catalog;
use rollwalk_host::operator::{Deadman, ExitStage, Intent, Operator, ReleaseReaction, View};
use rollwalk_protocol::faults;
use rollwalk_protocol::library::{ClipId, Library, validate};
use rollwalk_protocol::wire::{Node, State};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::faults::stream::StreamFault;
use rollwalk_sim_host::faults::{Fault, FaultKind, FramePath};
use rollwalk_sim_host::rig::Rig;

/// Robot with its library, and an operator with the names of the library.
struct Console<B> {
    bus: B,
    operator: Operator,
}

impl<B: LinkBus> Console<B> {
    fn new(bus: B) -> Self {
        let mut session = connect(bus);
        session.flash(&robot::library(), |_| {}).unwrap();
        let mut operator = Operator::new(Node::new(1).unwrap(), Some(robot::config().hash()));
        operator.set_catalog(Some(catalog()));
        let mut console = Self { bus: session.into_bus(), operator };
        console.run(S);
        console
    }

    fn flash(&mut self, library: Vec<u8>) {
        self.operator.flash(self.bus.now_us(), library);
    }

    /// Runs until the view contains a message with `text`.
    fn wait_to_read(&mut self, text: &str) {
        let has_it = |view: &View| view.messages.iter().any(|message| message.text.contains(text));
        self.wait(text, has_it);
    }

    fn request(&mut self, intent: Intent) {
        self.operator.request(self.bus.now_us(), intent);
    }

    fn run(&mut self, us: u64) {
        let until_us = self.bus.now_us() + us;
        self.run_until(until_us, |_| false);
    }

    /// Runs until `condition` returns true for the view. Panics if this takes too long.
    fn wait(&mut self, what: &str, condition: impl FnMut(&View) -> bool) {
        let until_us = self.bus.now_us() + 20 * S;
        let found = self.run_until(until_us, condition);
        let view = self.operator.view(self.bus.now_us());
        assert!(found, "waited for {what}: {:?}, {:#?}", view.status, view.messages);
    }

    fn wait_for(&mut self, state: State) {
        self.wait(&format!("{state:?}"), |view| view.status.is_some_and(|s| s.state == state));
    }

    fn run_until(&mut self, until_us: u64, mut condition: impl FnMut(&View) -> bool) -> bool {
        loop {
            let now_us = self.bus.now_us();
            while let Some(frame) = self.operator.poll(now_us) {
                match self.bus.send(&frame) {
                    Ok(()) => {}
                    Err(LinkError::Busy) => {
                        self.operator.not_sent(frame);
                        break;
                    }
                    Err(error) => panic!("{error}"),
                }
            }
            if condition(&self.operator.view(now_us)) {
                return true;
            }
            if now_us >= until_us {
                return false;
            }
            let wake_us = self.operator.next_poll_us(now_us).max(now_us + 500).min(until_us);
            if let Some(frame) = self.bus.receive(wake_us).unwrap() {
                self.operator.on_frame(self.bus.now_us(), &frame);
            }
        }
    }

    fn view(&self) -> View {
        self.operator.view(self.bus.now_us())
    }

    fn state(&self) -> State {
        self.view().status.unwrap().state
    }
}

fn catalog() -> Catalog {
    let bytes = robot::library();
    let index = validate(&bytes, &robot::config()).unwrap();
    let channels = ["hip", "knee", "wheel"].map(str::to_owned).to_vec();
    Catalog::of(&Library::open(&bytes, &index).unwrap(), "one_leg", channels).unwrap()
}

/// Number of the clip of a motion. The library contains the motions in the order of their codes.
fn clip(code: u8) -> Option<u8> {
    Some(code - 1)
}

#[test]
fn arms_plays_pauses_and_goes_home() {
    let mut console = Console::new(rig());
    let view = console.view();
    assert_eq!(view.hello.map(|hello| hello.channels), Some(3));
    assert!(view.link.contact && view.link.lost == 0 && view.link.received > 10);
    // A heartbeat and its answer take 130 bits each on a bus with little else.
    assert!(view.link.round_trip_us.unwrap() < 2_000, "{:?}", view.link);
    assert_eq!(view.joints.len(), 3);
    console.request(Intent::Arm);
    console.wait_for(State::Ready);
    console.request(Intent::Play { code: SWING });
    console.wait("swing", |view| view.status.unwrap().clip == clip(SWING));
    console.request(Intent::PauseOrResume);
    console.wait_for(State::Paused);
    console.request(Intent::PauseOrResume);
    console.wait_for(State::Playing);
    console.request(Intent::Play { code: BOW });
    console.request(Intent::Play { code: ROLL });
    console.wait("roll", |view| view.status.unwrap().clip == clip(ROLL));
    console.request(Intent::Return);
    console.wait_for(State::Ready);
    assert_eq!(console.view().status.unwrap().clip, clip(STAND));
    console.request(Intent::Quit);
    console.wait("home", |view| view.leaving == ExitStage::Now);
    assert_eq!(console.state(), State::Disarmed);
    assert!(!console.view().messages.iter().any(|message| message.text.contains("refused")));
}

#[test]
fn a_loop_changes_its_speed_while_it_plays() {
    let mut console = Console::new(rig());
    console.request(Intent::Arm);
    console.wait_for(State::Ready);
    console.request(Intent::Play { code: ROLL });
    console.wait("roll", |view| view.status.unwrap().clip == clip(ROLL));
    console.run(2 * S);
    // Many small steps, as by a stick.
    for sixty_fourths in (32..64).rev() {
        console.request(Intent::Speed { sixty_fourths });
        console.run(20_000);
    }
    console.run(2 * S);
    assert_eq!(console.view().asked, Some((ROLL, 32)));
    let wheel = console.view().joints[&2].telemetry;
    // A step of telemetry is 2 mrad/s, and the wheel follows a constant speed.
    assert!((wheel.velocity_rad_s - 0.5 * robot::ROLL_RAD_S).abs() < 0.02, "{wheel:?}");
}

#[test]
fn a_stop_is_left_by_clearing_and_arming() {
    let mut console = Console::new(rig());
    console.request(Intent::Arm);
    console.wait_for(State::Ready);
    console.request(Intent::Play { code: SWING });
    console.request(Intent::Estop);
    console.wait_for(State::EStopped);
    assert!(!console.view().stopping);
    console.request(Intent::Arm);
    console.request(Intent::Play { code: SWING });
    console.run(S);
    assert_eq!(console.state(), State::EStopped);
    console.request(Intent::Clear);
    console.wait_for(State::Disarmed);
    console.request(Intent::Arm);
    console.wait_for(State::Ready);
    console.request(Intent::Play { code: SWING });
    console.wait_for(State::Playing);
}

#[test]
fn a_deadman_that_is_let_go_halts_or_returns_or_disarms() {
    for (let_go, ends) in [
        (ReleaseReaction::Pause, State::Paused),
        (ReleaseReaction::Return, State::Ready),
        (ReleaseReaction::Disarm, State::Disarmed),
    ] {
        let mut console = Console::new(rig());
        console.request(Intent::Deadman(Deadman::Released(let_go)));
        console.request(Intent::Arm);
        console.run(S);
        assert_eq!(console.state(), State::Disarmed, "not armed without it");
        console.request(Intent::Deadman(Deadman::Held));
        console.request(Intent::Arm);
        console.wait_for(State::Ready);
        console.request(Intent::Play { code: ROLL });
        console.wait("roll", |view| view.status.unwrap().clip == clip(ROLL));
        console.request(Intent::Deadman(Deadman::Released(let_go)));
        console.wait_for(ends);
        // Neither time nor another press makes the robot move.
        console.request(Intent::Deadman(Deadman::Held));
        console.run(2 * S);
        assert_eq!(console.state(), ends);
    }
}

/// The host can send but no longer receive. Its heartbeats must not keep a loop playing that the host may be unable to halt.
#[test]
fn a_robot_that_is_not_heard_any_more_goes_home_without_the_deadman_and_when_its_operator_leaves() {
    for intent in [Intent::Deadman(Deadman::Released(ReleaseReaction::Pause)), Intent::Quit] {
        let mut console = Console::new(rig());
        console.request(Intent::Deadman(Deadman::Held));
        console.request(Intent::Arm);
        console.wait_for(State::Ready);
        console.request(Intent::Play { code: ROLL });
        console.wait("roll", |view| view.status.unwrap().clip == clip(ROLL));
        let from = console.bus.now();
        let until = from + SimTime::from_ms(13_000);
        let kind = FaultKind::Stream(FramePath::LinkToHost, StreamFault::Lose(1000));
        console.bus.add_fault(Fault { kind, from, until });
        console.run(2 * S);
        let turns = |console: &Console<Rig>| console.bus.body().values()[2].abs() > 0.1;
        assert!(turns(&console), "with the deadman held it goes on");
        console.request(intent);
        console.run(S);
        // The request cannot be cancelled before the robot answers.
        console.request(Intent::Deadman(Deadman::Held));
        console.run(9 * S);
        assert!(!turns(&console), "{intent:?}");
        assert!(console.bus.body().servos().iter().all(|servo| !servo.is_driving()));
        console.run(2 * S);
        let view = console.view();
        assert_eq!(view.status.map(|status| status.state), Some(State::TorqueOff));
        assert!(view.faults.iter().any(|fault| fault.fault == faults::Fault::HostLost));
    }
}

/// The motion is acknowledged but has not begun, so there is nothing to pause yet.
#[test]
fn a_deadman_let_go_at_any_instant_halts_the_robot() {
    for delay_us in (0..60_000).step_by(3_000) {
        let mut console = Console::new(rig());
        console.request(Intent::Deadman(Deadman::Held));
        console.request(Intent::Arm);
        console.wait_for(State::Ready);
        console.request(Intent::Play { code: ROLL });
        console.run(delay_us);
        console.request(Intent::Deadman(Deadman::Released(ReleaseReaction::Pause)));
        console.run(3 * S);
        assert!(matches!(console.state(), State::Paused | State::Ready), "{delay_us} µs");
        let wheel = console.view().joints[&2].telemetry.velocity_rad_s;
        assert!(wheel.abs() < 0.02, "{delay_us} µs: {wheel}");
    }
}

#[test]
fn a_robot_whose_operator_is_gone_returns_by_itself() {
    let mut console = Console::new(rig());
    console.request(Intent::Arm);
    console.wait_for(State::Ready);
    console.request(Intent::Play { code: SWING });
    console.wait("swing", |view| view.status.unwrap().clip == clip(SWING));
    // The program stalls for a while, so frames wait.
    let until_us = console.bus.now_us() + 10 * S;
    let mut frames = Vec::new();
    while let Some(frame) = console.bus.receive(until_us).unwrap() {
        frames.push(frame);
    }
    for frame in frames {
        console.operator.on_frame(until_us, &frame);
    }
    console.run(S);
    let view = console.view();
    assert_eq!(view.status.unwrap().state, State::TorqueOff);
    assert!(
        view.faults.iter().any(|fault| fault.fault == faults::Fault::HostLost && fault.present)
    );
    console.request(Intent::Clear);
    console.wait_for(State::Disarmed);
    console.request(Intent::Arm);
    console.wait_for(State::Ready);
}

#[test]
fn a_link_that_loses_frames_delays_but_does_not_derail() {
    for seed in 0..10 {
        // A twentieth of all frames is lost.
        let mut console = Console::new(Lossy::new(rig(), 50, seed));
        for (intent, state) in [
            (Intent::Arm, State::Ready),
            (Intent::Play { code: SWING }, State::Playing),
            (Intent::Disarm, State::Disarmed),
        ] {
            // Requests without an answer are repeated, as by an operator.
            for _ in 0..5 {
                console.request(intent);
                let until_us = console.bus.now_us() + 8 * S;
                let there = |view: &View| view.status.is_some_and(|s| s.state == state);
                if console.run_until(until_us, there) {
                    break;
                }
            }
            assert_eq!(console.state(), state, "seed {seed}: {:#?}", console.view().messages);
            console.run(2 * S);
        }
        assert!(console.view().link.lost > 0);
        let records = console.bus.inner().records();
        assert!(records.iter().any(|record| record.clip == ClipId(4)), "seed {seed}");
    }
}

#[test]
fn another_robots_operator_does_not_arm() {
    let mut session = connect(rig());
    session.flash(&robot::library(), |_| {}).unwrap();
    let operator = Operator::new(Node::new(1).unwrap(), Some(1));
    let mut console = Console { bus: session.into_bus(), operator };
    console.run(S);
    console.request(Intent::Arm);
    console.run(S);
    assert_eq!(console.state(), State::Disarmed);
    assert!(console.view().mismatch.unwrap().contains("for another robot"));
}

#[test]
fn a_library_is_transferred_beside_all_else_over_a_bad_link() {
    for seed in 0..3 {
        let mut console = Console::new(Lossy::new(rig(), 30, seed));
        console.flash(robot::library());
        console.wait("a transfer", |view| view.transfer.is_some_and(|transfer| transfer.done > 0));
        console.wait_to_read("the controller uses the transferred library");
        assert_eq!(console.view().transfer, None);
        console.request(Intent::Arm);
        console.wait_for(State::Ready);
        console.flash(robot::library());
        console.wait_to_read("the robot is not disarmed");
    }
}

#[test]
fn a_library_that_is_refused_says_why_and_the_old_one_stays() {
    let mut console = Console::new(rig());
    let used = console.view().hello.and_then(|hello| hello.library);
    let mut damaged = robot::library();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    console.flash(damaged);
    console.wait_to_read("the controller refused the library");
    console.wait("HELLO", |view| view.hello.is_some());
    assert_eq!((console.view().hello.unwrap().library, used.is_some()), (used, true));
    assert_eq!(console.state(), State::Disarmed);
}

#[test]
fn a_stop_during_a_transfer_ends_it() {
    let mut console = Console::new(rig());
    console.flash(robot::library());
    console.wait("a transfer", |view| view.transfer.is_some());
    console.request(Intent::Estop);
    console.wait("the end of the transfer", |view| view.transfer.is_none());
    console.wait_for(State::EStopped);
}
