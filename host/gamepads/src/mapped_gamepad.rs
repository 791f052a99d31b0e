//! State machine that turns gamepad events and time into operator requests.

use crate::file::{ButtonAction, Mapping, MotionChoice, North, Speed};
use crate::inputs::{AxisDirection, Input};
use rollwalk_host::catalog::Catalog;
use rollwalk_host::operator::{Deadman, Intent, Operator, Weight};
use std::collections::{BTreeMap, BTreeSet};

/// Position above which an axis counts as pressed.
const PRESSED: f32 = 0.6;
/// Position below which an axis counts as released. It is below 0.5, the rest position of a trigger that is mapped as a stick.
const LET_GO: f32 = 0.45;
/// Largest change of the playback speed that is treated as noise of the stick, 64ths.
const SPEED_NOISE: i8 = 2;

/// Event of a gamepad.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Connection of the gamepad. Inputs pressed at that time, except an emergency stop, must be released first.
    Found {
        /// Name of the device.
        name: String,
        /// Numbers of the pressed buttons.
        buttons: Vec<u16>,
        /// Positions of axes, as in [`Event::Axis`].
        axes: Vec<(u16, f32)>,
    },
    /// Press or release of a button.
    Button {
        /// Button number.
        number: u16,
        /// True if the button is pressed.
        down: bool,
    },
    /// Movement of an axis.
    Axis {
        /// Axis number.
        axis: u16,
        /// Position, −1 to 1; triggers 0 to 1.
        value: f32,
    },
    /// Disconnection of the gamepad, with its reason.
    Gone(String),
}

/// Request that results from an event.
#[derive(Clone, Debug, PartialEq)]
pub enum GamepadRequest {
    /// Intent of the operator.
    Intent(Intent),
    /// Request to play a motion.
    Play(MotionChoice),
    /// Message to the operator; true for an error.
    Message(String, bool),
}

impl GamepadRequest {
    /// Passes the request to the operator's core. `catalog` maps names of motions in the active library to command codes.
    pub fn execute(self, now_us: u64, operator: &mut Operator, catalog: Option<&Catalog>) {
        match self {
            Self::Intent(intent) => operator.request(now_us, intent),
            Self::Play(MotionChoice::Code(code)) => operator.request(now_us, Intent::Play { code }),
            Self::Play(MotionChoice::Named(name)) => {
                match catalog.and_then(|catalog| catalog.motion(&name)?.code) {
                    Some(code) => operator.request(now_us, Intent::Play { code }),
                    None => {
                        let text = format!(
                            "the library does not have a motion `{name}` with a command code"
                        );
                        operator.notify(now_us, Weight::Refused, text);
                    }
                }
            }
            Self::Message(text, wrong) => {
                operator.notify(now_us, if wrong { Weight::Warning } else { Weight::Note }, text);
            }
        }
    }
}

/// Gamepad with its mapping.
#[derive(Clone, Debug)]
pub struct MappedGamepad {
    mapping: Mapping,
    is_there: bool,
    down: BTreeSet<Input>,
    /// Inputs that were pressed when the gamepad connected, and are ignored until they are released.
    stale: BTreeSet<Input>,
    held: bool,
    /// Latest position of each axis.
    axes: BTreeMap<u16, f32>,
    speed: Option<i8>,
    heard_us: u64,
    /// Time for which a button must be held to arm, µs.
    arm_hold_us: u64,
    /// Button that is held to arm, and time of its press, µs.
    arming: Option<(Input, u64)>,
}

impl MappedGamepad {
    /// Creates a gamepad that is not connected yet.
    pub fn new(mapping: Mapping) -> Self {
        Self {
            mapping,
            is_there: false,
            down: BTreeSet::new(),
            stale: BTreeSet::new(),
            held: false,
            axes: BTreeMap::new(),
            speed: None,
            heard_us: 0,
            arm_hold_us: 0,
            arming: None,
        }
    }

    /// Sets the time for which the button must be held, together with the deadman, to arm.
    pub fn arming_after(self, arm_hold_us: u64) -> Self {
        Self { arm_hold_us, ..self }
    }

    /// Button of a browser's gamepad that corresponds to `BTN_NORTH`.
    pub fn north(&self) -> North {
        self.mapping.north
    }

    /// Short description of the gamepad's state.
    pub fn words(&self) -> String {
        let hold = self.mapping.deadman.input;
        if self.is_there {
            format!("gamepad {}, hold {hold}", self.mapping.name)
        } else {
            "GAMEPAD GONE".into()
        }
    }

