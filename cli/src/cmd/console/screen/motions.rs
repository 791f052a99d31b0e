//! Motions with their keys, and the motion graph as a table. Rows are origins; columns are the motions that the robot can
//! change to.

use super::super::scene::Scene;
use super::fit;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph};
use rollwalk_host::catalog::{Catalog, Transition};
use rollwalk_protocol::library::RATE_HZ;

/// Maximum length of a name that is shown in full, characters.
const NAME: usize = 18;

/// Position of the robot on the motion graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GraphPosition {
    Motion(usize),
    Between(Transition),
}

fn graph_position(scene: &Scene, catalog: &Catalog) -> Option<GraphPosition> {
    let clip = usize::from(scene.view.status?.clip?);
    if clip < catalog.motions.len() {
        return Some(GraphPosition::Motion(clip));
    }
    catalog.transitions.get(clip - catalog.motions.len()).copied().map(GraphPosition::Between)
}

fn name_width(catalog: &Catalog) -> usize {
    let longest = catalog.motions.iter().map(|motion| motion.name.chars().count()).max();
    longest.unwrap_or(0).clamp(6, NAME)
}

/// Width of the columns before the graph, including blanks: mark, key, name, loop sign and duration.
fn head_width(catalog: &Catalog) -> usize {
    4 + name_width(catalog) + 7
}

/// Width that shows all columns, characters.
pub fn width(scene: &Scene) -> u16 {
    let Some(catalog) = &scene.names.catalog else { return 36 };
    (head_width(catalog) + 2 * catalog.motions.len() + 1) as u16
}

/// Draws the motions and the graph.
pub fn draw(frame: &mut Frame, scene: &Scene, area: Rect) {
    let Some(catalog) = &scene.names.catalog else {
        let text = "\n Motion names are unknown on this\n computer. Keys 1 to 9 play codes\n 1 to \
            9. For names, run rollwalk\n flash, or start the console with\n --library LIB.rwl";
        let block = Block::bordered().title(" Motions ");
        return frame.render_widget(Paragraph::new(text).block(block), area);
    };
    let (width, height) =
        (usize::from(area.width.saturating_sub(2)), usize::from(area.height.saturating_sub(2)));
    let place = graph_position(scene, catalog);
    let graph = head_width(catalog) + 2 * catalog.motions.len() <= width + 1;
    let keys = scene.names.keys();
    let mut lines = Vec::new();
    if graph {
        let mut head = format!("{:>1$}", "s to ", head_width(catalog));
        for key in &keys {
            head += &format!("{} ", key.map_or('-', |key| key.key));
        }
        lines.push(Line::from(head));
    }
    // Rows around the motion that plays.
    let room = height.saturating_sub(lines.len() + 2).max(1);
    let middle = match place {
        Some(GraphPosition::Motion(motion)) => motion,
        Some(GraphPosition::Between(Transition { to, .. })) => to,
        None => 0,
    };
    let first = middle.saturating_sub(room / 2).min(catalog.motions.len().saturating_sub(room));
    let rows = catalog.motions.iter().enumerate().skip(first).take(room);
    for (index, motion) in rows {
        let (mark, style) = mark(place, index);
        let key = keys.get(index).copied().flatten().map_or(' ', |key| key.key);
        let round = if motion.looping { '↻' } else { ' ' };
        let seconds = f64::from(motion.frames) / f64::from(RATE_HZ);
        let name = fit(&motion.name, name_width(catalog));
        let text = format!("{mark} {key} {name} {round}{seconds:>4.1}");
        let mut spans = vec![Span::styled(text, style), Span::raw(" ")];
        if graph {
            let cells = (0..catalog.motions.len()).map(|to| cell(catalog, place, index, to));
            spans.extend(cells);
        }
        lines.push(Line::from(spans));
    }
    let hidden = catalog.motions.len().saturating_sub(room);
    if hidden > 0 {
        lines.push(Line::from(format!("  … and {hidden} more")));
    }
    lines.resize(height.saturating_sub(1), Line::from(""));
    lines.push(Line::from(fit(&now(scene, catalog, place, width), width)));
    let safe = catalog.motions.get(catalog.safe).map_or("", |motion| motion.name.as_str());
    let block = Block::bordered().title(format!(" Motions, {safe} is SAFE "));
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn mark(place: Option<GraphPosition>, index: usize) -> (char, Style) {
    let bold = Style::new().add_modifier(Modifier::BOLD);
    match place {
        Some(GraphPosition::Motion(motion)) if motion == index => {
            ('▶', bold.add_modifier(Modifier::REVERSED))
        }
        Some(GraphPosition::Between(edge)) if edge.to == index => ('⇢', bold),
        Some(GraphPosition::Between(edge)) if edge.from == index => ('·', bold),
        _ => (' ', Style::new()),
    }
}

fn cell(catalog: &Catalog, place: Option<GraphPosition>, from: usize, to: usize) -> Span<'static> {
    let here = Style::new().add_modifier(Modifier::BOLD | Modifier::REVERSED);
    let edge = Transition { from, to };
    if place == Some(GraphPosition::Between(edge)) {
        return Span::styled("▶ ", here);
    }
    if from == to {
        let is_here = place == Some(GraphPosition::Motion(from));
        return if is_here { Span::styled("● ", here) } else { Span::raw("○ ") };
    }
    let joined = catalog.transitions.contains(&edge);
    let reachable = joined && place == Some(GraphPosition::Motion(from));
    let style = if reachable { Style::new().add_modifier(Modifier::BOLD) } else { Style::new() };
    Span::styled(if joined { "→ " } else { "  " }, style)
}

/// Name and progress of the current clip.
fn now(scene: &Scene, catalog: &Catalog, place: Option<GraphPosition>, width: usize) -> String {
    let (Some(status), Some(place)) = (scene.view.status, place) else {
        return " nothing plays".into();
    };
    let name = status.clip.and_then(|clip| catalog.clip(clip)).unwrap_or_default();
    let frames = match place {
        GraphPosition::Motion(motion) => catalog.motions.get(motion).map(|motion| motion.frames),
        GraphPosition::Between(_) => None,
    };
    let Some(frames) = frames else {
        let seconds = f64::from(status.frame) / f64::from(RATE_HZ);
        return format!(" {name}, {seconds:.1} s");
    };
    let part = f64::from(status.frame) / f64::from(frames.saturating_sub(1).max(1));
    let part = part.clamp(0.0, 1.0);
    let room = width.saturating_sub(name.chars().count() + 9).min(20);
    let done = (part * room as f64).round() as usize;
    let bar = "█".repeat(done) + &"░".repeat(room - done);
    format!(" {name} {bar} {:>3.0} %", 100.0 * part)
}
