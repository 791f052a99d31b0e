//! Figures of sweeps over designs: lines over a parameter, choices side by side, maps over two parameters. A cross is a point that
//! does not hold.

use super::{BLACK, COLORS, Drawing, Drawn, Labels, RGBColor, SIZE, WHITE, svg};
use plotters::element::{Cross, PathElement, Rectangle, Text};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use rollwalk_design::sweep::picture::{Field, Kind, Picture, Values};
use std::ops::Range;

/// Most lines and most maps of a figure: more look alike.
const LINES_MAX: usize = 12;
const MAPS_MAX: usize = 9;
/// Width of the names of lines, px.
const LEGEND: i32 = 190;
/// Size of a map and width of its scale, px.
const MAP: (u32, u32) = (420, 340);
const SCALE_WIDTH: u32 = 110;
/// Colours from the smallest value to the largest: light to dark in equal steps, also for colour-blind readers (after viridis).
const RAMP: [RGBColor; 5] = [
    RGBColor(253, 231, 37),
    RGBColor(94, 201, 98),
    RGBColor(33, 145, 140),
    RGBColor(59, 82, 139),
    RGBColor(68, 1, 84),
];
const NOTHING: RGBColor = RGBColor(225, 225, 225);

/// Draws a figure, as the text of an SVG file.
///
/// # Errors
/// What plotters reports.
pub fn draw(picture: &Picture) -> miette::Result<String> {
    let Picture { title, quantity, kind } = picture;
    let title_with = |more: usize, what: &str| match more {
        0 => title.clone(),
        more => format!("{title} (without {more} more {what})"),
    };
    match kind {
        Kind::Lines { x, at, series } => {
            let shown = &series[..series.len().min(LINES_MAX)];
            let title = title_with(series.len() - shown.len(), "lines");
            let labels = Labels { title: &title, x, y: quantity };
            lines(&labels, at, shown, None)
        }
        Kind::Choices { axis, labels: names, series } => {
            let shown = &series[..series.len().min(LINES_MAX)];
            let title = title_with(series.len() - shown.len(), "combinations");
            let labels = Labels { title: &title, x: axis, y: quantity };
            let at: Vec<f64> = (0..names.len()).map(|k| k as f64).collect();
            lines(&labels, &at, shown, Some(names))
        }
        Kind::Maps { axes, at, panels } => {
            let shown = &panels[..panels.len().min(MAPS_MAX)];
            maps(&title_with(panels.len() - shown.len(), "maps"), quantity, axes, at, shown)
        }
    }
}

fn range(values: impl Iterator<Item = f64>, margin: f64) -> Range<f64> {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        return 0.0..1.0;
    }
    // A value alone has a range, too.
    let air = if high > low { margin * (high - low) } else { (1e-3 * high.abs()).max(1e-9) };
    low - air..high + air
}

