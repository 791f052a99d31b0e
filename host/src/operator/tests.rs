//! Individual cases of the operator. [`any_sequence`] tests the invariants.

mod any_sequence;

use super::*;
use crate::fixtures::servo_line;
use rollwalk_protocol::faults::{Fault, FaultBits, Severity};
use rollwalk_protocol::library::PlaceCode;
use rollwalk_protocol::wire::{
    Action, Command, CommandAck, CommandResult, Estop, EstopAck, FaultReport, HeartbeatReply,
    JointTelemetry, Node, SCHEMA_HASH, Status, ToController,
};

fn node() -> Node {
    Node::new(1).unwrap()
}

fn status(state: State, counter: u8) -> Status {
    let faults = FaultBits::default();
    let severity = Severity::None;
    Status { state, severity, faults, clip: None, frame: 0, counter, library: 0 }
}

fn catalog() -> Catalog {
    use crate::catalog::{CatalogMotion, Transition};
    let motion = |code: u8| CatalogMotion {
        name: format!("motion_{code}"),
        code: Some(code),
        frames: 60,
        looping: code.is_multiple_of(2),
    };
    Catalog {
        robot: "test".into(),
        config_hash: 7,
        library: 0,
        motions: (0..4).map(motion).collect(),
        transitions: vec![Transition { from: 0, to: 1 }],
        safe: 0,
        channels: vec!["hip".into()],
        actuators: Actuators::default(),
    }
}

/// Operator, with all messages that it has sent.
struct TestOperator {
    operator: Operator,
    now_us: u64,
    sent: Vec<ToController>,
    heartbeat: u8,
    /// True if the bus refuses the next command.
    full: bool,
}

impl TestOperator {
    /// Creates an operator in contact with a controller whose clock is known.
    fn new() -> Self {
        let operator = Operator::new(node(), None);
        let mut desk = Self { operator, now_us: 0, sent: Vec::new(), heartbeat: 0, full: false };
        desk.poll();
        desk.reply();
        desk.receive(status(State::Ready, 0).encode(node()));
        desk.operator.hello = Some(Hello {
            major: PROTOCOL_MAJOR,
            minor: PROTOCOL_MINOR,
            schema_hash: SCHEMA_HASH,
            config_hash: 7,
            format_major: 1,
            format_minor: 1,
            library: None,
            max_block: 512,
            channels: 3,
        });
        desk.poll();
        desk.sent.clear();
        desk
    }

    /// Creates an operator that has received nothing yet, with a released deadman.
    fn without_contact(let_go: ReleaseReaction) -> Self {
        let mut operator = Operator::new(node(), None);
        operator.request(0, Intent::Deadman(Deadman::Released(let_go)));
        Self { operator, now_us: 0, sent: Vec::new(), heartbeat: 0, full: false }
    }

    fn poll(&mut self) -> Vec<ToController> {
        let mut new = Vec::new();
        let released = matches!(self.operator.deadman, Some(Deadman::Released(_)));
        let may_live = !released || self.operator.link.in_contact(self.now_us);
        while let Some(frame) = self.operator.poll(self.now_us) {
            let message = ToController::decode(&frame).unwrap().1;
            if matches!(message, ToController::Command(_)) && std::mem::take(&mut self.full) {
                self.operator.not_sent(frame);
                break;
            }
            if let ToController::Heartbeat(heartbeat) = message {
                assert!(may_live, "a heartbeat without contact and without the deadman");
                self.heartbeat = heartbeat.seq;
            }
            new.push(message);
            assert!(new.len() < 20, "no end: {new:?}");
        }
        self.sent.extend(&new);
        new
    }

    fn reply(&mut self) {
        let reply =
            HeartbeatReply { seq: self.heartbeat, controller_ms: (self.now_us / 1000) as u32 };
        self.receive(reply.encode(node()));
    }

    fn receive(&mut self, frame: Frame) {
        self.operator.on_frame(self.now_us, &frame);
    }

    fn request(&mut self, intent: Intent) {
        self.operator.request(self.now_us, intent);
    }