    /// Initial state of the deadman: not held.
    pub fn released(&self) -> Deadman {
        Deadman::Released(self.mapping.deadman.released)
    }

    /// Deflection of an axis in the given direction, 0 to 1; 0 while the deadman is not held.
    pub fn pushed(&self, push: AxisDirection) -> f32 {
        let value = self.axes.get(&push.axis).filter(|_| self.held);
        value.map_or(0.0, |&value| push.how_far(value))
    }

    fn let_go(&self) -> GamepadRequest {
        GamepadRequest::Intent(Intent::Deadman(self.released()))
    }

    /// Processes an event, and returns the resulting requests.
    pub fn on_event(&mut self, now_us: u64, event: Event) -> Vec<GamepadRequest> {
        self.heard_us = now_us;
        match event {
            Event::Found { name, buttons, axes } => self.connected(&name, &buttons, &axes),
            Event::Gone(why) => self.disconnected(&why),
            // Events of a disconnected gamepad are stale.
            Event::Button { .. } | Event::Axis { .. } if !self.is_there => Vec::new(),
            Event::Button { number, down } => self.press(now_us, Input::Button(number), down),
            Event::Axis { axis, value } => self.push(now_us, axis, value),
        }
    }

    /// Processes timeouts. A deadman that is held without events for too long counts as released, and a button that is held for
    /// long enough arms.
    pub fn tick(&mut self, now_us: u64) -> Vec<GamepadRequest> {
        let mut requests = self.tick_silence(now_us);
        if !self.held {
            self.arming = None;
        }
        let long = |&mut (_, since_us): &mut (Input, u64)| {
            now_us.saturating_sub(since_us) >= self.arm_hold_us
        };
        if self.arming.take_if(long).is_some() {
            requests.push(GamepadRequest::Intent(Intent::Arm));
        }
        requests
    }

    fn tick_silence(&mut self, now_us: u64) -> Vec<GamepadRequest> {
        let Some(silent_s) = self.mapping.deadman.silent_s else { return Vec::new() };
        let silent_us = (silent_s * 1e6) as u64;
        if !self.held || now_us.saturating_sub(self.heard_us) < silent_us {
            return Vec::new();
        }
        self.held = false;
        self.stale.insert(self.mapping.deadman.input);
        let text =
            format!("no data from the gamepad for {silent_s} s: the deadman counts as released");
        vec![self.let_go(), GamepadRequest::Message(text, true)]
    }

    fn connected(
        &mut self,
        name: &str,
        buttons: &[u16],
        axes: &[(u16, f32)],
    ) -> Vec<GamepadRequest> {
        self.down = buttons.iter().map(|&number| Input::Button(number)).collect();
        for &(axis, value) in axes {
            for push in
                [AxisDirection { axis, positive: true }, AxisDirection { axis, positive: false }]
            {
                if push.how_far(value) > PRESSED {
                    self.down.insert(Input::Push(push));
                }
            }
        }
        self.stale = self.down.clone();
        self.held = false;
        self.arming = None;
        self.speed = None;
        let mut requests = Vec::new();
        // A stop button that is held counts as a stop.
        if self.mapping.estop.iter().any(|input| self.down.contains(input)) {
            requests.push(GamepadRequest::Intent(Intent::Estop));
        }
        requests.push(self.let_go());
        requests.push(GamepadRequest::Message(format!("gamepad: {name}"), false));
        self.is_there = true;
        self.axes = axes.iter().copied().collect();
        if let Some(Speed { push, .. }) = self.mapping.speed
            && let Some(&value) = self.axes.get(&push.axis)
        {
            requests.extend(self.set_speed(value));
        }
        requests
    }

    fn disconnected(&mut self, why: &str) -> Vec<GamepadRequest> {
        self.held = false;
        self.arming = None;
        self.down.clear();
        self.stale.clear();
        if !std::mem::take(&mut self.is_there) {
            return Vec::new();
        }
        vec![
            self.let_go(),
            GamepadRequest::Message(format!("the gamepad is disconnected: {why}"), true),
        ]
    }

    fn push(&mut self, now_us: u64, axis: u16, value: f32) -> Vec<GamepadRequest> {
        self.axes.insert(axis, value);
        let mut requests = Vec::new();
        for push in
            [AxisDirection { axis, positive: true }, AxisDirection { axis, positive: false }]
        {
            let how_far = push.how_far(value);
            if how_far > PRESSED {
                requests.extend(self.press(now_us, Input::Push(push), true));
            } else if how_far < LET_GO {
                requests.extend(self.press(now_us, Input::Push(push), false));
            }
        }
        if self.mapping.speed.is_some_and(|speed| speed.push.axis == axis) {
            requests.extend(self.set_speed(value));
        }
        requests
    }

