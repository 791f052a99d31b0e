//! Messages with their time since the start, s; the newest at the bottom.

use super::super::scene::Scene;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::text::Line;
use ratatui::widgets::{Block, Paragraph};
use rollwalk_host::operator::{Message, Weight};

/// Draws as many of the newest messages as fit.
pub fn draw(frame: &mut Frame, scene: &Scene, area: Rect) {
    let room = usize::from(area.height.saturating_sub(1));
    let width = usize::from(area.width);
    let mut lines: Vec<Line> = Vec::new();
    for message in scene.view.messages.iter().rev() {
        let mut wrapped = wrap(message, width);
        if lines.len() + wrapped.len() > room {
            break;
        }
        wrapped.reverse();
        lines.append(&mut wrapped);
    }
    lines.reverse();
    let block = Block::new().borders(ratatui::widgets::Borders::TOP).title(" Messages ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// Wraps a message to the width of the screen.
fn wrap(message: &Message, width: usize) -> Vec<Line<'static>> {
    let (sign, style) = match message.weight {
        Weight::Note => (' ', Style::new()),
        Weight::Refused => ('✗', Style::new().fg(Color::Yellow)),
        Weight::Warning => ('!', Style::new().fg(Color::Red)),
    };
    let seconds = message.at_us as f64 * 1e-6;
    let mut head = format!("{seconds:>8.1} {sign} ");
    let indent = head.chars().count();
    let mut lines = Vec::new();
    for word in message.text.split_whitespace() {
        let used = head.chars().count();
        if used > indent && used + word.chars().count() > width {
            lines.push(Line::styled(head.trim_end().to_owned(), style));
            head = " ".repeat(indent);
        }
        head.push_str(word);
        head.push(' ');
    }
    lines.push(Line::styled(head.trim_end().to_owned(), style));
    lines
}
