//! The keys, in words.

use super::super::scene::Scene;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::widgets::{Block, Clear, Paragraph};

const TEXT: &str = "\
SPACE Esc  EMERGENCY STOP: torque off at once, the robot falls
           c and then a lead out of it
a          arm: torque on, it goes to SAFE slowly
1 2 e f .. play a motion, see the list
p          pause; once more after a moment: go on
r          return to SAFE
d          disarm: return to SAFE, then torque off
c          clear an emergency stop or fault that has passed
+ -        speed of the motions, for loops at once
↑ ↓        more joints
q Ctrl-C   go home, torque off, leave; again: leave at once,
           the robot then returns by itself
→ in the graph: from this row's motion there is a way to the
  column's; ● here, ▶ on the way";

/// Draws the help over everything else.
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
