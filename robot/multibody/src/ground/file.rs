//! Terrain files: TOML files that describe ground and obstacles (docs/terrain-files.md).

use super::obstacle::Obstacle;
use super::obstacle_file::{self, FAR_M};
use super::terrain::CORNER_MIN_M;
use super::{Ground, GroundWithObstacles, HeightField, Plane, Profile, RotatedGround};
use nalgebra::{Rotation2, Vector2};
use rollwalk_robot::document::{Document, DocumentError, Table, alternatives};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Maximum slope, up or down, degrees.
pub const SLOPE_MAX_DEG: f64 = 45.0;
/// Maximum number of corners in a profile.
const CORNERS_MAX: usize = 200;
/// Maximum number of risers of stairs.
const STAIRS_MAX: u32 = 100;
/// Maximum number of heights in a field.
const HEIGHTS_MAX: usize = 250_000;

/// Maximum absolute height of the ground, m.
const HEIGHT_MAX_M: f64 = 10.0;

/// Ground of a terrain file.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    /// Text of the file.
    pub toml: String,
    /// Shape before it is turned.
    pub shape: Shape,
    /// Heading of the shape's x axis, rad.
    pub heading_rad: f64,
    /// Obstacles on the ground, in world axes.
    pub obstacles: Vec<Obstacle>,
}

/// Shape of a terrain.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Plane z = 0.
    Level,
    /// Plane through the origin that rises along x by an angle, rad.
    Slope(f64),
    /// Heights along x.
    Profile(Profile),
    /// Heights on a grid.
    Field(Arc<HeightField>),
}

impl Terrain {
    /// Solid of ground and obstacles, for simulations.
    pub fn solid(&self) -> Arc<dyn Ground> {
        let ground = self.ground();
        if self.obstacles.is_empty() {
            return ground;
        }
        Arc::new(GroundWithObstacles::new(ground, self.obstacles.clone()))
    }

    /// Height of the ground without obstacles, m. At a wall, this is the height of its upper edge.
    pub fn height_m(&self, at: &Vector2<f64>) -> f64 {
        let at = Rotation2::new(-self.heading_rad) * at;
        match &self.shape {
            Shape::Level => 0.0,
            Shape::Slope(angle_rad) => at.x * angle_rad.tan(),
            Shape::Profile(profile) => profile.height_m(at.x),
            Shape::Field(field) => field.elevation(at.x, at.y).height_m,
        }
    }

    /// Solid of the ground without obstacles.
    pub fn ground(&self) -> Arc<dyn Ground> {
        let solid: Arc<dyn Ground> = match &self.shape {
            Shape::Level => Arc::new(Plane::level()),
            Shape::Slope(angle_rad) => Arc::new(Plane::rising(*angle_rad)),
            Shape::Profile(profile) => Arc::new(profile.clone()),
            Shape::Field(field) => Arc::clone(field) as Arc<dyn Ground>,
        };
        match self.heading_rad {
            0.0 => solid,
            heading_rad => Arc::new(RotatedGround::new(solid, heading_rad)),
        }
    }
}

/// Reader of a kind of terrain.
type TerrainReader = fn(&Table<'_>) -> Option<Shape>;

/// Names of the tables for the kinds of terrain, with their readers.
const KINDS: [(&str, TerrainReader); 7] = [
    ("slope", slope),
    ("step", step),
    ("stairs", stairs),
    ("ramp", ramp),
    ("profile", profile),
    ("rough", rough),
    ("height_field", height_field),
];

/// Names of the terrain tables. A terrain file contains one of them, or none if it has obstacles on level ground.
pub fn kinds() -> impl Iterator<Item = &'static str> {
    KINDS.into_iter().map(|(name, _)| name)
}

/// Parses and validates a terrain file. `file_name` appears in messages only.
///
/// # Errors
/// Returns every fault of the file.
pub fn from_toml(file_name: &str, text: &str) -> Result<Terrain, DocumentError> {
    let document = Document::parse(file_name, text)?;
    let read = terrain(&document, text);
    document.finish(read)
}