    fn pass(&mut self, us: u64) {
        let until_us = self.now_us + us;
        while self.now_us < until_us {
            self.now_us = self.operator.next_poll_us(self.now_us).clamp(self.now_us + 1, until_us);
            self.poll();
        }
    }

    fn commands(&self) -> Vec<Command> {
        let command = |message: &ToController| match message {
            ToController::Command(command) => Some(*command),
            _ => None,
        };
        self.sent.iter().filter_map(command).collect()
    }

    /// Answers the latest command.
    fn answer(&mut self, result: CommandResult, value: u16) {
        let command = *self.commands().last().expect("a command was sent");
        let (seq, kind) = (command.seq, command.action.kind());
        let ack = CommandAck { seq, kind, result, state: State::Ready, motion: None, value };
        self.receive(ack.encode(node()));
        self.poll();
    }

    fn last_words(&self) -> &str {
        &self.operator.log.messages().back().unwrap().text
    }
}

#[test]
fn a_command_without_answer_is_repeated_with_its_number_and_then_given_up() {
    let mut desk = TestOperator::new();
    desk.request(Intent::Play { code: 3 });
    desk.pass(1_000_000);
    let commands = desk.commands();
    // Every 60 ms for half a second.
    assert_eq!(commands.len(), 9);
    assert!(commands.iter().all(|command| *command == commands[0]));
    assert!(desk.last_words().starts_with("no answer to the command to play code 3"));
    assert_eq!(desk.operator.view(desk.now_us).asking, None);
}

#[test]
fn arming_takes_two_steps_and_confirms_by_itself() {
    let mut desk = TestOperator::new();
    desk.request(Intent::Arm);
    desk.poll();
    desk.answer(CommandResult::Ok, 777);
    desk.answer(CommandResult::Ok, 0);
    let actions: Vec<_> = desk.commands().iter().map(|command| command.action).collect();
    assert_eq!(actions, [Action::ArmRequest, Action::ArmConfirm { nonce: 777 }]);
    assert_eq!(desk.last_words(), "armed: the robot moves to SAFE");
}

#[test]
fn an_outcome_has_the_number_of_the_wish_that_it_answers() {
    let mut desk = TestOperator::new();
    desk.request(Intent::Arm);
    desk.poll();
    let arm = desk.operator.latest_intent();
    desk.answer(CommandResult::Ok, 777);
    assert!(desk.operator.is_asking(arm), "the second step");
    desk.answer(CommandResult::Ok, 0);
    assert!(!desk.operator.is_asking(arm));
    desk.request(Intent::Pause);
    desk.poll();
    desk.answer(CommandResult::NotArmed, 0);
    desk.request(Intent::Estop);
    desk.request(Intent::Return);
    let answers: Vec<_> =
        desk.operator.log.messages().iter().map(|m| (m.answers, m.weight)).collect();
    let expected = [
        (Some(arm), Weight::Note),
        (Some(arm + 1), Weight::Refused),
        (None, Weight::Warning),
        (Some(arm + 3), Weight::Refused),
    ];
    assert_eq!(answers[answers.len() - 4..], expected, "{:?}", desk.operator.log.messages());
    let numbers: Vec<_> = desk.operator.log.messages().iter().map(|m| m.number).collect();
    assert_eq!(numbers, (1..=answers.len() as u64).collect::<Vec<_>>());
}

#[test]
fn a_number_out_of_order_is_counted_on_and_a_refusal_is_told() {
    let mut desk = TestOperator::new();
    desk.request(Intent::Play { code: 3 });
    desk.poll();
    desk.answer(CommandResult::OutOfOrder, 0);
    desk.answer(CommandResult::NotArmed, 0);
    let numbers: Vec<_> = desk.commands().iter().map(|command| command.seq).collect();
    assert_eq!(numbers, [1, 2]);
    assert_eq!(
        desk.last_words(),
        "the controller refused to play code 3: torque is off; arm first"
    );
}