/// Values over numbers, or over names: then only dots.
fn lines(
    labels: &Labels<'_>,
    at: &[f64],
    series: &[(String, Values)],
    names: Option<&[String]>,
) -> miette::Result<String> {
    let x = match names {
        Some(names) => -0.5..names.len() as f64 - 0.5,
        None => range(at.iter().copied(), 0.05),
    };
    let mut y = range(series.iter().flat_map(|(_, values)| values).filter_map(Field::value), 0.05);
    // Crosses stand below all values, one line of them below the other.
    let step = 0.035 * (y.end - y.start);
    let is_lost = |(_, values): &&(String, Values)| values.contains(&Field::Lost);
    let lost: Vec<&(String, Values)> = series.iter().filter(is_lost).collect();
    let bottom = y.start;
    y.start -= step * (lost.len() as f64 + 0.5);
    svg(labels.title, SIZE, |root| {
        let mut chart = ChartBuilder::on(root)
            .caption(labels.title, ("sans-serif", 16))
            .margin(12)
            .margin_right(LEGEND)
            .x_label_area_size(40)
            .y_label_area_size(72)
            .build_cartesian_2d(x, y.clone())?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(labels.x).y_desc(labels.y).light_line_style(WHITE);
        if names.is_some() {
            mesh.x_labels(0);
        }
        mesh.draw()?;
        for (at, name) in at.iter().zip(names.unwrap_or_default()) {
            let (x, y) = chart.backend_coord(&(*at, y.start));
            let style = ("sans-serif", 12).into_font().color(&BLACK);
            let style = style.pos(Pos::new(HPos::Center, VPos::Top));
            root.draw(&Text::new(name.as_str(), (x, y + 8), style))?;
        }
        let colors = || COLORS.iter().copied().cycle();
        for (index, ((name, values), color)) in series.iter().zip(colors()).enumerate() {
            let mut points: Vec<(f64, Field)> =
                at.iter().copied().zip(values.iter().copied()).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let held = |run: &[(f64, Field)]| -> Vec<(f64, f64)> {
                run.iter().filter_map(|(at, field)| Some((*at, field.value()?))).collect()
            };
            // The seventh line and those after it are thin: the colours come again.
            let stroke = color.stroke_width(if index < COLORS.len() { 2 } else { 1 });
            if names.is_none() {
                for run in points.split(|(_, field)| field.value().is_none()) {
                    chart.draw_series([PathElement::new(held(run), stroke)])?;
                }
            }
            let dots = held(&points).into_iter().map(|at| Circle::new(at, 3, color.filled()));
            chart.draw_series(dots)?;
            // Beside the drawing, so that it covers nothing.
            let (x, y) = (SIZE.0 as i32 - LEGEND + 10, 48 + 18 * index as i32);
            root.draw(&PathElement::new([(x, y), (x + 16, y)], stroke))?;
            let style = ("sans-serif", 11).into_font().color(&BLACK);
            let style = style.pos(Pos::new(HPos::Left, VPos::Center));
            root.draw(&Text::new(name.as_str(), (x + 22, y), style))?;
            if let Some(below) = lost.iter().position(|(other, _)| other == name) {
                let height = bottom - step * (below as f64 + 0.5);
                let crosses = points.iter().filter(|(_, field)| *field == Field::Lost);
                chart.draw_series(
                    crosses.map(|(at, _)| Cross::new((*at, height), 4, color.stroke_width(2))),
                )?;
            }
        }
        if !lost.is_empty() {
            let style = ("sans-serif", 11).into_font().color(&BLACK.mix(0.6));
            let words = "× does not hold";
            root.draw(&Text::new(words, (84, SIZE.1 as i32 - 20), style))?;
        }
        Ok(())
    })
}

/// Maps with one scale for all.
fn maps(
    title: &str,
    quantity: &str,
    axes: &[String; 2],
    at: &[Vec<f64>; 2],
    panels: &[(String, Vec<Values>)],
) -> miette::Result<String> {
    let columns = (panels.len() as f64).sqrt().ceil().max(1.0) as u32;
    let rows = (panels.len() as u32).div_ceil(columns).max(1);
    let size = (MAP.0 * columns + SCALE_WIDTH, MAP.1 * rows + 40);
    let all = panels.iter().flat_map(|(_, rows)| rows.iter().flatten()).filter_map(Field::value);
    let values = range(all, 0.0);
    svg(title, size, |root| {
        let root = root.titled(title, ("sans-serif", 16))?;
        let (maps, scale) = root.split_horizontally(size.0 - SCALE_WIDTH);
        let areas = maps.split_evenly((rows as usize, columns as usize));
        for (area, (name, cells)) in areas.iter().zip(panels) {
            map(area, name, axes, at, cells, &values)?;
        }
        draw_scale(&scale, quantity, &values)
    })
}

fn map(
    area: &Drawing<'_>,
    name: &str,
    axes: &[String; 2],
    at: &[Vec<f64>; 2],
    cells: &[Values],
    values: &Range<f64>,
) -> Drawn {
    let [ys, xs] = at.each_ref().map(|at| edges(at));
    let ends = |fields: &[Range<f64>]| {
        let low = fields.iter().map(|of| of.start).fold(f64::INFINITY, f64::min);
        low..fields.iter().map(|of| of.end).fold(f64::NEG_INFINITY, f64::max)
    };
    let mut chart = ChartBuilder::on(area)
        .caption(name, ("sans-serif", 13))
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(60)
        .build_cartesian_2d(ends(&xs), ends(&ys))?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_desc(&axes[1])
        .y_desc(&axes[0])
        .x_labels(5)
        .y_labels(6)
        .draw()?;
    for (y, (row, at_y)) in ys.iter().zip(cells.iter().zip(&at[0])) {
        for (x, (field, at_x)) in xs.iter().zip(row.iter().zip(&at[1])) {
            let color = field.value().map_or(NOTHING, |value| ramp(value, values));
            let corners = [(x.start, y.start), (x.end, y.end)];
            chart.draw_series([Rectangle::new(corners, color.filled())])?;
            if *field == Field::Lost {
                chart.draw_series([Cross::new((*at_x, *at_y), 5, BLACK.mix(0.5))])?;
            }
        }
    }
    Ok(())
}

