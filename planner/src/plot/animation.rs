//! Animation of a motion: one SVG file that any browser plays, as a page or as the image of a README.
//!
//! Every frame is a group, and CSS shows one at a time, so that visibility can change from frame to frame. The file needs no
//! script, because scripts do not run in images of other pages. Without CSS, and for users who prefer reduced motion, the first
//! frame remains visible.

use super::camera::Camera;
use super::panels;
use super::robot::{Figure, STYLE, closed_path};
use super::style::{FAINT, HEADER_HEIGHT, INK, MARGIN, document, heading, px};
use crate::motion::Ends;
use crate::plan::{Plan, Sample};
use crate::sample::PlanSpline;
use nalgebra::Vector3;
use rollwalk_multibody::ground::Terrain;
use rollwalk_multibody::ground::file::Shape;
use svg::Document;
use svg::node::element::{Group, Line, Style, Text, Title};

/// Frames per second.
const FRAMES_HZ: f64 = 30.0;
/// Maximum number of frames of a file.
const FRAMES_MAX: f64 = 240.0;
/// Duration of the last frame of a motion that does not repeat, s.
const HOLD_S: f64 = 0.8;
/// Distance over which a periodic motion is shown, in diameters of the robot. A motion in place is shown for one turn.
const TRAVEL: f64 = 2.5;
/// Maximum duration for which a periodic motion is shown, s.
const SHOWN_S: f64 = 8.0;
/// Width of the page, px.
const WIDTH: f64 = 800.0;
/// Maximum height of the picture, px.
const PICTURE_HEIGHT: f64 = 400.0;
/// Height of a line of the caption, px.
const CAPTION_HEIGHT: f64 = 24.0;
/// Height of a row of the footfall chart, px.
const ROW_HEIGHT: f64 = 20.0;
/// Height of title and axis of the footfall chart, px.
const CHART_HEIGHT: f64 = 72.0;
/// Width of the ground around the robot, as a fraction of its diameter.
const GROUND: f64 = 0.35;
/// Margin around the robot's points for the thickness of lines, as a fraction of the robot's diameter.
const AROUND: f64 = 0.1;
/// Space on the right for the labels of ground marks, px.
const MARK_WIDTH: f64 = 34.0;
/// Minimum distance of marks on the ground, px.
const MARKS_PX: f64 = 55.0;

/// Optional parts of an animation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AnimationParts {
    /// True to draw ground forces as arrows.
    pub forces: bool,
    /// True to draw the footfall chart, with a line at the present time.
    pub footfalls: bool,
}

/// Draws the motion of a validated plan in real time, repeated, as SVG text.
pub fn animation(plan: &Plan, extras: AnimationParts) -> String {
    let page = Page::new(plan, extras);
    let run = &page.run;
    let mut document = page.document().add(Style::new(style(run))).add(page.view.ground());
    for k in 0..run.moments.len() {
        // A negative delay: the animation has begun already when the page opens.
        let delay = format!("animation-delay:{:.4}s", k as f64 * run.frame_s() - run.loop_s());
        document = document.add(page.frame(k).set("class", run.class(k)).set("style", delay));
    }
    if let Some(chart) = &page.chart {
        let part = 100.0 * plan.motion.duration_s / run.pass_s();
        let moves = format!(
            ".now{{animation:now {:.4}s linear infinite}}\
             @keyframes now{{{part:.3}%,to{{transform:translateX({}px)}}}}\
             @media (prefers-reduced-motion:reduce){{.now{{animation:none}}}}",
            run.pass_s(),
            px(chart.axis_px[1] - chart.axis_px[0]),
        );
        document = document
            .add(chart.drawing.clone())
            .add(Style::new(moves))
            .add(chart.now(0.0).set("class", "now"));
    }
    // Line breaks would make the file larger, and diffs of it are not read.
    document.to_string().replace('\n', "") + "\n"
}