#[test]
fn of_several_motions_the_newest_counts_and_a_pause_waits_for_none() {
    let mut desk = TestOperator::new();
    for code in 1..=5 {
        desk.request(Intent::Play { code });
        desk.poll();
    }
    desk.answer(CommandResult::Ok, 0);
    let codes = desk.commands().iter().map(|command| command.action).collect::<Vec<_>>();
    let play = |code| Action::Play { code, speed_64ths: 64 };
    assert_eq!(codes, [play(1), play(5)]);
    desk.request(Intent::Play { code: 6 });
    desk.request(Intent::Pause);
    desk.pass(200_000);
    let last = desk.commands().split_off(2);
    assert!(last.iter().all(|command| command.action == Action::Pause), "{last:?}");
}

#[test]
fn a_motion_for_a_place_is_sent_when_the_operator_asks_again() {
    let mut catalog = catalog();
    catalog.motions[3].name = "climb@stairs".into();
    let mut desk = TestOperator::new();
    desk.operator.set_catalog(Some(catalog.clone()));
    let play = Intent::Play { code: 3 };
    let plays = |desk: &TestOperator| {
        let commands = desk.commands();
        commands.iter().filter(|of| of.action.kind() == 0).map(|of| of.action).collect::<Vec<_>>()
    };
    desk.request(play);
    assert!(desk.last_words().contains("begins at `stairs`"), "{}", desk.last_words());
    // A key that is held repeats at once.
    for _ in 0..20 {
        desk.pass(100_000);
        desk.request(play);
    }
    // Something else in between withdraws the question.
    desk.pass(2_000_000);
    desk.request(Intent::Return);
    desk.pass(2_000_000);
    desk.answer(CommandResult::Ok, 0);
    desk.request(play);
    desk.pass(11_000_000);
    desk.request(play);
    assert_eq!(plays(&desk), []);
    desk.pass(2_000_000);
    desk.request(play);
    desk.poll();
    let at = Action::play(Some(PlaceCode::named("stairs")), 3, 64);
    assert_eq!(plays(&desk), [at]);

    // A program that asks again does not know where the robot stands.
    let mut desk = TestOperator::new();
    desk.operator = std::mem::replace(&mut desk.operator, Operator::new(node(), None)).unwatched();
    desk.operator.set_catalog(Some(catalog));
    desk.request(play);
    desk.poll();
    assert_eq!(plays(&desk), [Action::play(None, 3, 64)]);
}

#[test]
fn a_motion_does_not_replace_a_stop_that_waits() {
    let orders = [Intent::Disarm, Intent::Return, Intent::Pause];
    for (stop, order) in orders.into_iter().zip([Action::Disarm, Action::Return, Action::Pause]) {
        let mut desk = TestOperator::new();
        // The next command waits for the answer.
        desk.request(Intent::Clear);
        desk.poll();
        desk.request(stop);
        let intent_number = desk.operator.latest_intent();
        for other in [Intent::Play { code: 3 }, Intent::Arm, Intent::Stream] {
            desk.request(other);
            assert!(desk.last_words().contains("a stop command is sent first"), "{other:?}");
        }
        assert!(desk.operator.is_asking(intent_number));
        desk.pass(1_500_000);
        let last = desk.commands().last().map(|command| command.action);
        assert_eq!(last, Some(order), "{:?}", desk.commands());
    }
}

#[test]
fn a_frame_that_the_bus_did_not_take_is_sent_again_but_not_after_a_stop() {
    let mut desk = TestOperator::new();
    desk.request(Intent::Play { code: 3 });
    let frame = desk.operator.poll(desk.now_us).unwrap();
    desk.operator.not_sent(frame);
    assert_eq!(desk.operator.poll(desk.now_us), Some(frame));
    desk.operator.not_sent(frame);
    desk.request(Intent::Estop);
    assert_eq!(desk.poll(), [ToController::Estop]);
    assert_eq!(desk.commands(), []);
}

