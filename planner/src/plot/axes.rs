//! One panel: a value over time with axes, ticks, limits, shading and a legend.

use super::{COLORS, FAINT, INK, px};
use svg::node::element::{Circle, Group, Line, Path, Rectangle, Text};

/// Margins around the drawing area, px: left for numbers, top for the title, right, bottom; and below it for time.
const LEFT: f64 = 52.0;
const TOP: f64 = 24.0;
const RIGHT: f64 = 14.0;
const BOTTOM: f64 = 14.0;
const TIME_AXIS: f64 = 18.0;
/// Height of a legend that has a line of its own below the title.
const LEGEND_LINE: f64 = 15.0;
/// Mean width of a letter in a title and in a legend, px.
const TITLE_LETTER: f64 = 6.6;
const LEGEND_LETTER: f64 = 5.5;
/// Width of the piece of line before a name in a legend, with the space around it, px.
const LEGEND_KEY: f64 = 24.0;

/// A curve.
pub struct Series {
    /// Name in the legend; empty for none.
    pub name: String,
    /// Index into [`COLORS`].
    pub color: usize,
    /// Points of the line: time in s, value.
    pub line: Vec<[f64; 2]>,
    /// Dots at planned samples.
    pub dots: Vec<[f64; 2]>,
    /// SVG dash pattern; empty for a full line.
    pub dash: &'static str,
}

/// Target value at a time or over a span of time.
#[derive(Clone, Copy)]
pub struct Mark {
    /// Start of the span, s.
    pub from_s: f64,
    /// End of the span, s; equal to the start for a single time.
    pub to_s: f64,
    /// The value.
    pub value: f64,
    /// Index into [`COLORS`].
    pub color: usize,
}

/// Content of a panel over its time axis.
pub enum Content {
    /// Curves over a value axis.
    Curves {
        /// The curves.
        series: Vec<Series>,
        /// Limits as dashed horizontal lines: value and index into [`COLORS`].
        limits: Vec<(f64, usize)>,
        /// Values that the value axis must include.
        include: Vec<f64>,
        /// Marks of target values.
        marks: Vec<Mark>,
    },
    /// One bar row for each name, filled over spans of time.
    Bars(Vec<(String, Vec<[f64; 2]>)>),
}

/// A panel.
pub struct Panel {
    /// Title with unit.
    pub title: String,
    /// Duration of the time axis, s.
    pub duration_s: f64,
    /// Spans of time to shade, s.
    pub shaded: Vec<[f64; 2]>,
    /// Content over the time axis.
    pub content: Content,
}

/// The drawing area of a panel in pixels with the scales of both axes.
struct Area {
    x: f64,
    y: f64,
    width: f64,
    height: f64,
    duration_s: f64,
    range: [f64; 2],
}

impl Area {
    fn x_of(&self, time_s: f64) -> f64 {
        px(self.x + self.width * time_s / self.duration_s)
    }

    fn y_of(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        px(self.y + self.height * (high - value) / (high - low))
    }
}

impl Panel {
    /// Adds the curves of another panel, dashed and without dots.
    pub fn compare(&mut self, other: &Self) {
        let (Content::Curves { series, .. }, Content::Curves { series: others, .. }) =
            (&mut self.content, &other.content)
        else {
            return;
        };
        series.extend(others.iter().map(|of| Series {
            name: String::new(),
            color: of.color,
            line: of.line.clone(),
            dots: Vec::new(),
            dash: "3 3",
        }));
    }

    /// Where the time axis of a panel at `x` of this width begins and ends on the page, px.
    pub fn time_axis_px(x: f64, width: f64) -> [f64; 2] {
        [x + LEFT, x + width - RIGHT]
    }