/// Draws the frames of the animation as separate pictures, for films. Also returns the duration of a frame, s. The last frame
/// of a motion that does not repeat occurs several times, to fill its duration.
pub fn frames(plan: &Plan, extras: AnimationParts) -> (f64, Vec<String>) {
    let page = Page::new(plan, extras);
    let run = &page.run;
    let one = |k: usize| {
        let mut document = page.document().add(Style::new(STYLE)).add(page.view.ground());
        document = document.add(page.frame(k));
        if let Some(chart) = &page.chart {
            let gone_s = (k as f64 * run.frame_s()) % run.period_s;
            document = document.add(chart.drawing.clone()).add(chart.now(gone_s / run.period_s));
        }
        format!("{document}\n")
    };
    let last = run.moments.len() - 1;
    let stays = (run.hold_s / run.frame_s()).round() as usize;
    let pictures = (0..=last).chain(std::iter::repeat_n(last, stays)).map(one).collect();
    (run.frame_s(), pictures)
}

/// Layout of all frames.
struct Page {
    run: Run,
    view: View,
    extras: AnimationParts,
    chart: Option<Chart>,
    height: f64,
    texts: [String; 2],
}

struct Chart {
    drawing: Group,
    /// Start and end of the time axis, px.
    axis_px: [f64; 2],
    /// Top and bottom of the rows, px.
    rows_px: [f64; 2],
}

impl Chart {
    /// Draws the line at a time, given as a fraction of the axis.
    fn now(&self, part: f64) -> Line {
        let x = px(self.axis_px[0] + part * (self.axis_px[1] - self.axis_px[0]));
        let line = Line::new().set("x1", x).set("x2", x).set("stroke", INK);
        let line = line.set("y1", px(self.rows_px[0])).set("y2", px(self.rows_px[1]));
        line.set("stroke-width", 1.5)
    }
}

impl Page {
    fn new(plan: &Plan, extras: AnimationParts) -> Self {
        let run = Run::new(plan);
        let view = View::of(&run, extras, plan.motion.ground.terrain());
        let chart = extras.footfalls.then(|| panels::footfalls(plan)).flatten();
        let feet = plan.robot.end_effectors.len();
        let chart_height = chart.as_ref().map_or(0.0, |_| CHART_HEIGHT + ROW_HEIGHT * feet as f64);
        let above_chart = HEADER_HEIGHT + view.height + CAPTION_HEIGHT;
        let chart = chart.map(|chart| {
            let (corner, size) = ([MARGIN, above_chart], [WIDTH - 2.0 * MARGIN, chart_height]);
            Chart {
                drawing: chart.draw(corner, size, true),
                axis_px: panels::Panel::axis_px(corner[0], size[0]),
                rows_px: [corner[1] + 20.0, corner[1] + chart_height - 32.0],
            }
        });
        let facts = match plan.motion.ends {
            Ends::Periodic => format!("period {:.2} s", plan.motion.duration_s),
            _ => format!("{:.2} s", plan.motion.duration_s),
        };
        let name = format!("{} – {}", plan.robot.name, plan.motion.name);
        let texts = [name, format!("{facts} · in real time")];
        Self { run, view, extras, chart, height: above_chart + chart_height + MARGIN, texts }
    }

    fn document(&self) -> Document {
        document(WIDTH, self.height)
            .set("role", "img")
            .set("aria-label", self.texts[0].clone())
            .add(Title::new(self.texts[0].clone()))
            .add(heading(self.texts.clone()))
    }

    fn frame(&self, k: usize) -> Group {
        let (run, view, moment) = (&self.run, &self.view, &self.run.moments[k]);
        let mut frame =
            Group::new().add(run.figure.draw(&view.camera, &moment.sample, &moment.spin_rad));
        if self.extras.forces {
            frame = frame.add(run.figure.forces(&view.camera, &moment.sample));
        }
        let caption = Text::new(run.caption(&moment.sample)).set("x", 0.5 * WIDTH);
        let baseline = HEADER_HEIGHT + view.height + 14.0;
        let caption = caption.set("y", px(baseline)).set("text-anchor", "middle");
        frame.add(caption.set("fill", FAINT))
    }
}