#[test]
fn what_is_wrong_with_the_bus_is_said_once_and_shown_as_it_is() {
    let mut desk = TestOperator::new();
    let said = desk.operator.log.messages().len();
    for damaged in [1, 9, 10] {
        let why = Some(format!("{damaged} damaged frames on can0"));
        desk.operator.on_complaint(desk.now_us, why.clone());
        assert_eq!(desk.operator.view(desk.now_us).complaint, why);
        assert_eq!(desk.last_words(), "1 damaged frames on can0");
    }
    desk.operator.on_complaint(desk.now_us, Some("can0 is bus-off".into()));
    assert_eq!(desk.last_words(), "can0 is bus-off");
    desk.operator.on_complaint(desk.now_us, None);
    desk.operator.on_complaint(desk.now_us, None);
    assert_eq!(desk.operator.log.messages().len(), said + 3);
    assert_eq!(desk.operator.view(desk.now_us).complaint, None);
}

#[test]
fn what_the_bus_did_not_take_does_not_move_the_robot_after_the_deadman_was_let_go() {
    let let_go = Intent::Deadman(Deadman::Released(ReleaseReaction::Pause));
    for intent in [Intent::PauseOrResume, Intent::Play { code: 3 }] {
        let mut desk = TestOperator::new();
        desk.receive(status(State::Paused, 1).encode(node()));
        desk.request(Intent::Deadman(Deadman::Held));
        desk.full = true;
        desk.request(intent);
        desk.poll();
        desk.request(let_go);
        desk.pass(300_000);
        assert_eq!(desk.commands(), [], "{intent:?}");
    }
    // The second step of arming is dropped on a stop of another node, on leaving, and on orders that stop.
    for intent in [Some(let_go), Some(Intent::Quit), Some(Intent::Disarm), None] {
        let mut desk = TestOperator::new();
        desk.request(Intent::Deadman(Deadman::Held));
        desk.request(Intent::Arm);
        desk.poll();
        desk.full = true;
        desk.answer(CommandResult::Ok, 777);
        match intent {
            Some(intent) => desk.request(intent),
            None => desk.receive(status(State::EStopped, 1).encode(node())),
        }
        desk.pass(300_000);
        let confirms = |command: &Command| matches!(command.action, Action::ArmConfirm { .. });
        assert!(!desk.commands().iter().any(confirms), "{intent:?}: {:?}", desk.commands());
    }
}

#[test]
fn after_a_stop_it_takes_clearing_and_arming() {
    let mut desk = TestOperator::new();
    desk.request(Intent::Estop);
    desk.request(Intent::Play { code: 3 });
    desk.request(Intent::Clear);
    assert!(desk.last_words().contains("not acknowledged yet"), "{}", desk.last_words());
    desk.receive(EstopAck { state: State::EStopped }.encode(node()));
    desk.receive(status(State::EStopped, 1).encode(node()));
    desk.request(Intent::Arm);
    desk.poll();
    assert_eq!(desk.commands(), []);
    desk.request(Intent::Clear);
    desk.poll();
    desk.answer(CommandResult::Ok, 5);
    desk.answer(CommandResult::Ok, 0);
    desk.receive(status(State::Disarmed, 2).encode(node()));
    desk.request(Intent::Play { code: 3 });
    assert_eq!(
        desk.last_words(),
        "the command to play code 3 was not sent: the robot was not armed after the stop; arm it first"
    );
    desk.request(Intent::Arm);
    desk.poll();
    desk.answer(CommandResult::Ok, 6);
    desk.answer(CommandResult::Ok, 0);
    desk.request(Intent::Play { code: 3 });
    desk.poll();
    assert!(matches!(desk.commands().last().unwrap().action, Action::Play { code: 3, .. }));
}

