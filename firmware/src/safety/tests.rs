//! Checks of the safety state machine over all states and events.

use rollwalk_protocol::faults::Fault;

use super::*;

/// Second copy of the event catalogue. The fault campaign takes severities from the same catalogue as the firmware, so it would
/// not notice a wrong severity.
#[test]
fn events_have_these_severities_and_faults() {
    use Event as E;
    use Severity as V;
    let expected = [
        (E::EStop, V::EStop, Some(Fault::EStop)),
        (E::BusOff, V::EStop, Some(Fault::BusOff)),
        (E::SelfTestFailed, V::TorqueOff, Some(Fault::Internal)),
        (E::FeedbackLost, V::Damp, Some(Fault::ActuatorSilent)),
        (E::ActuatorFault, V::Damp, Some(Fault::ActuatorFault)),
        (E::NotAcknowledged, V::Damp, Some(Fault::BusNoAck)),
        (E::BusPassive, V::Damp, Some(Fault::BusPassive)),
        (E::Tipped, V::Damp, Some(Fault::Tilt)),
        (E::NotFollowing, V::Damp, Some(Fault::TrackingError)),
        (E::PlaybackFailed, V::Damp, Some(Fault::LibraryUnreadable)),
        (E::Overrun, V::Damp, Some(Fault::Overrun)),
        (E::AlignFailed, V::Damp, Some(Fault::TrackingError)),
        (E::HostLost, V::Return, Some(Fault::HostLost)),
        (E::Leaning, V::Return, Some(Fault::Tilt)),
        (E::Disarm, V::Return, None),
        (E::ClearConfirmed, V::None, None),
        (E::ArmConfirmed, V::None, None),
        (E::Started, V::None, None),
        (E::SelfTestPassed, V::None, None),
        (E::Aligned, V::None, None),
        (E::MotionStarted, V::None, None),
        (E::PauseAsked, V::None, None),
        (E::ResumeAsked, V::None, None),
        (E::SafeReached, V::None, None),
        (E::HoldElapsed, V::None, None),
        (E::DampingElapsed, V::None, None),
        (E::FaultFree, V::None, None),
        (E::Unauthenticated, V::None, None),
        (E::StreamStarted, V::None, None),
        (E::StreamEnded, V::None, None),
        (E::StreamLost, V::Return, Some(Fault::SetpointTimeout)),
        (E::StreamHalted, V::None, None),
    ];
    let catalogue = Event::ALL.iter().map(|&e| (e, e.severity(), e.fault()));
    assert!(catalogue.eq(expected));
}

#[test]
fn estop_stops_from_every_state_in_one_step() {
    for &s in State::ALL {
        for e in [Event::EStop, Event::BusOff] {
            assert_eq!(step(s, e), (State::EStopped, Action::CutTorque));
        }
    }
}

#[test]
fn severity_torque_off_ends_every_state_that_has_torque_or_may_get_it() {
    let armable = |s: State| s == State::Disarmed || s.torque() != Torque::Off;
    for &s in State::ALL.iter().filter(|&&s| armable(s)) {
        for &e in Event::ALL.iter().filter(|e| e.severity() == Severity::TorqueOff) {
            assert_eq!(step(s, e), (State::TorqueOff, Action::CutTorque), "{s:?} {e:?}");
        }
    }
}

#[test]
fn torque_comes_on_only_by_arming_from_disarmed() {
    for &s in State::ALL {
        for &e in Event::ALL {
            let (next, action) = step(s, e);
            if s.torque() == Torque::Off && next.torque() != Torque::Off {
                assert_eq!((s, e), (State::Disarmed, Event::ArmConfirmed));
                assert_eq!((next, action), (State::Aligning, Action::AlignFromMeasured));
            }
            if next == State::Aligning && s != State::Aligning {
                let begins = [
                    (State::Disarmed, Event::ArmConfirmed),
                    (State::Streaming, Event::StreamEnded),
                ];
                assert!(begins.contains(&(s, e)), "{s:?} {e:?}");
            }
        }
    }
}

