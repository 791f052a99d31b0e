//! Keys of the console, and the operator requests that they send.

use super::scene::Names;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use rollwalk_host::operator::Intent;

/// Time after a press within which the same key counts as held and is ignored, µs.
///
/// Most terminals report a held key as repeated presses. Keys for stop, disarm, return, speed, help and scrolling are exempt and
/// always act.
const HELD_US: u64 = 700_000;
/// Step of the playback speed, 64ths.
const SPEED_STEP: i8 = 8;

/// Meaning of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyAction {
    /// Request for the robot.
    Intent(Intent),
    /// Opens or closes the help.
    Help,
    Scroll(isize),
}

#[derive(Clone, Debug, Default)]
pub struct Keyboard {
    last: Option<(KeyCode, KeyModifiers, u64)>,
}

impl Keyboard {
    /// Returns the meaning of a key that is pressed now; `speed_64ths` is the current playback speed.
    pub fn press(
        &mut self,
        now_us: u64,
        key: KeyEvent,
        names: &Names,
        speed_64ths: i8,
    ) -> Option<KeyAction> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        let is_repeated = key.kind == KeyEventKind::Repeat;
        let is_held = is_repeated
            || self.last.is_some_and(|(code, modifiers, at_us)| {
                (code, modifiers) == (key.code, key.modifiers)
                    && now_us.saturating_sub(at_us) < HELD_US
            });
        self.last = Some((key.code, key.modifiers, now_us));
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        let speed = |by: i8| {
            // Whole steps from the slowest speed.
            let sixty_fourths = (speed_64ths + by).clamp(SPEED_STEP, 64);
            KeyAction::Intent(Intent::Speed { sixty_fourths })
        };
        // Repetitions of these keys do no harm.
        match key.code {
            KeyCode::Esc | KeyCode::Char(' ') => return Some(KeyAction::Intent(Intent::Estop)),
            KeyCode::Char('+' | '=') => return Some(speed(SPEED_STEP)),
            KeyCode::Char('-') => return Some(speed(-SPEED_STEP)),
            KeyCode::Char('?') | KeyCode::F(1) => return Some(KeyAction::Help),
            KeyCode::Up => return Some(KeyAction::Scroll(-1)),
            KeyCode::Down => return Some(KeyAction::Scroll(1)),
            KeyCode::PageUp => return Some(KeyAction::Scroll(-10)),
            KeyCode::PageDown => return Some(KeyAction::Scroll(10)),
            _ => {}
        }
        let is_command = control || key.modifiers.contains(KeyModifiers::ALT);
        let intent = match key.code {
            KeyCode::Char('c') if control && !is_held => Intent::Quit,
            KeyCode::Char(_) if is_command => return None,
            KeyCode::Char('d') => Intent::Disarm,
            KeyCode::Char('r') => Intent::Return,
            // A second press in quick succession halts the robot. The robot continues only after a separate press.
            KeyCode::Char('p') if is_held && !is_repeated => Intent::Pause,
            _ if is_held => return None,
            KeyCode::Char('a') => Intent::Arm,
            KeyCode::Char('c') => Intent::Clear,
            KeyCode::Char('p') => Intent::PauseOrResume,
            KeyCode::Char('q') => Intent::Quit,
            KeyCode::Char(key) => Intent::Play { code: names.code_of(key)? },
            _ => return None,
        };
        Some(KeyAction::Intent(intent))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(keyboard: &mut Keyboard, now_us: u64, key: char) -> Option<KeyAction> {
        let key = KeyEvent::new(KeyCode::Char(key), KeyModifiers::NONE);
        keyboard.press(now_us, key, &Names::default(), 64)
    }

    #[test]
    fn a_key_that_is_held_counts_once_but_the_stop_always() {
        let mut keyboard = Keyboard::default();
        let quit = Some(KeyAction::Intent(Intent::Quit));
        assert_eq!(press(&mut keyboard, 0, 'q'), quit);
        // The keyboard repeats it after half a second, and then 30 times a second.
        for repeated in 0..50 {
            assert_eq!(press(&mut keyboard, 500_000 + 33_000 * repeated, 'q'), None);
        }
        assert_eq!(press(&mut keyboard, 10_000_000, 'q'), quit);
        for at_us in [0, 500_000, 533_000] {
            let stop = Some(KeyAction::Intent(Intent::Estop));
            assert_eq!(press(&mut keyboard, at_us, ' '), stop);
        }
    }

    #[test]
    fn keys_that_calm_the_robot_count_however_fast_they_come() {
        let want = |intent| Some(KeyAction::Intent(intent));
        let mut keyboard = Keyboard::default();
        // Three presses within a second, as in panic.
        for (at_us, intent) in
            [(0, Intent::PauseOrResume), (333_000, Intent::Pause), (666_000, Intent::Pause)]
        {
            assert_eq!(press(&mut keyboard, at_us, 'p'), want(intent));
        }
        assert_eq!(press(&mut keyboard, 2_000_000, 'p'), want(Intent::PauseOrResume));
        for (key, intent) in [('r', Intent::Return), ('d', Intent::Disarm)] {
            for at_us in [3_000_000, 3_033_000, 3_066_000] {
                assert_eq!(press(&mut keyboard, at_us, key), want(intent));
            }
        }
        // Some terminals mark repetitions; these are not presses.
        let mut repeated = KeyEvent::new(KeyCode::Char('p'), KeyModifiers::NONE);
        repeated.kind = KeyEventKind::Repeat;
        assert_eq!(keyboard.press(5_000_000, repeated, &Names::default(), 64), None);
    }

    #[test]
    fn the_same_letter_with_another_modifier_is_another_key() {
        let mut keyboard = Keyboard::default();
        assert_eq!(press(&mut keyboard, 0, 'c'), Some(KeyAction::Intent(Intent::Clear)));
        let quit = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        let meaning = keyboard.press(300_000, quit, &Names::default(), 64);
        assert_eq!(meaning, Some(KeyAction::Intent(Intent::Quit)));
        assert_eq!(keyboard.press(333_000, quit, &Names::default(), 64), None);
    }

    #[test]
    fn without_names_digits_are_command_codes() {
        let mut keyboard = Keyboard::default();
        let play = |code| Some(KeyAction::Intent(Intent::Play { code }));
        assert_eq!(press(&mut keyboard, 0, '3'), play(3));
        assert_eq!(press(&mut keyboard, 0, '0'), None);
        assert_eq!(press(&mut keyboard, 0, 'x'), None);
    }

    #[test]
    fn speed_goes_in_steps_between_an_eighth_and_all() {
        let mut keyboard = Keyboard::default();
        let mut speed = 64;
        for expected in [56, 48, 40, 32, 24, 16, 8, 8] {
            let key = KeyEvent::new(KeyCode::Char('-'), KeyModifiers::NONE);
            let meaning = keyboard.press(0, key, &Names::default(), speed);
            speed = expected;
            assert_eq!(meaning, Some(KeyAction::Intent(Intent::Speed { sixty_fourths: expected })));
        }
    }
}