/// A stop that does not arrive is not reported as one that did.
#[test]
fn an_emergency_stop_without_an_answer_refers_to_the_robots_own_stop() {
    let words = |desk: &TestOperator, part: &str| {
        let messages = desk.operator.log.messages();
        messages.iter().filter(|message| message.text.contains(part)).count()
    };
    let mut desk = TestOperator::new();
    desk.request(Intent::Estop);
    desk.pass(400_000);
    assert_eq!(words(&desk, "NOT acknowledged"), 0);
    desk.request(Intent::Estop);
    desk.pass(2_000_000);
    assert_eq!(words(&desk, "NOT acknowledged"), 1);
    assert_eq!(desk.operator.view(desk.now_us).advice, "press the robot's own emergency stop");
    // A controller that hung answers all repetitions.
    for _ in 0..8 {
        desk.receive(EstopAck { state: State::EStopped }.encode(node()));
    }
    assert_eq!(words(&desk, "is acknowledged"), 1);
    desk.pass(2_000_000);
    assert_eq!(words(&desk, "NOT acknowledged"), 1);

    let mut desk = TestOperator::new();
    desk.operator.on_bus_lost(desk.now_us, "unplugged");
    desk.request(Intent::Estop);
    assert!(desk.last_words().contains("NOT acknowledged"), "{}", desk.last_words());
    let mut desk = TestOperator::new();
    desk.request(Intent::Estop);
    desk.operator.on_bus_lost(desk.now_us, "unplugged");
    assert!(desk.last_words().contains("NOT acknowledged"), "{}", desk.last_words());
}

/// The state of a robot without a link is unknown; its reaction is not.
#[test]
fn a_lost_bus_is_reported_with_the_reaction_of_the_robot() {
    let told = |state| {
        let mut desk = TestOperator::new();
        desk.receive(status(state, 1).encode(node()));
        desk.operator.on_bus_lost(desk.now_us, "unplugged");
        desk.last_words().to_owned()
    };
    assert_eq!(told(State::Disarmed), "the bus is lost: unplugged");
    assert!(told(State::Streaming).contains("holds the robot's pose, then lets it sink"));
    assert!(told(State::Playing).contains("returns the robot to SAFE"));
}

/// Another host has cleared and armed. This operator must still request both, but no command is sent.
#[test]
fn what_another_host_has_cleared_needs_no_command() {
    let mut desk = TestOperator::new();
    desk.receive(status(State::EStopped, 1).encode(node()));
    desk.receive(status(State::Ready, 2).encode(node()));
    desk.request(Intent::Play { code: 3 });
    desk.request(Intent::Clear);
    desk.request(Intent::Arm);
    desk.poll();
    assert_eq!(desk.commands(), []);
    desk.request(Intent::Play { code: 3 });
    desk.poll();
    assert_eq!(desk.commands().len(), 1);
}

#[test]
fn a_robot_that_moves_without_the_deadman_is_told_to_pause_until_it_does() {
    let mut desk = TestOperator::new();
    desk.request(Intent::Deadman(Deadman::Held));
    desk.request(Intent::Play { code: 3 });
    desk.poll();
    // The deadman is released before the motion begins, so nothing can be paused yet.
    desk.request(Intent::Deadman(Deadman::Released(ReleaseReaction::Pause)));
    desk.poll();
    desk.sent.clear();
    desk.receive(status(State::Playing, 1).encode(node()));
    desk.poll();
    assert_eq!(desk.commands().last().unwrap().action, Action::Pause);
    desk.answer(CommandResult::WrongState, 0);
    desk.pass(150_000);
    assert_eq!(desk.commands().last().unwrap().action, Action::Pause);
    for intent in [Intent::Play { code: 3 }, Intent::Return, Intent::Arm] {
        desk.request(intent);
        assert!(desk.last_words().ends_with("hold the deadman"), "{}", desk.last_words());
    }
    desk.receive(status(State::Aligning, 2).encode(node()));
    desk.pass(600_000);
    assert_eq!(desk.commands().last().unwrap().action, Action::Disarm);
}