/// States that events allowed by `may` can reach from `from`.
fn reachable(from: State, may: impl Fn(State, Event) -> bool) -> [bool; State::ALL.len()] {
    let mut seen = [false; State::ALL.len()];
    let mut stack = heapless::Vec::<State, 512>::new();
    stack.push(from).unwrap();
    while let Some(s) = stack.pop() {
        if core::mem::replace(&mut seen[s as usize], true) {
            continue;
        }
        for e in Event::ALL.iter().copied().filter(|&e| may(s, e)) {
            let next = step(s, e).0;
            if !seen[next as usize] {
                stack.push(next).unwrap();
            }
        }
    }
    seen
}

#[test]
fn every_state_is_reachable_from_boot() {
    assert_eq!(reachable(State::Boot, |_, _| true), [true; State::ALL.len()]);
}

#[test]
fn no_path_to_torque_skips_aligning() {
    for from in State::ALL.iter().copied().filter(|s| s.torque() == Torque::Off) {
        let seen = reachable(from, |s, _| s != State::Aligning);
        for s in State::ALL.iter().copied().filter(|&s| seen[s as usize]) {
            assert!(s.torque() == Torque::Off || s == State::Aligning, "{from:?} to {s:?}");
        }
    }
}

#[test]
fn every_state_reaches_torque_off() {
    for &from in State::ALL {
        let seen = reachable(from, |_, e| e != Event::EStop && e != Event::BusOff);
        let off = [State::TorqueOff, State::EStopped].map(|s| seen[s as usize]);
        assert!(off.contains(&true), "{from:?}");
        // Torque is switched off without a command, except in the states that the operator holds.
        let seen = reachable(from, |_, e| e.severity() == Severity::None && !by_command(e));
        let idle =
            State::ALL.iter().copied().any(|s| seen[s as usize] && s.torque() == Torque::Off);
        let held = matches!(
            from,
            State::Aligning | State::Ready | State::Playing | State::Paused | State::Streaming
        );
        assert!(idle || held, "{from:?} waits for somebody");
    }
}

fn by_command(e: Event) -> bool {
    use Event as E;
    matches!(
        e,
        E::ClearConfirmed
            | E::ArmConfirmed
            | E::MotionStarted
            | E::PauseAsked
            | E::ResumeAsked
            | E::StreamStarted
            | E::StreamEnded
    )
}

#[test]
fn every_loss_of_torque_is_acted_on_and_no_step_gains_torque_back() {
    for &s in State::ALL {
        for &e in Event::ALL {
            let (next, action) = step(s, e);
            match (s.torque(), next.torque()) {
                (Torque::Driven | Torque::Damped, Torque::Off) => {
                    assert_eq!(action, Action::CutTorque, "{s:?} {e:?}");
                }
                (Torque::Driven, Torque::Damped) => assert_eq!(action, Action::Damp),
                (Torque::Damped, Torque::Driven) => panic!("{s:?} {e:?} drives again"),
                _ => {}
            }
        }
    }
}

/// Torque goes off without a host or a command: timers and the player lead out of every state with torque.
#[test]
fn without_a_host_every_state_ends_without_torque() {
    for &start in State::ALL {
        let mut s = start;
        for e in [
            Event::HostLost,
            Event::AlignFailed,
            Event::SafeReached,
            Event::HoldElapsed,
            Event::DampingElapsed,
        ] {
            s = step(s, e).0;
        }
        assert_eq!(s.torque(), Torque::Off, "from {start:?}");
    }
}

#[test]
fn latched_states_leave_only_by_clearing_into_the_self_test() {
    for &e in Event::ALL {
        let (next, _) = step(State::EStopped, e);
        let expected = if e == Event::ClearConfirmed { State::SelfTest } else { State::EStopped };
        assert_eq!(next, expected);
    }
}

