//! Picture of a standing robot without a plan, with the names of its joints and end effectors.

use super::camera::Camera;
use super::robot::{Figure, STYLE, closed_path};
use super::style::{self, FAINT, HEADER_HEIGHT, INK, MARGIN, heading, px};
use crate::plan::{EndEffectorSample, Sample};
use crate::problem::state::tilt_and_yaw;
use nalgebra::Vector3;
use rollwalk_multibody::{Standing, Tree};
use rollwalk_robot::Robot;
use svg::node::element::{Group, Polyline, Style, Text, Title};

/// Size of the picture between its columns of names, px.
const PICTURE: [f64; 2] = [520.0, 420.0];
/// Width of a column of names, px.
const COLUMN_WIDTH: f64 = 190.0;
/// Minimum distance of two names in a column, px.
const ROW: f64 = 17.0;
/// Fraction of the picture that the robot fills.
const FILL: f64 = 0.8;
/// Half width of the ground, as a fraction of the robot's diameter.
const GROUND: f64 = 0.55;

/// Draws a robot in its nominal pose as SVG text. `None` if a wheel lies flat, so that the robot cannot stand.
pub fn robot(robot: &Robot) -> Option<String> {
    let standing = Standing::new(&Tree::new(robot))?;
    let sample = sample(robot, &standing);
    let figure = Figure::new(robot);
    let px_per_m = FILL * PICTURE[0].min(PICTURE[1]) / figure.extent_m();
    let middle = 0.5 * sample.base_position_m[2];
    let width = PICTURE[0] + 2.0 * (COLUMN_WIDTH + MARGIN);
    let camera = Camera {
        target_m: Vector3::new(standing.com.x, standing.com.y, middle),
        origin: [0.5 * width, HEADER_HEIGHT + 0.5 * PICTURE[1]],
        px_per_m,
    };
    let still = vec![0.0; robot.end_effectors.len()];
    let picture = figure.draw(&camera, &sample, &still);
    let names = names(robot, &standing);
    let names: Vec<_> = names.iter().map(|(name, at)| (*name, camera.project(at))).collect();
    let middle_px = 0.5 * width;
    let (left, right): (Vec<_>, Vec<_>) = names.into_iter().partition(|(_, at)| at[0] < middle_px);
    let rows = left.len().max(right.len()) as f64;
    let height = HEADER_HEIGHT + PICTURE[1].max(ROW * rows) + MARGIN;
    let title = format!(
        "{:.3} kg · {} joints · {} end effectors · body {:.3} m above the ground",
        robot.total_mass_kg(),
        robot.joints.len(),
        robot.end_effectors.len(),
        standing.frames.link_origins[0].z,
    );
    let document = style::document(width, height)
        .set("role", "img")
        .set("aria-label", robot.name.clone())
        .add(Title::new(robot.name.clone()))
        .add(Style::new(STYLE))
        .add(heading([robot.name.clone(), title]))
        .add(ground(&camera, figure.extent_m(), &standing))
        .add(picture)
        .add(column(left, Side::Left, width, height))
        .add(column(right, Side::Right, width, height));
    Some(format!("{document}\n"))
}

/// Converts the standing robot to a sample of a plan.
fn sample(robot: &Robot, standing: &Standing) -> Sample {
    let feet = robot.end_effectors.iter().zip(&standing.contacts);
    let foot =
        |(foot, contact): (&rollwalk_robot::EndEffector, &rollwalk_multibody::StandingContact)| {
            let turn = &standing.frames.world_from_link[foot.link];
            let axis = foot.contact.axis_in_link().map(|axis| turn * axis);
            let (tilt_rad, yaw_rad) = axis.map_or((0.0, 0.0), |axis| tilt_and_yaw(&axis, 0.0));
            EndEffectorSample {
                contact: contact.force_n > 0.0,
                position_m: contact.position.into(),
                force_n: [0.0, 0.0, contact.force_n],
                wheel_speed_rad_s: 0.0,
                motor_speed_rad_s: 0.0,
                motor_torque_nm: foot.contact.actuator().map(|_| 0.0),
                tilt_rad,
                yaw_rad,
            }
        };
    Sample {
        time_s: 0.0,
        base_position_m: standing.frames.link_origins[0].into(),
        base_yaw_pitch_roll_rad: [0.0; 3],
        base_orientation_wxyz: [1.0, 0.0, 0.0, 0.0],
        joint_rad: robot.joints.iter().map(|joint| joint.nominal_rad).collect(),
        joint_correction_rad: Vec::new(),
        joint_torque_nm: standing.torque_nm.clone(),
        com_m: standing.com.into(),
        end_effectors: feet.map(foot).collect(),
    }
}