/// An unanswered order may not have reached the robot. A speed change afterwards must still not restart the earlier motion.
#[test]
fn the_speed_does_not_bring_back_what_an_unanswered_order_has_ended() {
    let playing = |counter| Status { clip: Some(2), ..status(State::Playing, counter) };
    let codes = |desk: &TestOperator| {
        let code = |command: &Command| match command.action {
            Action::Play { code, speed_64ths } => Some((code, speed_64ths)),
            _ => None,
        };
        desk.commands().iter().filter_map(code).collect::<Vec<_>>()
    };
    let orders = [None, Some(Intent::Return), Some(Intent::Disarm), Some(Intent::Play { code: 3 })];
    for order in orders {
        let mut desk = TestOperator::new();
        desk.operator.set_catalog(Some(catalog()));
        desk.request(Intent::Play { code: 2 });
        desk.poll();
        desk.answer(CommandResult::Ok, 0);
        desk.receive(playing(1).encode(node()));
        if let Some(order) = order {
            desk.request(order);
            desk.pass(600_000);
        }
        desk.receive(playing(2).encode(node()));
        desk.sent.clear();
        desk.request(Intent::Speed { sixty_fourths: 20 });
        desk.pass(100_000);
        assert_eq!(codes(&desk).contains(&(2, 20)), order.is_none(), "{order:?}");
    }
}

#[test]
fn a_paused_robot_goes_home_without_the_deadman_only_where_that_is_what_it_means() {
    for (let_go, goes) in [
        (ReleaseReaction::Pause, false),
        (ReleaseReaction::Return, true),
        (ReleaseReaction::Disarm, false),
    ] {
        let mut desk = TestOperator::new();
        desk.receive(status(State::Paused, 1).encode(node()));
        desk.request(Intent::Deadman(Deadman::Released(let_go)));
        desk.request(Intent::Return);
        desk.poll();
        let sent = desk.commands().iter().any(|command| command.action == Action::Return);
        assert_eq!(sent, goes, "{let_go:?}: {}", desk.last_words());
        // Finally torque is off in every case.
        desk.request(Intent::Disarm);
        desk.pass(600_000);
        let last = desk.commands().last().map(|command| command.action);
        assert_eq!(last, Some(Action::Disarm), "{let_go:?}");
    }
}

#[test]
fn without_contact_and_without_the_deadman_it_is_silent_but_for_asking() {
    let mut desk = TestOperator::without_contact(ReleaseReaction::Pause);
    desk.pass(1_200_000);
    assert!(!desk.sent.is_empty(), "it asks: a board with several ports answers there");
    assert!(desk.sent.iter().all(|&message| message == ToController::Transport));
    desk.request(Intent::Deadman(Deadman::Held));
    desk.sent.clear();
    desk.pass(200_000);
    assert_eq!(desk.sent, [], "what was held again brings nothing back");
    desk.receive(status(State::Disarmed, 0).encode(node()));
    assert!(matches!(desk.poll()[..], [ToController::Heartbeat(_), ..]), "{:?}", desk.sent);
}

/// A loss of contact is reported with the control that the operator has: a key, the deadman or Ctrl-C.
#[test]
fn a_loss_of_contact_names_the_control_that_this_program_has() {
    let told = |state, prepare: fn(&mut TestOperator)| {
        let mut desk = TestOperator::new();
        desk.receive(status(state, 1).encode(node()));
        prepare(&mut desk);
        desk.pass(600_000);
        let messages = desk.operator.log.messages();
        let mut text = messages.iter().map(|message| &message.text);
        text.rfind(|text| text.starts_with("no contact")).cloned().unwrap()
    };
    let bare = "no contact: no frame arrived for 0.5 s";
    assert_eq!(told(State::Disarmed, |_| ()), bare);
    let by = |what: &str| {
        format!("{bare}; press the robot's own emergency stop if it moves, or {what}: {LEFT_ALONE}")
    };
    assert_eq!(told(State::Playing, |_| ()), by("quit"));
    assert_eq!(
        told(State::Playing, |desk| desk.request(Intent::Deadman(Deadman::Held))),
        by("release the deadman")
    );
    let scripted = |desk: &mut TestOperator| desk.operator = desk.operator.clone().scripted();
    assert_eq!(told(State::Streaming, scripted), by("end this program with Ctrl-C"));
}

