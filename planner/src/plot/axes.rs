//! Panel: curves, bars or a map over two axes, with ticks, limits, shading and a legend.

use super::scale::{Scale, padded_range};
use super::style::{COLORS, FAINT, INK, px};
use svg::node::element::{Circle, Group, Line, Path, Rectangle, Text};

/// Margin on the left of the drawing area for values, px.
const LEFT: f64 = 52.0;
/// Margin above the drawing area for the title, px.
const TOP: f64 = 24.0;
/// Margin on the right of the drawing area, px.
const RIGHT: f64 = 14.0;
/// Margin below the drawing area, px.
const BOTTOM: f64 = 14.0;
/// Additional margin below the drawing area for the time axis, px.
const TIME_AXIS: f64 = 18.0;
/// Height of a legend line below the title, px.
const LEGEND_LINE: f64 = 15.0;
/// Mean width of a letter in a title, px.
const TITLE_LETTER: f64 = 6.6;
/// Mean width of a letter in a legend, px.
const LEGEND_LETTER: f64 = 5.5;
/// Width of the line sample before a name in a legend, with the space around it, px.
const LEGEND_KEY: f64 = 24.0;

/// Horizontal axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Quantity with unit.
    pub label: String,
    /// Values at the left and right end.
    pub range: [f64; 2],
    /// Spacing of the values.
    pub scale: Scale,
}

/// Curve of a panel.
pub struct Series {
    /// Name in the legend; empty for a curve without one.
    pub name: String,
    /// Index into [`COLORS`].
    pub color: usize,
    /// Points of the line. A NaN interrupts the line.
    pub line: Vec<[f64; 2]>,
    /// Dots; in figures of plans, at the planned samples.
    pub dots: Vec<[f64; 2]>,
    /// SVG dash pattern; empty for a full line.
    pub dash: &'static str,
}

/// Cross at a point, or bar over a span.
#[derive(Clone, Copy)]
pub struct Mark {
    /// Start of the span.
    pub from: f64,
    /// End of the span; equal to the start for a cross.
    pub to: f64,
    /// Value on the vertical axis.
    pub value: f64,
    /// Index into [`COLORS`].
    pub color: usize,
}

/// Rectangle of one colour.
pub struct Cell {
    /// Left and right end.
    pub x: [f64; 2],
    /// Lower and upper end.
    pub y: [f64; 2],
    /// SVG colour.
    pub fill: String,
}

/// Content of a panel over its horizontal axis.
pub enum Content {
    /// Curves over a value axis.
    Curves {
        /// The curves.
        series: Vec<Series>,
        /// Limits as dashed horizontal lines: value and index into [`COLORS`].
        limits: Vec<(f64, usize)>,
        /// Values that the value axis must include.
        include: Vec<f64>,
        /// Minimum margin above and below the values. Smaller differences between values count as zero.
        margin: f64,
        /// Crosses and bars.
        marks: Vec<Mark>,
        /// Scale of the value axis.
        scale: Scale,
    },
    /// Cells over a value axis.
    Map {
        /// The cells.
        cells: Vec<Cell>,
        /// Crosses and bars.
        marks: Vec<Mark>,
    },
    /// Rows of bars.
    Bars(Vec<BarRow>),
}

/// Row of bars with its name.
pub struct BarRow {
    /// Name.
    pub name: String,
    /// Filled spans.
    pub filled: Vec<[f64; 2]>,
    /// Outlined spans, behind the filled ones.
    pub outlined: Vec<[f64; 2]>,
}

/// Panel of a figure.
pub struct Panel {
    /// Title with unit.
    pub title: String,
    /// Horizontal axis.
    pub axis: Axis,
    /// Spans to shade.
    pub shaded: Vec<[f64; 2]>,
    /// Vertical lines with text beside their upper ends.
    pub moments: Vec<(f64, String)>,
    /// Content over the horizontal axis.
    pub content: Content,
}

impl Axis {
    /// Time axis from 0, s.
    pub fn time(duration_s: f64) -> Self {
        Self { label: "time (s)".to_owned(), range: [0.0, duration_s], scale: Scale::Linear }
    }
}

/// Drawing area of a panel in pixels, with both axes.
struct Area<'a> {
    x: f64,
    y: f64,
    width: f64,
    height: f64,
    axis: &'a Axis,
    range: [f64; 2],
    scale: &'a Scale,
}

impl Area<'_> {
    fn x_of(&self, value: f64) -> f64 {
        let [low, high, value] = [self.axis.range[0], self.axis.range[1], value]
            .map(|value| self.axis.scale.coordinate(value));
        px(self.x + self.width * (value - low) / (high - low))
    }

    fn y_of(&self, value: f64) -> f64 {
        let [low, high, value] =
            [self.range[0], self.range[1], value].map(|value| self.scale.coordinate(value));
        px(self.y + self.height * (high - value) / (high - low))
    }
}

