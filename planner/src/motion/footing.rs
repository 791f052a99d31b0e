//! Ground of a motion, as its body, stances, swings and links need it.
//!
//! On smooth ground all of these are one height map. A terrain has walls, where a height map has no slope:
//!
//! - Feet and wheels that step stand on treads, the planes between walls, with a margin to each border.
//! - Wheels that only roll follow the surface that a disc of their radius can touch.
//! - Swings follow an envelope, the highest ground within their reach.
//! - The body follows the mean ground below the robot.
//! - Links keep their distance from the terrain itself.

use nalgebra::{Rotation2, Vector2, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, Model};
use rollwalk_multibody::ground::file::Shape;
use rollwalk_multibody::ground::obstacle::Obstacle;
use rollwalk_multibody::ground::{
    Contour, ElevationMap, Filter, Ground, HeightField, Profile, Terrain, Tread,
};
use rollwalk_robot::Robot;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Distances between contacts and the edges of a terrain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactMargins {
    /// Distance of footholds from edges that drop, m.
    pub margin_m: f64,
    /// Distance from a wall at which a swing is above it, m. Must be at least the distance that a foot covers in one sample.
    pub swing_reach_m: f64,
}

/// Ratio of the default margin to the standing height.
const MARGIN: f64 = 0.13;
/// Ratio of the default reach of a swing to the standing height.
const SWING_REACH: f64 = 0.17;
/// Ratio of the standard deviation that smooths a swing's envelope to the reach of the swing.
const SWING_DEVIATION: f64 = 0.25;
/// Ratio of the radius of the rolling disc to that of the wheel. A disc of the wheel's own radius would stop where it touches
/// floor and wall, and the contact point would be undetermined there.
const DISC: f64 = 1.2;
/// Ratio of the standard deviation that smooths the ground under wheels to their radius.
const WHEEL_DEVIATION: f64 = 0.15;
/// Ratio of the standard deviation of the mean ground below the body to the distance between end effectors.
const BODY_DEVIATION: f64 = 2.0 / 3.0;
/// Ratio of the distance of footholds from a kink without a wall to the margin.
const KINK: f64 = 1.0 / 3.0;
/// Height difference above which a border between two treads is a wall, m.
const WALL_M: f64 = 0.002;

impl ContactMargins {
    /// Default margins for a robot.
    pub fn of(robot: &Robot) -> Self {
        let height_m = standing_height_m(robot);
        Self { margin_m: MARGIN * height_m, swing_reach_m: SWING_REACH * height_m }
    }
}

/// Height of the body in the nominal posture, m.
pub(super) fn standing_height_m(robot: &Robot) -> f64 {
    Model::new(robot).standing_q(&nominal_rad(robot))[BASE_POSITION + 2].abs()
}

fn nominal_rad(robot: &Robot) -> Vec<f64> {
    robot.joints.iter().map(|joint| joint.nominal_rad).collect()
}

/// Ground of a motion.
#[derive(Clone, Debug, PartialEq)]
pub enum Footing {
    /// Smooth ground.
    Smooth(ElevationMap),
    /// Terrain of a file.
    Terrain(Arc<TerrainMaps>),
}

impl Default for Footing {
    /// The plane z = 0.
    fn default() -> Self {
        Self::Smooth(ElevationMap::default())
    }
}

impl From<ElevationMap> for Footing {
    fn from(map: ElevationMap) -> Self {
        Self::Smooth(map)
    }
}

/// Maps of a terrain for one robot.
#[derive(Clone, Debug)]
pub struct TerrainMaps {
    terrain: Terrain,
    /// Solid of ground and obstacles.
    solid: Arc<dyn Ground>,
    /// Solid of the ground without obstacles.
    bare: Arc<dyn Ground>,
    body: ElevationMap,
    /// Ground in stance of each end effector that only rolls; `None` for one that steps.
    rolled: Vec<Option<ElevationMap>>,
    /// Ground in swing of each end effector.
    envelopes: Vec<ElevationMap>,
    /// Treads with their borders, for each end effector that steps. Empty on smooth terrain.
    patches: Vec<Vec<Patch>>,
}

impl PartialEq for TerrainMaps {
    /// Compares terrain and patches. The maps follow from both.
    fn eq(&self, other: &Self) -> bool {
        self.terrain == other.terrain && self.patches == other.patches
    }
}

/// Part of a terrain on which a foot may stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Plane of the patch.
    pub plane: ElevationMap,
    /// Borders, at the margin from the edges.
    pub borders: Vec<Border>,
}