    fn set_speed(&mut self, value: f32) -> Option<GamepadRequest> {
        let speed = self.mapping.speed?;
        let sixty_fourths = speed.sixty_fourths(value);
        let ends = [speed.rest, speed.pushed, speed.opposite].map(whole);
        let same = self.speed.is_some_and(|last| {
            last == sixty_fourths
                || (last - sixty_fourths).abs() < SPEED_NOISE && !ends.contains(&sixty_fourths)
        });
        if same {
            return None;
        }
        self.speed = Some(sixty_fourths);
        Some(GamepadRequest::Intent(Intent::Speed { sixty_fourths }))
    }

    /// Processes a press or release of an input, which may be a repetition.
    fn press(&mut self, now_us: u64, input: Input, down: bool) -> Vec<GamepadRequest> {
        // The button or the deadman was released too early.
        self.arming
            .take_if(|(held, _)| !down && [*held, self.mapping.deadman.input].contains(&input));
        let changed = if down { self.down.insert(input) } else { self.down.remove(&input) };
        let was_stale = if down { self.stale.contains(&input) } else { self.stale.remove(&input) };
        if self.mapping.estop.contains(&input) {
            let pressed = changed && down;
            return if pressed { vec![GamepadRequest::Intent(Intent::Estop)] } else { Vec::new() };
        }
        if !changed || was_stale {
            return Vec::new();
        }
        if input == self.mapping.deadman.input {
            self.held = down;
            let held = GamepadRequest::Intent(Intent::Deadman(Deadman::Held));
            return vec![if down { held } else { self.let_go() }];
        }
        let does = self.mapping.buttons.iter().find(|(known, _)| *known == input);
        let Some((_, does)) = does.filter(|_| down) else { return Vec::new() };
        let request = match does {
            ButtonAction::Clear => GamepadRequest::Intent(Intent::Clear),
            ButtonAction::Disarm => GamepadRequest::Intent(Intent::Disarm),
            // Without the deadman, the button pauses but does not resume. A return is passed on, since the operator's interlocks
            // decide on it.
            ButtonAction::Pause if !self.held => GamepadRequest::Intent(Intent::Pause),
            ButtonAction::Return => GamepadRequest::Intent(Intent::Return),
            ButtonAction::Play(_) | ButtonAction::Arm if !self.held => {
                let hold = self.mapping.deadman.input;
                GamepadRequest::Message(
                    format!("hold {hold} first, because {input} moves the robot"),
                    false,
                )
            }
            ButtonAction::Pause => GamepadRequest::Intent(Intent::PauseOrResume),
            ButtonAction::Arm if self.arm_hold_us > 0 => {
                self.arming = Some((input, now_us));
                return Vec::new();
            }
            ButtonAction::Arm => GamepadRequest::Intent(Intent::Arm),
            ButtonAction::Play(motion) => GamepadRequest::Play(motion.clone()),
        };
        vec![request]
    }
}

impl Speed {
    /// Speed in 64ths for an axis at `value`.
    fn sixty_fourths(&self, value: f32) -> i8 {
        let towards = |push: AxisDirection| {
            let past = push.how_far(value) - self.dead_zone;
            (past / (1.0 - self.dead_zone)).clamp(0.0, 1.0)
        };
        let other = AxisDirection { positive: !self.push.positive, ..self.push };
        let part = self.rest
            + towards(self.push) * (self.pushed - self.rest)
            + towards(other) * (self.opposite - self.rest);
        whole(part)
    }
}

fn whole(part: f32) -> i8 {
    ((64.0 * part).round() as i8).clamp(1, 64)
}

/// Normalised position of an axis: −1 to 1 for a stick, 0 to 1 for a trigger.
///
/// The number of the axis determines its kind, because the ranges of values do not: a PlayStation's sticks and triggers both
/// have the range 0 to 255.
pub fn normal(axis: u16, raw: i32, min: i32, max: i32) -> f32 {
    // ABS_Z, ABS_RZ, ABS_THROTTLE, ABS_GAS, ABS_BRAKE.
    const TRIGGERS: [u16; 5] = [0x02, 0x05, 0x06, 0x09, 0x0a];
    let span = f64::from(max) - f64::from(min);
    if span <= 0.0 {
        return 0.0;
    }
    let part = ((f64::from(raw) - f64::from(min)) / span).clamp(0.0, 1.0);
    let value = if TRIGGERS.contains(&axis) { part } else { 2.0 * part - 1.0 };
    value as f32
}