/// CSS that shows one frame at a time.
fn style(run: &Run) -> String {
    /// Overlap of frames in percent of the loop, so that rounding leaves no gap between them.
    const OVERLAP: f64 = 0.01;
    let percent = |seconds: f64| (100.0 * seconds / run.loop_s() + OVERLAP).min(100.0);
    let (frame, last) = (percent(run.frame_s()), percent(run.frame_s() + run.hold_s));
    format!(
        "{STYLE}.f{{visibility:hidden;animation:f {loop_s:.4}s step-end infinite}}\
         .first{{visibility:visible}}.last{{animation-name:l}}\
         @keyframes f{{from{{visibility:visible}}{frame:.4}%,to{{visibility:hidden}}}}\
         @keyframes l{{from{{visibility:visible}}{last:.4}%,to{{visibility:hidden}}}}\
         @media (prefers-reduced-motion:reduce){{.f{{animation:none}}}}",
        loop_s = run.loop_s(),
    )
}

/// State of the robot in one frame.
struct Moment {
    sample: Sample,
    spin_rad: Vec<f64>,
}

/// Frames of the animation.
struct Run {
    figure: Figure,
    moments: Vec<Moment>,
    /// Duration of all shown periods, s.
    shown_s: f64,
    /// Duration of one period, s. For a motion that does not repeat, its duration.
    period_s: f64,
    /// Additional duration of the last frame, s.
    hold_s: f64,
}

impl Run {
    fn new(plan: &Plan) -> Self {
        let spline = PlanSpline::new(plan);
        let figure = Figure::new(&plan.robot);
        let period_s = plan.motion.duration_s;
        let periodic = plan.motion.ends == Ends::Periodic;
        let periods = if periodic { periods(plan, figure.extent_m()) } else { 1.0 };
        let shown_s = periods * period_s;
        let frames_hz = FRAMES_HZ.min(FRAMES_MAX / shown_s);
        let count = (shown_s * frames_hz).round().max(1.0) as usize;
        let at = |time_s: f64| Moment {
            sample: spline.sample(time_s),
            spin_rad: spline.motor_angles_rad(time_s),
        };
        // The last frame of a motion that does not repeat is its end.
        let intervals = if periodic { count } else { (count - 1).max(1) };
        let moments = (0..count).map(|k| at(shown_s * k as f64 / intervals as f64)).collect();
        let hold_s = if periodic { 0.0 } else { HOLD_S };
        Self { figure, moments, shown_s, period_s, hold_s }
    }

    fn frame_s(&self) -> f64 {
        self.shown_s / self.moments.len() as f64
    }

    /// Duration of the loop, s.
    fn loop_s(&self) -> f64 {
        self.shown_s + self.hold_s
    }

    /// Duration of one pass over the footfall chart, s.
    fn pass_s(&self) -> f64 {
        self.period_s + self.hold_s
    }

    fn class(&self, frame: usize) -> &'static str {
        match frame {
            0 => "f first",
            _ if frame + 1 == self.moments.len() => "f last",
            _ => "f",
        }
    }

    /// Time and travelled distance of a frame.
    fn caption(&self, sample: &Sample) -> String {
        let [from, to] = [&self.moments[0].sample, sample].map(|sample| sample.base_position_m);
        let [x, y] = [0, 1].map(|axis| ((to[axis] - from[axis]) * 100.0).round() / 100.0 + 0.0);
        format!("{:.2} s · x {x:.2} m, y {y:.2} m", sample.time_s)
    }
}

