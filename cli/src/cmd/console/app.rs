//! The console's loop: keys and frames in, frames and a screen out, in one thread.
//!
//! One thread on purpose: a console that cannot read keys or draw for a quarter of a second sends no heartbeat
//! either, and the robot returns to SAFE by itself.

use super::keys::{Keyboard, Meaning};
use super::scene::{Lookup, Names, Scene};
use super::screen;
use crate::gamepad::{self, device};
use crate::link::LinkArgs;
use crate::{Exit, output};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::port::Live;
use rollwalk_gamepads::pad::{self, Pad, Wish};
use rollwalk_host::authentication::Peer;
use rollwalk_host::operator::{Intent, Leaving, Operator, View, Weight};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::thread;
use std::time::{Duration, Instant};

/// Maximum interval between checks for keys, µs.
const KEYS_US: u64 = 10_000;
/// Interval between redraws of the screen, µs.
const DRAW_US: u64 = 50_000;
/// Interval between attempts to open a lost bus, µs.
const REOPEN_US: u64 = 1_000_000;
/// Duration of a blocked loop, not counting sleep of the computer, after which the console ends.
const STUCK: Duration = Duration::from_secs(2);
/// Time to print the reason.
const FAREWELL: Duration = Duration::from_millis(100);
/// Delay before a full transmit queue is tried again, µs.
const BUSY_US: u64 = 500;

/// A gamepad and its events.
pub struct Gamepad {
    pad: Pad,
    events: Receiver<pad::Event>,
}

impl Gamepad {
    /// Finds a gamepad and its mapping, and listens.
    ///
    /// # Errors
    /// There is none, it may not be read, or nothing says what its buttons do.
    pub fn open(device: &str, mapping: Option<&Path>) -> miette::Result<Self> {
        let found = device::find(device)?;
        let pad = Pad::new(gamepad::mapping(mapping, &found)?);
        Ok(Self { pad, events: device::listen(found) })
    }

    /// Operator requests from the events since the last call.
    fn wishes(&mut self, now_us: u64) -> Vec<Wish> {
        let mut wishes = Vec::new();
        loop {
            match self.events.try_recv() {
                Ok(event) => wishes.extend(self.pad.on_event(now_us, event)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    let gone = pad::Event::Gone("its reader has ended".into());
                    wishes.extend(self.pad.on_event(now_us, gone));
                    break;
                }
            }
        }
        wishes.extend(self.pad.tick(now_us));
        wishes
    }
}

/// A console at work.
pub struct App<'a> {
    link: &'a LinkArgs,
    lookup: Lookup,
    bus: Option<Live>,
    operator: Operator,
    names: Names,
    /// Configuration and library that the names are of.
    named: Option<(u32, Option<u32>)>,
    keyboard: Keyboard,
    gamepad: Option<Gamepad>,
    help: bool,
    scroll: usize,
    started: Instant,
    reopen_us: u64,
    /// A signal has asked the program to end: `kill`, or a system that shuts down. Ctrl-C is a key here.
    asked_to_end: Arc<AtomicBool>,
    /// Number of iterations of the loop.
    rounds: Arc<AtomicU64>,
}

/// Ends a console whose terminal is gone: it no longer is the robot's host.
pub fn terminal_gone(why: &str) -> Exit {
    output::say(format_args!(
        "the terminal is gone, {why}: without heartbeat an armed robot returns to SAFE by itself"
    ));
    Exit::NotDone
}

/// Ends a console whose loop stands still: reading keys of a terminal that is gone never returns, nor does drawing
/// on one that stands still itself. That one has its keys as before, if it ever goes on; it takes no other screen.
fn watch(rounds: Arc<AtomicU64>) {
    thread::spawn(move || {
        let mut last = None;
        loop {
            thread::sleep(STUCK);
            let now = Some(rounds.load(Ordering::Relaxed));
            if now == last {
                let _ = ratatui::crossterm::terminal::disable_raw_mode();
                // Messages may go where the screen does.
                thread::spawn(|| terminal_gone("or stands still"));
                thread::sleep(FAREWELL);
                std::process::exit(Exit::NotDone.code().into());
            }
            last = now;
        }
    });
}

fn us_since(start: Instant) -> u64 {
    u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX)
}

impl<'a> App<'a> {
    /// A console on an open bus.
    pub fn new(
        link: &'a LinkArgs,
        peer: Peer,
        lookup: Lookup,
        gamepad: Option<Gamepad>,
        bus: Live,
    ) -> Self {
        let mut operator = Operator::new(peer, lookup.config_hash());
        if let Some(gamepad) = &gamepad {
            operator.want(0, Intent::Deadman(gamepad.pad.released()));
        }
        let asked_to_end = Arc::default();
        for signal in [SIGINT, SIGTERM] {
            // Fails only for signals that cannot be caught.
            let _ = flag::register(signal, Arc::clone(&asked_to_end));
        }
        let rounds = Arc::default();
        watch(Arc::clone(&rounds));
        Self {
            link,
            lookup,
            bus: Some(bus),
            operator,
            names: Names::default(),
            named: None,
            keyboard: Keyboard::default(),
            gamepad,
            help: false,
            scroll: 0,
            started: Instant::now(),
            reopen_us: 0,
            asked_to_end,
            rounds,
        }
    }

