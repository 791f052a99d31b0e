//! Mapping files, which assign actions to buttons and axes (docs/gamepad.md).

use crate::inputs::{self, AxisDirection, Input};
use rollwalk_host::operator::ReleaseReaction;
use rollwalk_robot::document::{Document, DocumentError, Span, Table, alternatives};

/// Validated mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping {
    /// Name of the mapping, for messages.
    pub name: String,
    /// Substrings of the device names for which the mapping is made.
    pub devices: Vec<String>,
    /// Inputs that stop the robot; never empty.
    pub estop: Vec<Input>,
    /// Button that the device's driver calls `BTN_NORTH`.
    pub north: North,
    /// Input that must be held while the robot moves, the deadman.
    pub deadman: DeadmanInput,
    /// Axis that sets the playback speed; `None` without one.
    pub speed: Option<Speed>,
    /// Actions of the other buttons.
    pub buttons: Vec<(Input, ButtonAction)>,
}

/// Button on the right that a driver calls `BTN_NORTH`: the top or the left one. The driver calls the remaining one `BTN_WEST`.
///
/// A mapping must state this, because browsers number buttons by their positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum North {
    /// Top button, as Linux documents it.
    #[default]
    Top,
    /// Left button, as in `xpad`.
    Left,
}

/// Deadman: the input that must be held while the robot moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeadmanInput {
    /// Button or direction of an axis.
    pub input: Input,
    /// Reaction of a moving robot when the input is released.
    pub released: ReleaseReaction,
    /// Time without events after which the gamepad counts as disconnected, s.
    pub silent_s: Option<f64>,
}

/// Playback speeds for a stick or trigger, as fractions of the planned speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speed {
    /// Axis and its positive direction.
    pub push: AxisDirection,
    /// Dead zone, as a fraction of the travel.
    pub dead_zone: f32,
    /// Speed at rest.
    pub rest: f32,
    /// Speed at full deflection.
    pub pushed: f32,
    /// Speed at full deflection in the opposite direction.
    pub opposite: f32,
}

/// Action of a button.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ButtonAction {
    /// Plays a motion.
    Play(MotionChoice),
    /// Switches torque on.
    Arm,
    /// Clears a stop.
    Clear,
    /// Pauses or resumes.
    Pause,
    /// Returns to SAFE.
    Return,
    /// Returns to SAFE, then switches torque off.
    Disarm,
}

/// Motion that a button plays.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MotionChoice {
    /// Motion with the given command code.
    Code(u8),
    /// Motion with the given name in the library.
    Named(String),
}

/// Texts accepted for a button.
const WORDS: [&str; 6] = ["play MOTION", "arm", "clear", "pause", "return", "disarm"];

impl Mapping {
    /// Reads and validates a mapping file. `file_name` is used only in messages.
    ///
    /// # Errors
    /// Returns all defects of the file.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let mapping = mapping(&document);
        document.finish(mapping)
    }
}

/// Inputs that already have a meaning, with that meaning.
#[derive(Default)]
struct UsedInputs(Vec<(Input, String)>);

impl UsedInputs {
    /// Records the meaning of an input. Reports a fault if the input already has a meaning.
    fn take(&mut self, document: &Document<'_>, span: Span, input: Input, does: &str) {
        match self.0.iter().find(|(taken, _)| *taken == input) {
            Some((_, other)) => document.fault(
                span,
                format!("{input} has two actions, {other} and {does}"),
                "a second action",
                "give each button or direction one action",
            ),
            None => self.0.push((input, does.to_owned())),
        }
    }
}

fn mapping(document: &Document<'_>) -> Option<Mapping> {
    let root = document.root();
    let name = root.string("name");
    let devices = root.strings("devices");
    let mut taken = UsedInputs::default();
    let estop = estop(document, &root, &mut taken);
    let north = match root.has("north_is") {
        true => root.choice("north_is", &["top", "left"]),
        false => Some(0),
    };
    let deadman = root.table("deadman").and_then(|table| hold(document, &table, &mut taken));
    let speed =
        if root.has("speed") { root.table("speed").map(|table| speed(&table)) } else { None };
    let buttons = if root.has("buttons") {
        root.table("buttons").map(|table| buttons(document, &table, &mut taken))
    } else {
        Some(Vec::new())
    };
    root.done();
    Some(Mapping {
        name: name?,
        devices: devices?.into_iter().map(|(part, _)| part.to_owned()).collect(),
        estop: estop?,
        north: if north? == 0 { North::Top } else { North::Left },
        deadman: deadman?,
        speed: match speed {
            None => None,
            Some(speed) => Some(speed?),
        },
        buttons: buttons?,
    })
}