/// Faults are described for the kind of bus that this robot has.
#[test]
fn faults_of_a_serial_line_are_told_in_its_words() {
    let mut desk = TestOperator::new();
    desk.operator.set_actuators(servo_line([1]));
    desk.receive(status(State::Playing, 1).encode(node()));
    let faults = FaultBits::default().with(Fault::BusOff);
    desk.receive(Status { faults, ..status(State::EStopped, 2) }.encode(node()));
    let messages: Vec<_> =
        desk.operator.log.messages().iter().map(|message| &*message.text).collect();
    assert!(
        messages.contains(&"the robot is stopped: the serial adapter of the servos is gone"),
        "{messages:?}"
    );
    let view = desk.operator.view(desk.now_us);
    assert!(
        view.advice.starts_with("switch motor power off, plug the adapter in again"),
        "{}",
        view.advice
    );
    desk.receive(status(State::Disarmed, 3).encode(node()));
    let messages = desk.operator.log.messages();
    assert!(
        messages
            .iter()
            .any(|of| of.text == "fault cleared: the serial adapter of the servos is gone")
    );
}

#[test]
fn a_host_without_a_person_leaves_a_robot_with_torque_alone_that_it_does_not_hear() {
    for (state, is_left) in [(State::Playing, true), (State::Disarmed, false)] {
        let mut desk = TestOperator::new();
        desk.operator = desk.operator.unwatched();
        desk.receive(status(state, 1).encode(node()));
        desk.pass(600_000);
        let messages: Vec<_> =
            desk.operator.log.messages().iter().map(|message| &*message.text).collect();
        let left = messages.iter().any(|text| text.starts_with("this host sends no heartbeats"));
        assert_eq!(left, is_left, "{messages:?}");
        assert_eq!(desk.last_words(), "no contact: no frame arrived for 0.5 s");
        desk.sent.clear();
        desk.pass(400_000);
        let lives = desk.sent.iter().any(|sent| matches!(sent, ToController::Heartbeat(_)));
        assert_eq!(lives, !is_left, "{state:?}: {:?}", desk.sent);
        desk.receive(status(State::Returning, 2).encode(node()));
        desk.sent.clear();
        desk.pass(100_000);
        assert!(desk.sent.iter().any(|sent| matches!(sent, ToController::Heartbeat(_))));
    }
}

#[test]
fn while_nobody_is_at_the_controls_it_sends_no_heartbeats_and_nothing_that_moves() {
    let mut desk = TestOperator::new();
    desk.request(Intent::Play { code: 2 });
    desk.operator.set_attended(desk.now_us, false);
    for counter in 1..20 {
        desk.pass(50_000);
        desk.receive(status(State::Playing, counter % 16).encode(node()));
    }
    assert_eq!(desk.sent, []);
    // Requests in the meantime are dropped too.
    desk.request(Intent::Play { code: 3 });
    desk.pass(100_000);
    assert_eq!(desk.sent, []);
    // A stop is sent even without an operator.
    desk.request(Intent::Estop);
    assert_eq!(desk.poll(), [ToController::Estop]);
    desk.receive(EstopAck { state: State::EStopped }.encode(node()));
    desk.sent.clear();
    desk.pass(200_000);
    assert_eq!(desk.sent, []);
    desk.operator.set_attended(desk.now_us, true);
    assert!(matches!(desk.poll()[..], [ToController::Heartbeat(_)]), "{:?}", desk.sent);
}

#[test]
fn a_stop_that_the_bus_did_not_take_goes_out_next_also_without_contact() {
    let mut desk = TestOperator::without_contact(ReleaseReaction::Pause);
    desk.pass(1_200_000);
    desk.request(Intent::Estop);
    let stop = Estop.encode(node());
    assert_eq!(desk.operator.poll(desk.now_us), Some(stop));
    desk.operator.not_sent(stop);
    assert_eq!(desk.operator.poll(desk.now_us), Some(stop));
}