fn terrain(document: &Document<'_>, text: &str) -> Option<Terrain> {
    let root = document.root();
    let toml = text.to_owned();
    let heading_deg = match root.has("heading_deg") {
        true => root.number_in("heading_deg", -180.0..=180.0, "degrees"),
        false => Some(0.0),
    };
    let mut found = KINDS.into_iter().filter(|(name, _)| root.has(name));
    let (first, second) = (found.next(), found.next());
    let obstacles = obstacle_file::obstacles(&root, heading_deg.unwrap_or(0.0).to_radians());
    root.done();
    if let (Some((first, _)), Some((second, _))) = (first, second) {
        root.fault(
            second,
            format_args!("is a second terrain beside `{first}`"),
            "second terrain",
            "keep one of the two terrains",
        );
    }
    let heading_rad = heading_deg.map(f64::to_radians);
    let Some((name, read)) = first else {
        if root.has(obstacle_file::KEY) {
            let (shape, heading_rad, obstacles) = (Shape::Level, heading_rad?, obstacles?);
            return Some(Terrain { toml, shape, heading_rad, obstacles });
        }
        let names = KINDS.map(|(name, _)| name);
        let help = format!(
            "describe the ground in a table, or obstacles on level ground in [[obstacle]]; {}",
            alternatives("", names)
        );
        document.fault(root.span(), "there is no terrain", "needs a terrain", help);
        return None;
    };
    let table = root.table(name)?;
    let shape = read(&table);
    table.done();
    let (shape, heading_rad, obstacles) = (shape?, heading_rad?, obstacles?);
    Some(Terrain { toml, shape, heading_rad, obstacles })
}

fn slope(table: &Table<'_>) -> Option<Shape> {
    let angle_deg = table.number_in("angle_deg", -SLOPE_MAX_DEG..=SLOPE_MAX_DEG, "degrees")?;
    Some(Shape::Slope(angle_deg.to_radians()))
}

fn step(table: &Table<'_>) -> Option<Shape> {
    let at_x_m = coordinate(table, "at_x_m");
    let height_m = height(table, "height_m");
    Some(Shape::Profile(Profile::step(at_x_m?, height_m?).ok()?))
}

/// Reads stairs with risers of equal height, positive up, and a landing after the final one.
fn stairs(table: &Table<'_>) -> Option<Shape> {
    let at_x_m = coordinate(table, "at_x_m");
    let count = table.integer("count", 1..=STAIRS_MAX);
    let riser_m = height(table, "riser_m");
    let tread_m = table.number_in("tread_m", 0.01..=FAR_M, "m");
    let (at_x_m, count, riser_m, tread_m) = (at_x_m?, count?, riser_m?, tread_m?);
    let riser = |k: u32| {
        let x_m = at_x_m + tread_m * f64::from(k);
        [k, k + 1].map(|step| [x_m, riser_m * f64::from(step)])
    };
    Some(Shape::Profile(Profile::new((0..count).flat_map(riser).collect()).ok()?))
}

fn ramp(table: &Table<'_>) -> Option<Shape> {
    let from_x_m = coordinate(table, "from_x_m");
    let length_m = table.number_in("length_m", 0.001..=FAR_M, "m");
    let height_m = height(table, "height_m");
    Some(Shape::Profile(Profile::ramp(from_x_m?, length_m?, height_m?).ok()?))
}

fn profile(table: &Table<'_>) -> Option<Shape> {
    let x_m = within(table, "x_m", 1..=CORNERS_MAX, FAR_M);
    let z_m = within(table, "z_m", 1..=CORNERS_MAX, HEIGHT_MAX_M);
    let (x_m, z_m) = (x_m?, z_m?);
    if x_m.len() != z_m.len() {
        let problem = format!("has {} numbers, but `x_m` has {}", z_m.len(), x_m.len());
        table.fault("z_m", problem, "another count", "give a height in `z_m` for each x");
        return None;
    }
    let corners = x_m.into_iter().zip(z_m).map(|(x, z)| [x, z]).collect();
    match Profile::new(corners) {
        Ok(profile) => Some(Shape::Profile(profile)),
        Err(why) => {
            table.fault(
                "x_m",
                format_args!("is not a profile: {why}"),
                "not a profile",
                "give x in ascending order, and a step as the same x twice",
            );
            None
        }
    }
}

/// Reads ground with random heights from 0 to `height_m`. Equal seeds give equal heights.
fn rough(table: &Table<'_>) -> Option<Shape> {
    let height_m = table.number_in("height_m", 0.0..=1.0, "m");
    let spacing_m = table.number_in("spacing_m", 0.01..=10.0, "m");
    let half_m = table.number_in("half_m", 0.1..=100.0, "m");
    let seed = table.integer("seed", 0..=u32::MAX);
    let (spacing_m, half_m) = (spacing_m?, half_m?);
    let count = 2 * (half_m / spacing_m).ceil() as usize + 1;
    if count < 4 || count * count > HEIGHTS_MAX {
        let problem =
            format!("is {half_m} m, which gives {count} heights along each side at this spacing");
        let help = format!(
            "choose `half_m` and `spacing_m` for 4 to {} heights along each side",
            HEIGHTS_MAX.isqrt()
        );
        table.fault("half_m", problem, "not a field", help);
        return None;
    }
    let (height_m, mut rng) = (height_m?, fastrand::Rng::with_seed(seed?.into()));
    let heights = (0..count * count).map(|_| height_m * rng.f64()).collect();
    let origin = -0.5 * spacing_m * (count - 1) as f64;
    let field = HeightField::new([origin; 2], spacing_m, [count; 2], heights).ok()?;
    Some(Shape::Field(Arc::new(field)))
}