/// Number of shown periods of a periodic motion.
fn periods(plan: &Plan, extent_m: f64) -> f64 {
    let placement = &plan.end_placement;
    let [x, y] = placement.offset_m;
    let travel_m = x.hypot(y);
    let wanted = if travel_m > 0.05 * extent_m {
        TRAVEL * extent_m / travel_m
    } else if placement.yaw_rad.abs() > 1e-3 {
        std::f64::consts::TAU / placement.yaw_rad.abs()
    } else {
        1.0
    };
    wanted.min(SHOWN_S / plan.motion.duration_s).round().max(1.0)
}

/// Fixed camera and the visible ground.
struct View {
    camera: Camera,
    height: f64,
    /// Minimum and maximum world x and y of the ground, m.
    ground_m: [[f64; 2]; 2],
    terrain: Option<Terrain>,
    /// Faces of the obstacles on the visible ground.
    obstacles: Vec<[Vector3<f64>; 4]>,
}

impl View {
    /// Fits the view to a whole run.
    fn of(run: &Run, extras: AnimationParts, terrain: Option<&Terrain>) -> Self {
        let extent_m = run.figure.extent_m();
        let mut points: Vec<Vector3<f64>> = Vec::new();
        for moment in &run.moments {
            points.extend(run.figure.outline(&moment.sample));
            if extras.forces {
                points.extend(run.figure.arrows(&moment.sample).map(|[_, tip]| tip));
            }
        }
        let ground_m = [0, 1].map(|axis| {
            let [low, high] = bounds(points.iter().map(|p| p[axis]));
            [low - GROUND * extent_m, high + GROUND * extent_m]
        });
        let unit = Camera { target_m: Vector3::zeros(), origin: [0.0; 2], px_per_m: 1.0 };
        let around = AROUND * extent_m;
        let facets = terrain.map(|terrain| terrain.facets(ground_m)).unwrap_or_default();
        let obstacles = terrain.map(|terrain| obstacles_on(terrain, ground_m)).unwrap_or_default();
        // A long wall reaches beyond the page, instead of making the robot small.
        let near = obstacles.iter().flatten().map(|corner| {
            let [x, y] =
                [0, 1].map(|axis| corner[axis].clamp(ground_m[axis][0], ground_m[axis][1]));
            Vector3::new(x, y, corner.z)
        });
        let facets = facets.into_iter().flatten().chain(near);
        let surface = corners(ground_m).into_iter().chain(facets);
        let page: Vec<[f64; 2]> = surface.map(|p| unit.project(&p)).collect();
        let robot = points.iter().map(|p| unit.project(p));
        let [x, y] = [0, 1].map(|axis| {
            let [low, high] = bounds(robot.clone().map(|p| p[axis]));
            let [ground_low, ground_high] = bounds(page.iter().map(|p| p[axis]));
            [(low - around).min(ground_low), (high + around).max(ground_high)]
        });
        let [width, height] = [x, y].map(|[low, high]| high - low);
        let px_per_m = ((WIDTH - 2.0 * MARGIN - MARK_WIDTH) / width).min(PICTURE_HEIGHT / height);
        // The ground's marks are written below its lower edge.
        let height = px_per_m * height + 18.0;
        let origin = [
            0.5 * (WIDTH - MARK_WIDTH - px_per_m * (x[0] + x[1])),
            HEADER_HEIGHT - px_per_m * y[0],
        ];
        let camera = Camera { target_m: Vector3::zeros(), origin, px_per_m };
        Self { camera, height, ground_m, terrain: terrain.cloned(), obstacles }
    }

    /// Draws the terrain, the parts furthest from the camera first. Steep parts are darker.
    fn terrain(&self, terrain: &Terrain) -> Group {
        let mut facets = terrain.facets(self.ground_m);
        let depth = |facet: &[Vector3<f64>; 4]| {
            facet.iter().map(|corner| self.camera.depth(corner)).sum::<f64>()
        };
        facets.sort_by(|one, other| depth(other).total_cmp(&depth(one)));
        let shaded = |facet: &[Vector3<f64>; 4]| {
            let normal = (facet[1] - facet[0]).cross(&(facet[3] - facet[0]));
            let level = normal.z.abs() / normal.norm().max(f64::MIN_POSITIVE);
            let fill = if level > 0.999 {
                "#f5f7fa"
            } else if level > 0.9 {
                "#eef2f6"
            } else {
                "#cbd2d9"
            };
            let patch = closed_path(&facet.map(|corner| self.camera.project(&corner)));
            patch.set("fill", fill).set("stroke", "#9aa5b1")
        };
        facets.iter().map(shaded).fold(Group::new(), Group::add)
    }