/// Fields around values, in their order: each to the middle of its neighbours.
fn edges(at: &[f64]) -> Vec<Range<f64>> {
    let mut sorted = at.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let gap = |a: usize, b: usize| 0.5 * (sorted[b] - sorted[a]);
    let field = |value: &f64| {
        let k = sorted.iter().position(|other| other == value).unwrap_or(0);
        let last = sorted.len() - 1;
        // A value alone has a field, too.
        let alone = 0.05 * value.abs().max(0.1);
        let below = if k > 0 {
            gap(k - 1, k)
        } else if last > 0 {
            gap(0, 1)
        } else {
            alone
        };
        let above = if k < last {
            gap(k, k + 1)
        } else if last > 0 {
            gap(last - 1, last)
        } else {
            alone
        };
        value - below..value + above
    };
    at.iter().map(field).collect()
}

fn ramp(value: f64, values: &Range<f64>) -> RGBColor {
    let part = ((value - values.start) / (values.end - values.start)).clamp(0.0, 1.0);
    let along = part * (RAMP.len() - 1) as f64;
    let k = (along as usize).min(RAMP.len() - 2);
    let mix = |a: u8, b: u8| {
        (f64::from(a) + (along - k as f64) * (f64::from(b) - f64::from(a))).round() as u8
    };
    let (a, b) = (RAMP[k], RAMP[k + 1]);
    RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}

fn draw_scale(area: &Drawing<'_>, quantity: &str, values: &Range<f64>) -> Drawn {
    const STEPS: usize = 64;
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_top(34)
        .margin_bottom(60)
        .set_label_area_size(LabelAreaPosition::Right, 64)
        .build_cartesian_2d(0.0..1.0, values.clone())?;
    // As in the maps: without sizes they follow from that of the area.
    chart
        .configure_mesh()
        .disable_mesh()
        .disable_x_axis()
        .y_desc(quantity)
        .y_labels(8)
        .label_style(("sans-serif", 11))
        .axis_desc_style(("sans-serif", 12))
        .draw()?;
    let step = (values.end - values.start) / STEPS as f64;
    for k in 0..STEPS {
        let low = values.start + step * k as f64;
        let corners = [(0.0, low), (1.0, low + step)];
        chart.draw_series([Rectangle::new(corners, ramp(low + 0.5 * step, values).filled())])?;
    }
    let style = ("sans-serif", 11).into_font().color(&BLACK.mix(0.6));
    let height = area.dim_in_pixel().1 as i32;
    area.draw(&Text::new("× does not hold", (6, height - 40), style))
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
        let svg =
            draw(&picture(Kind::Lines { x: "x, m".into(), at, series: series.clone() })).unwrap();
        assert_eq!((count(&svg, "<circle"), count(&svg, "× does not hold")), (6, 1), "{svg}");
        assert!(svg.contains("a &amp; b") && !svg.contains("NaN"));
        let labels = ["p", "q", "r", "s"].map(str::to_owned).to_vec();
        let svg = draw(&picture(Kind::Choices { axis: "x".into(), labels, series })).unwrap();
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
        let draw = |cells| {
            draw(&Picture { title: "t".into(), quantity: "q".into(), kind: kind(cells) }).unwrap()
        };
        let whole = draw(vec![vec![Holds(1.0); 3], vec![Holds(2.0), Lost, Holds(3.0)]]);
        // Both ends of the ramp, and two fields in which nothing holds.
        for (color, fields) in [("#FDE725", 6), ("#440154", 2), ("#E1E1E1", 2)] {
            assert_eq!(count(&whole, &format!("fill=\"{color}\"")), fields, "{color}");
        }
        let none = draw(vec![vec![Lost; 3], vec![Absent; 3]]);
        assert_eq!(count(&none, "fill=\"#E1E1E1\""), 12);
        assert!(!none.contains("NaN") && !none.contains("inf"));
    }

    #[test]
    fn fields_meet_in_the_middle() {
        assert_eq!(edges(&[0.0, 4.0, 1.0]), [-0.5..0.5, 2.5..5.5, 0.5..2.5]);
        assert_eq!(edges(&[0.2]).len(), 1);
    }
}