fn height_field(table: &Table<'_>) -> Option<Shape> {
    let origin_m = table.numbers::<2>("origin_m").filter(|origin_m| {
        let near = origin_m.iter().all(|value| value.abs() <= FAR_M);
        if !near {
            let help = format!("give values from -{FAR_M} to {FAR_M} m");
            table.fault("origin_m", "is too far away", "out of range", help);
        }
        near
    });
    let spacing_m = table.number_in("spacing_m", 0.001..=FAR_M, "m");
    let across = table.integer("columns", 4..=HEIGHTS_MAX as u32 / 4);
    let heights_m = within(table, "heights_m", 16..=HEIGHTS_MAX, HEIGHT_MAX_M);
    let (origin_m, spacing_m, across, heights_m) =
        (origin_m?, spacing_m?, across? as usize, heights_m?);
    let (rows, rest) = (heights_m.len() / across, heights_m.len() % across);
    if rest != 0 {
        let problem =
            format!("has {} numbers, which are not whole rows of {across}", heights_m.len());
        table.fault(
            "heights_m",
            problem,
            "not whole rows",
            "give `columns` heights along x for each row, with rows along y",
        );
        return None;
    }
    match HeightField::new(origin_m, spacing_m, [across, rows], heights_m) {
        Ok(field) => Some(Shape::Field(Arc::new(field))),
        Err(why) => {
            table.fault(
                "heights_m",
                format_args!("is not a height field: {why}"),
                "not a field",
                "give four or more heights along each axis",
            );
            None
        }
    }
}

/// Reads a list of numbers with absolute values up to `most`, m.
fn within(
    table: &Table<'_>,
    key: &'static str,
    count: RangeInclusive<usize>,
    most: f64,
) -> Option<Vec<f64>> {
    let numbers = table.list(key, count)?;
    if let Some(far) = numbers.iter().find(|number| number.abs() > most) {
        let help = format!("give values from -{most} to {most} m");
        table.fault(key, format_args!("contains {far}"), "out of range", help);
        return None;
    }
    Some(numbers)
}

fn coordinate(table: &Table<'_>, key: &'static str) -> Option<f64> {
    table.number_in(key, -FAR_M..=FAR_M, "m")
}