fn estop(document: &Document<'_>, root: &Table<'_>, taken: &mut UsedInputs) -> Option<Vec<Input>> {
    let names = root.strings("estop")?;
    if names.is_empty() {
        let help = "give at least one button, such as estop = [\"BTN_EAST\"]";
        root.fault("estop", "is empty", "no emergency stop", help);
    }
    let mut inputs = Vec::new();
    for (name, span) in names {
        let input = input(document, "estop", name, span.clone())?;
        taken.take(document, span, input, "estop");
        inputs.push(input);
    }
    Some(inputs)
}

fn input(document: &Document<'_>, what: &str, name: &str, span: Span) -> Option<Input> {
    let found = Input::named(name);
    if found.is_none() {
        let known = inputs::names();
        let message = format!("{what}: `{name}` is not a button, nor an axis with a direction");
        let help = match name {
            _ if inputs::push(&format!("{name}+")).is_some() => {
                format!("add a direction: `{name}+` or `{name}-`")
            }
            _ => alternatives(name, known.iter().map(String::as_str)),
        };
        document.fault(span, message, "not an input", help);
    }
    found
}

fn hold(
    document: &Document<'_>,
    table: &Table<'_>,
    taken: &mut UsedInputs,
) -> Option<DeadmanInput> {
    let name = table.string("hold");
    let span = table.span_of("hold");
    let input = name.and_then(|name| input(document, "[deadman]", &name, span.clone()));
    if let Some(input) = input {
        taken.take(document, span, input, "deadman");
    }
    let released = table.choice("released", &["pause", "return", "disarm"]);
    let silent_s =
        table.has("silent_s").then(|| table.number_in("silent_s", 0.2..=60.0, "s")).flatten();
    table.done();
    let released = match released? {
        0 => ReleaseReaction::Pause,
        1 => ReleaseReaction::Return,
        _ => ReleaseReaction::Disarm,
    };
    Some(DeadmanInput { input: input?, released, silent_s })
}

fn speed(table: &Table<'_>) -> Option<Speed> {
    let name = table.string("axis");
    let push = name.and_then(|name| {
        let push = inputs::push(&name);
        if push.is_none() {
            let known = inputs::axis_names();
            let help = match inputs::push(&format!("{name}+")) {
                Some(_) => format!("add a direction: `{name}+` or `{name}-`"),
                None => alternatives(&name, known.iter().map(String::as_str)),
            };
            table.fault("axis", format!("is \"{name}\""), "not an axis with a direction", help);
        }
        push
    });
    let part = |key| table.number_in(key, 1.0 / 64.0..=1.0, "of the planned speed");
    let dead_zone = table.number_in("dead_zone", 0.0..=0.9, "of the full deflection");
    let (rest, pushed) = (part("rest"), part("pushed"));
    let opposite = if table.has("opposite") { part("opposite") } else { rest };
    table.done();
    Some(Speed {
        push: push?,
        dead_zone: dead_zone? as f32,
        rest: rest? as f32,
        pushed: pushed? as f32,
        opposite: opposite? as f32,
    })
}

fn buttons(
    document: &Document<'_>,
    table: &Table<'_>,
    taken: &mut UsedInputs,
) -> Vec<(Input, ButtonAction)> {
    let mut all = Vec::new();
    for entry in table.named_strings() {
        let input = input(document, "[buttons]", entry.name, entry.name_span.clone());
        let does = button_action(entry.text);
        if let Err(help) = &does {
            let message = format!("[buttons]: `{}` cannot be \"{}\"", entry.name, entry.text);
            document.fault(entry.text_span, message, "not an action", help);
        }
        if let (Some(input), Ok(does)) = (input, does) {
            taken.take(document, entry.name_span, input, entry.text);
            all.push((input, does));
        }
    }
    all
}