/// Names of joints and end effectors with their positions in the world, m.
fn names<'r>(robot: &'r Robot, standing: &Standing) -> Vec<(&'r str, Vector3<f64>)> {
    let frames = &standing.frames;
    let joints = robot.joints.iter().map(|j| (j.name.as_str(), frames.link_origins[j.child]));
    let feet = robot.end_effectors.iter();
    let feet = feet.map(|e| (e.name.as_str(), frames.point(e.link, &e.center_in_link_m)));
    joints.chain(feet).collect()
}

#[derive(Clone, Copy, PartialEq)]
enum Side {
    Left,
    Right,
}

/// Draws names beside the picture, ordered by height, each with a line to its joint or end effector.
fn column(mut names: Vec<(&str, [f64; 2])>, side: Side, width: f64, height: f64) -> Group {
    names.sort_by(|a, b| a.1[1].total_cmp(&b.1[1]));
    // From the top downwards, each row keeps its distance to the previous row. The last row is on the page.
    let mut rows: Vec<f64> = Vec::new();
    for (index, (_, at)) in names.iter().enumerate() {
        let below = (names.len() - 1 - index) as f64 * ROW;
        let least = rows.last().map_or(HEADER_HEIGHT + ROW, |last| last + ROW);
        rows.push(at[1].min(height - MARGIN - below).max(least));
    }
    let (text_x, anchor, towards) = match side {
        Side::Left => (MARGIN + COLUMN_WIDTH, "end", 1.0),
        Side::Right => (width - MARGIN - COLUMN_WIDTH, "start", -1.0),
    };
    names.iter().zip(rows).fold(Group::new(), |group, ((name, at), y)| {
        let points = [[text_x + towards * 6.0, y], [text_x + towards * 22.0, y], *at];
        let points: Vec<_> = points.iter().map(|[x, y]| format!("{},{}", px(*x), px(*y))).collect();
        let line = Polyline::new().set("points", points.join(" ")).set("fill", "none");
        let text = Text::new(*name).set("x", px(text_x)).set("y", px(y + 4.0));
        group
            .add(line.set("stroke", FAINT).set("stroke-width", 0.7))
            .add(text.set("font-size", 12).set("text-anchor", anchor).set("fill", INK))
    })
}

/// Draws a patch of ground below the robot.
fn ground(camera: &Camera, extent_m: f64, standing: &Standing) -> svg::node::element::Path {
    let half_m = GROUND * extent_m;
    let [x, y] = [standing.com.x, standing.com.y];
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let corners = corners.map(|[a, b]| Vector3::new(x + a * half_m, y + b * half_m, 0.0));
    let patch = closed_path(&corners.map(|corner| camera.project(&corner)));
    patch.set("fill", "#f5f7fa").set("stroke", "#e4e7eb")
}

#[cfg(test)]
mod tests {
    use crate::test_robots;

    #[test]
    fn every_joint_and_end_effector_has_its_name_and_a_line_to_its_place() {
        for robot in test_robots::all() {
            let text = super::robot(&robot).expect("it stands");
            let joints = robot.joints.iter().map(|joint| &joint.name);
            let names: Vec<_> = joints.chain(robot.end_effectors.iter().map(|e| &e.name)).collect();
            let lines: Vec<_> = text.lines().map(str::trim).collect();
            for name in &names {
                assert!(lines.contains(&name.as_str()), "{}: {name}", robot.name);
            }
            assert_eq!(text.matches("<polyline").count(), names.len(), "{}", robot.name);
        }
    }
}