    /// Draws the ground. Level ground has labels at the edges nearest the camera.
    fn ground(&self) -> Group {
        match &self.terrain {
            None => self.level(),
            Some(terrain) if terrain.shape == Shape::Level => self.obstacles(self.level()),
            Some(terrain) => self.obstacles(self.terrain(terrain)),
        }
    }

    /// Draws the obstacles over the ground. They are transparent, because the robot is drawn over those nearer to the camera.
    fn obstacles(&self, ground: Group) -> Group {
        let face = |facet: &[Vector3<f64>; 4]| {
            let face = closed_path(&facet.map(|corner| self.camera.project(&corner)));
            face.set("fill", "#f0b429").set("fill-opacity", 0.3).set("stroke", "#b4690e")
        };
        self.obstacles.iter().map(face).fold(ground, Group::add)
    }

    /// Draws level ground with lines at round distances.
    fn level(&self) -> Group {
        let [[x_min, x_max], [y_min, y_max]] = self.ground_m;
        let patch = closed_path(&corners(self.ground_m).map(|p| self.camera.project(&p)));
        let mut group = Group::new().add(patch.set("fill", "#f5f7fa").set("stroke", "#e4e7eb"));
        let mut mark = |from: [f64; 2], to: [f64; 2], value_m: f64, step_m: f64, anchor: &str| {
            let [from, to] = [from, to].map(|[x, y]| self.camera.project(&Vector3::new(x, y, 0.0)));
            let line = Line::new().set("x1", px(from[0])).set("y1", px(from[1]));
            let line = line.set("x2", px(to[0])).set("y2", px(to[1])).set("stroke", "#d9e2ec");
            let decimals = if step_m < 1.0 { 1 } else { 0 };
            let text = format!("{:.decimals$} m", value_m + 0.0).replace('-', "−");
            let text = Text::new(text);
            let text = text.set("x", px(from[0])).set("y", px(from[1] + 13.0)).set("fill", FAINT);
            let group_now = std::mem::replace(&mut group, Group::new());
            group = group_now.add(line).add(text.set("text-anchor", anchor));
        };
        let step_m = |along: Vector3<f64>| {
            let unit = self.camera.project(&along);
            let px_per_m = (unit[0] - self.camera.origin[0]).hypot(unit[1] - self.camera.origin[1]);
            round_step(MARKS_PX / px_per_m)
        };
        let step = step_m(Vector3::x());
        for x in multiples(step, x_min, x_max) {
            mark([x, y_min], [x, y_max], x, step, "middle");
        }
        let step = step_m(Vector3::y());
        for y in multiples(step, y_min, y_max) {
            mark([x_max, y], [x_min, y], y, step, "start");
        }
        group
    }
}

/// Faces of the obstacles above a rectangle of the ground.
fn obstacles_on(terrain: &Terrain, ground_m: [[f64; 2]; 2]) -> Vec<[Vector3<f64>; 4]> {
    let is_above = |facets: &Vec<[Vector3<f64>; 4]>| {
        (0..2).all(|axis| {
            let [low, high] = bounds(facets.iter().flatten().map(|corner| corner[axis]));
            low <= ground_m[axis][1] && high >= ground_m[axis][0]
        })
    };
    let facets = terrain.obstacles.iter().map(|obstacle| obstacle.shape.facets());
    facets.filter(is_above).flatten().collect()
}

