//! Pictures of the robot at several times of a motion, side by side: body, limbs, wheels with a spoke that shows
//! their angle, and a mark under each foot in stance.

use super::camera::Camera;
use super::{FAINT, INK, MARGIN, px};
use crate::plan::{Plan, Sample};
use crate::problem::state::ContactFrame;
use crate::sample::PlanSpline;
use nalgebra::{DVector, Rotation3, Unit, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS, Model, Pose};
use svg::Document;
use svg::node::element::{Circle, Ellipse, Group, Line, Path, Text};

/// Size of one picture of the robot, px.
const CELL: [f64; 2] = [230.0, 190.0];
const TITLE_HEIGHT: f64 = 36.0;
/// Share of a cell filled by the robot.
const FILL: f64 = 0.95;
/// Points on a wheel's rim.
const RIM_POINTS: usize = 40;

/// SVG text of a strip with `phases` times of every plan, one row per plan.
pub fn strip(plans: &[&Plan], phases: usize) -> String {
    let phases = phases.max(2);
    let width = CELL[0] * phases as f64 + 2.0 * MARGIN;
    let row_height = TITLE_HEIGHT + CELL[1];
    let height = row_height * plans.len() as f64 + 2.0 * MARGIN;
    let mut document = super::document(width, height);
    for (r, plan) in plans.iter().enumerate() {
        document = row(document, plan, phases, MARGIN + r as f64 * row_height);
    }
    format!("{document}\n")
}

fn row(mut document: Document, plan: &Plan, phases: usize, top: f64) -> Document {
    let spline = PlanSpline::new(plan);
    let figure = Figure { model: spline.model() };
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
        document = document.add(figure.ground(&camera)).add(figure.draw(&camera, &sample, &spin));
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

/// Drawing of one robot.
struct Figure<'a> {
    model: &'a Model,
}

/// Piece of the picture with its distance from the viewer, m.
struct Piece {
    depth: f64,
    group: Group,
}

