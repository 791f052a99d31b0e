//! Shortest ways through the state machine.

use rollwalk_firmware::safety::{EVENTS, Event, StateMachine};
use std::collections::{HashSet, VecDeque};

/// The fewest events that lead from a machine to one that `is_goal`: without any fault if that can be.
pub fn shortest(from: StateMachine, is_goal: impl Fn(&StateMachine) -> bool) -> Option<Vec<Event>> {
    let orderly = |event: Event| event.fault().is_none();
    search(from, &is_goal, orderly).or_else(|| search(from, &is_goal, |_| true))
}

fn search(
    from: StateMachine,
    is_goal: impl Fn(&StateMachine) -> bool,
    may: impl Fn(Event) -> bool,
) -> Option<Vec<Event>> {
    let mut seen = HashSet::new();
    let mut queue = VecDeque::from([(from, Vec::new())]);
    while let Some((machine, way)) = queue.pop_front() {
        if is_goal(&machine) {
            return Some(way);
        }
        if !seen.insert((machine.state(), machine.latched().0, machine.is_holding())) {
            continue;
        }
        // Of as many events the mildest: they are listed the most severe first.
        let events = EVENTS.into_iter().rev();
        for event in events.filter(|&event| may(event) && machine.can_arise(event)) {
            let mut next = machine;
            next.handle(event);
            if next != machine {
                queue.push_back((next, [&way[..], &[event]].concat()));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_firmware::safety::{STATES, State};

    #[test]
    fn torque_comes_on_by_arming_and_goes_off_on_request() {
        let from = StateMachine::new;
        let to = |state| move |machine: &StateMachine| machine.state() == state;
        assert_eq!(
            shortest(from(State::EStopped), to(State::Playing)).unwrap(),
            [
                Event::ClearConfirmed,
                Event::SelfTestPassed,
                Event::ArmConfirmed,
                Event::Aligned,
                Event::MotionStarted
            ]
        );
        assert_eq!(shortest(from(State::Ready), to(State::EStopped)).unwrap(), [Event::BusOff]);
        // SAFE has to be reached before it has been held, and an emergency stop is no shortcut.
        assert_eq!(
            shortest(from(State::Returning), to(State::Disarmed)).unwrap(),
            [Event::SafeReached, Event::HoldElapsed, Event::DampingElapsed, Event::FaultFree]
        );
        for state in STATES {
            let boot = shortest(from(state), to(State::Boot));
            assert_eq!(boot, (state == State::Boot).then(Vec::new));
        }
    }
}