    /// Runs until the operator leaves; how everything was then.
    ///
    /// # Errors
    /// The terminal is gone: see [`terminal_gone`].
    pub fn run(&mut self, terminal: &mut DefaultTerminal) -> io::Result<View> {
        let mut draw_us = 0;
        loop {
            self.rounds.fetch_add(1, Ordering::Relaxed);
            let now_us = self.now_us();
            self.read_gamepad(now_us);
            self.read_keys()?;
            self.look_names(now_us);
            self.send(now_us);
            if self.operator.leaving() == Leaving::Now {
                return Ok(self.operator.view(now_us));
            }
            if now_us >= draw_us {
                draw_us = now_us + DRAW_US;
                if let Some(bus) = &self.bus {
                    self.operator.on_complaint(now_us, bus.complaint());
                }
                let view = self.operator.view(now_us);
                let bus = self.link.bus.to_string();
                let gamepad = self.gamepad.as_ref().map(|gamepad| gamepad.pad.words());
                let scene = Scene {
                    view: &view,
                    bus: &bus,
                    names: &self.names,
                    gamepad: gamepad.as_deref(),
                    help: self.help,
                    scroll: self.scroll,
                };
                terminal.draw(|frame| screen::draw(frame, &scene))?;
            }
            self.hear();
        }
    }

    fn now_us(&self) -> u64 {
        us_since(self.started)
    }

    fn read_keys(&mut self) -> io::Result<()> {
        if self.asked_to_end.swap(false, Ordering::Relaxed) {
            self.operator.want(self.now_us(), Intent::Quit);
        }
        while event::poll(Duration::ZERO)? {
            // A new size shows when the screen is drawn next.
            let Event::Key(key) = event::read()? else { continue };
            let now_us = self.now_us();
            let speed = self.operator.speed_64ths();
            match self.keyboard.press(now_us, key, &self.names, speed) {
                None => {}
                Some(Meaning::Want(intent)) => self.operator.want(now_us, intent),
                Some(Meaning::Help) => self.help = !self.help,
                Some(Meaning::Scroll(by)) => {
                    self.scroll = self.scroll.saturating_add_signed(by).min(64);
                }
            }
        }
        Ok(())
    }

    fn read_gamepad(&mut self, now_us: u64) {
        let Some(gamepad) = &mut self.gamepad else { return };
        for wish in gamepad.wishes(now_us) {
            wish.give(now_us, &mut self.operator, self.names.catalog.as_ref());
        }
    }

    /// Looks up the names of motions once the controller has answered HELLO.
    fn look_names(&mut self, now_us: u64) {
        let Some(hello) = self.operator.hello() else { return };
        let wanted = Some((hello.config_hash, hello.library));
        if self.named == wanted {
            return;
        }
        let (names, other) = self.lookup.names(hello.config_hash, hello.library);
        self.named = wanted;
        if hello.library.is_none() {
            let text =
                "the controller has no library: quit, and `rollwalk flash LIB.rwl` gives it one";
            self.operator.say(now_us, Weight::Warning, text);
        } else if other {
            let text = "the controller has another library than the one named with --library";
            self.operator.say(now_us, Weight::Warning, text);
        }
        self.operator.set_catalog(names.catalog.clone());
        self.names = names;
    }

    fn send(&mut self, now_us: u64) {
        let Some(bus) = &mut self.bus else {
            if now_us >= self.reopen_us {
                self.reopen_us = now_us + REOPEN_US;
                if let Ok(live) = self.link.live() {
                    self.bus = Some(live);
                    self.operator.on_bus_back(now_us);
                }
            }
            return;
        };
        while let Some(frame) = self.operator.poll(now_us) {
            match bus.send(&frame) {
                Ok(()) => {}
                Err(LinkError::Busy) => {
                    self.operator.not_sent(frame);
                    let at_us = bus.now_us() + BUSY_US;
                    return self.hear_until(at_us);
                }
                Err(error) => return self.lose(&error),
            }
        }
    }

    /// Listens until there is something to do.
    fn hear(&mut self) {
        let now_us = self.now_us();
        let wait_us =
            self.operator.next_poll_us(now_us).saturating_sub(now_us).clamp(BUSY_US, KEYS_US);
        match &self.bus {
            Some(bus) => {
                let until_us = bus.now_us() + wait_us;
                self.hear_until(until_us);
            }
            None => thread::sleep(Duration::from_micros(KEYS_US)),
        }
    }

    fn hear_until(&mut self, until_us: u64) {
        let Some(bus) = &mut self.bus else { return };
        let mut until_us = until_us;
        loop {
            match bus.receive(until_us) {
                Ok(Some(frame)) => {
                    self.operator.on_frame(us_since(self.started), &frame);
                    // What else is there already; an answer may be due at once.
                    if bus.now_us() >= until_us {
                        return;
                    }
                    until_us = bus.now_us();
                }
                Ok(None) => return,
                Err(error) => return self.lose(&error),
            }
        }
    }

    fn lose(&mut self, error: &LinkError) {
        let why = match error {
            LinkError::Down(why) => why.clone(),
            LinkError::Busy => error.to_string(),
        };
        let now_us = self.now_us();
        self.bus = None;
        self.reopen_us = now_us + REOPEN_US;
        self.operator.on_bus_lost(now_us, &why);
    }
}
