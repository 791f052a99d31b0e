//! Joints and wheels: position within the range, speed, torque, age of these values, temperature and supply voltage.

use super::super::scene::{Range, Scene};
use super::{fit, shorten};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::Line;
use ratatui::widgets::{Block, Paragraph};
use rollwalk_host::operator::JointView;
use rollwalk_terminal::output::unsigned_zero;

/// Minimum number of columns.
pub const LEAST_WIDTH: u16 = 46;
/// Smallest number of columns with which the temperatures are shown.
const TEMPERATURE_WIDTH: usize = 60;
/// Age above which values are marked as old, µs. A robot with 64 channels reports each channel four times a second.
const OLD_US: u64 = 500_000;

pub fn draw(frame: &mut Frame, scene: &Scene, area: Rect) {
    let (width, height) =
        (usize::from(area.width.saturating_sub(2)), usize::from(area.height.saturating_sub(2)));
    // Columns beside name, bar and temperature: 29.
    let is_hot_known = temperatures(scene).next().is_some() && width >= TEMPERATURE_WIDTH;
    let spare = width.saturating_sub(if is_hot_known { 34 } else { 29 });
    let bar = (spare / 3).clamp(5, 15);
    let name = spare.saturating_sub(bar).min(24);
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let (joint, range) = (fit("joint", name), fit("range", bar));
    let celsius = if is_hot_known { "   °C" } else { "" };
    let head =
        format!("  {joint} {:>6} {range} {:>6} {:>6}{:>5}{celsius}", "rad", "rad/s", "N·m", "age");
    let mut lines = vec![Line::styled(head, bold)];
    let all: Vec<_> = scene.view.joints.iter().collect();
    let room = height.saturating_sub(1);
    let first = scene.scroll.min(all.len().saturating_sub(room));
    for &(&channel, joint) in all.iter().skip(first).take(room) {
        let range = scene.names.ranges.get(usize::from(channel)).copied().flatten();
        let wheel = scene.names.ranges.len() > usize::from(channel) && range.is_none();
        let mut line = row(&shorten(&scene.names.channel(channel), name), joint, range, wheel, bar);
        if is_hot_known {
            line.push_span(
                joint
                    .readings
                    .and_then(|of| of.temperature_c)
                    .map_or_else(|| " ".repeat(5), |temperature_c| format!("{temperature_c:>5.0}")),
            );
        }
        lines.push(line);
    }
    let shown = if all.len() > room {
        format!(" {} to {} of {}, ↑ ↓", first + 1, (first + room).min(all.len()), all.len())
    } else {
        String::new()
    };
    let title = format!(" Joints{shown}{} ", supply(scene));
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(title)), area);
}

/// Temperatures of the actuators that report them, °C.
fn temperatures(scene: &Scene) -> impl Iterator<Item = f32> {
    scene.view.joints.values().filter_map(|joint| joint.readings?.temperature_c)
}

/// Range of the supply voltages, to follow the title; empty if no actuator reports its supply.
fn supply(scene: &Scene) -> String {
    let voltages = scene.view.joints.values().filter_map(|joint| joint.readings?.voltage_v);
    let range = voltages.fold(None, |range, voltage_v| {
        let (low, high) = range.unwrap_or((voltage_v, voltage_v));
        Some((voltage_v.min(low), voltage_v.max(high)))
    });
    range.map_or_else(String::new, |(low, high)| format!(", supply {low:.1} to {high:.1} V"))
}

fn row(
    name: &str,
    joint: &JointView,
    range: Option<Range>,
    wheel: bool,
    width: usize,
) -> Line<'static> {
    let telemetry = joint.telemetry;
    let outside = range
        .is_some_and(|r| telemetry.position_rad < r.min_rad || telemetry.position_rad > r.max_rad);
    let old = joint.age_us > OLD_US;
    let (mark, style) = if telemetry.status.faulty() {
        ('!', Style::new().fg(Color::Red))
    } else if outside {
        ('>', Style::new().fg(Color::Yellow))
    } else if old {
        ('?', Style::new().add_modifier(Modifier::DIM))
    } else {
        (' ', Style::new())
    };
    let bar = match range {
        Some(range) => bar(telemetry.position_rad, range, width),
        None if wheel => fit("wheel", width),
        None => fit("", width),
    };
    let age_s = (joint.age_us as f64 * 1e-6).min(999.0);
    Line::styled(
        format!(
            "{mark} {name} {:>6} {bar} {:>6} {:>6}{age_s:>5.1}",
            hundredths(telemetry.position_rad),
            hundredths(telemetry.velocity_rad_s),
            hundredths(telemetry.torque_nm)
        ),
        style,
    )
}

fn hundredths(value: f32) -> String {
    unsigned_zero(format!("{value:.2}"))
}

/// Draws a position within a range as `├──●───┤`. A position outside the range replaces the end by `◀` or `▶`.
fn bar(position_rad: f32, range: Range, width: usize) -> String {
    let span = range.max_rad - range.min_rad;
    let part = if span > 0.0 { (position_rad - range.min_rad) / span } else { 0.5 };
    let inner = width.saturating_sub(2).max(1);
    let mut cells = vec!['─'; inner];
    let at = (part.clamp(0.0, 1.0) * (inner - 1) as f32).round() as usize;
    let (mut left, mut right) = ('├', '┤');
    if part < 0.0 {
        left = '◀';
    } else if part > 1.0 {
        right = '▶';
    } else if let Some(cell) = cells.get_mut(at) {
        *cell = '●';
    }
    let cells: String = cells.into_iter().collect();
    format!("{left}{cells}{right}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_shows_where_in_its_range_a_joint_is() {
        let range = Range { min_rad: -1.0, max_rad: 1.0 };
        let shown = [-1.0, 0.0, 1.0, -1.1, 1.1].map(|position| bar(position, range, 7));
        assert_eq!(shown, ["├●────┤", "├──●──┤", "├────●┤", "◀─────┤", "├─────▶"]);
        assert_eq!(bar(f32::NAN, range, 7), "├●────┤");
    }
}
