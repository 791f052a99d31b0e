//! Loop of a drive: reads keys, sticks, plans and frames; sends requests and frames, and draws the screen.

use super::controls::{Controls, KeyAction, sticks};
use super::screen::{self, Scene};
use super::steps::{self, Step};
use crate::gamepad::reader::Gamepad;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event};
use rollwalk_bus::port::LiveLink;
use rollwalk_gamepads::mapped_gamepad::GamepadRequest;
use rollwalk_host::catalog::Catalog;
use rollwalk_host::describe::{alone, has_to_be_cleared, is_at_rest};
use rollwalk_host::operator::{Deadman, ExitStage, Intent, Operator, Weight};
use rollwalk_pilot::{ActionAfterStop, END_US, Phase, Pilot, SteeredRobot, Tally};
use rollwalk_planner::receding::Steering;
use rollwalk_terminal::link::LinkArgs;
use rollwalk_terminal::link::operated_bus::{OperatedBus, print_new_messages};
use rollwalk_terminal::{Exit, interrupt, output};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Interval between redraws of the screen, µs.
const DRAW_US: u64 = 50_000;
/// Interval between printed lines of a drive without a terminal, µs.
const TELL_US: u64 = 1_000_000;
/// Maximum time until the robot follows the steering of a drive without a terminal, µs.
const START_US: u64 = 20_000_000;
/// Time without contact after which a drive without a terminal ends, µs.
const SILENT_US: u64 = 5_000_000;

/// Result of a drive.
pub struct DriveResult {
    pub words: String,
    /// Exit code for scripts.
    pub exit: Exit,
}

pub struct App<'a> {
    operated: OperatedBus<'a>,
    bus: String,
    steered: SteeredRobot,
    controls: Controls,
    /// Gamepad that steers; `None` without one.
    pub gamepad: Option<Gamepad>,
    /// Library that the controller must have.
    catalog: Catalog,
    /// True after a message about a different library on the controller.
    is_other: bool,
    /// Planning times, ms.
    took_ms: Vec<f64>,
    /// Steering for which no plan met the constraints; `None` after the next accepted plan.
    unplanned: Option<Steering>,
    asked_to_end: Arc<AtomicBool>,
    rounds: Arc<AtomicU64>,
}

impl<'a> App<'a> {
    /// Starts a drive on an open bus.
    pub fn new(
        link: &'a LinkArgs,
        bus: LiveLink,
        operator: Operator,
        steered: SteeredRobot,
        controls: Controls,
        catalog: Catalog,
    ) -> Self {
        Self {
            operated: OperatedBus::new(link, bus, operator),
            bus: link.bus.to_string(),
            steered,
            controls,
            gamepad: None,
            catalog,
            is_other: false,
            took_ms: Vec::new(),
            unplanned: None,
            asked_to_end: Arc::default(),
            rounds: Arc::default(),
        }
    }