#[test]
fn a_controller_of_another_protocol_hears_no_heartbeat_but_the_stop() {
    let mut desk = TestOperator::new();
    let mut other = desk.operator.hello.unwrap();
    other.schema_hash ^= 1;
    desk.operator.on_hello(desk.now_us, other);
    desk.request(Intent::Arm);
    desk.pass(300_000);
    assert!(desk.last_words().contains("same release"), "{}", desk.last_words());
    assert_eq!(desk.sent, []);
    desk.request(Intent::Estop);
    assert_eq!(desk.poll(), [ToController::Estop]);
    other.schema_hash ^= 1;
    desk.operator.on_hello(desk.now_us, other);
    desk.sent.clear();
    desk.poll();
    assert_eq!(desk.sent, [ToController::Estop], "silent until the stop is acknowledged");
    desk.receive(EstopAck { state: State::EStopped }.encode(node()));
    desk.sent.clear();
    desk.poll();
    assert!(matches!(desk.sent[..], [ToController::Heartbeat(_)]), "{:?}", desk.sent);
}

#[test]
fn leaving_waits_for_torque_to_go_off_or_for_a_second_wish() {
    let mut desk = TestOperator::new();
    desk.request(Intent::Quit);
    desk.poll();
    assert_eq!(desk.commands().last().unwrap().action, Action::Disarm);
    desk.answer(CommandResult::Ok, 0);
    assert_eq!(desk.operator.leaving(), ExitStage::WhenHome);
    desk.request(Intent::Play { code: 3 });
    assert!(
        desk.last_words().ends_with("this program is ending, and the robot returns to SAFE"),
        "{}",
        desk.last_words()
    );
    let mut other = TestOperator { operator: desk.operator.clone(), sent: Vec::new(), ..desk };
    desk.operator.on_frame(desk.now_us, &status(State::TorqueOff, 1).encode(node()));
    assert_eq!(desk.operator.leaving(), ExitStage::WhenHome);
    desk.operator.on_frame(desk.now_us, &status(State::Disarmed, 2).encode(node()));
    assert_eq!(desk.operator.leaving(), ExitStage::Now);
    other.request(Intent::Quit);
    assert_eq!(other.operator.leaving(), ExitStage::Now);
}

#[test]
fn lost_frames_faults_and_silence_are_told() {
    let mut desk = TestOperator::new();
    let faults = FaultBits::default().with(Fault::HostLost);
    let told = Status { faults, ..status(State::TorqueOff, 4) };
    desk.receive(told.encode(node()));
    let report = FaultReport { counter: 0, fault: Fault::HostLost, channel: None, value: 0.3 };
    desk.receive(report.encode(node()));
    let view = desk.operator.view(desk.now_us);
    assert_eq!((view.link.received, view.link.lost), (2, 3));
    let fault =
        FaultView { fault: Fault::HostLost, present: true, channel: None, value: Some(0.3) };
    assert_eq!(view.faults, [fault]);
    assert!(view.advice.contains("clear the fault, then arm"));
    desk.pass(600_000);
    assert!(desk.last_words().starts_with("no contact"), "{}", desk.last_words());
    assert!(!desk.operator.view(desk.now_us).link.contact);
}

#[test]
fn a_controller_that_has_restarted_is_called_that_and_asked_who_it_is() {
    let mut desk = TestOperator::new();
    desk.now_us = 200_000;
    desk.poll();
    desk.reply();
    assert!(desk.operator.hello().is_some());
    desk.now_us = 400_000;
    desk.receive(status(State::Disarmed, 1).encode(node()));
    desk.poll();
    desk.receive(HeartbeatReply { seq: desk.heartbeat, controller_ms: 40 }.encode(node()));
    assert_eq!(desk.last_words(), "the controller has restarted");
    assert!(desk.operator.hello().is_none());
    assert!(desk.poll().contains(&ToController::Transport), "HELLO");
}

#[test]
fn an_acknowledged_stop_can_be_cleared_before_the_next_status() {
    let mut desk = TestOperator::new();
    desk.receive(status(State::Playing, 1).encode(node()));
    desk.request(Intent::Estop);
    desk.poll();
    desk.receive(EstopAck { state: State::EStopped }.encode(node()));
    desk.request(Intent::Clear);
    desk.poll();
    let actions: Vec<_> = desk.commands().iter().map(|command| command.action).collect();
    assert_eq!(actions, [Action::ClearRequest], "{}", desk.last_words());
}