/// Severity whose reaction leads to state `s`.
fn depth(s: State) -> Severity {
    match s {
        State::EStopped => Severity::EStop,
        State::TorqueOff => Severity::TorqueOff,
        State::Damped => Severity::Damp,
        State::Returning => Severity::Return,
        _ => Severity::None,
    }
}

/// A fault gets its reaction, or a stronger one, in every state that drives the motors.
#[test]
fn a_fault_gets_at_least_its_reaction() {
    for s in State::ALL.iter().copied().filter(|s| s.torque() == Torque::Driven) {
        for e in Event::ALL.iter().copied().filter(|e| e.severity() != Severity::None) {
            let elsewhere = e == Event::AlignFailed && s != State::Aligning;
            let reacts = depth(step(s, e).0).code() >= e.severity().code();
            assert!(reacts || elsewhere, "{s:?} {e:?}");
        }
    }
}

/// A milder fault that arises with or after a severe one must not soften the outcome.
#[test]
fn the_most_severe_trigger_wins() {
    let faults = || Event::ALL.iter().copied().filter(|e| e.severity() != Severity::None);
    for &s in State::ALL {
        for a in faults() {
            for b in faults() {
                let alone = depth(step(s, a).0).code();
                let both = depth(step(step(s, a).0, b).0).code();
                assert!(both >= alone, "{s:?}: {a:?} then {b:?}");
            }
        }
    }
}

#[test]
fn faults_latch_until_they_are_cleared() {
    for &from in State::ALL {
        for fault in Event::ALL.iter().copied().filter(|e| e.fault().is_some()) {
            let mut machine = StateMachine::new(from);
            machine.handle(fault);
            let bits = FaultBits::default().with(fault.fault().unwrap());
            assert_eq!(machine.latched(), bits);
            let cleared_in = |s| matches!(s, State::TorqueOff | State::EStopped);
            for e in Event::ALL.iter().copied().filter(|e| e.fault().is_none()) {
                let before = machine;
                machine.handle(e);
                let cleared = e == Event::ClearConfirmed && cleared_in(before.state());
                assert_eq!(machine.latched().is_empty(), cleared, "{before:?} {e:?}");
                machine = before;
            }
        }
    }
}

#[test]
fn safe_is_held_from_reaching_it_to_leaving() {
    let mut machine = StateMachine::new(State::Playing);
    machine.handle(Event::Disarm);
    assert!(!machine.can_arise(Event::HoldElapsed));
    machine.handle(Event::SafeReached);
    machine.handle(Event::SafeReached);
    assert!(machine.holding && machine.can_arise(Event::HoldElapsed));
    machine.handle(Event::HoldElapsed);
    assert!(!machine.holding && machine.state() == State::Damped);
}

#[test]
fn with_a_fault_latched_it_stays_without_torque() {
    let mut machine = StateMachine::new(State::Damped);
    machine.handle(Event::HostLost);
    machine.handle(Event::DampingElapsed);
    assert!(!machine.can_arise(Event::FaultFree));
    machine.handle(Event::ClearConfirmed);
    assert_eq!((machine.state(), machine.latched().is_empty()), (State::SelfTest, true));
    machine = StateMachine::new(State::TorqueOff);
    assert!(machine.can_arise(Event::FaultFree));
}

#[test]
fn the_set_hands_out_by_severity_whatever_the_order() {
    for &a in Event::ALL {
        for &b in Event::ALL {
            let mut set = EventSet::default();
            set.insert(a);
            set.insert(b);
            let rank = |e: &Event| (core::cmp::Reverse(e.severity()), e.code());
            assert_eq!(set.pop(), [a, b].into_iter().min_by_key(rank));
            assert_eq!(set.pop(), [a, b].into_iter().max_by_key(rank).filter(|_| a != b));
            assert_eq!(set.pop(), None);
        }
    }
}
