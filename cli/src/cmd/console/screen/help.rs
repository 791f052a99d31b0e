//! Help of the console: a list of all keys.

use super::super::scene::Scene;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::widgets::{Block, Clear, Paragraph};

const TEXT: &str = "\
SPACE Esc  EMERGENCY STOP: torque off at once, the robot falls
           afterwards c clears the stop, and a arms
a          arm: torque on, the robot moves slowly to SAFE
1 2 e f .. play the motion with this key in the list
p          pause; after a moment, p resumes
r          return to SAFE
d          disarm: return to SAFE, then torque off
c          clear an emergency stop or fault that has passed
+ -        speed of the motions; loops change at once
↑ ↓        scroll the joints
q Ctrl-C   SAFE, torque off, then leave; again: leave at once,
           the robot then returns to SAFE automatically
→ in the graph: a transition from the row to the column;
  ● playing motion, ▶ playing transition";

/// Draws the help over the screen.
pub fn draw(frame: &mut Frame, _: &Scene, area: Rect) {
    let (width, height) = (64.min(area.width), 16.min(area.height));
    let popup = Rect {
        x: area.x + (area.width - width) / 2,
        y: area.y + (area.height - height) / 2,
        width,
        height,
    };
    frame.render_widget(Clear, popup);
    let block = Block::bordered().title(" Keys (? closes) ");
    frame.render_widget(Paragraph::new(TEXT).block(block), popup);
}
