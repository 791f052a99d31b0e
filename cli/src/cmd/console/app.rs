//! Loop of the console, in one thread with the bus ([`OperatedBus`]): reads keys and frames, sends frames and draws the screen.

use super::keys::{KeyAction, Keyboard};
use super::scene::{Lookup, Names, Scene};
use super::screen;
use crate::gamepad::reader::Gamepad;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event};
use rollwalk_bus::port::LiveLink;
use rollwalk_host::authentication::Peer;
use rollwalk_host::operator::{ExitStage, Intent, Operator, View, Weight};
use rollwalk_terminal::link::LinkArgs;
use rollwalk_terminal::link::operated_bus::OperatedBus;
use rollwalk_terminal::{Exit, output};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

/// Interval between redraws of the screen, µs.
const DRAW_US: u64 = 50_000;
/// Time without an iteration of the loop after which the console ends. Sleep of the computer is not counted.
const STUCK: Duration = Duration::from_secs(2);
/// Time allowed for printing the reason before the process exits.
const FAREWELL: Duration = Duration::from_millis(100);

/// Running console.
pub struct App<'a> {
    /// Bus, as the user typed it.
    bus: String,
    lookup: Lookup,
    operated: OperatedBus<'a>,
    names: Names,
    /// Configuration and library for which `names` were looked up.
    named: Option<(u32, Option<u32>)>,
    keyboard: Keyboard,
    gamepad: Option<Gamepad>,
    help: bool,
    scroll: usize,
    /// True if a signal has requested the end: `kill`, or a system shutdown. Ctrl-C is read as a key instead.
    asked_to_end: Arc<AtomicBool>,
    /// Number of iterations of the loop.
    rounds: Arc<AtomicU64>,
}

/// Reports that the terminal is gone and returns the exit code. The robot loses its host.
pub fn terminal_gone(why: &str) -> Exit {
    output::print_line(format_args!(
        "the terminal is gone ({why}): without heartbeats an armed robot returns to SAFE \
         automatically"
    ));
    Exit::NotDone
}

/// Ends the process if the loop blocks for `STUCK`. The watching thread ends when no other owner of `rounds` is left.
///
/// Reading keys of a closed terminal never returns, and neither does drawing on a terminal that is suspended. The keyboard mode
/// of a suspended terminal is restored; its screen cannot be.
pub fn watch(rounds: Arc<AtomicU64>) {
    thread::spawn(move || {
        let mut last = None;
        loop {
            thread::sleep(STUCK);
            // The loop has ended.
            if Arc::strong_count(&rounds) == 1 {
                return;
            }
            let now = Some(rounds.load(Ordering::Relaxed));
            if now == last {
                let _ = ratatui::crossterm::terminal::disable_raw_mode();
                // The terminal may have gone, so a message may block.
                thread::spawn(|| terminal_gone("or it is suspended"));
                thread::sleep(FAREWELL);
                std::process::exit(Exit::NotDone.code().into());
            }
            last = now;
        }
    });
}

impl<'a> App<'a> {
    /// Starts a console on an open bus.
    pub fn new(
        link: &'a LinkArgs,
        peer: Peer,
        lookup: Lookup,
        gamepad: Option<Gamepad>,
        bus: LiveLink,
    ) -> Self {
        let mut operator = Operator::new(peer, lookup.config_hash());
        if let Some(gamepad) = &gamepad {
            operator.request(0, Intent::Deadman(gamepad.released()));
        }
        let asked_to_end = Arc::default();
        for signal in [SIGINT, SIGTERM] {
            // `register` fails only for signals that cannot be caught.
            let _ = flag::register(signal, Arc::clone(&asked_to_end));
        }
        let rounds = Arc::default();
        watch(Arc::clone(&rounds));
        Self {
            bus: link.bus.to_string(),
            lookup,
            operated: OperatedBus::new(link, bus, operator),
            names: Names::default(),
            named: None,
            keyboard: Keyboard::default(),
            gamepad,
            help: false,
            scroll: 0,
            asked_to_end,
            rounds,
        }
    }

    /// Runs until the operator leaves, and returns the final view.
    ///
    /// # Errors
    /// Returns an error if the terminal is gone; see [`terminal_gone`].
    pub fn run(&mut self, terminal: &mut DefaultTerminal) -> io::Result<View> {
        let mut draw_us = 0;
        loop {
            self.rounds.fetch_add(1, Ordering::Relaxed);
            let now_us = self.now_us();
            self.read_gamepad(now_us);
            self.read_keys()?;
            self.load_names(now_us);
            self.operated.send();
            if self.operated.operator.leaving() == ExitStage::Now {
                return Ok(self.operated.operator.view(now_us));
            }
            if now_us >= draw_us {
                draw_us = now_us + DRAW_US;
                self.operated.diagnose();
                let view = self.operated.operator.view(now_us);
                let gamepad = self.gamepad.as_ref().map(Gamepad::words);
                let scene = Scene {
                    view: &view,
                    bus: &self.bus,
                    names: &self.names,
                    gamepad: gamepad.as_deref(),
                    help: self.help,
                    scroll: self.scroll,
                };
                terminal.draw(|frame| screen::draw(frame, &scene))?;
            }
            self.operated.receive();
        }
    }

    fn now_us(&self) -> u64 {
        self.operated.now_us()
    }

    fn read_keys(&mut self) -> io::Result<()> {
        if self.asked_to_end.swap(false, Ordering::Relaxed) {
            self.operated.operator.request(self.now_us(), Intent::Quit);
        }
        while event::poll(Duration::ZERO)? {
            // The next draw uses the new size.
            let Event::Key(key) = event::read()? else { continue };
            let now_us = self.now_us();
            let speed = self.operated.operator.speed_64ths();
            match self.keyboard.press(now_us, key, &self.names, speed) {
                None => {}
                Some(KeyAction::Intent(intent)) => self.operated.operator.request(now_us, intent),
                Some(KeyAction::Help) => self.help = !self.help,
                Some(KeyAction::Scroll(by)) => {
                    self.scroll = self.scroll.saturating_add_signed(by).min(64);
                }
            }
        }
        Ok(())
    }

    fn read_gamepad(&mut self, now_us: u64) {
        let Some(gamepad) = &mut self.gamepad else { return };
        for request in gamepad.requests(now_us) {
            request.execute(now_us, &mut self.operated.operator, self.names.catalog.as_ref());
        }
    }

    /// Looks up the names of motions after the controller has answered HELLO.
    fn load_names(&mut self, now_us: u64) {
        let Some(hello) = self.operated.operator.hello() else { return };
        let wanted = Some((hello.config_hash, hello.library));
        if self.named == wanted {
            return;
        }
        let (names, other) = self.lookup.names(hello.config_hash, hello.library);
        self.named = wanted;
        if hello.library.is_none() {
            let text =
                "the controller has no library: quit, and flash one with `rollwalk flash LIB.rwl`";
            self.operated.operator.notify(now_us, Weight::Warning, text);
        } else if other {
            let text = "the library of the controller differs from --library, so the names come from the \
                 cache of this computer: leave out --library, or flash the library";
            self.operated.operator.notify(now_us, Weight::Warning, text);
        }
        self.operated.operator.set_catalog(names.catalog.clone());
        self.operated.operator.set_actuators(names.actuators.clone());
        self.names = names;
    }
}