/// Parses the action of a button.
///
/// # Errors
/// Returns a description of valid actions.
fn button_action(text: &str) -> Result<ButtonAction, String> {
    match text {
        "arm" => return Ok(ButtonAction::Arm),
        "clear" => return Ok(ButtonAction::Clear),
        "pause" => return Ok(ButtonAction::Pause),
        "return" => return Ok(ButtonAction::Return),
        "disarm" => return Ok(ButtonAction::Disarm),
        "estop" => return Err("move this button into `estop` above".into()),
        _ => {}
    }
    let motion = match text.split_once(' ') {
        Some(("play", motion)) => motion.trim(),
        _ if text == "play" => "",
        _ => return Err(alternatives(text, WORDS)),
    };
    if motion.is_empty() || motion.contains(char::is_whitespace) {
        return Err(
            "give one motion or its command code, such as \"play walk\" or \"play 3\"".into()
        );
    }
    if motion.chars().all(|c| c.is_ascii_digit()) {
        return match motion.parse() {
            Ok(code @ 1..) => Ok(ButtonAction::Play(MotionChoice::Code(code))),
            _ => Err("give a command code from 1 to 255".into()),
        };
    }
    Ok(ButtonAction::Play(MotionChoice::Named(motion.to_owned())))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIGHT: &str = r#"
name = "test"
devices = ["pad"]
estop = ["BTN_EAST"]

[deadman]
hold = "ABS_Z+"
released = "pause"

[speed]
axis = "ABS_RZ+"
dead_zone = 0.1
rest = 0.5
pushed = 1.0

[buttons]
BTN_SOUTH = "play walk"
ABS_HAT0Y- = "arm"
BTN_NORTH = "play 12"
"#;

    fn faults(text: &str) -> Vec<(String, String)> {
        let error = Mapping::from_toml("test.toml", text).unwrap_err();
        error.faults().map(|fault| (fault.message.clone(), fault.help.clone())).collect()
    }

    #[test]
    fn a_mapping_is_read() {
        let mapping = Mapping::from_toml("test.toml", RIGHT).unwrap();
        assert_eq!(mapping.estop, [Input::Button(0x131)]);
        let push = |axis, positive| AxisDirection { axis, positive };
        assert_eq!(mapping.deadman.input, Input::Push(push(2, true)));
        assert_eq!(mapping.speed.unwrap().opposite, 0.5);
        let named = ButtonAction::Play(MotionChoice::Named("walk".into()));
        assert_eq!(mapping.buttons.len(), 3);
        assert!(mapping.buttons.contains(&(Input::Button(0x130), named)));
        assert!(mapping.buttons.contains(&(Input::Push(push(0x11, false)), ButtonAction::Arm)));
    }

    #[test]
    fn what_is_wrong_is_said_with_what_would_be_right() {
        for (from, to, message, help) in [
            (
                "BTN_SOUTH =",
                "BTN_SUOTH =",
                "`BTN_SUOTH` is not a button",
                "did you mean `BTN_SOUTH`",
            ),
            ("\"play walk\"", "\"jump\"", "cannot be \"jump\"", "`play MOTION`"),
            ("\"play walk\"", "\"play 300\"", "cannot be \"play 300\"", "1 to 255"),
            ("\"play walk\"", "\"play\"", "cannot be \"play\"", "play walk"),
            ("\"play walk\"", "\"estop\"", "cannot be \"estop\"", "`estop` above"),
            ("BTN_NORTH =", "BTN_EAST =", "two actions, estop and play 12", "one action"),
            ("\"ABS_Z+\"", "\"ABS_Z\"", "`ABS_Z` is not a button", "`ABS_Z+` or `ABS_Z-`"),
            ("\"ABS_RZ+\"", "\"ABS_RZ\"", "`axis` is \"ABS_RZ\"", "`ABS_RZ+` or"),
            ("[\"BTN_EAST\"]", "[]", "`estop` is empty", "at least one"),
            ("\"pause\"", "\"stop\"", "`released` cannot be \"stop\"", "`pause`"),
            ("dead_zone = 0.1", "dead_zone = 1.5", "`dead_zone` is 1.5", "0 to 0.9"),
            ("rest = 0.5", "rest = 0", "`rest` is 0", "of the planned speed"),
            (
                "released = \"pause\"",
                "relaesed = \"pause\"",
                "`released` is missing",
                "`released`?",
            ),
            ("name =", "north_is = \"up\"\nname =", "`north_is` cannot be \"up\"", "`left`"),
            ("[deadman]", "[daedman]", "`deadman` is missing", "`deadman`"),
        ] {
            assert!(RIGHT.contains(from), "{from}");
            let found = faults(&RIGHT.replace(from, to));
            assert!(found.iter().any(|(m, _)| m.contains(message)), "{to}: {found:?}");
            assert!(found.iter().any(|(_, h)| h.contains(help)), "{to}: {found:?}");
        }
    }

    #[test]
    fn shipped_mappings_are_right() {
        for (path, text) in crate::shipped() {
            Mapping::from_toml(path, text).unwrap_or_else(|error| panic!("{error}"));
        }
    }
}