impl Panel {
    /// Adds the curves of another panel, dashed and without dots.
    pub(super) fn compare(&mut self, other: &Self) {
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

    /// Returns the ends of the horizontal axis of a panel at `x` with the given width, px.
    pub(super) fn axis_px(x: f64, width: f64) -> [f64; 2] {
        [x + LEFT, x + width - RIGHT]
    }

    /// Draws the panel into a rectangle, px. If `numbers` is true, the values of the horizontal axis are written below it.
    pub(super) fn draw(&self, [x, y]: [f64; 2], [width, height]: [f64; 2], numbers: bool) -> Group {
        let inner_width = width - LEFT - RIGHT;
        let (range, scale) = self.value_axis();
        let legend = self.legend(inner_width);
        let legend_height = LEGEND_LINE * legend.lines_below as f64;
        let area = Area {
            x: x + LEFT,
            y: y + TOP + legend_height,
            width: inner_width,
            height: height - TOP - legend_height - BOTTOM - TIME_AXIS,
            axis: &self.axis,
            range,
            scale,
        };
        let mut group = Group::new();
        for &[from, to] in &self.shaded {
            group =
                group.add(rectangle(&area, [from, to], area.y, area.height).set("fill", "#eef2f6"));
        }
        group = axis_grid(group, &area, numbers);
        group = group.add(
            label(&self.title, area.x, y + 15.0)
                .set("font-weight", 600)
                .set("fill", INK)
                .set("font-size", 12),
        );
        group = match &self.content {
            Content::Curves { series, limits, marks, .. } => {
                group = value_grid(group, &area);
                for &(value, color) in limits {
                    let line = horizontal(&area, value).set("stroke", COLORS[color % COLORS.len()]);
                    group =
                        group.add(line.set("stroke-dasharray", "6 3").set("stroke-opacity", 0.55));
                }
                group = series.iter().fold(group, |group, s| curve(group, &area, s));
                group = marks.iter().fold(group, |group, mark| mark_in(group, &area, mark));
                legend.draw(group, &area, y + 15.0)
            }
            Content::Map { cells, marks } => {
                group = value_grid(group, &area);
                for cell in cells {
                    let [bottom, top] = cell.y.map(|y| area.y_of(y));
                    let cell_px = rectangle(&area, cell.x, top, bottom - top);
                    // Without gaps between neighbours.
                    let cell_px = cell_px.set("shape-rendering", "crispEdges");
                    group = group.add(cell_px.set("fill", &*cell.fill));
                }
                marks.iter().fold(group, |group, mark| mark_in(group, &area, mark))
            }
            Content::Bars(rows) => bars(group, &area, rows),
        };
        self.moments.iter().fold(group, |group, moment| moment_in(group, &area, moment))
    }

    /// Range and scale of the value axis.
    fn value_axis(&self) -> ([f64; 2], &Scale) {
        match &self.content {
            Content::Curves { series, limits, include, margin, marks, scale } => {
                let lines = series.iter().flat_map(|s| s.line.iter().chain(&s.dots)).map(|p| p[1]);
                let asked = marks.iter().map(|mark| mark.value).chain(include.iter().copied());
                let values = lines.chain(limits.iter().map(|l| l.0)).chain(asked);
                (padded_range(values, *margin, scale), scale)
            }
            Content::Map { cells, .. } => {
                let ends = cells.iter().flat_map(|cell| cell.y);
                let bounds = |[low, high]: [f64; 2], y: f64| [low.min(y), high.max(y)];
                (ends.fold([f64::INFINITY, f64::NEG_INFINITY], bounds), &Scale::Linear)
            }
            Content::Bars(_) => ([0.0, 1.0], &Scale::Linear),
        }
    }

    /// Legend on the title line if it fits there, otherwise on lines below.
    fn legend(&self, inner_width: f64) -> Legend<'_> {
        let named: Vec<&Series> = match &self.content {
            Content::Curves { series, .. } => {
                series.iter().filter(|s| !s.name.is_empty()).collect()
            }
            _ => Vec::new(),
        };
        let width = |series: &[&Series]| -> f64 { series.iter().map(|s| entry_width(s)).sum() };
        let title_width = TITLE_LETTER * self.title.chars().count() as f64;
        if title_width + width(&named) <= inner_width {
            return Legend { lines: vec![named], lines_below: 0 };
        }
        let mut lines: Vec<Vec<&Series>> = vec![Vec::new()];
        for series in named {
            let last = lines.len() - 1;
            if !lines[last].is_empty() && width(&lines[last]) + entry_width(series) > inner_width {
                lines.push(vec![series]);
            } else {
                lines[last].push(series);
            }
        }
        Legend { lines_below: lines.len(), lines }
    }
}

/// Names of curves, by line of the legend.
struct Legend<'a> {
    lines: Vec<Vec<&'a Series>>,
    /// Number of lines below the title line.
    lines_below: usize,
}