/// Border of a patch: contact points e satisfy n·e ≤ d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    /// Unit normal n, out of the patch.
    pub outward: Vector2<f64>,
    /// Distance d of the border from the origin along its normal, m.
    pub at_m: f64,
}

impl Patch {
    /// Returns the point of the patch that is nearest to a point.
    pub fn nearest(&self, point: &Vector2<f64>) -> Vector2<f64> {
        let over =
            |border: &Border| border.outward * (border.outward.dot(point) - border.at_m).max(0.0);
        point - self.borders.iter().map(over).sum::<Vector2<f64>>()
    }
}

impl Footing {
    /// Ground for the motions of a robot on a terrain. Flags of `rolls` are set for the end effectors that never leave the
    /// ground.
    pub fn on(terrain: Terrain, margins: &ContactMargins, robot: &Robot, rolls: &[bool]) -> Self {
        let maps = Maps { terrain: &terrain, margins, robot };
        let (mut rolled, mut envelopes, mut patches) = (Vec::new(), Vec::new(), Vec::new());
        for (foot, never_lifts) in robot.end_effectors.iter().zip(rolls) {
            let is_wheel = foot.contact.rolls();
            let rolls = is_wheel && *never_lifts;
            // A wheel keeps its radius from walls.
            let radius_m = if is_wheel { foot.radius_m } else { 0.0 };
            rolled.push(rolls.then(|| maps.under_wheel(foot.radius_m)));
            envelopes.push(maps.envelope(radius_m));
            patches.push(if rolls { Vec::new() } else { maps.patches(radius_m) });
        }
        let (body, solid, bare) = (maps.body(), terrain.solid(), terrain.ground());
        let maps = TerrainMaps { terrain, solid, bare, body, rolled, envelopes, patches };
        Self::Terrain(Arc::new(maps))
    }

    /// Returns true if the ground has constant height.
    pub fn is_level(&self) -> bool {
        self.body().is_level()
    }

    /// Terrain of the ground, if any.
    pub fn terrain(&self) -> Option<&Terrain> {
        match self {
            Self::Smooth(_) => None,
            Self::Terrain(maps) => Some(&maps.terrain),
        }
    }

    /// Obstacles on the ground.
    pub fn obstacles(&self) -> &[Obstacle] {
        self.terrain().map_or(&[], |terrain| &terrain.obstacles)
    }

    /// Returns true if the ground has edges, so that footholds and swings need rows of their own.
    pub fn has_edges(&self) -> bool {
        self.terrain().is_some_and(|terrain| matches!(terrain.shape, Shape::Profile(_)))
    }

    /// Solid of the terrain, for simulations; `None` for ground without a terrain.
    pub fn solid(&self) -> Option<Arc<dyn Ground>> {
        match self {
            Self::Smooth(_) => None,
            Self::Terrain(maps) => Some(Arc::clone(&maps.solid)),
        }
    }

    /// Mean ground below the body.
    pub fn body(&self) -> &ElevationMap {
        match self {
            Self::Smooth(map) => map,
            Self::Terrain(maps) => &maps.body,
        }
    }

    /// Ground at the contact of end effector `j`, in stance or swing, near a point.
    pub fn contact(&self, j: usize, stands: bool, near: &Vector3<f64>) -> ElevationMap {
        match self {
            Self::Smooth(map) => map.clone(),
            Self::Terrain(maps) if !stands => maps.envelopes[j].clone(),
            Self::Terrain(maps) => match (&maps.rolled[j], self.patch(j, &near.xy())) {
                (Some(map), _) => map.clone(),
                (None, Some(patch)) => patch.plane.clone(),
                (None, None) => maps.envelopes[j].clone(),
            },
        }
    }

    /// Patch on which end effector `j` stands if its foothold is planned at a point. `None` for end effectors that only roll, and
    /// on ground without edges.
    pub fn patch(&self, j: usize, near: &Vector2<f64>) -> Option<&Patch> {
        let Self::Terrain(maps) = self else { return None };
        let off = |patch: &&Patch| (patch.nearest(near) - near).norm_squared();
        maps.patches[j].iter().min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// First-order distance of a point from the ground, m, and its gradient.
    pub fn distance(&self, point: &Vector3<f64>) -> (f64, Vector3<f64>) {
        match self {
            Self::Smooth(map) => map.distance(point),
            Self::Terrain(maps) => {
                let surface = maps.bare.at(point);
                (surface.gap_m, surface.gradient)
            }
        }
    }
}

/// Maker of the maps of a terrain.
struct Maps<'a> {
    terrain: &'a Terrain,
    margins: &'a ContactMargins,
    robot: &'a Robot,
}

