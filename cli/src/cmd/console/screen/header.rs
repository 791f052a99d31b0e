//! Head of the screen: state, link, described faults, and advice on the next step.

use super::super::scene::Scene;
use super::fit;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use rollwalk_host::actuators::{ReadingWarning, conditions, fault_words};
use rollwalk_host::operator::{ExitStage, FaultView, View};
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::faults::{Fault, Quantity, Severity};
use rollwalk_protocol::wire::State;

/// Width of the state box, columns.
const STATE_WIDTH: u16 = 20;

/// Draws the state, the link and the speed.
pub fn draw(frame: &mut Frame, scene: &Scene, area: Rect) {
    let [left, right] =
        Layout::horizontal([Constraint::Length(STATE_WIDTH), Constraint::Min(0)]).areas(area);
    let view = scene.view;
    let style = Style::new().fg(Color::Black).bg(colour(view)).add_modifier(Modifier::BOLD);
    let lines = vec![
        Line::from(""),
        Line::from(state_words(view)).centered(),
        Line::from(severity(view)).centered(),
    ];
    frame.render_widget(Paragraph::new(lines).style(style), left);
    let width = usize::from(right.width.saturating_sub(1));
    let robot = scene.names.robot.as_deref().unwrap_or("robot");
    let library = match view.hello {
        Some(hello) => {
            hello.library.map_or("no library".into(), |library| format!("library {library:08x}"))
        }
        None => "identity requested".into(),
    };
    let name = format!(" {robot}, {library}, node {} on {}", view.node, scene.bus);
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let lines = vec![
        Line::styled(fit(&name, width), bold),
        link(view, width),
        Line::from(fit(&activity(scene), width)),
    ];
    frame.render_widget(Paragraph::new(lines), right);
}

/// State in capital letters.
pub fn state_words(view: &View) -> &'static str {
    if view.stopping && (view.bus_lost.is_some() || !view.link.contact) {
        return "STOP NOT CONFIRMED";
    }
    if view.stopping {
        return "STOPPING";
    }
    if view.bus_lost.is_some() {
        return "BUS LOST";
    }
    if view.status.is_some() && !view.link.contact {
        return "NO CONTACT";
    }
    match view.status.map(|status| status.state) {
        None => "NO STATUS YET",
        Some(State::Boot) => "STARTING",
        Some(State::SelfTest) => "TESTING ITSELF",
        Some(State::Disarmed) => "DISARMED",
        Some(State::Aligning) => "ALIGNING",
        Some(State::Ready) => "READY",
        Some(State::Playing) => "PLAYING",
        Some(State::Paused) => "PAUSED",
        Some(State::Returning) => "RETURNING",
        Some(State::Damped) => "DAMPED",
        Some(State::TorqueOff) => "TORQUE OFF",
        // The stop of a failed bus is not an emergency stop, because the operator has pressed nothing.
        Some(State::EStopped) if stopped_by_a_bus(view) => "STOPPED",
        Some(State::EStopped) => "EMERGENCY STOP",
        Some(State::Streaming) => "STREAMING",
    }
}

fn stopped_by_a_bus(view: &View) -> bool {
    let faults = view.status.map(|status| status.faults).unwrap_or_default();
    faults.contains(Fault::BusOff) && !faults.contains(Fault::EStop)
}

fn colour(view: &View) -> Color {
    if view.stopping || view.bus_lost.is_some() {
        return Color::Red;
    }
    if !view.link.contact {
        return Color::Gray;
    }
    match view.status.map(|status| status.state) {
        Some(State::Ready | State::Playing | State::Streaming) => Color::Green,
        Some(State::Aligning | State::Paused | State::Returning) => Color::Yellow,
        Some(State::Damped | State::TorqueOff | State::EStopped) => Color::Red,
        Some(State::Boot | State::SelfTest | State::Disarmed) | None => Color::Gray,
    }
}

fn severity(view: &View) -> &'static str {
    match view.status.filter(|_| view.link.contact).map(|status| status.severity) {
        None => "",
        Some(Severity::None) if has_faulty_servo(view) => "see the warning",
        Some(Severity::None) => "no fault",
        Some(Severity::Notice) => "notice",
        Some(Severity::Return) => "because of a fault",
        Some(Severity::Damp) => "sinks damped",
        Some(Severity::TorqueOff) => "clear before arming",
        Some(Severity::EStop) => "torque is off",
    }
}

fn has_faulty_servo(view: &View) -> bool {
    view.joints.values().any(|joint| joint.telemetry.status.faulty())
}