    /// Draws the panel into a rectangle, px; `time_axis` adds the numbers of the time axis below it.
    pub fn draw(&self, [x, y]: [f64; 2], [width, height]: [f64; 2], time_axis: bool) -> Group {
        let range = match &self.content {
            Content::Curves { series, limits, include, marks } => {
                let lines = series.iter().flat_map(|s| s.line.iter().chain(&s.dots)).map(|p| p[1]);
                let asked = marks.iter().map(|mark| mark.value).chain(include.iter().copied());
                padded_range(lines.chain(limits.iter().map(|l| l.0)).chain(asked))
            }
            Content::Bars(_) => [0.0, 1.0],
        };
        let inner_width = width - LEFT - RIGHT;
        let title_width = TITLE_LETTER * self.title.chars().count() as f64;
        let fits = title_width + self.legend_width() <= inner_width;
        let legend_line = if fits { 0.0 } else { LEGEND_LINE };
        let area = Area {
            x: x + LEFT,
            y: y + TOP + legend_line,
            width: inner_width,
            height: height - TOP - legend_line - BOTTOM - TIME_AXIS,
            duration_s: self.duration_s,
            range,
        };
        let mut group = Group::new();
        for &[from, to] in &self.shaded {
            group = group.add(
                Rectangle::new()
                    .set("x", area.x_of(from))
                    .set("y", px(area.y))
                    .set("width", px(area.x_of(to) - area.x_of(from)))
                    .set("height", px(area.height))
                    .set("fill", "#eef2f6"),
            );
        }
        group = time_grid(group, &area, time_axis);
        group = group.add(
            label(&self.title, area.x, y + 15.0)
                .set("font-weight", 600)
                .set("fill", INK)
                .set("font-size", 12),
        );
        match &self.content {
            Content::Curves { series, limits, marks, .. } => {
                group = value_grid(group, &area);
                for &(value, color) in limits {
                    let line = horizontal(&area, value).set("stroke", COLORS[color % COLORS.len()]);
                    group =
                        group.add(line.set("stroke-dasharray", "6 3").set("stroke-opacity", 0.55));
                }
                group = series.iter().fold(group, |group, s| curve(group, &area, s));
                group = marks.iter().fold(group, |group, mark| mark_in(group, &area, mark));
                legend(group, &area, series, y + 15.0 + legend_line)
            }
            Content::Bars(rows) => bars(group, &area, rows),
        }
    }

    fn legend_width(&self) -> f64 {
        let Content::Curves { series, .. } = &self.content else { return 0.0 };
        let named = series.iter().filter(|s| !s.name.is_empty());
        named.map(|s| LEGEND_LETTER * s.name.chars().count() as f64 + LEGEND_KEY).sum()
    }
}

fn label(content: &str, x: f64, y: f64) -> Text {
    Text::new(content).set("x", px(x)).set("y", px(y)).set("fill", FAINT)
}

fn horizontal(area: &Area, value: f64) -> Line {
    let y = area.y_of(value);
    Line::new().set("x1", px(area.x)).set("x2", px(area.x + area.width)).set("y1", y).set("y2", y)
}

fn time_grid(mut group: Group, area: &Area, numbers: bool) -> Group {
    let bottom = area.y + area.height;
    for t in ticks([0.0, area.duration_s], 7) {
        let x = area.x_of(t);
        let line =
            Line::new().set("x1", x).set("x2", x).set("y1", px(area.y)).set("y2", px(bottom));
        group = group.add(line.set("stroke", "#e4e7eb"));
        if numbers {
            let text = number(t, area.duration_s);
            group = group.add(label(&text, x, bottom + 15.0).set("text-anchor", "middle"));
        }
    }
    if numbers {
        let x = area.x + 0.5 * area.width;
        group = group.add(label("time (s)", x, bottom + 29.0).set("text-anchor", "middle"));
    }
    let frame = Rectangle::new().set("x", px(area.x)).set("y", px(area.y));
    let frame = frame.set("width", px(area.width)).set("height", px(area.height));
    group.add(frame.set("fill", "none").set("stroke", "#cbd2d9"))
}

fn value_grid(mut group: Group, area: &Area) -> Group {
    let [low, high] = area.range;
    for value in ticks(area.range, 4) {
        let stroke = if value.abs() < 1e-9 * (high - low) { "#9aa5b1" } else { "#e4e7eb" };
        group = group.add(horizontal(area, value).set("stroke", stroke));
        let text = number(value, high - low);
        group =
            group.add(label(&text, area.x - 6.0, area.y_of(value) + 4.0).set("text-anchor", "end"));
    }
    group
}

fn curve(mut group: Group, area: &Area, series: &Series) -> Group {
    let color = COLORS[series.color % COLORS.len()];
    let mut path = String::new();
    for (k, &[t, value]) in series.line.iter().enumerate() {
        let command = if k == 0 { 'M' } else { 'L' };
        path.push_str(&format!("{command}{} {}", area.x_of(t), area.y_of(value)));
    }
    let line = Path::new().set("d", path).set("fill", "none").set("stroke", color);
    let line = line.set("stroke-width", 1.6).set("stroke-linejoin", "round");
    group = group.add(match series.dash {
        "" => line,
        dash => line.set("stroke-dasharray", dash),
    });
    for &[t, value] in &series.dots {
        let dot = Circle::new().set("cx", area.x_of(t)).set("cy", area.y_of(value));
        group = group.add(dot.set("r", 1.9).set("fill", color));
    }
    group
}

