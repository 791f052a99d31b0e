//! SVG figure of a [`Picture`]. A cross marks a point whose motion fails the checks.

use super::picture::{Field, Kind, Picture, Values};
use rollwalk_planner::plot::chart::{
    Axis, COLORS, Cell, Content, Mark, Panel, Scale, Series, page,
};

/// Maximum number of lines in a figure. Further lines would be indistinguishable.
const LINES_MAX: usize = 12;
/// Maximum number of maps in a figure.
const MAPS_MAX: usize = 9;
/// Width and height of a line figure, px.
const LINES: [f64; 2] = [720.0, 380.0];
/// Width and height of a map, px.
const MAP: [f64; 2] = [420.0, 320.0];
/// Width of the colour scale beside maps, px.
const SCALE_WIDTH: f64 = 220.0;
/// Index of the darkest colour in [`COLORS`].
const INK: usize = COLORS.len() - 1;
/// Colours from the smallest to the largest value: light to dark in equal steps, suitable for colour-blind readers (after
/// viridis).
const RAMP: [[u8; 3]; 5] =
    [[253, 231, 37], [94, 201, 98], [33, 145, 140], [59, 82, 139], [68, 1, 84]];
const NOTHING: &str = "#e1e1e1";
/// Number of cells in the colour scale.
const STEPS: usize = 64;

/// Draws a figure as SVG text.
pub fn draw(picture: &Picture) -> String {
    let Picture { title, quantity, kind } = picture;
    let title_without = |more: usize, what: &str| match more {
        0 => title.clone(),
        more => format!("{title} (without {more} more {what})"),
    };
    match kind {
        Kind::Lines { x, at, series } => {
            let shown = &series[..series.len().min(LINES_MAX)];
            let title = title_without(series.len() - shown.len(), "lines");
            let [low, high] = range(at.iter().copied());
            let axis = Axis { label: x.clone(), range: [low, high], scale: Scale::Linear };
            lines(title, quantity, axis, at, shown)
        }
        Kind::Choices { axis, labels, series } => {
            let shown = &series[..series.len().min(LINES_MAX)];
            let title = title_without(series.len() - shown.len(), "combinations");
            let at: Vec<f64> = (0..labels.len()).map(|k| k as f64).collect();
            let range = [-0.5, (labels.len() as f64 - 0.5).max(0.5)];
            let axis = Axis { label: axis.clone(), range, scale: Scale::Names(labels.clone()) };
            lines(title, quantity, axis, &at, shown)
        }
        Kind::Maps { axes, at, panels } => {
            let shown = &panels[..panels.len().min(MAPS_MAX)];
            maps(title_without(panels.len() - shown.len(), "maps"), quantity, axes, at, shown)
        }
    }
}

/// Range of values, which is never empty.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let bounds = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], bounds);
    if low > high {
        return [0.0, 1.0];
    }
    let air = if high > low { 0.0 } else { (1e-3 * high.abs()).max(1e-9) };
    [low - air, high + air]
}

fn facts(values: &[&Values]) -> String {
    let any = values.iter().any(|values| values.contains(&Field::Lost));
    if any { "× fails in simulation".to_owned() } else { String::new() }
}

