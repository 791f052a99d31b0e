//! Screen of the console, a pure function of the scene. Words or signs repeat whatever a colour shows.

mod header;
mod help;
mod joints;
mod messages;
mod motions;
#[cfg(test)]
mod tests;

use super::scene::Scene;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

/// Minimum size of a full screen, columns and rows. A smaller terminal only shows how to stop the robot.
const LEAST: (u16, u16) = (56, 16);

pub fn draw(frame: &mut Frame, scene: &Scene) {
    let area = frame.area();
    if area.width < LEAST.0 || area.height < LEAST.1 {
        return draw_small(frame, scene, area);
    }
    let log = if area.height >= 32 { 9 } else { 6 };
    let [header, faults, middle, messages, footer] = Layout::vertical([
        Constraint::Length(3),
        Constraint::Length(2),
        Constraint::Min(6),
        Constraint::Length(log),
        Constraint::Length(1),
    ])
    .areas(area);
    header::draw(frame, scene, header);
    header::draw_faults(frame, scene, faults);
    let most = middle.width.saturating_sub(joints::LEAST_WIDTH);
    let left = motions::width(scene).clamp(26, most.max(26));
    let [motions, joints] =
        Layout::horizontal([Constraint::Length(left), Constraint::Min(0)]).areas(middle);
    motions::draw(frame, scene, motions);
    joints::draw(frame, scene, joints);
    messages::draw(frame, scene, messages);
    draw_footer(frame, footer);
    if scene.help {
        help::draw(frame, scene, area);
    }
}

fn draw_small(frame: &mut Frame, scene: &Scene, area: Rect) {
    let lines = vec![
        Line::from(format!("robot: {}", header::state_words(scene.view))),
        Line::from("SPACE: emergency stop, q: leave"),
        Line::from(format!("the console requires {} x {} characters", LEAST.0, LEAST.1)),
    ];
    frame.render_widget(Paragraph::new(lines), area);
}

fn draw_footer(frame: &mut Frame, area: Rect) {
    let stop = Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD);
    let mut spans = vec![Span::styled(" SPACE STOP ", stop)];
    for (key, does) in [
        ("a", "arm"),
        ("p", "pause"),
        ("r", "return"),
        ("d", "disarm"),
        ("c", "clear"),
        ("+-", "speed"),
        ("q", "quit"),
        ("?", "help"),
    ] {
        spans.push(Span::styled(format!(" {key}"), Style::new().add_modifier(Modifier::BOLD)));
        spans.push(Span::raw(format!(" {does}")));
    }
    frame.render_widget(Paragraph::new(Line::from(spans)), area);
}

/// Pads or cuts a text to a number of columns.
fn fit(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return format!("{text:<width$}");
    }
    let kept: String = text.chars().take(width.saturating_sub(1)).collect();
    if width == 0 { kept } else { format!("{kept}…") }
}

/// Shortens a name to a number of columns by reducing words to initials, beginning with the first word.
fn shorten(name: &str, width: usize) -> String {
    let mut words: Vec<String> = name.split('_').map(str::to_owned).collect();
    let last = words.len() - 1;
    for index in 0..last {
        if words.join("_").chars().count() <= width {
            break;
        }
        words[index] = words[index].chars().take(1).collect();
    }
    fit(&words.join("_"), width)
}