/// Reads a nonzero height.
fn height(table: &Table<'_>, key: &'static str) -> Option<f64> {
    let height_m = table.number_in(key, -HEIGHT_MAX_M..=HEIGHT_MAX_M, "m")?;
    if height_m.abs() < CORNER_MIN_M {
        table.fault(
            key,
            format_args!("is {height_m}"),
            "level",
            "give a height above or below 0, in m",
        );
        return None;
    }
    Some(height_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn height_at(text: &str, x: f64, y: f64) -> f64 {
        let terrain = from_toml("test.toml", text).unwrap_or_else(|error| panic!("{error}"));
        let ground = terrain.solid();
        // Downwards along the vertical.
        let mut z = 0.0;
        for _ in 0..60 {
            let surface = ground.at(&Vector3::new(x, y, z));
            z -= surface.gap_m / surface.gradient.z.max(0.3);
        }
        close(terrain.height_m(&Vector2::new(x, y)), z);
        z
    }

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9, "{found}, {expected}");
    }

    #[test]
    fn each_kind_of_terrain_is_where_its_file_says() {
        close(height_at("[slope]\nangle_deg = 10", 0.5, 0.3), 0.5 * 10f64.to_radians().tan());
        let step = "[step]\nat_x_m = 0.5\nheight_m = 0.03";
        close(height_at(step, 0.4, 0.0), 0.0);
        close(height_at(step, 0.6, 0.0), 0.03);
        let turned = format!("heading_deg = 90\n{step}");
        close(height_at(&turned, 0.6, 0.0), 0.0);
        close(height_at(&turned, 0.0, 0.6), 0.03);
        let ramp = "[ramp]\nfrom_x_m = 0.4\nlength_m = 0.6\nheight_m = -0.1";
        close(height_at(ramp, 0.7, 0.0), -0.05);
        let stairs = "[stairs]\nat_x_m = 0.5\ncount = 3\nriser_m = 0.1\ntread_m = 0.3";
        for (x_m, z_m) in [(0.4, 0.0), (0.6, 0.1), (0.9, 0.2), (2.0, 0.3)] {
            close(height_at(stairs, x_m, 0.0), z_m);
        }
        let profile = "[profile]\nx_m = [0.5, 0.5, 1]\nz_m = [0, 0.1, 0.1]";
        close(height_at(profile, 0.7, 0.0), 0.1);
        let row = "0, 0.01, 0.02, 0.03, ";
        let field = format!(
            "[height_field]\norigin_m = [0, 0]\nspacing_m = 0.1\ncolumns = 4\nheights_m = [{}]",
            row.repeat(4)
        );
        close(height_at(&field, 0.2, 0.15), 0.02);
        let rough = "[rough]\nheight_m = 0.05\nspacing_m = 0.2\nhalf_m = 2\nseed = 3";
        let heights: Vec<_> = (0..20).map(|k| height_at(rough, 0.1 * f64::from(k), 0.3)).collect();
        assert!(heights.iter().all(|height| (-0.02..0.07).contains(height)), "{heights:?}");
        assert!(heights.iter().any(|height| (height - heights[0]).abs() > 0.01), "{heights:?}");
        assert_eq!(height_at(rough, 0.7, 0.3), heights[7]);
    }

    #[test]
    fn the_examples_of_the_documentation_are_right() {
        let text = include_str!("../../../../docs/terrain-files.md");
        let examples: Vec<_> = text.split("```toml\n").skip(1).collect();
        assert!(examples.len() > KINDS.len());
        for example in &examples {
            let (example, _) = example.split_once("```").unwrap();
            from_toml("terrain-files.md", example).unwrap_or_else(|error| panic!("{error}"));
        }
        for (kind, _) in KINDS {
            assert!(
                examples.iter().any(|example| example.contains(&format!("\n[{kind}]"))),
                "{kind}"
            );
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_what_would_be_right() {
        for (text, message, help) in [
            ("", "there is no terrain", "`slope`"),
            ("[sloop]\nangle_deg = 1", "unknown key `sloop`", "`slope`"),
            ("[slope]\nangle_deg = 50", "`angle_deg` is 50", "-45 to 45 degrees"),
            ("[slope]", "`angle_deg` is missing", "a number"),
            (
                "[slope]\nangle_deg = 5\n[step]\nat_x_m = 1\nheight_m = 1",
                "`step` is a second terrain beside `slope`",
                "one of the two terrains",
            ),
            ("[step]\nat_x_m = 1\nheight_m = 0", "`height_m` is 0", "above or below"),
            ("[step]\nat_x_m = 1\nheight = 1", "`height_m` is missing", "`height_m`"),
            ("[profile]\nx_m = [0, 1]\nz_m = [0]", "`z_m` has 1 numbers, but", "for each x"),
            ("[profile]\nx_m = [1, 0]\nz_m = [0, 0]", "point 1 at x = 0 m", "ascending order"),
            ("[profile]\nx_m = []\nz_m = []", "`x_m` must be", "1 to 200"),
            (
                "[rough]\nheight_m = 0.1\nspacing_m = 0.01\nhalf_m = 50\nseed = 1",
                "10001 heights",
                "4 to 500",
            ),
            (
                "[height_field]\norigin_m = [0, 0]\nspacing_m = 1\ncolumns = 5\nheights_m = [0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0]",
                "not whole rows of 5",
                "rows along y",
            ),
            (
                "[profile]\nx_m = [-1e308, 1e308]\nz_m = [0, 0]",
                "`x_m` contains -1",
                "-1000 to 1000 m",
            ),
            ("[profile]\nx_m = [0, 1e-320]\nz_m = [0, 1e-321]", "point 1 at x = ", "same x twice"),
            ("[step]\nat_x_m = 1\nheight_m = 1e-320", "`height_m` is 0.0000", "above or below"),
            ("heading_deg = 200\n[slope]\nangle_deg = 1", "`heading_deg` is 200", "-180 to 180"),
        ] {
            let error = from_toml("test.toml", text).unwrap_err();
            let faults: Vec<_> =
                error.faults().map(|f| (f.message.clone(), f.help.clone())).collect();
            assert!(
                faults.iter().any(|(m, _)| m.contains(message))
                    && faults.iter().any(|(_, h)| h.contains(help)),
                "{text}: {faults:?}"
            );
        }
    }
}