fn mark_in(group: Group, area: &Area, mark: &Mark) -> Group {
    let (from, to, y) = (area.x_of(mark.from_s), area.x_of(mark.to_s), area.y_of(mark.value));
    let color = COLORS[mark.color % COLORS.len()];
    let path = if to > from {
        Path::new()
            .set("d", format!("M{from} {y}H{to}"))
            .set("stroke-width", 5)
            .set("stroke-opacity", 0.45)
    } else {
        // A cross.
        let arm = 5.0;
        let [left, right, top, bottom] = [from - arm, from + arm, y - arm, y + arm].map(px);
        Path::new()
            .set("d", format!("M{left} {top}L{right} {bottom}M{left} {bottom}L{right} {top}"))
            .set("stroke-width", 2)
    };
    group.add(path.set("stroke", color).set("fill", "none"))
}

/// Draws names with a sample of their line, from the right edge to the left.
fn legend(mut group: Group, area: &Area, series: &[Series], baseline: f64) -> Group {
    let mut x = area.x + area.width;
    for s in series.iter().rev().filter(|s| !s.name.is_empty()) {
        x -= LEGEND_LETTER * s.name.chars().count() as f64;
        group = group.add(label(&s.name, x, baseline).set("font-size", 10).set("fill", INK));
        let y = px(baseline - 3.5);
        let line =
            Line::new().set("x1", px(x - 18.0)).set("x2", px(x - 4.0)).set("y1", y).set("y2", y);
        let line = line.set("stroke", COLORS[s.color % COLORS.len()]).set("stroke-width", 2);
        group = group.add(match s.dash {
            "" => line,
            dash => line.set("stroke-dasharray", dash),
        });
        x -= LEGEND_KEY;
    }
    group
}

fn bars(mut group: Group, area: &Area, rows: &[(String, Vec<[f64; 2]>)]) -> Group {
    let pitch = area.height / rows.len().max(1) as f64;
    for (k, (name, spans)) in rows.iter().enumerate() {
        let top = area.y + k as f64 * pitch;
        for &[from, to] in spans {
            let bar = Rectangle::new().set("x", area.x_of(from)).set("y", px(top + 0.18 * pitch));
            let bar = bar.set("width", px(area.x_of(to) - area.x_of(from)));
            group =
                group.add(bar.set("height", px(0.64 * pitch)).set("rx", 2).set("fill", "#8fb4d9"));
        }
        let text = label(name, area.x + 5.0, top + 0.5 * pitch + 3.5);
        group = group.add(text.set("font-size", 10).set("fill", INK).set("font-weight", 600));
    }
    group
}

/// Range of the values with a margin; never empty.
fn padded_range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        return [-1.0, 1.0];
    }
    let air = (0.07 * (high - low)).max(1e-3 * high.abs().max(low.abs())).max(1e-3);
    [low - air, high + air]
}

/// Round numbers inside a range, about `wanted` of them, in steps of 1, 2 or 5 times a power of ten.
fn ticks([low, high]: [f64; 2], wanted: usize) -> Vec<f64> {
    let rough = (high - low) / wanted as f64;
    let power = 10.0_f64.powf(rough.log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= rough).unwrap_or(rough);
    let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    (first..=last).map(|k| k as f64 * step).collect()
}

/// Number of a tick with enough decimals to differ from its neighbours.
fn number(value: f64, span: f64) -> String {
    let decimals = (1.0 - (span / 4.0).log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.replace('-', "−") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks([0.0, 2.0], 4), [0.0, 0.5, 1.0, 1.5, 2.0]);
        assert_eq!(ticks([-0.31, 0.29], 4), [-0.2, 0.0, 0.2]);
        assert_eq!(ticks([0.0, 30.0], 7), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0]);
    }

    #[test]
    fn numbers_carry_the_decimals_they_need() {
        assert_eq!(number(0.05, 0.2), "0.05");
        assert_eq!(number(-0.5, 2.0), "−0.5");
        assert_eq!(number(-0.0, 2.0), "0");
        assert_eq!(number(20.0, 60.0), "20");
    }

    #[test]
    fn a_constant_still_has_a_range() {
        let [low, high] = padded_range([0.3; 5].into_iter());
        assert!(low < 0.3 && high > 0.3);
    }
}
