//! Steering inputs of the operator: keys of a terminal and sticks of a gamepad.

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use rollwalk_gamepads::inputs::{AxisDirection, push};
use rollwalk_host::operator::Intent;
use rollwalk_pilot::{ActionAfterStop, Fastest, SteeringRequest};
use rollwalk_planner::receding::Steering;

/// Number of key presses from rest to the maximum speed.
const STEPS: f64 = 5.0;
/// Time within which repeated presses of a stop key count as one, µs. Terminals report a held key as repeated presses.
const HELD_US: u64 = 700_000;
/// Dead zone of a stick, as a fraction of its full deflection.
const DEAD_ZONE: f64 = 0.1;
/// Gamepad axes for steering forward, left and turning left.
const AXES: [&str; 3] = ["ABS_Y-", "ABS_X-", "ABS_RX-"];

/// Meaning of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyAction {
    /// The steering changed.
    Steered,
    /// Stop the robot, return it to SAFE, then take the given action.
    Stop(ActionAfterStop),
    /// Request for the robot.
    Intent(Intent),
}

#[derive(Clone, Copy, Debug)]
pub struct Controls {
    fastest: Fastest,
    /// Steering forward, left and turning left, in steps.
    steps: [f64; 3],
    /// True if the robot has a gait to walk in.
    has_gait: bool,
    /// True if the operator has selected driving on wheels for a robot that also has a gait.
    rolls: bool,
    /// Previous key, and its time, µs.
    last: Option<(KeyCode, u64)>,
}

impl Controls {
    pub fn new(fastest: Fastest, has_gait: bool) -> Self {
        Self { fastest, steps: [0.0; 3], has_gait, rolls: false, last: None }
    }

    pub fn rest(&mut self) {
        self.steps = [0.0; 3];
    }

    /// Steering from keys and sticks. The deflections of the sticks, −1 to 1, are added to the keys.
    pub fn request(&self, sticks: [f64; 3]) -> SteeringRequest {
        let part = |c: usize| (self.steps[c] / STEPS + sticks[c]).clamp(-1.0, 1.0);
        let Fastest { speed_m_s, turn_rad_s } = self.fastest;
        let steering = Steering {
            forward_m_s: part(0) * speed_m_s,
            left_m_s: part(1) * speed_m_s,
            turn_rad_s: part(2) * turn_rad_s,
        };
        self.request_for(steering)
    }

    /// Request for a given steering. A robot with a gait walks unless it stands.
    pub fn request_for(&self, steering: Steering) -> SteeringRequest {
        SteeringRequest::of(steering, self.has_gait && !self.rolls)
    }

    /// Returns the meaning of a key that is pressed now. A held key repeats only steering and the emergency stop.
    pub fn press(&mut self, now_us: u64, key: KeyEvent) -> Option<KeyAction> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        let last = self.last.replace((key.code, now_us));
        let is_held = key.kind == KeyEventKind::Repeat
            || last.is_some_and(|(code, at_us)| {
                code == key.code && now_us.saturating_sub(at_us) < HELD_US
            });
        let meaning = self.action(key)?;
        let counts = match meaning {
            KeyAction::Steered => key.code != KeyCode::Char('g'),
            meaning => meaning == KeyAction::Intent(Intent::Estop),
        };
        (counts || !is_held).then_some(meaning)
    }

    fn action(&mut self, key: KeyEvent) -> Option<KeyAction> {
        let is_command = key.modifiers.intersects(KeyModifiers::CONTROL | KeyModifiers::ALT);
        Some(match key.code {
            KeyCode::Esc | KeyCode::Char(' ') => KeyAction::Intent(Intent::Estop),
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => {
                KeyAction::Stop(ActionAfterStop::Leave)
            }
            _ if is_command => return None,
            KeyCode::Up => self.step(0, 1.0),
            KeyCode::Down => self.step(0, -1.0),
            KeyCode::Left => self.step(2, 1.0),
            KeyCode::Right => self.step(2, -1.0),
            KeyCode::Char(',') => self.step(1, 1.0),
            KeyCode::Char('.') => self.step(1, -1.0),
            KeyCode::Char('x') => {
                self.rest();
                KeyAction::Steered
            }
            KeyCode::Char('g') if self.has_gait => {
                self.rolls = !self.rolls;
                KeyAction::Steered
            }
            KeyCode::Char('r') => KeyAction::Stop(ActionAfterStop::Rest),
            KeyCode::Char('d') => KeyAction::Stop(ActionAfterStop::Disarm),
            KeyCode::Char('q') => KeyAction::Stop(ActionAfterStop::Leave),
            KeyCode::Char('a') => KeyAction::Intent(Intent::Arm),
            KeyCode::Char('c') => KeyAction::Intent(Intent::Clear),
            _ => return None,
        })
    }

    fn step(&mut self, c: usize, by: f64) -> KeyAction {
        self.steps[c] = (self.steps[c] + by).clamp(-STEPS, STEPS);
        KeyAction::Steered
    }
}