    /// Number of iterations of the loop.
    pub fn rounds(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.rounds)
    }

    /// Runs with keys and gamepad until the operator leaves.
    ///
    /// # Errors
    /// Returns an error if the terminal is gone.
    pub fn run(&mut self, terminal: &mut DefaultTerminal) -> io::Result<DriveResult> {
        for signal in [SIGINT, SIGTERM] {
            // `register` fails only for signals that cannot be caught.
            let _ = flag::register(signal, Arc::clone(&self.asked_to_end));
        }
        if let Some(gamepad) = &self.gamepad {
            let released = Intent::Deadman(gamepad.released());
            self.operated.operator.request(0, released);
        }
        let mut draw_us = 0;
        loop {
            self.rounds.fetch_add(1, Ordering::Relaxed);
            let now_us = self.operated.now_us();
            if self.steered.pilot.phase() == Phase::Off || self.is_let_go(now_us) {
                self.controls.rest();
            }
            self.read_keys(now_us)?;
            let sticks = self.read_gamepad(now_us);
            if sticks != [0.0; 3] {
                self.steered.pilot.rise();
            }
            self.steered.pilot.steer(self.controls.request(sticks));
            self.turn(now_us);
            if self.operated.operator.leaving() == ExitStage::Now {
                return Ok(self.ending(true));
            }
            if now_us >= draw_us {
                draw_us = now_us + DRAW_US;
                self.operated.diagnose();
                let view = self.operated.operator.view(now_us);
                let gamepad = self.gamepad.as_ref().map(Gamepad::words);
                let scene = Scene {
                    view: &view,
                    bus: &self.bus,
                    pilot: &self.steered.pilot,
                    actuators: &self.catalog.actuators,
                    gamepad: gamepad.as_deref(),
                    ahead: self.operated.operator.streamed_ahead(),
                    took_ms: self.took_ms.last().copied(),
                };
                terminal.draw(|frame| screen::draw(frame, &scene))?;
            }
            self.operated.receive();
        }
    }

    /// Arms the robot, steers it by a list of steps, stops and disarms it; prints the events.
    pub fn steer(&mut self, steps: &[Step], until_s: f64) -> DriveResult {
        self.steered.pilot = Pilot::new(true);
        let (mut said, mut tell_us, mut heard_us) = (None, 0, 0);
        let (mut begun_us, mut over_us, mut is_whole) = (None, None, false);
        loop {
            let now_us = self.operated.now_us();
            if begun_us.is_none() && self.steered.pilot.phase() == Phase::Steered {
                begun_us = Some(now_us);
            }
            let time_s = begun_us.map(|begun_us| (now_us - begun_us) as f64 * 1e-6);
            let steering = time_s.map_or(Steering::default(), |time_s| steps::at(steps, time_s));
            let has_ended = match begun_us {
                Some(_) => self.steered.pilot.phase() == Phase::Off,
                None => now_us > START_US || self.is_stopped(now_us) || self.has_given_up(now_us),
            };
            if over_us.is_none() {
                is_whole = !has_ended && time_s.is_some_and(|time_s| time_s >= until_s);
                if is_whole || has_ended || interrupt::requested() {
                    over_us = Some(now_us);
                    self.steered.pilot.stop(
                        now_us,
                        ActionAfterStop::Leave,
                        &mut self.operated.operator,
                    );
                } else {
                    self.steered.pilot.steer(self.controls.request_for(steering));
                }
            }
            self.turn(now_us);
            let view = self.operated.operator.view(now_us);
            if view.link.contact {
                heard_us = now_us;
            }
            print_new_messages(&mut said, &view.messages);
            let is_linked = view.link.contact && view.bus_lost.is_none();
            let is_steered = is_linked && over_us.is_none();
            if let Some(time_s) = time_s.filter(|_| now_us >= tell_us && is_steered) {
                tell_us = now_us + TELL_US;
                self.print_progress(now_us, time_s, steering);
            }
            let overtime_us = over_us.map_or(0, |over_us: u64| now_us - over_us);
            if overtime_us > END_US && self.operated.operator.leaving() == ExitStage::No {
                self.operated.operator.request(now_us, Intent::Quit);
            }
            // After twice `END_US`, the drive ends.
            let is_lost = now_us.saturating_sub(heard_us) > SILENT_US || overtime_us > 2 * END_US;
            if self.operated.operator.leaving() == ExitStage::Now || is_lost {
                return self.ending(is_whole && !is_lost);
            }
            self.operated.receive();
        }
    }

    /// True if the robot has stopped and must be cleared before it can be armed.
    fn is_stopped(&self, now_us: u64) -> bool {
        let view = self.operated.operator.view(now_us);
        view.link.contact && view.status.as_ref().is_some_and(has_to_be_cleared)
    }

    /// True if the robot does not follow the steering and is not going to.
    fn has_given_up(&self, now_us: u64) -> bool {
        self.steered.pilot.has_given_up(now_us, &self.operated.operator.view(now_us))
    }

    /// Prints a line of a drive without a terminal. The first time is that of all messages, the second is the time base of
    /// `--steer`.
    fn print_progress(&self, now_us: u64, time_s: f64, steering: Steering) {
        let [forward, left, turn] = self.steered.pilot.tally().velocity;
        let Steering { forward_m_s, left_m_s, turn_rad_s } = steering;
        let line = format!(
            "{:7.1} s: after {time_s:.1} s steered forward {forward_m_s:.2} m/s, left {left_m_s:.2} m/s, \
             turn {turn_rad_s:.2} rad/s; planned forward {forward:.3} m/s, left {left:.3} m/s, turn \
             {turn:.3} rad/s; {} frames ahead",
            now_us as f64 * 1e-6,
            self.operated.operator.streamed_ahead()
        );
        if output::line(&line).is_err() {
            interrupt::request();
        }
    }

    /// Passes finished plans to the operator, requests new plans, and sends frames.
    fn turn(&mut self, now_us: u64) {
        let operator = &mut self.operated.operator;
        let took_ms = &mut self.took_ms;
        self.steered.turn(now_us, operator, |took| took_ms.push(took.as_secs_f64() * 1e3));
        let pilot = &self.steered.pilot;
        if pilot.phase() == Phase::Steered {
            let steering = pilot.steered().steering;
            // The planner's errors have their own messages.
            let is_rejected = pilot.is_unsure() && !pilot.has_failed();
            self.unplanned = is_rejected.then(|| self.unplanned.unwrap_or(steering));
        }
        let library = operator.hello().and_then(|hello| hello.library);
        if library.is_some_and(|id| id != self.catalog.library) && !self.is_other {
            self.is_other = true;
            let text = "the library of the controller differs from the given library, so its SAFE pose may \
                 differ: flash the given library, or give the library of the controller";
            operator.notify(now_us, Weight::Warning, text);
        }
        self.operated.send();
    }

    /// True if the gamepad has a deadman switch that is released.
    fn is_let_go(&self, now_us: u64) -> bool {
        self.operated.operator.view(now_us).deadman_held == Some(false)
    }

    fn read_keys(&mut self, now_us: u64) -> io::Result<()> {
        if self.asked_to_end.swap(false, Ordering::Relaxed) {
            self.stop(ActionAfterStop::Leave);
        }
        while event::poll(Duration::ZERO)? {
            let Event::Key(key) = event::read()? else { continue };
            match self.controls.press(now_us, key) {
                None => {}
                Some(KeyAction::Steered) if self.is_let_go(now_us) => self.controls.rest(),
                Some(KeyAction::Steered) => self.steered.pilot.rise(),
                Some(KeyAction::Stop(after)) => self.stop(after),
                Some(KeyAction::Intent(intent)) => self.request(intent),
            }
        }
        Ok(())
    }

    fn stop(&mut self, after: ActionAfterStop) {
        self.controls.rest();
        let now_us = self.operated.now_us();
        if self.steered.pilot.phase() == Phase::Off && after == ActionAfterStop::Rest {
            // A button of the gamepad had started a motion.
            self.operated.operator.request(now_us, Intent::Return);
        }
        self.steered.pilot.stop(now_us, after, &mut self.operated.operator);
    }

    fn request(&mut self, intent: Intent) {
        let now_us = self.operated.now_us();
        if intent == Intent::Arm {
            self.steered.pilot.rise();
        }
        if matches!(intent, Intent::Estop | Intent::Arm) {
            self.controls.rest();
        }
        self.operated.operator.request(now_us, intent);
    }

    /// Executes the buttons of the gamepad, and returns the deflections of its sticks.
    fn read_gamepad(&mut self, now_us: u64) -> [f64; 3] {
        let Some(gamepad) = &mut self.gamepad else { return [0.0; 3] };
        let requests = gamepad.requests(now_us);
        let sticks = sticks(|push| gamepad.pushed(push));
        let follows = self.steered.pilot.phase() != Phase::Off;
        for request in requests {
            match request {
                // The robot first stops on all its feet.
                GamepadRequest::Intent(Intent::Return | Intent::Pause | Intent::PauseOrResume)
                    if follows =>
                {
                    self.stop(ActionAfterStop::Rest);
                }
                GamepadRequest::Intent(Intent::Disarm) if follows => {
                    self.stop(ActionAfterStop::Disarm)
                }
                GamepadRequest::Intent(Intent::Deadman(deadman)) => {
                    if deadman != Deadman::Held {
                        self.controls.rest();
                    }
                    self.operated.operator.request(now_us, Intent::Deadman(deadman));
                }
                GamepadRequest::Intent(intent) => self.request(intent),
                // A robot that streams set-points cannot play motions.
                GamepadRequest::Play(_) if follows => {}
                request => {
                    request.execute(now_us, &mut self.operated.operator, Some(&self.catalog))
                }
            }
        }
        sticks
    }

    /// Returns the result of the drive; `is_whole` is true if all steering steps were completed.
    fn ending(&mut self, is_whole: bool) -> DriveResult {
        let now_us = self.operated.now_us();
        let view = self.operated.operator.view(now_us);
        let Tally { planned, rejected, least_ahead, .. } = self.steered.pilot.tally();
        self.took_ms.sort_by(f64::total_cmp);
        let at = |part: f64| {
            let index = (part * self.took_ms.len() as f64) as usize;
            self.took_ms.get(index.min(self.took_ms.len().saturating_sub(1))).copied()
        };
        let mut words = match (at(0.5), at(0.99)) {
            (Some(median), Some(most)) => format!(
                "{planned} horizons, {median:.0} ms each (median; 99 %: {most:.0} ms), {rejected} \
                 rejected, at least {} frames ahead; ",
                least_ahead.unwrap_or(0)
            ),
            _ => "nothing was planned; ".to_owned(),
        };
        let (Some(status), Some(condition)) = (view.status, view.condition) else {
            words += "the controller never answered; `rollwalk doctor` finds the cause";
            return DriveResult { words, exit: Exit::NotDone };
        };
        if let Some(steering) = self.unplanned.filter(|_| !is_whole) {
            words += &why_halted(steering).unwrap_or_default();
        }
        if !view.link.contact {
            words += &format!("no contact; the robot was {condition}");
            let alone = alone(status.state);
            words += &alone.map_or_else(String::new, |alone| format!(": {alone}"));
            return DriveResult { words, exit: Exit::NotDone };
        }
        words += &format!("the robot is {condition}");
        if has_to_be_cleared(&status) {
            words += "; type `rollwalk clear` before arming it";
        }
        let exit = match is_at_rest(&status) {
            true if interrupt::requested() => Exit::Interrupted,
            true if is_whole => Exit::Ok,
            _ => Exit::NotDone,
        };
        DriveResult { words, exit }
    }
}

/// Reason of a halt for which no plan met the constraints; `None` if the robot was steered to stand, so that it cannot be
/// steered slower.
fn why_halted(steering: Steering) -> Option<String> {
    let Steering { forward_m_s, left_m_s, turn_rad_s } = steering;
    (steering != Steering::default()).then(|| {
        format!(
            "no plan met the constraints at forward {forward_m_s:.2} m/s, left {left_m_s:.2} m/s, turn \
             {turn_rad_s:.2} rad/s, so the robot halted: steer slower; "
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_robot_that_was_to_move_is_to_be_steered_slower() {
        assert_eq!(why_halted(Steering::default()), None);
        let fast = Steering { forward_m_s: 1.0, ..Steering::default() };
        let words = why_halted(fast).unwrap();
        assert!(words.contains("forward 1.00 m/s") && words.contains("steer slower"), "{words}");
    }
}
