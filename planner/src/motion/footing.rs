//! Ground of a motion, as its body, stances, swings and links need it.
//!
//! On smooth ground all of these are one height map. A terrain has walls, where a height map has no slope:
//!
//! - Feet and wheels that step stand on treads, the planes between walls, with a margin to each border.
//! - Wheels that only roll follow the surface that a disc of their radius can touch.
//! - Swings follow an envelope, the highest ground within their reach.
//! - The body follows the mean ground below the robot.
//! - Links keep their distance from the terrain itself.
//!
//! A sensed elevation map gets the same maps (`mapped`). A foot that stands keeps the height of its foothold (`stand`).

mod mapped;
mod margins;
mod patch;
mod stand;

pub use margins::ContactMargins;
pub(super) use margins::standing_height_m;
pub use patch::{Border, Patch};
pub use stand::Stand;

use mapped::{Mapped, Steppable};
use margins::{DISC, WHEEL_DEVIATION, body_deviation_m, swing_deviation_m};
use nalgebra::{Rotation2, Vector2, Vector3};
use rollwalk_multibody::ground::file::Shape;
use rollwalk_multibody::ground::obstacle::Obstacle;
use rollwalk_multibody::ground::{
    Contour, ElevationGrid, ElevationMap, FieldError, Filter, Ground, HeightField, Profile,
    Terrain, Tread,
};
use rollwalk_robot::Robot;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Ratio of the distance of footholds from a kink without a wall to the margin.
const KINK: f64 = 1.0 / 3.0;
/// Height difference above which a border between two treads is a wall, m.
const WALL_M: f64 = 0.002;

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
    /// Steppable cells of an elevation map, for each end effector; `None` for one that only rolls. Empty for terrain files.
    steppable: Vec<Option<Arc<Steppable>>>,
    /// Footholds of end effectors that stand at present. Empty for motions from rest.
    stands: Vec<Option<Stand>>,
}

impl PartialEq for TerrainMaps {
    /// Compares terrain, patches and footholds. The maps follow from them.
    fn eq(&self, other: &Self) -> bool {
        let Self { terrain, patches, stands, .. } = self;
        (terrain, patches, stands) == (&other.terrain, &other.patches, &other.stands)
    }
}

impl TerrainMaps {
    /// Terrain with the map of the ground under the body, without maps of end effectors.
    fn new(terrain: Terrain, body: ElevationMap) -> Self {
        Self {
            solid: terrain.solid(),
            bare: terrain.ground(),
            terrain,
            body,
            rolled: Vec::new(),
            envelopes: Vec::new(),
            patches: Vec::new(),
            steppable: Vec::new(),
            stands: Vec::new(),
        }
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
        let body = maps.body();
        let maps = TerrainMaps { rolled, envelopes, patches, ..TerrainMaps::new(terrain, body) };
        Self::Terrain(Arc::new(maps))
    }

    /// Ground of a robot on a sensed elevation map. Flags of `rolls` are set for the end effectors that never leave the ground.
    ///
    /// # Errors
    /// Returns an error if the grid is not valid, or if no height is known.
    pub fn mapped(
        sensed: &ElevationGrid,
        margins: &ContactMargins,
        robot: &Robot,
        rolls: &[bool],
    ) -> Result<Self, FieldError> {
        let Mapped { field, body, rolled, envelopes, steppable } =
            Mapped::new(sensed, margins, robot, rolls)?;
        let (toml, obstacles) = (String::new(), Vec::new());
        let terrain = Terrain { toml, shape: Shape::Field(field), heading_rad: 0.0, obstacles };
        let patches = vec![Vec::new(); robot.end_effectors.len()];
        let maps = TerrainMaps::new(terrain, body);
        let maps = TerrainMaps { rolled, envelopes, patches, steppable, ..maps };
        Ok(Self::Terrain(Arc::new(maps)))
    }