impl Maps<'_> {
    fn contour(&self, profile: &Profile, filter: Filter, deviation_m: f64) -> ElevationMap {
        let contour = Contour::of(profile, filter, deviation_m);
        ElevationMap::Contour(Arc::new(contour)).turned(self.terrain.heading_rad)
    }

    /// Elevation map of ground without edges: a slope or a height field.
    fn smooth(&self) -> Option<ElevationMap> {
        let map = match &self.terrain.shape {
            Shape::Level => ElevationMap::default(),
            Shape::Slope(angle_rad) => {
                let slope = Vector2::new(angle_rad.tan(), 0.0);
                ElevationMap::Plane { height_m: 0.0, slope }
            }
            Shape::Field(field) => ElevationMap::Field(Arc::clone(field)),
            Shape::Profile(_) => return None,
        };
        Some(map.turned(self.terrain.heading_rad))
    }

    /// Standard deviation of a swing's envelope, m.
    fn swing_deviation_m(&self) -> f64 {
        SWING_DEVIATION * self.margins.swing_reach_m
    }

    fn envelope(&self, radius_m: f64) -> ElevationMap {
        match &self.terrain.shape {
            Shape::Profile(profile) => {
                let reach_m = self.margins.swing_reach_m + radius_m;
                self.contour(profile, Filter::Highest(reach_m), self.swing_deviation_m())
            }
            _ => self.smooth().expect("no profile"),
        }
    }

    fn under_wheel(&self, radius_m: f64) -> ElevationMap {
        match &self.terrain.shape {
            Shape::Profile(profile) => {
                let rolled = Filter::Rolled(DISC * radius_m);
                self.contour(profile, rolled, WHEEL_DEVIATION * radius_m)
            }
            _ => self.smooth().expect("no profile"),
        }
    }

    /// Standard deviation of the mean ground below the body, m.
    fn body_deviation_m(&self) -> f64 {
        let model = Model::new(self.robot);
        let pose = model.pose_values(&model.standing_q(&nominal_rad(self.robot)));
        let along = |axis: usize| {
            let places = pose.end_effectors.iter().map(|mount| mount.center[axis]);
            let (least, most) = places
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), at| {
                    (least.min(at), most.max(at))
                });
            most - least
        };
        BODY_DEVIATION * along(0).max(along(1)).max(self.margins.swing_reach_m)
    }

    fn body(&self) -> ElevationMap {
        let deviation_m = self.body_deviation_m();
        match &self.terrain.shape {
            Shape::Level | Shape::Slope(_) => self.smooth().expect("a plane"),
            Shape::Profile(profile) => self.contour(profile, Filter::Plain, deviation_m),
            Shape::Field(field) => {
                let blurred: HeightField = field.blurred(deviation_m);
                ElevationMap::Field(Arc::new(blurred)).turned(self.terrain.heading_rad)
            }
        }
    }

    /// Treads on which an end effector can stand. A wheel keeps its radius from walls.
    fn patches(&self, radius_m: f64) -> Vec<Patch> {
        let Shape::Profile(profile) = &self.terrain.shape else { return Vec::new() };
        let treads = profile.treads();
        let margin_m = self.margins.margin_m;
        // Below a wall the envelope must have come down to the tread: 2.5 standard deviations.
        let below_m = self.margins.swing_reach_m + radius_m + 2.5 * self.swing_deviation_m();
        let to_border = |here: &Tread, beside: &Tread, x_m: f64| {
            let rise_m = beside.height_m(x_m) - here.height_m(x_m);
            if rise_m.abs() < WALL_M {
                KINK * margin_m
            } else if rise_m > 0.0 {
                below_m
            } else {
                margin_m
            }
        };
        let turn = Rotation2::new(self.terrain.heading_rad);
        let along = turn * Vector2::x();
        let patch = |k: usize| {
            let tread = &treads[k];
            let from_m = match k.checked_sub(1) {
                Some(before) => tread.from_m + to_border(tread, &treads[before], tread.from_m),
                None => f64::NEG_INFINITY,
            };
            let to_m = match treads.get(k + 1) {
                Some(after) => tread.to_m - to_border(tread, after, tread.to_m),
                None => f64::INFINITY,
            };
            let plane = match tread.slope {
                0.0 => ElevationMap::Plane { height_m: tread.at_m[1], slope: Vector2::zeros() },
                slope => ElevationMap::Plane {
                    height_m: tread.height_m(0.0),
                    slope: Vector2::new(slope, 0.0),
                },
            };
            let borders = [(-along, -from_m), (along, to_m)];
            let borders = borders.into_iter().filter(|(_, at_m)| at_m.is_finite());
            (from_m <= to_m).then(|| Patch {
                plane: plane.turned(self.terrain.heading_rad),
                borders: borders.map(|(outward, at_m)| Border { outward, at_m }).collect(),
            })
        };
        (0..treads.len()).filter_map(patch).collect()
    }
}