fn link(view: &View, width: usize) -> Line<'static> {
    let bad = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);
    if let Some(why) = &view.bus_lost {
        return Line::styled(fit(&format!(" BUS LOST, reconnecting: {why}"), width), bad);
    }
    let age_s = view.link.status_age_us.map(|us| us as f64 * 1e-6);
    let complaint = view.complaint.as_deref();
    if !view.link.contact {
        let text = match (age_s, complaint) {
            (Some(age_s), None) => format!(" NO CONTACT for {age_s:.1} s"),
            (Some(age_s), Some(why)) => format!(" NO CONTACT for {age_s:.1} s: {why}"),
            (None, None) => " no answer yet: check power, cable and address".into(),
            (None, Some(why)) => format!(" no answer yet: {why}"),
        };
        return Line::styled(fit(&text, width), bad);
    }
    let round_trip =
        view.link.round_trip_us.map_or("?".into(), |us| format!("{:.1}", us as f64 * 1e-3));
    let (lost, all) = (view.link.lost, view.link.lost + view.link.received);
    let age_s = age_s.unwrap_or(0.0);
    let text =
        format!(" round trip {round_trip} ms, status {age_s:.2} s old, lost {lost} of {all}");
    match complaint {
        // A complaint about the bus is more important than its load.
        Some(why) => Line::styled(fit(&format!(" BUS: {why}"), width), bad),
        None => Line::from(fit(&text, width)),
    }
}

fn activity(scene: &Scene) -> String {
    let view = scene.view;
    let mut parts = vec![format!("speed {}", part(view.speed_64ths))];
    if let Some((_, speed)) = view.asked.filter(|&(_, speed)| speed != view.speed_64ths) {
        parts.push(format!("plays at {}", part(speed)));
    }
    match view.deadman_held {
        Some(true) => parts.push("deadman held".into()),
        Some(false) => parts.push("DEADMAN NOT HELD".into()),
        None => {}
    }
    if let Some(gamepad) = scene.gamepad {
        parts.push(gamepad.to_owned());
    }
    if view.leaving == ExitStage::WhenHome {
        parts.push("QUITTING: q quits at once".into());
    }
    if let Some(asking) = &view.asking {
        parts.push(format!("command: {asking}"));
    }
    format!(" {}", parts.join(", "))
}

fn part(sixty_fourths: i8) -> String {
    format!("{:.0} %", f64::from(sixty_fourths) / 0.64)
}

/// Draws the faults and the advice on the next step.
pub fn draw_faults(frame: &mut Frame, scene: &Scene, area: Rect) {
    let view = scene.view;
    let width = usize::from(area.width);
    let bad = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);
    let faults: Vec<_> = view.faults.iter().map(|fault| words(scene, fault)).collect();
    let servos = servos(scene);
    let first = match &view.mismatch {
        Some(why) => Line::styled(fit(&format!(" DO NOT ARM: {why}"), width), bad),
        None if !view.link.contact && faults.is_empty() => {
            Line::styled(fit(" faults are unknown without contact", width), bad)
        }
        None if faults.is_empty() && servos.is_empty() => Line::from(" no fault"),
        None if faults.is_empty() => {
            Line::styled(fit(&format!(" WARNING: {}", servos.join("; ")), width), bad)
        }
        None => Line::styled(fit(&format!(" FAULT: {}", faults.join("; ")), width), bad),
    };
    let next = Line::from(vec![
        Span::styled(" next: ", Style::new().add_modifier(Modifier::BOLD)),
        Span::raw(fit(view.advice, width.saturating_sub(7))),
    ]);
    frame.render_widget(Paragraph::new(vec![first, next]), area);
}

/// Descriptions of actuators that are too hot, have a wrong supply voltage, or failed otherwise, and then of servos close to
/// their limits.
fn servos(scene: &Scene) -> Vec<String> {
    let (mut failed, mut close) = (Vec::new(), Vec::new());
    for (&channel, joint) in &scene.view.joints {
        let name = scene.names.channel(channel);
        let limits = scene.names.actuators.limits(channel);
        if joint.telemetry.status.faulty() {
            let status = ActuatorStatus(joint.telemetry.status.0 & ActuatorStatus::FAULTS);
            failed.push(format!("{name}: {}", conditions(status, limits).join(", ")));
        }
        if let (Some(readings), Some(limits)) = (&joint.readings, limits) {
            let all = ReadingWarning::all(readings, limits).into_iter();
            close.extend(all.map(|of| format!("{name}: {}", of.words(readings, limits))));
        }
    }
    failed.append(&mut close);
    failed
}

/// Short description of a fault with its channel, and with its value if that has a unit.
fn words(scene: &Scene, fault: &FaultView) -> String {
    let description = fault.fault.description();
    let kind = scene.names.actuators.kind_for(fault.fault, fault.channel, fault.value);
    let channel = fault.channel.map(|channel| format!(", {}", scene.names.channel(channel)));
    let words = fault_words(fault.fault, kind).name.to_owned() + &channel.unwrap_or_default();
    let unit = description.value.map_or("", Quantity::unit);
    match fault.value {
        Some(value) if !unit.is_empty() => format!("{words} ({value:.2} {unit})"),
        _ => words,
    }
}
