//! Picture of the robot at one time: body, limbs, wheels with a spoke that shows their angle, and a mark under each stance
//! foot.

use super::camera::Camera;
use super::hull::convex_hull;
use super::style::px;
use crate::plan::Sample;
use crate::problem::state::ContactFrame;
use nalgebra::{DVector, Rotation3, Unit, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS, Model, Pose};
use rollwalk_robot::{GRAVITY_M_S2, Robot};
use svg::node::element::{Circle, Ellipse, Group, Line, Path};

/// Length of the force arrow of a foot that carries the whole robot, as a multiple of the robot's diameter.
const ARROW: f64 = 0.5;

/// CSS of the pieces, the content of a `style` element.
pub const STYLE: &str = "\
    .body{fill:#829ab1;stroke:#829ab1;stroke-linejoin:round}\
    .limb{stroke:#486581;stroke-linecap:round}\
    .joint{fill:#f0f4f8;stroke:#243b53}\
    .stands{fill:#f0b429;fill-opacity:.55}\
    .foot{fill:#102a43}\
    .wheel{fill:#d9e2ec;fill-opacity:.9;stroke:#102a43}\
    .spoke{stroke:#ba2525}\
    .force{stroke:#009e73;stroke-width:2;stroke-linecap:round;stroke-linejoin:round;fill:none}\
    @media(prefers-color-scheme:dark){\
    .limb{stroke:#6d8aa6}\
    .foot{fill:#bcccdc}\
    .wheel{fill:#243b53;stroke:#bcccdc}\
    .spoke{stroke:#ef6c6c}}";

/// Drawing of a robot.
pub struct Figure {
    model: Model,
    extent_m: f64,
}

/// Piece of the picture with its distance from the viewer, m.
struct Piece {
    depth: f64,
    group: Group,
}

impl Figure {
    /// Prepares the drawing of a robot.
    pub fn new(robot: &Robot) -> Self {
        let model = Model::new(robot);
        let pose = model.pose(model.nominal_q());
        let reach = |p: &Vector3<f64>| (p - pose.com).norm();
        let feet = pose.end_effectors.iter().zip(&robot.end_effectors);
        let furthest = feet.map(|(mount, e)| reach(&mount.center) + e.radius_m).fold(0.0, f64::max);
        let links = pose.frames.link_origins.iter().map(reach).fold(furthest, f64::max);
        Self { model, extent_m: (2.0 * links).max(1e-3) }
    }

    /// Diameter of the robot in its nominal pose, m.
    pub fn extent_m(&self) -> f64 {
        self.extent_m
    }

    /// Draws the robot at a sample. `spin_rad` contains the angle of every end effector's wheel.
    pub fn draw(&self, camera: &Camera, sample: &Sample, spin_rad: &[f64]) -> Group {
        let pose = self.pose(sample);
        let stroke = camera.px_per_m * self.extent_m;
        let mut pieces = vec![self.body(camera, &pose, stroke)];
        for (j, &spin_rad) in spin_rad.iter().enumerate() {
            pieces.push(self.limb(camera, &pose, j, stroke));
            pieces.push(self.foot(camera, &pose, sample, j, spin_rad));
        }
        pieces.sort_by(|a, b| b.depth.total_cmp(&a.depth));
        pieces.into_iter().fold(Group::new(), |group, piece| group.add(piece.group))
    }

    /// Draws ground forces as arrows from the contact points.
    pub fn forces(&self, camera: &Camera, sample: &Sample) -> Group {
        let arrows = self.arrows(sample);
        let arrows = arrows.filter_map(|ends| {
            let [from, to] = ends.map(|end| camera.project(&end));
            arrow(from, to)
        });
        arrows.fold(Group::new(), Group::add)
    }