/// Terrain of a motion as plan files store it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionTerrain {
    /// Text of the terrain file.
    pub toml: String,
    /// Distances of contacts from edges.
    pub margins: ContactMargins,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_robots;
    use rollwalk_multibody::ground::file::from_toml;

    const STAIRS: &str = "[stairs]\nat_x_m = 0.3\ncount = 2\nriser_m = 0.05\ntread_m = 0.4";
    const MARGINS: ContactMargins = ContactMargins { margin_m: 0.03, swing_reach_m: 0.04 };

    /// Ground of a robot whose feet step, on a terrain.
    fn stepping(toml: &str) -> Footing {
        let robot = &test_robots::all()[0];
        let rolls = vec![false; robot.end_effectors.len()];
        Footing::on(from_toml("test.toml", toml).unwrap(), &MARGINS, robot, &rolls)
    }

    #[test]
    fn a_foothold_near_an_edge_moves_onto_the_nearest_tread() {
        let robot = &test_robots::all()[0];
        let ground = stepping(STAIRS);
        // AgileBot's wheels keep their radius from walls.
        let below_m = 0.04 + robot.end_effectors[0].radius_m + 2.5 * 0.01;
        for (near_m, place_m, height_m) in [
            (0.0, 0.0, 0.0),
            (0.29, 0.3 + 0.03, 0.05),
            (0.2, 0.3 - below_m, 0.0),
            (0.5, 0.5, 0.05),
            (0.69, 0.7 + 0.03, 0.1),
            (2.0, 2.0, 0.1),
        ] {
            let near = Vector2::new(near_m, 0.2);
            let patch = ground.patch(0, &near).unwrap();
            let place = patch.nearest(&near);
            assert!((place - Vector2::new(place_m, 0.2)).amax() < 1e-12, "{near_m}: {place}");
            let found_m = patch.plane.at(&place.push(0.0)).height_m;
            assert!((found_m - height_m).abs() < 1e-12, "{near_m}: {found_m}");
        }
    }

    #[test]
    fn treads_that_are_too_short_carry_nothing() {
        let ground = stepping(&STAIRS.replace("tread_m = 0.4", "tread_m = 0.1"));
        for near_m in [0.3, 0.35, 0.4] {
            let near = Vector2::new(near_m, 0.0);
            let height_m = ground.patch(0, &near).unwrap().plane.at(&near.push(0.0)).height_m;
            assert!(height_m == 0.0 || height_m == 0.1, "{near_m}: {height_m}");
        }
    }

    #[test]
    fn borders_turn_with_the_terrain() {
        let ground = stepping(&format!("heading_deg = 90\n{STAIRS}"));
        let place = ground.patch(0, &Vector2::new(0.0, 0.31)).unwrap();
        let nearest = place.nearest(&Vector2::new(-0.1, 0.31));
        assert!((nearest - Vector2::new(-0.1, 0.33)).amax() < 1e-12, "{nearest}");
    }

    #[test]
    fn smooth_terrain_has_one_map_and_no_patches() {
        for toml in [
            "[slope]\nangle_deg = 10",
            "[rough]\nheight_m = 0.02\nspacing_m = 0.2\nhalf_m = 2\nseed = 1",
        ] {
            let ground = stepping(toml);
            let near = Vector3::new(0.4, 0.1, 0.0);
            assert!(!ground.has_edges() && ground.patch(0, &near.xy()).is_none());
            let [stance, swing] =
                [true, false].map(|stands| ground.contact(0, stands, &near).at(&near));
            assert_eq!(stance, swing);
            let (distance_m, _) = ground.distance(&(near + Vector3::z() * stance.height_m));
            assert!(distance_m.abs() < 1e-9, "{toml}: {distance_m}");
        }
    }
}