impl Legend<'_> {
    /// Draws names with samples of their lines, from the right edge to the left.
    fn draw(&self, mut group: Group, area: &Area, title_baseline: f64) -> Group {
        for (number, line) in self.lines.iter().enumerate() {
            let lines_above = if self.lines_below > 0 { number + 1 } else { 0 };
            let baseline = title_baseline + LEGEND_LINE * lines_above as f64;
            let mut x = area.x + area.width;
            for s in line.iter().rev() {
                x -= LEGEND_LETTER * s.name.chars().count() as f64;
                group =
                    group.add(label(&s.name, x, baseline).set("font-size", 10).set("fill", INK));
                let y = px(baseline - 3.5);
                let line = Line::new().set("x1", px(x - 18.0)).set("x2", px(x - 4.0));
                let line = line.set("y1", y).set("y2", y);
                let line =
                    line.set("stroke", COLORS[s.color % COLORS.len()]).set("stroke-width", 2);
                group = group.add(match s.dash {
                    "" => line,
                    dash => line.set("stroke-dasharray", dash),
                });
                x -= LEGEND_KEY;
            }
        }
        group
    }
}

/// Width of a legend entry: name and line sample, px.
fn entry_width(series: &Series) -> f64 {
    LEGEND_LETTER * series.name.chars().count() as f64 + LEGEND_KEY
}

/// Rectangle between two values of the horizontal axis, with its top and height in px.
fn rectangle(area: &Area, [from, to]: [f64; 2], top: f64, height: f64) -> Rectangle {
    Rectangle::new()
        .set("x", area.x_of(from))
        .set("y", px(top))
        .set("width", px(area.x_of(to) - area.x_of(from)))
        .set("height", px(height))
}

fn label(content: &str, x: f64, y: f64) -> Text {
    Text::new(content).set("x", px(x)).set("y", px(y)).set("fill", FAINT)
}

fn horizontal(area: &Area, value: f64) -> Line {
    let y = area.y_of(value);
    Line::new().set("x1", px(area.x)).set("x2", px(area.x + area.width)).set("y1", y).set("y2", y)
}

fn axis_grid(mut group: Group, area: &Area, numbers: bool) -> Group {
    let bottom = area.y + area.height;
    for (value, text) in area.axis.scale.ticks(area.axis.range, 7) {
        let x = area.x_of(value);
        let line =
            Line::new().set("x1", x).set("x2", x).set("y1", px(area.y)).set("y2", px(bottom));
        group = group.add(line.set("stroke", "#e4e7eb"));
        if numbers {
            group = group.add(label(&text, x, bottom + 15.0).set("text-anchor", "middle"));
        }
    }
    if numbers {
        let x = area.x + 0.5 * area.width;
        group = group.add(label(&area.axis.label, x, bottom + 29.0).set("text-anchor", "middle"));
    }
    let frame = Rectangle::new().set("x", px(area.x)).set("y", px(area.y));
    let frame = frame.set("width", px(area.width)).set("height", px(area.height));
    group.add(frame.set("fill", "none").set("stroke", "#cbd2d9"))
}

fn value_grid(mut group: Group, area: &Area) -> Group {
    let [low, high] = area.range;
    for (value, text) in area.scale.ticks(area.range, 4) {
        let is_zero = *area.scale == Scale::Linear && value.abs() < 1e-9 * (high - low);
        let stroke = if is_zero { "#9aa5b1" } else { "#e4e7eb" };
        group = group.add(horizontal(area, value).set("stroke", stroke));
        group =
            group.add(label(&text, area.x - 6.0, area.y_of(value) + 4.0).set("text-anchor", "end"));
    }
    group
}

fn curve(mut group: Group, area: &Area, series: &Series) -> Group {
    let color = COLORS[series.color % COLORS.len()];
    let mut path = String::new();
    for stretch in series.line.split(|point| point[1].is_nan()) {
        for (k, &[t, value]) in stretch.iter().enumerate() {
            let command = if k == 0 { 'M' } else { 'L' };
            path.push_str(&format!("{command}{} {}", area.x_of(t), area.y_of(value)));
        }
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
    let (from, to, y) = (area.x_of(mark.from), area.x_of(mark.to), area.y_of(mark.value));
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

fn moment_in(group: Group, area: &Area, (at, words): &(f64, String)) -> Group {
    let (x, bottom) = (area.x_of(*at), px(area.y + area.height));
    let line = Line::new().set("x1", x).set("x2", x).set("y1", px(area.y)).set("y2", bottom);
    let group = group.add(line.set("stroke", INK).set("stroke-opacity", 0.25));
    if words.is_empty() { group } else { group.add(label(words, x + 4.0, area.y + 12.0)) }
}

fn bars(mut group: Group, area: &Area, rows: &[BarRow]) -> Group {
    let pitch = area.height / rows.len().max(1) as f64;
    for (k, BarRow { name, filled, outlined }) in rows.iter().enumerate() {
        let top = area.y + k as f64 * pitch;
        for &span in outlined {
            let frame = rectangle(area, span, top + 0.06 * pitch, 0.88 * pitch);
            group = group.add(frame.set("rx", 2).set("fill", "none").set("stroke", INK));
        }
        for &[from, to] in filled {
            let bar = rectangle(area, [from, to], top + 0.18 * pitch, 0.64 * pitch);
            group = group.add(bar.set("rx", 2).set("fill", "#8fb4d9"));
        }
        let text = label(name, area.x + 5.0, top + 0.5 * pitch + 3.5);
        group = group.add(text.set("font-size", 10).set("fill", INK).set("font-weight", 600));
    }
    group
}