    /// Start and end points of the arrows of ground forces, in the world, m.
    pub fn arrows<'a>(
        &'a self,
        sample: &'a Sample,
    ) -> impl Iterator<Item = [Vector3<f64>; 2]> + 'a {
        let weight_n = self.model.robot().total_mass_kg() * GRAVITY_M_S2;
        let m_per_n = ARROW * self.extent_m / weight_n;
        sample.end_effectors.iter().map(move |foot| {
            let from = Vector3::from(foot.position_m);
            [from, from + Vector3::from(foot.force_n) * m_per_n]
        })
    }

    /// Points that bound the drawing: all of it is within `extent_m / 10` or a wheel's radius of one of them.
    pub fn outline(&self, sample: &Sample) -> Vec<Vector3<f64>> {
        let pose = self.pose(sample);
        let feet = pose.end_effectors.iter().map(|mount| mount.center);
        pose.frames.link_origins.iter().copied().chain(feet).collect()
    }

    fn pose(&self, sample: &Sample) -> Pose {
        let mut q = DVector::zeros(self.model.dofs());
        q.rows_mut(BASE_POSITION, 3).copy_from_slice(&sample.base_position_m);
        q.rows_mut(BASE_YAW, 3).copy_from_slice(&sample.base_yaw_pitch_roll_rad);
        q.rows_mut(JOINTS, sample.joint_rad.len()).copy_from_slice(&sample.joint_rad);
        self.model.pose(&q)
    }

    /// Draws the root link as the convex hull of its centre of mass and its joints.
    fn body(&self, camera: &Camera, pose: &Pose, stroke: f64) -> Piece {
        let robot = self.model.robot();
        let on_root = robot.joints.iter().filter(|joint| joint.parent == 0);
        let mut corners: Vec<Vector3<f64>> =
            on_root.map(|joint| pose.frames.link_origins[joint.child]).collect();
        corners.push(pose.frames.point(0, &robot.links[0].com_in_link_m));
        let hull = convex_hull(corners.iter().map(|c| camera.project(c)).collect());
        let path = closed_path(&hull).set("class", "body").set("stroke-width", px(0.09 * stroke));
        let center = corners.iter().sum::<Vector3<f64>>() / corners.len() as f64;
        Piece { depth: camera.depth(&center), group: Group::new().add(path) }
    }

    /// Draws a limb as a line through its joints to the centre of its end effector.
    fn limb(&self, camera: &Camera, pose: &Pose, j: usize, stroke: f64) -> Piece {
        let robot = self.model.robot();
        let joints =
            self.model.chain(j).dofs.iter().filter(|&&dof| dof >= JOINTS).map(|dof| dof - JOINTS);
        let mut points: Vec<Vector3<f64>> =
            joints.map(|k| pose.frames.link_origins[robot.joints[k].child]).collect();
        points.push(pose.end_effectors[j].center);
        let page: Vec<[f64; 2]> = points.iter().map(|p| camera.project(p)).collect();
        let mut group = Group::new();
        for (k, ends) in page.windows(2).enumerate() {
            let width = px(stroke * (0.05 - 0.007 * k.min(4) as f64));
            group =
                group.add(line(ends[0], ends[1]).set("class", "limb").set("stroke-width", width));
        }
        for &[x, y] in &page[..page.len() - 1] {
            let dot = Circle::new().set("cx", px(x)).set("cy", px(y)).set("r", px(0.02 * stroke));
            group = group.add(dot.set("class", "joint"));
        }
        let center = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        Piece { depth: camera.depth(&center), group }
    }

    /// Draws a wheel with a spoke or the sphere of a foot, with a mark on the ground in stance.
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
        let radius = end_effector.radius_m * camera.px_per_m;
        let mut group = Group::new();
        if state.contact {
            let mark_px = radius.max(5.0);
            let mark = ellipse(camera.project(&state.position_m.into()), [mark_px, 0.3 * mark_px]);
            group = group.add(mark.set("class", "stands"));
        }
        let page = camera.project(&center);
        if end_effector.contact.rolls() {
            let frame = ContactFrame::wheel(end_effector.radius_m, state.tilt_rad, state.yaw_rad);
            let turn = Rotation3::from_axis_angle(&Unit::new_normalize(frame.axis), spin_rad);
            let hub = camera.project(&(center + frame.axis));
            let rim = rim(page, [hub[0] - page[0], hub[1] - page[1]], radius, camera.px_per_m);
            let spoke = line(page, camera.project(&(center + turn * frame.to_contact)));
            group = group
                .add(rim.set("class", "wheel").set("stroke-width", px(0.28 * radius)))
                .add(spoke.set("class", "spoke").set("stroke-width", px(0.16 * radius)));
        } else {
            let [x, y] = page;
            let dot = Circle::new().set("cx", px(x)).set("cy", px(y)).set("r", px(radius.max(2.5)));
            group = group.add(dot.set("class", "foot"));
        }
        Piece { depth: camera.depth(&center), group }
    }
}

/// Parallel projection of a circle: an ellipse with the radius of the circle across its axis, and a smaller one along it.
/// `axis` is the projection of the axis' unit vector; its length is `px_per_m` if the axis is in the page.
fn rim(center: [f64; 2], axis: [f64; 2], radius: f64, px_per_m: f64) -> Ellipse {
    let in_page = (axis[0].hypot(axis[1]) / px_per_m).min(1.0);
    let along = radius * (1.0 - in_page * in_page).sqrt();
    let turn_deg = px(axis[1].atan2(axis[0]).to_degrees());
    let [x, y] = center.map(px);
    ellipse(center, [along, radius]).set("transform", format!("rotate({turn_deg} {x} {y})"))
}

fn ellipse([x, y]: [f64; 2], [rx, ry]: [f64; 2]) -> Ellipse {
    Ellipse::new().set("cx", px(x)).set("cy", px(y)).set("rx", px(rx)).set("ry", px(ry))
}

fn line(from: [f64; 2], to: [f64; 2]) -> Line {
    let line = Line::new().set("x1", px(from[0])).set("y1", px(from[1]));
    line.set("x2", px(to[0])).set("y2", px(to[1]))
}

/// Draws an arrow. `None` if the arrow is shorter than its head.
fn arrow(from: [f64; 2], to: [f64; 2]) -> Option<Path> {
    const HEAD_PX: f64 = 5.0;
    let way = [to[0] - from[0], to[1] - from[1]];
    let length = way[0].hypot(way[1]);
    if length < HEAD_PX {
        return None;
    }
    let [along, across] = [way, [-way[1], way[0]]].map(|v| v.map(|c| c / length * HEAD_PX));
    let barb = |side: f64| {
        let x = to[0] - along[0] + side * 0.6 * across[0];
        format!("{} {}", px(x), px(to[1] - along[1] + side * 0.6 * across[1]))
    };
    let [[x1, y1], [x2, y2]] = [from, to].map(|p| p.map(px));
    let data = format!("M{x1} {y1}L{x2} {y2}M{}L{x2} {y2}L{}", barb(1.0), barb(-1.0));
    Some(Path::new().set("d", data).set("class", "force"))
}

/// Closed path through page points.
pub fn closed_path(points: &[[f64; 2]]) -> Path {
    let corners: Vec<String> =
        points.iter().map(|[x, y]| format!("{} {}", px(*x), px(*y))).collect();
    Path::new().set("d", format!("M{}Z", corners.join("L")))
}
