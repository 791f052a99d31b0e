//! Pictures of the robot at several times of a motion, side by side.

use super::camera::Camera;
use super::robot::{Figure, STYLE, closed_path};
use super::style::{FAINT, INK, MARGIN, document, px};
use crate::plan::Plan;
use crate::sample::PlanSpline;
use nalgebra::Vector3;
use svg::Document;
use svg::node::element::{Path, Style, Text};

/// Size of one picture of the robot, px.
const CELL: [f64; 2] = [230.0, 190.0];
const TITLE_HEIGHT: f64 = 36.0;
/// Fraction of a cell that the robot fills.
const FILL: f64 = 0.95;

/// Draws every plan at `phases` (at least 2) equally spaced times from start to end, one row per plan, as SVG text.
pub fn strip(plans: &[&Plan], phases: usize) -> String {
    let phases = phases.max(2);
    let width = CELL[0] * phases as f64 + 2.0 * MARGIN;
    let row_height = TITLE_HEIGHT + CELL[1];
    let height = row_height * plans.len() as f64 + 2.0 * MARGIN;
    let mut document = document(width, height).add(Style::new(STYLE));
    for (r, plan) in plans.iter().enumerate() {
        document = row(document, plan, phases, MARGIN + r as f64 * row_height);
    }
    format!("{document}\n")
}

fn row(mut document: Document, plan: &Plan, phases: usize, top: f64) -> Document {
    let spline = PlanSpline::new(plan);
    let figure = Figure::new(&plan.robot);
    let px_per_m = FILL * CELL[0].min(CELL[1]) / figure.extent_m();
    let title = Text::new(format!("{} – {}", plan.robot.name, plan.motion.name));
    let title = title.set("x", MARGIN + 10.0).set("y", px(top + 26.0)).set("font-size", 15);
    document = document.add(title.set("font-weight", 600).set("fill", INK));
    for k in 0..phases {
        let t = plan.motion.duration_s * k as f64 / (phases - 1) as f64;
        let sample = spline.sample(t);
        let spin = spline.motor_angles_rad(t);
        let center = [MARGIN + (k as f64 + 0.5) * CELL[0], top + TITLE_HEIGHT + 0.5 * CELL[1]];
        let [x, y, _] = sample.base_position_m;
        let middle = 0.5 * sample.base_position_m[2];
        let camera = Camera { target_m: Vector3::new(x, y, middle), origin: center, px_per_m };
        document = document
            .add(ground(&camera, figure.extent_m()))
            .add(figure.draw(&camera, &sample, &spin));
        // The camera follows the robot; a label shows the distance travelled.
        let [x_start, y_start, _] = spline.sample(0.0).base_position_m;
        let way = [x - x_start, y - y_start].map(|way| (way * 100.0).round() / 100.0 + 0.0);
        let caption = format!("{t:.2} s · x {:.2} m, y {:.2} m", way[0], way[1]);
        let caption = Text::new(caption).set("x", px(center[0])).set("y", px(top + row_baseline()));
        document = document.add(caption.set("text-anchor", "middle").set("fill", FAINT));
    }
    document
}

fn row_baseline() -> f64 {
    TITLE_HEIGHT + CELL[1] - 6.0
}

/// Draws a patch of ground below the robot.
fn ground(camera: &Camera, extent_m: f64) -> Path {
    let half = 0.46 * extent_m;
    let [x, y] = [camera.target_m.x, camera.target_m.y];
    let corner = |sx: f64, sy: f64| Vector3::new(x + sx * half, y + sy * half, 0.0);
    let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let patch = closed_path(&corners.map(|corner| camera.project(&corner)));
    patch.set("fill", "#f5f7fa").set("stroke", "#e4e7eb")
}
