//! Line charts of benchmarks as SVG.

use miette::miette;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::ops::Range;

/// A curve: name and points.
pub type Curve = (String, Vec<(f64, f64)>);

/// What a chart says around its curves.
pub struct Labels<'a> {
    /// Title.
    pub title: &'a str,
    /// Horizontal axis with unit.
    pub x: &'a str,
    /// Vertical axis with unit.
    pub y: &'a str,
}

const COLORS: [RGBColor; 6] = [
    RGBColor(31, 119, 180),
    RGBColor(214, 39, 40),
    RGBColor(44, 160, 44),
    RGBColor(148, 103, 189),
    RGBColor(255, 127, 14),
    RGBColor(90, 90, 90),
];

/// Draws curves of positive values over logarithmic axes, as the text of an SVG file.
///
/// # Errors
/// What plotters reports.
pub fn draw(labels: &Labels, curves: &[Curve]) -> miette::Result<String> {
    let points = || curves.iter().flat_map(|(_, points)| points).filter(|p| p.1 > 0.0);
    let range = |pick: fn(&(f64, f64)) -> f64| {
        points()
            .map(pick)
            .fold((f64::INFINITY, 0.0f64), |(low, high), value| (low.min(value), high.max(value)))
    };
    let ((x0, x1), (y0, y1)) = (range(|p| p.0), range(|p| p.1));
    svg(labels, |root| plot(root, labels, [0.85 * x0..1.18 * x1, 0.7 * y0..1.4 * y1], curves))
}

/// The text of an SVG file with what `plot` draws.
fn svg(
    labels: &Labels,
    plot: impl FnOnce(
        &DrawingArea<SVGBackend<'_>, Shift>,
    ) -> Result<(), DrawingAreaErrorKind<std::io::Error>>,
) -> miette::Result<String> {
    let mut svg = String::new();
    let root = SVGBackend::with_string(&mut svg, (760, 460)).into_drawing_area();
    plot(&root)
        .and_then(|()| root.present())
        .map_err(|error| miette!("cannot draw {}: {error}", labels.title))?;
    drop(root);
    Ok(svg)
}

/// Draws curves over linear axes, as the text of an SVG file.
///
/// # Errors
/// What plotters reports.
pub fn draw_linear(labels: &Labels, curves: &[Curve]) -> miette::Result<String> {
    let points = || curves.iter().flat_map(|(_, points)| points);
    let range = |pick: fn(&(f64, f64)) -> f64| {
        let bounds = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
        let (low, high) = points().map(pick).fold((f64::INFINITY, f64::NEG_INFINITY), bounds);
        let margin = 0.05 * (high - low).max(1e-9);
        low - margin..high + margin
    };
    svg(labels, |root| plot_linear(root, labels, [range(|p| p.0), range(|p| p.1)], curves))
}

fn plot_linear<'a>(
    root: &DrawingArea<SVGBackend<'a>, Shift>,
    labels: &Labels,
    [x, y]: [Range<f64>; 2],
    curves: &[Curve],
) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(root)
        .caption(labels.title, ("sans-serif", 16))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(x, y)?;
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(labels.x).y_desc(labels.y).light_line_style(WHITE).draw()?;
    for ((name, points), color) in curves.iter().zip(COLORS.iter().cycle()) {
        chart
            .draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(2)))?
            .label(name)
            .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .border_style(BLACK.mix(0.3))
        .background_style(WHITE.mix(0.9))
        .draw()
}

fn plot<'a>(
    root: &DrawingArea<SVGBackend<'a>, Shift>,
    labels: &Labels,
    [x, y]: [Range<f64>; 2],
    curves: &[Curve],
) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(root)
        .caption(labels.title, ("sans-serif", 16))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(x.log_scale(), y.log_scale())?;
    chart
        .configure_mesh()
        .x_desc(labels.x)
        .y_desc(labels.y)
        .y_label_formatter(&|value| format!("{value:.0e}"))
        .light_line_style(WHITE)
        .draw()?;
    for ((name, points), color) in curves.iter().zip(COLORS.iter().cycle()) {
        let shown = || points.iter().copied().filter(|p| p.1 > 0.0);
        chart
            .draw_series(LineSeries::new(shown(), color.stroke_width(2)))?
            .label(name)
            .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
        if points.len() <= 40 {
            let dots = shown().map(|point| Circle::new(point, 3, color.filled()));
            chart.draw_series(dots)?;
        }
    }
    chart
        .configure_series_labels()
        .border_style(BLACK.mix(0.3))
        .background_style(WHITE.mix(0.9))
        .draw()
}
