//! Lines at the bottom of the terminal while a robot is steered, a pure function of the scene.

use ratatui::Frame;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use rollwalk_host::actuators::Actuators;
use rollwalk_host::describe::{condition, state_name};
use rollwalk_host::operator::{View, Weight};
use rollwalk_pilot::{Phase, Pilot};

/// Height of the screen, lines.
pub const HEIGHT: u16 = 9;
/// Number of message lines in the screen.
const MESSAGES: usize = 4;

/// Content of the screen.
pub struct Scene<'a> {
    /// View that the operator has of the link and the robot.
    pub view: &'a View,
    /// Bus, as the user typed it.
    pub bus: &'a str,
    pub pilot: &'a Pilot,
    /// Actuators of the robot.
    pub actuators: &'a Actuators,
    /// Short description of the gamepad; `None` without one.
    pub gamepad: Option<&'a str>,
    /// Number of frames that the controller has not played yet.
    pub ahead: usize,
    /// Duration of the most recent solve, ms.
    pub took_ms: Option<f64>,
}

pub fn draw(frame: &mut Frame, scene: &Scene) {
    let mut lines = vec![state(scene), steering(scene), plans(scene), Line::from("")];
    let messages = &scene.view.messages;
    for message in messages.iter().skip(messages.len().saturating_sub(MESSAGES)) {
        let style = match message.weight {
            Weight::Note => Style::new(),
            Weight::Refused => Style::new().fg(Color::Yellow),
            Weight::Warning => Style::new().fg(Color::Red),
        };
        let text = format!("{:8.1} s  {}", message.at_us as f64 * 1e-6, message.text);
        lines.push(Line::styled(text, style));
    }
    lines.resize(usize::from(HEIGHT) - 1, Line::from(""));
    lines.push(keys());
    frame.render_widget(Paragraph::new(lines), frame.area());
}

fn state(scene: &Scene) -> Line<'static> {
    let view = scene.view;
    let (words, colour) = match view.status {
        _ if view.stopping && view.link.contact => {
            ("EMERGENCY STOP is being sent".to_owned(), Color::Red)
        }
        _ if view.stopping => {
            ("EMERGENCY STOP is NOT acknowledged: press the robot's own".to_owned(), Color::Red)
        }
        _ if view.bus_lost.is_some() => ("the bus is lost".to_owned(), Color::Red),
        None => ("no answer yet".to_owned(), Color::Gray),
        Some(_) if !view.link.contact => ("no contact".to_owned(), Color::Red),
        Some(status) if status.faults.is_empty() => {
            (format!("the robot is {}", state_name(status.state)), Color::Green)
        }
        Some(status) => (
            format!("the robot is {}; {}", condition(&status, scene.actuators), view.advice),
            Color::Red,
        ),
    };
    let round_trip =
        view.link.round_trip_us.map_or(String::new(), |us| format!(", {:.1} ms", us as f64 * 1e-3));
    Line::from(vec![
        Span::styled(words, Style::new().fg(colour).add_modifier(Modifier::BOLD)),
        Span::raw(format!("   {}{round_trip}", scene.bus)),
    ])
}

fn steering(scene: &Scene) -> Line<'static> {
    let wanted = scene.pilot.steered();
    let s = wanted.steering;
    let how = match scene.pilot.phase() {
        Phase::Off if scene.view.deadman_held == Some(false) => "hold the deadman, then arm",
        Phase::Off => "not steered",
        Phase::Beginning => "begins",
        Phase::Stopping => "the robot stops, then returns to SAFE",
        Phase::Homeward => "the robot returns to SAFE",
        Phase::Steered if scene.pilot.is_unsure() => "STOPS: no plan meets the constraints",
        Phase::Steered if wanted.walks => "walks",
        Phase::Steered => "on all its feet and wheels",
    };
    Line::from(format!(
        "forward {:+.2} m/s   left {:+.2} m/s   turn {:+.2} rad/s   {how}",
        s.forward_m_s, s.left_m_s, s.turn_rad_s
    ))
}

fn plans(scene: &Scene) -> Line<'static> {
    let tally = scene.pilot.tally();
    let [forward, left, turn] = tally.velocity;
    let took = scene.took_ms.map_or(String::new(), |ms| format!(", last in {ms:.0} ms"));
    let gamepad = scene.gamepad.map_or(String::new(), |words| format!("   {words}"));
    Line::from(format!(
        "planned {forward:+.2} {left:+.2} {turn:+.2}   {} horizons{took}, {} rejected   {:.2} s \
         ahead{gamepad}",
        tally.planned,
        tally.rejected,
        scene.ahead as f64 / 60.0
    ))
}

fn keys() -> Line<'static> {
    let stop = Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD);
    let mut spans = vec![Span::styled(" SPACE STOP ", stop)];
    for (key, does) in [
        ("↑↓", "forward"),
        ("←→", "turn"),
        (", .", "sideways"),
        ("x", "halt"),
        ("g", "gait"),
        ("a", "arm"),
        ("r", "SAFE"),
        ("c", "clear"),
        ("q", "quit"),
    ] {
        spans.push(Span::styled(format!(" {key}"), Style::new().add_modifier(Modifier::BOLD)));
        spans.push(Span::raw(format!(" {does}")));
    }
    Line::from(spans)
}