    /// Ground with the footholds of end effectors that stand; `None` for end effectors in the air. Level ground has none.
    pub fn with_stands(&self, stands: Vec<Option<Stand>>) -> Self {
        match self {
            Self::Smooth(_) => self.clone(),
            Self::Terrain(maps) => {
                let mut maps = maps.as_ref().clone();
                maps.stands = stands;
                Self::Terrain(Arc::new(maps))
            }
        }
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

    /// Returns true if the ground has edges, which add constraint rows for footholds and swings.
    pub fn has_edges(&self) -> bool {
        let Self::Terrain(maps) = self else { return false };
        !maps.steppable.is_empty() || matches!(maps.terrain.shape, Shape::Profile(_))
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

    /// Ground at the contact of end effector `j` with this centre, in stance or swing.
    pub fn contact(&self, j: usize, stands: bool, center_m: &Vector3<f64>) -> ElevationMap {
        match self {
            Self::Smooth(map) => map.clone(),
            Self::Terrain(maps) if !stands => maps.envelopes[j].clone(),
            Self::Terrain(maps) => {
                let planned = self.in_stance(j, &center_m.xy());
                let stand = maps.stands.get(j).and_then(Option::as_ref);
                let stand = stand.filter(|stand| stand.is_below(center_m, &planned));
                stand.map_or(planned, Stand::map)
            }
        }
    }

    /// Ground in a stance of end effector `j` that begins near a point.
    fn in_stance(&self, j: usize, near: &Vector2<f64>) -> ElevationMap {
        match self {
            Self::Smooth(map) => map.clone(),
            Self::Terrain(maps) => {
                let steppable = maps.steppable.get(j).and_then(Option::as_ref);
                let tread = || nearest(&maps.patches[j], near).map(|patch| patch.plane.clone());
                let rolled = maps.rolled[j].clone().or_else(|| Some(steppable?.map.clone()));
                rolled.or_else(tread).unwrap_or_else(|| maps.envelopes[j].clone())
            }
        }
    }

    /// Patch on which end effector `j` stands if its foothold is planned at a point. `None` for end effectors that only roll, and
    /// on ground without edges.
    pub fn patch(&self, j: usize, near: &Vector2<f64>) -> Option<Patch> {
        let Self::Terrain(maps) = self else { return None };
        match maps.steppable.get(j).and_then(Option::as_ref) {
            Some(steppable) => steppable.patch(near),
            None => nearest(&maps.patches[j], near).cloned(),
        }
    }

    /// Returns true if end effector `j` may stand only on a patch.
    pub fn needs_patch(&self, j: usize) -> bool {
        matches!(self, Self::Terrain(maps) if self.has_edges() && maps.rolled[j].is_none())
    }

    /// Vertical height of a point above the ground itself, m. Behind the face of a step, the ground is its tread.
    pub fn height_above_m(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Smooth(map) => map.height_above_m(point),
            Self::Terrain(maps) => point.z - maps.terrain.height_m(&point.xy()),
        }
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

/// Patch with the point that is nearest to a point.
fn nearest<'a>(patches: &'a [Patch], near: &Vector2<f64>) -> Option<&'a Patch> {
    let off = |patch: &&Patch| (patch.nearest(near) - near).norm_squared();
    patches.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
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

    /// Elevation map of ground without edges: level, a slope or a height field. `None` for a profile.
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

    /// Standard deviation of the filter that smooths a swing's envelope, m.
    fn swing_deviation_m(&self) -> f64 {
        swing_deviation_m(self.margins)
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

    fn body(&self) -> ElevationMap {
        let deviation_m = body_deviation_m(self.robot, self.margins);
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
    fn a_point_behind_the_face_of_a_step_is_below_its_tread() {
        let ground = stepping("heading_deg = 90\n[step]\nat_x_m = 0.3\nheight_m = 0.05");
        for (y_m, height_m) in [(0.303, -0.04), (0.297, 0.01)] {
            let found_m = ground.height_above_m(&Vector3::new(0.7, y_m, 0.01));
            assert!((found_m - height_m).abs() < 1e-12, "{y_m}: {found_m}");
        }
        let (distance_m, _) = ground.distance(&Vector3::new(0.7, 0.303, 0.01));
        assert!((distance_m + 0.003).abs() < 1e-12, "{distance_m}");
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

    /// Ground of a robot whose feet step, with a kerb of 60 mm at x = 0.31 m.
    fn kerb(noise_m: f64) -> Footing {
        let robot = &test_robots::all()[0];
        let mut rng = fastrand::Rng::with_seed(2);
        let grid = ElevationGrid::around(Vector2::zeros(), 0.8, 0.02, |at| {
            (if at.x > 0.31 { 0.06 } else { 0.0 }) + noise_m * 2.0 * (rng.f64() - 0.5)
        });
        let rolls = vec![false; robot.end_effectors.len()];
        Footing::mapped(&grid, &MARGINS, robot, &rolls).unwrap()
    }

    #[test]
    fn footholds_keep_their_distance_from_edges_and_walls() {
        let robot = &test_robots::all()[0];
        let below_m = MARGINS.swing_reach_m + robot.end_effectors[0].radius_m;
        for ground in [kerb(0.0), kerb(0.004)] {
            assert!(ground.has_edges() && !ground.is_level());
            for (near_m, range_m, height_m) in [
                (0.0, -0.01..=0.01, 0.0),
                (0.33, 0.31 + 0.03..=0.31 + 0.09, 0.06),
                (0.27, 0.31 - below_m - 0.09..=0.31 - below_m, 0.0),
                (0.6, 0.59..=0.61, 0.06),
            ] {
                let near = Vector2::new(near_m, 0.1);
                let patch = ground.patch(0, &near).unwrap();
                let place = patch.nearest(&near);
                assert!(range_m.contains(&place.x), "{near_m}: {place:?}");
                let found_m = patch.plane.at(&place.push(0.0)).height_m;
                assert!((found_m - height_m).abs() < 0.004, "{near_m}: {found_m}");
            }
        }
    }

    #[test]
    fn a_foothold_keeps_its_height_when_the_map_is_exchanged() {
        let (before, after) = (kerb(0.0), kerb(0.004));
        let robot = &test_robots::all()[0];
        let radius_m = robot.end_effectors[0].radius_m;
        let place = Vector2::new(0.1, 0.05);
        let height_m = before.contact(0, true, &place.push(radius_m)).at(&place.push(0.0)).height_m;
        let contact = place.push(height_m + 0.007);
        let center = contact + Vector3::z() * radius_m;
        let map = after.contact(0, true, &center);
        let mut stands = vec![None; robot.end_effectors.len()];
        stands[0] = Some(Stand::new(map, contact, radius_m));
        let kept = after.with_stands(stands);
        let above_m =
            |ground: &Footing, j| ground.contact(j, true, &center).height_above_m(&contact);
        assert!(above_m(&kept, 0).abs() < 1e-12);
        assert_eq!(above_m(&kept, 1), above_m(&after, 1));
        // The next stance is on the kerb.
        let next = Vector3::new(0.4, 0.05, 0.3);
        assert_eq!(kept.contact(0, true, &next), after.contact(0, true, &next));
    }
}
