//! Charts as SVG: of benchmarks, of runs, and of sweeps.

pub mod sweep;

use miette::miette;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
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

/// Size of a chart, and of a panel of several.
const SIZE: (u32, u32) = (760, 460);
const PANEL: (u32, u32) = (1100, 240);
/// Curves with more points have no dots.
const DOTS_MAX: usize = 40;

/// Draws curves of positive values over logarithmic axes, as the text of an SVG file.
///
/// # Errors
/// What plotters reports.
pub fn draw(labels: &Labels<'_>, curves: &[Curve]) -> miette::Result<String> {
    let positive: Vec<Curve> = curves
        .iter()
        .map(|(name, points)| {
            (name.clone(), points.iter().copied().filter(|point| point.1 > 0.0).collect())
        })
        .collect();
    let range = |pick: fn(&(f64, f64)) -> f64| {
        let bounds = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
        points(&positive).map(pick).fold((f64::INFINITY, 0.0), bounds)
    };
    let ((x0, x1), (y0, y1)) = (range(|point| point.0), range(|point| point.1));
    let (x, y) = ((0.85 * x0..1.18 * x1).log_scale(), (0.7 * y0..1.4 * y1).log_scale());
    svg(labels.title, SIZE, |root| {
        plot(root, labels, (x, y), Some(&|value| format!("{value:.0e}")), &positive, &[])
    })
}

/// Draws curves over linear axes, as the text of an SVG file.
///
/// # Errors
/// What plotters reports.
pub fn draw_linear(labels: &Labels<'_>, curves: &[Curve]) -> miette::Result<String> {
    svg(labels.title, SIZE, |root| plot(root, labels, linear(curves), None, curves, &[]))
}

/// Draws panels of curves over linear axes, one below the other, as the text of an SVG file. Marks are words at places of the
/// horizontal axis that all have in common.
///
/// # Errors
/// What plotters reports.
pub fn draw_panels(
    title: &str,
    panels: &[(Labels<'_>, Vec<Curve>)],
    marks: &[(f64, String)],
) -> miette::Result<String> {
    svg(title, (PANEL.0, PANEL.1 * panels.len() as u32), |root| {
        let areas = root.split_evenly((panels.len(), 1));
        areas.iter().zip(panels).try_for_each(|(area, (labels, curves))| {
            plot(area, labels, linear(curves), None, curves, marks)
        })
    })
}

fn points(curves: &[Curve]) -> impl Iterator<Item = &(f64, f64)> {
    curves.iter().flat_map(|(_, points)| points)
}

/// Ranges of both axes, with a margin.
fn linear(curves: &[Curve]) -> (Range<f64>, Range<f64>) {
    let range = |pick: fn(&(f64, f64)) -> f64| {
        let bounds = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
        let (low, high) = points(curves).map(pick).fold((f64::INFINITY, f64::NEG_INFINITY), bounds);
        // No points, or some that no axis spans.
        if !(high - low).is_finite() {
            return 0.0..1.0;
        }
        let margin = 0.05 * (high - low).max(1e-9);
        low - margin..high + margin
    };
    (range(|point| point.0), range(|point| point.1))
}

type Drawing<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// The text of an SVG file with what `plot` draws.
fn svg(
    title: &str,
    size: (u32, u32),
    plot: impl FnOnce(&Drawing<'_>) -> Drawn,
) -> miette::Result<String> {
    let mut svg = String::new();
    let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
    root.fill(&WHITE)
        .and_then(|()| plot(&root))
        .and_then(|()| root.present())
        .map_err(|error| miette!("cannot draw {title}: {error}"))?;
    drop(root);
    Ok(svg)
}

/// Curves over two axes of any scale, with a legend.
fn plot<X, Y>(
    root: &Drawing<'_>,
    labels: &Labels<'_>,
    (x, y): (X, Y),
    y_label: Option<&dyn Fn(&f64) -> String>,
    curves: &[Curve],
    marks: &[(f64, String)],
) -> Drawn
where
    X: AsRangedCoord<Value = f64>,
    Y: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let mut chart = ChartBuilder::on(root)
        .caption(labels.title, ("sans-serif", 16))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(x, y)?;
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(labels.x).y_desc(labels.y).light_line_style(WHITE);
    if let Some(y_label) = y_label {
        mesh.y_label_formatter(y_label);
    }
    mesh.draw()?;
    let Range { start: bottom, end: top } = chart.y_range();
    for (at, words) in marks {
        let line = PathElement::new([(*at, bottom), (*at, top)], BLACK.mix(0.25));
        chart.draw_series([line])?;
        let style = ("sans-serif", 11).into_font().color(&BLACK.mix(0.6));
        chart.draw_series([Text::new(format!(" {words}"), (*at, top), style)])?;
    }
    for ((name, points), color) in curves.iter().zip(COLORS.iter().cycle()) {
        chart
            .draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(2)))?
            .label(name)
            .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
        if points.len() <= DOTS_MAX {
            let dots = points.iter().map(|point| Circle::new(*point, 3, color.filled()));
            chart.draw_series(dots)?;
        }
    }
    chart
        .configure_series_labels()
        .border_style(BLACK.mix(0.3))
        .background_style(WHITE.mix(0.9))
        .draw()
}