impl Figure<'_> {
    /// Diameter of the robot in its nominal pose, m.
    fn extent_m(&self) -> f64 {
        let pose = self.model.pose(self.model.nominal_q());
        let reach = |p: &Vector3<f64>| (p - pose.com).norm();
        let feet = pose.end_effectors.iter().zip(&self.model.robot().end_effectors);
        let furthest = feet.map(|(mount, e)| reach(&mount.center) + e.radius_m).fold(0.0, f64::max);
        let links = pose.link_origins.iter().map(reach).fold(furthest, f64::max);
        (2.0 * links).max(1e-3)
    }

    fn draw(&self, camera: &Camera, sample: &Sample, spin: &[f64]) -> Group {
        let mut q = DVector::zeros(self.model.dofs());
        q.rows_mut(BASE_POSITION, 3).copy_from_slice(&sample.base_position_m);
        q.rows_mut(BASE_YAW, 3).copy_from_slice(&sample.base_yaw_pitch_roll_rad);
        q.rows_mut(JOINTS, sample.joint_rad.len()).copy_from_slice(&sample.joint_rad);
        let pose = self.model.pose(&q);
        let stroke = camera.px_per_m * self.extent_m();
        let mut pieces = vec![self.body(camera, &pose, stroke)];
        for j in 0..sample.end_effectors.len() {
            pieces.push(self.limb(camera, &pose, j, stroke));
            pieces.push(self.foot(camera, &pose, sample, j, spin[j]));
        }
        pieces.sort_by(|a, b| b.depth.total_cmp(&a.depth));
        pieces.into_iter().fold(Group::new(), |group, piece| group.add(piece.group))
    }

    /// Root link as the convex hull of its centre of mass and its joints.
    fn body(&self, camera: &Camera, pose: &Pose, stroke: f64) -> Piece {
        let robot = self.model.robot();
        let on_root = robot.joints.iter().filter(|joint| joint.parent == 0);
        let mut corners: Vec<Vector3<f64>> =
            on_root.map(|joint| pose.link_origins[joint.child]).collect();
        corners.push(pose.link_origins[0] + pose.world_from_body * robot.links[0].com_in_link_m);
        let hull = convex_hull(corners.iter().map(|c| camera.project(c)).collect());
        let path = closed_path(&hull).set("fill", "#829ab1").set("stroke", "#829ab1");
        let path = path.set("stroke-width", px(0.09 * stroke)).set("stroke-linejoin", "round");
        let center = corners.iter().sum::<Vector3<f64>>() / corners.len() as f64;
        Piece { depth: camera.depth(&center), group: Group::new().add(path) }
    }

    /// Line through the joints of a limb to the centre of its end effector.
    fn limb(&self, camera: &Camera, pose: &Pose, j: usize, stroke: f64) -> Piece {
        let robot = self.model.robot();
        let joints =
            self.model.chain(j).dofs.iter().filter(|&&dof| dof >= JOINTS).map(|dof| dof - JOINTS);
        let mut points: Vec<Vector3<f64>> =
            joints.map(|k| pose.link_origins[robot.joints[k].child]).collect();
        points.push(pose.end_effectors[j].center);
        let page: Vec<[f64; 2]> = points.iter().map(|p| camera.project(p)).collect();
        let mut group = Group::new();
        for (k, ends) in page.windows(2).enumerate() {
            let width = px(stroke * (0.05 - 0.007 * k.min(4) as f64));
            let line = Line::new().set("x1", px(ends[0][0])).set("y1", px(ends[0][1]));
            let line = line.set("x2", px(ends[1][0])).set("y2", px(ends[1][1]));
            group = group.add(
                line.set("stroke", "#486581")
                    .set("stroke-width", width)
                    .set("stroke-linecap", "round"),
            );
        }
        for &[x, y] in &page[..page.len() - 1] {
            let dot = Circle::new().set("cx", px(x)).set("cy", px(y)).set("r", px(0.02 * stroke));
            group = group.add(dot.set("fill", "#f0f4f8").set("stroke", "#243b53"));
        }
        let center = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        Piece { depth: camera.depth(&center), group }
    }

    /// Wheel with a spoke, or sphere of a foot, and a shadow in stance.
    fn foot(
        &self,
        camera: &Camera,
        pose: &Pose,
        sample: &Sample,
        j: usize,
        spin_rad: f64,
    ) -> Piece {
        let end_effector = &self.model.robot().end_effectors[j];
        let state = &sample.end_effectors[j];
        let center = pose.end_effectors[j].center;
        let [x, y] = camera.project(&center);
        let radius = end_effector.radius_m * camera.px_per_m;
        let mut group = Group::new();
        if state.contact {
            let [x, y] = camera.project(&state.position_m.into());
            let shadow =
                Ellipse::new().set("cx", px(x)).set("cy", px(y)).set("rx", px(radius.max(5.0)));
            group = group.add(
                shadow
                    .set("ry", px(0.3 * radius.max(5.0)))
                    .set("fill", "#f0b429")
                    .set("fill-opacity", 0.55),
            );
        }
        if !end_effector.contact.rolls() {
            let dot = Circle::new().set("cx", px(x)).set("cy", px(y)).set("r", px(radius.max(2.5)));
            group = group.add(dot.set("fill", "#102a43"));
        } else {
            let frame = ContactFrame::wheel(end_effector.radius_m, state.tilt_rad, state.yaw_rad);
            let axis = Unit::new_normalize(frame.axis);
            let rim_at =
                |angle: f64| center + Rotation3::from_axis_angle(&axis, angle) * frame.to_contact;
            let turn = |k: usize| std::f64::consts::TAU * k as f64 / RIM_POINTS as f64;
            let rim: Vec<[f64; 2]> =
                (0..RIM_POINTS).map(|k| camera.project(&rim_at(turn(k)))).collect();
            let rim = closed_path(&rim)
                .set("fill", "#d9e2ec")
                .set("fill-opacity", 0.9)
                .set("stroke", "#102a43");
            group = group
                .add(rim.set("stroke-width", px(0.28 * radius)).set("stroke-linejoin", "round"));
            let [sx, sy] = camera.project(&rim_at(spin_rad));
            let spoke =
                Line::new().set("x1", px(x)).set("y1", px(y)).set("x2", px(sx)).set("y2", px(sy));
            group =
                group.add(spoke.set("stroke", "#ba2525").set("stroke-width", px(0.16 * radius)));
        }
        Piece { depth: camera.depth(&center), group }
    }

    /// Patch of ground below the robot.
    fn ground(&self, camera: &Camera) -> Group {
        let half = 0.46 * self.extent_m();
        let [x, y] = [camera.target_m.x, camera.target_m.y];
        let corner =
            |sx: f64, sy: f64| camera.project(&Vector3::new(x + sx * half, y + sy * half, 0.0));
        let patch = closed_path(&[
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ]);
        Group::new().add(patch.set("fill", "#f5f7fa").set("stroke", "#e4e7eb"))
    }
}

fn closed_path(points: &[[f64; 2]]) -> Path {
    let corners: Vec<String> =
        points.iter().map(|[x, y]| format!("{} {}", px(*x), px(*y))).collect();
    Path::new().set("d", format!("M{}Z", corners.join("L")))
}

/// Convex hull of page points, counter-clockwise on the page (Andrew's monotone chain).
fn convex_hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turns_right = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) <= 0.0
    };
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while chain.len() >= 2 && turns_right(chain[chain.len() - 2], chain[chain.len() - 1], p)
            {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    if hull.is_empty() { points } else { hull }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_of_a_square_with_inner_points_is_the_square() {
        let points = vec![[0.0, 0.0], [1.0, 1.0], [0.5, 0.5], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0]];
        assert_eq!(convex_hull(points), [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(convex_hull(vec![[2.0, 3.0]]), [[2.0, 3.0]]);
    }
}