fn corners([[x_min, x_max], [y_min, y_max]]: [[f64; 2]; 2]) -> [Vector3<f64>; 4] {
    let corner = |x: f64, y: f64| Vector3::new(x, y, 0.0);
    [corner(x_min, y_min), corner(x_max, y_min), corner(x_max, y_max), corner(x_min, y_max)]
}

fn bounds(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

/// Returns the smallest of 0.1, 0.2, 0.5, 1, 2, 5, … that is at least `least_m`.
fn round_step(least_m: f64) -> f64 {
    let decade = 10f64.powf(least_m.log10().floor().max(-1.0));
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * decade);
    steps.into_iter().find(|step| *step >= least_m).unwrap_or(10.0 * decade)
}

fn multiples(step: f64, low: f64, high: f64) -> impl Iterator<Item = f64> {
    let [first, last] = [(low / step).ceil() as i64, (high / step).floor() as i64];
    (first..=last).map(move |k| k as f64 * step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_plans;

    #[test]
    fn every_frame_is_shown_once_a_loop() {
        for plan in [test_plans::cruise(), test_plans::start_stop()] {
            let run = Run::new(&plan);
            let svg = animation(&plan, AnimationParts::default());
            assert_eq!(svg.matches("animation-delay:").count(), run.moments.len());
            assert!(!svg.contains("NaN") && !svg.contains("inf "), "finite");
            assert!(svg.contains("prefers-reduced-motion"));
            assert!(!svg.contains("<script"));
            assert!(run.moments.len() as f64 <= FRAMES_MAX);
        }
    }

    #[test]
    fn a_motion_from_rest_to_rest_ends_at_its_end() {
        let plan = test_plans::start_stop();
        let run = Run::new(&plan);
        let last = run.moments.last().expect("there are frames");
        assert_eq!(last.sample.time_s, plan.motion.duration_s);
        assert_eq!(run.hold_s, HOLD_S);
    }

    #[test]
    fn a_periodic_motion_travels_over_the_ground() {
        let plan = test_plans::cruise();
        let run = Run::new(&plan);
        let periods = run.shown_s / run.period_s;
        assert_eq!(periods, periods.round());
        let [first, last] =
            [0, run.moments.len() - 1].map(|k| run.moments[k].sample.base_position_m[0]);
        let [per_period, _] = plan.end_placement.offset_m;
        let expected = per_period * periods;
        assert!((last - first) / expected > 0.9 && (last - first) / expected < 1.0);
    }

    #[test]
    fn extras_are_drawn_only_if_asked_for() {
        let plan = test_plans::cruise();
        let arrows = |svg: &str| svg.matches("class=\"force\"").count();
        let plain = animation(&plan, AnimationParts::default());
        assert!(arrows(&plain) == 0 && !plain.contains("footfalls"));
        let full = animation(&plan, AnimationParts { forces: true, footfalls: true });
        assert!(arrows(&full) > 0 && full.contains("footfalls") && full.contains("class=\"now\""));
    }

    #[test]
    fn all_that_moves_is_on_the_page() {
        let plan = test_plans::cruise();
        let run = Run::new(&plan);
        let extras = AnimationParts { forces: true, ..AnimationParts::default() };
        let view = View::of(&run, extras, None);
        for moment in &run.moments {
            for point in run.figure.outline(&moment.sample) {
                let [x, y] = view.camera.project(&point);
                assert!((MARGIN..=WIDTH - MARGIN).contains(&x), "{x}");
                assert!((HEADER_HEIGHT..=HEADER_HEIGHT + view.height).contains(&y), "{y}");
            }
        }
    }

    #[test]
    fn marks_are_at_round_distances() {
        assert_eq!(
            [0.03, 0.1, 0.11, 0.3, 0.7, 3.0, 60.0].map(round_step),
            [0.1, 0.1, 0.2, 0.5, 1.0, 5.0, 100.0]
        );
        let marks: Vec<f64> = multiples(0.5, -0.6, 1.1).collect();
        assert_eq!(marks, [-0.5, 0.0, 0.5, 1.0]);
    }
}