/// Returns the deflections of a gamepad's sticks, −1 to 1: forward, left and turning left. `pushed` returns the deflection of
/// an axis in one direction, 0 to 1.
pub fn sticks(pushed: impl Fn(AxisDirection) -> f32) -> [f64; 3] {
    AXES.map(|name| {
        let to = push(name).expect("an axis of that name");
        let other = AxisDirection { positive: !to.positive, ..to };
        let value = f64::from(pushed(to)) - f64::from(pushed(other));
        value.signum() * ((value.abs() - DEAD_ZONE) / (1.0 - DEAD_ZONE)).max(0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FASTEST: Fastest = Fastest { speed_m_s: 0.2, turn_rad_s: 0.5 };

    fn press(controls: &mut Controls, code: KeyCode) -> Option<KeyAction> {
        controls.press(10_000_000, KeyEvent::new(code, KeyModifiers::NONE))
    }

    #[test]
    fn keys_steer_in_steps_up_to_the_fastest() {
        let mut controls = Controls::new(FASTEST, true);
        (0..8).for_each(|_| assert!(press(&mut controls, KeyCode::Up).is_some()));
        press(&mut controls, KeyCode::Right);
        let SteeringRequest { steering, walks } = controls.request([0.0; 3]);
        assert_eq!((steering.forward_m_s, steering.turn_rad_s), (0.2, -0.1));
        assert!(walks);
        press(&mut controls, KeyCode::Char('g'));
        assert!(!controls.request([0.0; 3]).walks);
        press(&mut controls, KeyCode::Char('x'));
        assert_eq!(controls.request([0.0; 3]), SteeringRequest::default());
        assert_eq!(
            press(&mut controls, KeyCode::Char('q')),
            Some(KeyAction::Stop(ActionAfterStop::Leave))
        );
        // A key that is held counts as one press.
        assert_eq!(press(&mut controls, KeyCode::Char('q')), None);
        let stop = Some(KeyAction::Intent(Intent::Estop));
        assert_eq!(press(&mut controls, KeyCode::Char(' ')), stop);
        assert_eq!(press(&mut controls, KeyCode::Char(' ')), stop);
    }

    #[test]
    fn sticks_have_a_dead_zone_and_signs_that_fit() {
        // The stick is pushed forward and to the right. Forward is negative.
        let at = |axis: u16, value: f32| {
            move |to: AxisDirection| if to.axis == axis { to.how_far(value) } else { 0.0 }
        };
        let [forward, left, turn] = sticks(at(1, -1.0));
        assert_eq!((forward, left, turn), (1.0, 0.0, 0.0));
        assert_eq!(sticks(at(0, 1.0)), [0.0, -1.0, 0.0]);
        assert_eq!(sticks(at(3, 0.09)), [0.0; 3]);
        let wanted = Controls::new(FASTEST, false).request([1.0, 0.0, -0.5]);
        assert_eq!(wanted.steering.turn_rad_s, -0.25);
        assert!(!wanted.walks);
    }
}