/// Draws values over a numeric axis as lines with dots, or over names as dots alone.
fn lines(
    title: String,
    quantity: &str,
    axis: Axis,
    at: &[f64],
    fields: &[(String, Values)],
) -> String {
    let [low, high] = range(fields.iter().flat_map(|(_, values)| values).filter_map(Field::value));
    let (mut series, mut marks, mut crossed) = (Vec::new(), Vec::new(), 0);
    for (number, (name, values)) in fields.iter().enumerate() {
        let mut points: Vec<(f64, Field)> =
            at.iter().copied().zip(values.iter().copied()).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let value = |(at, field): &(f64, Field)| [*at, field.value().unwrap_or(f64::NAN)];
        let all: Vec<[f64; 2]> = points.iter().map(value).collect();
        let dots = all.iter().copied().filter(|[_, value]| !value.is_nan()).collect();
        let line = if axis.scale == Scale::Linear { all } else { Vec::new() };
        let dash = if number < COLORS.len() { "" } else { "3 3" };
        series.push(Series { name: name.clone(), color: number, line, dots, dash });
        let lost = points.iter().filter(|(_, field)| *field == Field::Lost);
        let lost: Vec<f64> = lost.map(|(at, _)| *at).collect();
        if !lost.is_empty() {
            // Crosses are below all values, with one row for each line.
            crossed += 1;
            let value = low - 0.05 * (high - low) * f64::from(crossed);
            marks.extend(lost.iter().map(|&at| Mark { from: at, to: at, value, color: number }));
        }
    }
    let values: Vec<&Values> = fields.iter().map(|(_, values)| values).collect();
    let content = Content::Curves {
        series,
        limits: Vec::new(),
        include: vec![low, high],
        margin: 0.0,
        marks,
        scale: Scale::Linear,
    };
    page(vec![(LINES[0], vec![panel(quantity, axis, content)])], LINES[1], [title, facts(&values)])
}

fn panel(title: &str, axis: Axis, content: Content) -> Panel {
    Panel { title: title.to_owned(), axis, shaded: Vec::new(), moments: Vec::new(), content }
}

/// Draws maps with a common colour scale.
fn maps(
    title: String,
    quantity: &str,
    axes: &[String; 2],
    at: &[Vec<f64>; 2],
    maps: &[(String, Vec<Values>)],
) -> String {
    let fields: Vec<&Values> = maps.iter().flat_map(|(_, rows)| rows).collect();
    let values = range(fields.iter().flat_map(|row| row.iter()).filter_map(Field::value));
    let [ys, xs] = at.each_ref().map(|at| edges(at));
    let mut columns: Vec<(f64, Vec<Panel>)> = Vec::new();
    let rows = (maps.len() as f64).sqrt().ceil().max(1.0) as usize;
    for column in maps.chunks(rows) {
        let map = |(name, rows): &(String, Vec<Values>)| {
            let (mut cells, mut marks) = (Vec::new(), Vec::new());
            for ((y, at_y), row) in ys.iter().zip(&at[0]).zip(rows) {
                for ((x, at_x), field) in xs.iter().zip(&at[1]).zip(row) {
                    let fill =
                        field.value().map_or(NOTHING.to_owned(), |value| ramp(value, values));
                    cells.push(Cell { x: *x, y: *y, fill });
                    if *field == Field::Lost {
                        marks.push(Mark { from: *at_x, to: *at_x, value: *at_y, color: INK });
                    }
                }
            }
            let range = range(xs.iter().flatten().copied());
            let axis = Axis { label: axes[1].clone(), range, scale: Scale::Linear };
            panel(&format!("{name}: {}", axes[0]), axis, Content::Map { cells, marks })
        };
        columns.push((MAP[0], column.iter().map(map).collect()));
    }
    columns.push((SCALE_WIDTH, vec![color_scale(quantity, values)]));
    page(columns, MAP[1], [title, facts(&fields)])
}

/// Edges of the cells around values, in the order of the values. Cells meet midway between neighbours.
fn edges(at: &[f64]) -> Vec<[f64; 2]> {
    let mut sorted = at.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let cell = |value: &f64| {
        let k = sorted.iter().position(|other| other == value).unwrap_or(0);
        let half = |a: usize, b: usize| 0.5 * (sorted[b] - sorted[a]);
        let [below, above] =
            [k.checked_sub(1).map(|j| half(j, k)), (k + 1 < sorted.len()).then(|| half(k, k + 1))];
        // A single value also has a cell.
        let alone = 0.05 * value.abs().max(0.1);
        let [below, above] = [below.or(above), above.or(below)].map(|half| half.unwrap_or(alone));
        [value - below, value + above]
    };
    at.iter().map(cell).collect()
}

