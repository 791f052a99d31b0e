//! Charts as SVG text: of benchmarks, runs and sweeps.

pub use super::axes::{Axis, Cell, Content, Mark, Panel, Series};
pub use super::scale::Scale;
pub use super::style::COLORS;

/// Curve: name and points.
pub type Curve = (String, Vec<(f64, f64)>);

/// Texts of a chart.
pub struct Labels<'a> {
    /// Title.
    pub title: &'a str,
    /// Horizontal axis with unit.
    pub x: &'a str,
    /// Vertical axis with unit.
    pub y: &'a str,
}

/// Size of a single chart, px.
const SIZE: [f64; 2] = [720.0, 380.0];
/// Size of a panel in a chart of several, px.
const PANEL: [f64; 2] = [1060.0, 200.0];
/// Maximum number of points of a curve with dots.
const DOTS_MAX: usize = 40;

/// Draws curves over linear axes.
pub fn linear(labels: &Labels<'_>, curves: &[Curve]) -> String {
    single(labels, curves, &Scale::Linear)
}

/// Draws curves over logarithmic axes. Values that are not positive are left out.
pub fn logarithmic(labels: &Labels<'_>, curves: &[Curve]) -> String {
    let positive = |(name, points): &Curve| {
        (name.clone(), points.iter().copied().filter(|(x, y)| *x > 0.0 && *y > 0.0).collect())
    };
    let curves: Vec<Curve> = curves.iter().map(positive).collect();
    single(labels, &curves, &Scale::Logarithmic)
}

fn single(labels: &Labels<'_>, curves: &[Curve], scale: &Scale) -> String {
    let axis = axis(labels.x, curves.iter(), scale);
    let panel = panel(labels.y, axis, curves, Vec::new());
    page(vec![(SIZE[0], vec![panel])], SIZE[1], [labels.title.to_owned(), String::new()])
}

/// Draws panels of curves over linear axes, one below the other. Each panel has a title with the unit of its values. All panels
/// have the horizontal axis `x` in common, and text marks at values of that axis.
pub fn panels(
    title: &str,
    x: &str,
    panels: &[(String, Vec<Curve>)],
    marks: &[(f64, String)],
) -> String {
    let axis = axis(x, panels.iter().flat_map(|(_, curves)| curves), &Scale::Linear);
    let column = panels.iter();
    let column =
        column.map(|(title, curves)| panel(title, axis.clone(), curves, marks.to_vec())).collect();
    page(vec![(PANEL[0], column)], PANEL[1], [title.to_owned(), String::new()])
}

/// Draws columns of panels below a title and a line of facts. Columns have the given widths, px, and panels at least the given
/// height.
pub fn page(columns: Vec<(f64, Vec<Panel>)>, least_height: f64, texts: [String; 2]) -> String {
    super::page::page(columns, least_height, texts)
}

/// Horizontal axis that covers all curves.
fn axis<'c>(label: &str, curves: impl Iterator<Item = &'c Curve>, scale: &Scale) -> Axis {
    let places = curves.flat_map(|(_, points)| points).map(|point| point.0);
    let bounds = |[low, high]: [f64; 2], x: f64| [low.min(x), high.max(x)];
    let [low, high] = places.fold([f64::INFINITY, f64::NEG_INFINITY], bounds);
    let range = match scale {
        // No points.
        _ if low > high => [0.5, 1.5],
        Scale::Logarithmic => [0.85 * low, 1.18 * high],
        // A single position also needs a range.
        _ if low == high => [low - 0.5, high + 0.5],
        _ => [low, high],
    };
    Axis { label: label.to_owned(), range, scale: scale.clone() }
}

fn panel(title: &str, axis: Axis, curves: &[Curve], moments: Vec<(f64, String)>) -> Panel {
    let series = |(color, (name, points)): (usize, &Curve)| {
        let line: Vec<[f64; 2]> = points.iter().map(|&(x, y)| [x, y]).collect();
        let dots = if line.len() <= DOTS_MAX { line.clone() } else { Vec::new() };
        Series { name: name.clone(), color, line, dots, dash: "" }
    };
    let content = Content::Curves {
        series: curves.iter().enumerate().map(series).collect(),
        limits: Vec::new(),
        include: Vec::new(),
        margin: 0.0,
        marks: Vec::new(),
        scale: axis.scale.clone(),
    };
    Panel { title: title.to_owned(), axis, shaded: Vec::new(), moments, content }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_have_their_labels_curves_and_no_odd_numbers() {
        let labels = Labels { title: "a & b", x: "time, s", y: "way, m" };
        let curves = [
            ("up".to_owned(), vec![(0.0, 1e-3), (1.0, 20.0)]),
            ("flat".to_owned(), vec![(1.0, 0.0)]),
        ];
        let panels = panels("a & b", "time, s", &[("way, m".to_owned(), curves.to_vec())], &[]);
        let few = [("none".to_owned(), vec![]), ("up".to_owned(), vec![(2.0, 2.0)])];
        let drawn = [linear, logarithmic].map(|draw| (draw(&labels, &curves), draw(&labels, &few)));
        for svg in drawn.iter().flat_map(|(one, other)| [one, other]).chain([&panels]) {
            for words in ["a &amp; b", "time, s", "way, m", "up"] {
                assert!(svg.contains(words), "{words}: {svg}");
            }
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
        // Logarithms of 0 are left out.
        let dots = |svg: &str| svg.matches("<circle").count();
        assert_eq!([dots(&drawn[0].0), dots(&drawn[1].0)], [3, 1]);
    }
}
