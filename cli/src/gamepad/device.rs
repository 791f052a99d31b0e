//! Gamepads of this computer over Linux evdev: discovery, and a reader thread that reconnects after a disconnection.

use super::capabilities::{self, BUTTONS};
use evdev::{AbsoluteAxisCode, Device, EventSummary, KeyCode};
use miette::miette;
use rollwalk_bus::serial::join;
use rollwalk_gamepads::mapped_gamepad::{Event, normal};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::Duration;

/// Interval between attempts to find a disconnected gamepad.
const RETRY: Duration = Duration::from_secs(1);
/// User group with read access to gamepads.
pub const GROUP: &str = "input";
const FOLDER: &str = "/dev/input";

#[derive(Clone, Debug)]
pub struct GamepadDevice {
    /// Name of the device.
    pub name: String,
    pub path: PathBuf,
}

/// Finds the gamepad: the only one for `auto`, or that of a device path.
///
/// # Errors
/// Returns an error with the command to type if there is no gamepad, if there are several, or if it cannot be read.
pub fn find(wanted: &str) -> miette::Result<GamepadDevice> {
    if wanted != "auto" {
        let path = Path::new(wanted);
        return match Device::open(path) {
            Ok(device) if is_gamepad(&device) => Ok(gamepad_device(path, &device)),
            Ok(device) => Err(miette!(
                help = listed(&gamepads().0),
                "{} is not a gamepad: {}",
                path.display(),
                name(&device)
            )),
            Err(error) if is_denied(&error) && capabilities::has_buttons(path) == Some(false) => {
                Err(miette!(help = listed(&gamepads().0), "{} is not a gamepad", path.display()))
            }
            Err(error) if is_denied(&error) => Err(denied(path)),
            Err(error) => Err(miette!(help = listed(&gamepads().0), "{}: {error}", path.display())),
        };
    }
    let (mut all, unreadable) = gamepads();
    match (all.len(), unreadable) {
        (1, _) => Ok(all.remove(0)),
        (0, Some(path)) => Err(denied(&path)),
        (0, None) => Err(miette!(
            help = "plug in or pair a gamepad; `ls /dev/input/by-id` lists the detected devices",
            "there is no gamepad"
        )),
        _ => Err(miette!(help = listed(&all), "there are several gamepads: give one of them")),
    }
}

fn is_denied(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::PermissionDenied
}

fn denied(path: &Path) -> miette::Report {
    miette!(help = join(GROUP), "this user may not read {}", path.display())
}

fn listed(all: &[GamepadDevice]) -> String {
    if all.is_empty() {
        return "plug in a gamepad: none was found".into();
    }
    let line =
        |found: &GamepadDevice| format!("--gamepad {}   {}", found.path.display(), found.name);
    all.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Readable gamepads, and the path of an unreadable one. Keyboards are never readable, on purpose, and are left out.
pub fn gamepads() -> (Vec<GamepadDevice>, Option<PathBuf>) {
    let (mut all, mut unreadable) = (Vec::new(), None);
    let entries = fs::read_dir(FOLDER).into_iter().flatten().flatten();
    let mut paths: Vec<_> = entries
        .map(|entry| entry.path())
        .filter(|path| {
            path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("event"))
        })
        .collect();
    paths.sort();
    for path in paths {
        match Device::open(&path) {
            Ok(device) if is_gamepad(&device) => all.push(gamepad_device(&path, &device)),
            Err(error) if is_denied(&error) && capabilities::has_buttons(&path) == Some(true) => {
                unreadable = Some(path);
            }
            _ => {}
        }
    }
    (all, unreadable)
}

fn is_gamepad(device: &Device) -> bool {
    let keys = device.supported_keys();
    keys.is_some_and(|keys| BUTTONS.into_iter().any(|key| keys.contains(key)))
}

fn name(device: &Device) -> String {
    device.name().unwrap_or("a device without name").to_owned()
}

fn gamepad_device(path: &Path, device: &Device) -> GamepadDevice {
    GamepadDevice { name: name(device), path: path.to_owned() }
}

/// Starts a thread that reads the gamepad's events. After a disconnection it is found again by its path or name.
pub fn start_reader(found: GamepadDevice) -> Receiver<Event> {
    let (sender, events) = channel();
    thread::spawn(move || {
        let mut path = found.path.clone();
        loop {
            let why = match Device::open(&path) {
                Ok(device) if name(&device) == found.name => match forward(device, &sender) {
                    Ok(()) => return,
                    Err(error) => error.to_string(),
                },
                Ok(_) => "another device has the same path".into(),
                Err(error) => error.to_string(),
            };
            if sender.send(Event::Gone(why)).is_err() {
                return;
            }
            thread::sleep(RETRY);
            // The device may have another number after it is plugged in again.
            if let Some(again) = gamepads().0.into_iter().find(|again| again.name == found.name) {
                path = again.path;
            }
        }
    });
    events
}

/// Forwards the events of a device until it disconnects or the receiver is dropped.
fn forward(mut device: Device, to: &Sender<Event>) -> io::Result<()> {
    let mut ranges = BTreeMap::new();
    let mut axes = Vec::new();
    for (AbsoluteAxisCode(axis), info) in device.get_absinfo()? {
        ranges.insert(axis, (info.minimum(), info.maximum()));
        axes.push((axis, normal(axis, info.value(), info.minimum(), info.maximum())));
    }
    let buttons = device.get_key_state()?.iter().map(|key| key.0).collect();
    if to.send(Event::Found { name: name(&device), buttons, axes }).is_err() {
        return Ok(());
    }
    loop {
        // If the kernel dropped events, the present state replaces them.
        for event in device.fetch_events()? {
            let event = match event.destructure() {
                // Value 2 marks a repetition of a key.
                EventSummary::Key(_, KeyCode(number), value @ (0 | 1)) => {
                    Event::Button { number, down: value == 1 }
                }
                EventSummary::AbsoluteAxis(_, AbsoluteAxisCode(axis), raw) => {
                    let Some(&(min, max)) = ranges.get(&axis) else { continue };
                    Event::Axis { axis, value: normal(axis, raw, min, max) }
                }
                _ => continue,
            };
            if to.send(event).is_err() {
                return Ok(());
            }
        }
    }
}