fn ramp(value: f64, [low, high]: [f64; 2]) -> String {
    let along = ((value - low) / (high - low)).clamp(0.0, 1.0) * (RAMP.len() - 1) as f64;
    let k = (along as usize).min(RAMP.len() - 2);
    let [r, g, b] = [0, 1, 2].map(|c| {
        let (from, to) = (f64::from(RAMP[k][c]), f64::from(RAMP[k + 1][c]));
        (from + (along - k as f64) * (to - from)).round() as u8
    });
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn color_scale(quantity: &str, values: [f64; 2]) -> Panel {
    let step = (values[1] - values[0]) / STEPS as f64;
    let cell = |k: usize| {
        let low = values[0] + step * k as f64;
        Cell { x: [0.0, 1.0], y: [low, low + step], fill: ramp(low + 0.5 * step, values) }
    };
    let axis = Axis { label: String::new(), range: [0.0, 1.0], scale: Scale::Names(Vec::new()) };
    let cells = (0..STEPS).map(cell).collect();
    panel(quantity, axis, Content::Map { cells, marks: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::Field::{Absent, Holds, Lost};
    use super::*;

    fn count(svg: &str, part: &str) -> usize {
        svg.matches(part).count()
    }

    #[test]
    fn what_does_not_hold_has_a_cross_and_no_dot() {
        let values = vec![Holds(1.0), Lost, Holds(3.0), Absent];
        let picture = |kind| Picture { title: "t".into(), quantity: "q, m".into(), kind };
        let series =
            vec![("a & b".to_owned(), values.clone()), ("c".to_owned(), vec![Holds(2.0); 4])];
        let at = vec![0.1, 0.2, 0.3, 0.4];
        let svg = draw(&picture(Kind::Lines { x: "x, m".into(), at, series: series.clone() }));
        assert_eq!((count(&svg, "<circle"), count(&svg, "× fails in simulation")), (6, 1), "{svg}");
        assert!(svg.contains("a &amp; b") && !svg.contains("NaN"));
        let labels = ["p", "q", "r", "s"].map(str::to_owned).to_vec();
        let svg = draw(&picture(Kind::Choices { axis: "x".into(), labels, series }));
        assert_eq!(count(&svg, "<circle"), 6);
        for name in ["p", "q", "r", "s"] {
            assert!(svg.contains(&format!("\n{name}\n")), "{name}: {svg}");
        }
    }

    #[test]
    fn maps_have_a_field_for_every_point_also_where_none_holds() {
        let kind = |cells: Vec<Values>| Kind::Maps {
            axes: ["y".into(), "x".into()],
            at: [vec![0.0, 1.0], vec![0.2, 0.1, 0.4]],
            panels: vec![("trot".into(), cells.clone()), ("walk".into(), cells)],
        };
        let draw =
            |cells| draw(&Picture { title: "t".into(), quantity: "q".into(), kind: kind(cells) });
        let whole = draw(vec![vec![Holds(1.0); 3], vec![Holds(2.0), Lost, Holds(3.0)]]);
        // Both ends of the ramp, and two cells in which no plan passes.
        for (color, fields) in [("#fde725", 6), ("#440154", 2), (NOTHING, 2)] {
            assert_eq!(count(&whole, &format!("fill=\"{color}\"")), fields, "{color}");
        }
        let none = draw(vec![vec![Lost; 3], vec![Absent; 3]]);
        assert_eq!(count(&none, &format!("fill=\"{NOTHING}\"")), 12);
        assert!(!none.contains("NaN") && !none.contains("inf"));
    }

    #[test]
    fn fields_meet_in_the_middle() {
        assert_eq!(edges(&[0.0, 4.0, 1.0]), [[-0.5, 0.5], [2.5, 5.5], [0.5, 2.5]]);
        assert_eq!(edges(&[0.2]).len(), 1);
    }
}
